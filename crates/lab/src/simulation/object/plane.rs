//! A plane surface: a plate, tilted so that fringe orders change across it.

use nalgebra::UnitQuaternion;

use crate::simulation::solid::{PointMm, Solid, rounded_box};

/// A plate of 66 mm × 50 mm × 3 mm.
pub(super) struct Plane {
    plate_from_object: UnitQuaternion<f64>,
}

/// Centre of the plate, millimetres.
const CENTRE: [f64; 3] = [0.0, 0.0, 12.0];

impl Plane {
    pub(super) fn new() -> Self {
        Self { plate_from_object: UnitQuaternion::from_euler_angles(0.07, -0.14, 0.05) }
    }
}

impl Solid for Plane {
    fn distance_mm(&self, point: &PointMm) -> f64 {
        let p = self.plate_from_object * (point - PointMm::from(CENTRE));
        rounded_box(&p, PointMm::zeros(), PointMm::new(33.0, 25.0, 1.5), 0.3)
    }

    fn bounds_mm(&self) -> (PointMm, PointMm) {
        (PointMm::new(-37.0, -30.0, 3.0), PointMm::new(37.0, 30.0, 21.0))
    }
}
