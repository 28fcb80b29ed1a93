//! A ray through the scene.

use super::solid::PointMm;

/// A ray in the frame of the object. Its direction has length 1, its parameter is in millimetres.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ray {
    pub(super) origin: PointMm,
    pub(super) direction: PointMm,
}

impl Ray {
    pub(super) fn at(&self, distance: f64) -> PointMm {
        self.origin + self.direction * distance
    }
}
