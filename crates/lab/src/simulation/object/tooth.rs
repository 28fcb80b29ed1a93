//! A plaster tooth: a molar on a base, its crown with four cusps and crossing fissures.

use crate::simulation::solid::{PointMm, Solid, cylinder, ellipsoid, round_cone, smooth_cut, smooth_union, sphere};

/// A molar of 15 mm × 13.5 mm, 20 mm high with its base.
pub(super) struct Tooth;

/// Position (x, y), height of the centre and radius of the cusps.
const CUSPS: [[f64; 4]; 4] =
    [[-3.4, 3.0, 15.0, 3.6], [3.6, 2.8, 14.6, 3.4], [-3.3, -2.9, 14.5, 3.5], [3.5, -2.8, 14.2, 3.3]];

impl Solid for Tooth {
    fn distance_mm(&self, point: &PointMm) -> f64 {
        let base = cylinder(point, [0.0, 0.0], 12.5, [0.0, 4.0], 1.0);
        let rim = cylinder(point, [0.0, 0.0], 9.0, [2.0, 6.0], 1.4);
        smooth_union(smooth_union(base, rim, 1.5), crown(point), 1.2)
    }

    fn bounds_mm(&self) -> (PointMm, PointMm) {
        (PointMm::new(-13.0, -13.0, 0.0), PointMm::new(13.0, 13.0, 20.0))
    }
}

fn crown(p: &PointMm) -> f64 {
    let neck = round_cone(p, (PointMm::new(0.0, 0.0, 4.0), 5.2), (PointMm::new(0.0, 0.0, 9.0), 5.8));
    let belly = ellipsoid(p, PointMm::new(0.0, 0.0, 10.5), PointMm::new(7.5, 6.7, 5.6));
    let mut body = smooth_union(neck, belly, 2.5);
    for [x, y, z, radius] in CUSPS {
        body = smooth_union(body, sphere(p, PointMm::new(x, y, z), radius), 1.8);
    }
    let groove = |a: [f64; 3], b: [f64; 3]| round_cone(p, (PointMm::from(a), 0.45), (PointMm::from(b), 0.65));
    let fissures = [
        groove([-6.0, 0.3, 16.6], [0.0, 0.0, 15.6]),
        groove([0.0, 0.0, 15.6], [6.0, 0.2, 16.2]),
        groove([0.4, 5.8, 16.6], [0.0, 0.0, 15.6]),
        groove([-0.2, -5.8, 16.2], [0.0, 0.0, 15.6]),
    ];
    let pit = sphere(p, PointMm::new(0.0, 0.0, 16.6), 1.5);
    fissures.into_iter().fold(smooth_cut(body, pit, 1.2), |body, groove| smooth_cut(body, groove, 0.8))
}
