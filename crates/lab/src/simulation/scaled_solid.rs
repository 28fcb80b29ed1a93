//! A solid of another size.

use super::solid::{Material, PointMm, Solid};

/// A solid scaled about the origin of its frame.
pub(super) struct ScaledSolid {
    pub(super) solid: Box<dyn Solid>,
    pub(super) factor: f64,
}

impl Solid for ScaledSolid {
    fn distance_mm(&self, point: &PointMm) -> f64 {
        self.solid.distance_mm(&(point / self.factor)) * self.factor
    }

    fn bounds_mm(&self) -> (PointMm, PointMm) {
        let (min, max) = self.solid.bounds_mm();
        (min * self.factor, max * self.factor)
    }

    fn material(&self, point: &PointMm) -> Material {
        self.solid.material(&(point / self.factor))
    }
}
