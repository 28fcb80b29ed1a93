//! The toy elephant, lying on its side, seen from its left.

use crate::simulation::solid::{PointMm, Solid, ellipsoid, round_cone, smooth_cut, smooth_union, sphere};

/// An elephant 74 mm long, 22 mm thick.
pub(super) struct Elephant;

/// Places and radii along the trunk, from head to tip.
const TRUNK: [[f64; 4]; 5] = [
    [-25.0, 8.0, 11.0, 5.4],
    [-31.5, 0.0, 11.0, 4.3],
    [-33.0, -9.0, 11.0, 3.5],
    [-31.0, -16.0, 11.0, 2.9],
    [-26.5, -19.5, 11.0, 2.5],
];
/// Hip or shoulder (x, y, z), foot (x, y, z).
const LEGS: [[f64; 6]; 4] = [
    [-9.0, -5.0, 14.5, -11.5, -26.0, 14.8],
    [-3.0, -5.0, 7.0, -2.0, -26.0, 6.5],
    [19.0, -4.0, 14.5, 18.5, -26.0, 14.8],
    [23.0, -4.0, 7.0, 27.5, -25.5, 6.5],
];

impl Solid for Elephant {
    fn distance_mm(&self, point: &PointMm) -> f64 {
        let mut body = smooth_union(trunk_of_body(point), head(point), 3.0);
        for [x, y, z, foot_x, foot_y, foot_z] in LEGS {
            let (hip, foot) = (PointMm::new(x, y, z), PointMm::new(foot_x, foot_y, foot_z));
            body = smooth_union(body, round_cone(point, (hip, 6.0), (foot, 4.6)), 2.0);
        }
        let ear = smooth_union(ear(point), body, 0.8);
        let tail = round_cone(point, (PointMm::new(33.0, 7.0, 11.0), 1.5), (PointMm::new(37.0, -6.0, 11.5), 1.0));
        smooth_union(ear, tail, 1.5).max(-point.z)
    }

    fn bounds_mm(&self) -> (PointMm, PointMm) {
        (PointMm::new(-39.0, -32.0, 0.0), PointMm::new(40.0, 30.0, 23.0))
    }
}

fn trunk_of_body(p: &PointMm) -> f64 {
    let chest = ellipsoid(p, PointMm::new(-1.0, 5.0, 10.8), PointMm::new(17.0, 16.0, 10.8));
    let rump = ellipsoid(p, PointMm::new(18.0, 4.5, 10.5), PointMm::new(16.0, 15.0, 10.5));
    smooth_union(chest, rump, 4.0)
}

fn head(p: &PointMm) -> f64 {
    let skull = ellipsoid(p, PointMm::new(-20.0, 13.5, 11.0), PointMm::new(10.5, 11.5, 9.5));
    let mut head = smooth_union(skull, sphere(p, PointMm::new(-24.0, 7.0, 11.0), 7.0), 3.0);
    for pair in TRUNK.windows(2) {
        let [a, b] = [pair[0], pair[1]].map(|[x, y, z, radius]| (PointMm::new(x, y, z), radius));
        head = smooth_union(head, round_cone(p, a, b), 1.5);
    }
    let tusk = round_cone(p, (PointMm::new(-24.0, 2.0, 16.0), 1.7), (PointMm::new(-33.0, -4.0, 18.0), 0.8));
    let eye = sphere(p, PointMm::new(-25.5, 13.5, 18.6), 1.3);
    smooth_union(smooth_union(head, tusk, 0.6), eye, 0.3)
}

/// The left ear: a flap that stands off the head, hollowed.
fn ear(p: &PointMm) -> f64 {
    let flap = ellipsoid(p, PointMm::new(-11.0, 11.0, 18.8), PointMm::new(8.5, 11.0, 2.9));
    let hollow = ellipsoid(p, PointMm::new(-11.5, 11.0, 23.0), PointMm::new(6.5, 9.0, 2.6));
    smooth_cut(flap, hollow, 1.0)
}
