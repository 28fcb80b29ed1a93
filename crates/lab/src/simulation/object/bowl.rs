//! A bowl, seen from inside.

use crate::simulation::solid::{PointMm, Solid, sphere};

/// A bowl of 68 mm diameter, 22 mm high.
pub(super) struct Bowl;

/// Height of the rim, and that of the inside in the middle, millimetres.
const RIM: f64 = 22.0;
const FLOOR: f64 = 2.0;
/// Radius of the inner ball, and thickness of the wall.
const RADIUS: f64 = 36.0;
const WALL: f64 = 1.8;

impl Solid for Bowl {
    fn distance_mm(&self, point: &PointMm) -> f64 {
        let inside = sphere(point, PointMm::new(0.0, 0.0, FLOOR + RADIUS), RADIUS);
        (-inside).max(inside - WALL).max(point.z - RIM)
    }

    fn bounds_mm(&self) -> (PointMm, PointMm) {
        (PointMm::new(-35.0, -35.0, 0.0), PointMm::new(35.0, 35.0, RIM + 0.5))
    }
}
