//! A nose: the middle of a plaster face, from the brows to the upper lip.

use crate::simulation::solid::{PointMm, Solid, ellipsoid, round_cone, smooth_cut, smooth_union, sphere};

/// A face 76 mm wide whose nose stands 43 mm above the board.
pub(super) struct Nose;

impl Solid for Nose {
    fn distance_mm(&self, point: &PointMm) -> f64 {
        // The face is symmetric.
        let p = PointMm::new(point.x.abs(), point.y, point.z);
        let nostril = ellipsoid(&p, PointMm::new(4.4, -11.2, 27.2), PointMm::new(2.2, 2.6, 3.6));
        smooth_cut(smooth_union(face(&p), nose(&p), 6.0), nostril, 1.0)
    }

    fn bounds_mm(&self) -> (PointMm, PointMm) {
        (PointMm::new(-39.0, -38.0, 0.0), PointMm::new(39.0, 38.0, 43.5))
    }
}

/// Cheeks, brows, eyes and upper lip.
fn face(p: &PointMm) -> f64 {
    let head = ellipsoid(p, PointMm::new(0.0, 0.0, 0.0), PointMm::new(37.0, 37.0, 23.0));
    let cheek = sphere(p, PointMm::new(17.0, -8.0, 5.0), 16.0);
    let brow = round_cone(p, (PointMm::new(5.0, 20.5, 16.5), 5.5), (PointMm::new(23.0, 19.0, 9.0), 4.5));
    let mouth = round_cone(p, (PointMm::new(0.0, -24.0, 14.0), 7.0), (PointMm::new(9.0, -24.0, 9.5), 6.0));
    let mut body = smooth_union(smooth_union(head, cheek, 6.0), smooth_union(brow, mouth, 1.0), 5.0);
    let socket = ellipsoid(p, PointMm::new(15.0, 10.5, 22.5), PointMm::new(10.0, 7.0, 9.0));
    body = smooth_cut(body, socket, 3.5);
    body = smooth_union(body, sphere(p, PointMm::new(15.5, 10.5, 8.0), 8.2), 0.6);
    let philtrum = round_cone(p, (PointMm::new(0.0, -15.0, 23.0), 2.0), (PointMm::new(0.0, -22.0, 22.5), 2.2));
    let lips = round_cone(p, (PointMm::new(0.0, -26.0, 21.8), 0.7), (PointMm::new(12.0, -26.6, 16.2), 0.5));
    smooth_cut(smooth_cut(body, philtrum, 2.0), lips, 1.2)
}

/// Bridge, tip, wings and septum.
fn nose(p: &PointMm) -> f64 {
    let bridge = round_cone(p, (PointMm::new(0.0, 19.0, 16.0), 4.5), (PointMm::new(0.0, -3.0, 33.0), 5.0));
    let tip = sphere(p, PointMm::new(0.0, -6.0, 36.0), 6.6);
    let wing = ellipsoid(p, PointMm::new(7.2, -8.5, 27.0), PointMm::new(4.6, 5.4, 6.6));
    let septum = round_cone(p, (PointMm::new(0.0, -9.0, 32.0), 3.0), (PointMm::new(0.0, -13.0, 22.0), 3.2));
    smooth_union(smooth_union(smooth_union(bridge, tip, 5.0), wing, 4.5), septum, 2.0)
}
