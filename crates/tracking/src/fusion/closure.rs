//! Loop closure of a scan that ends where it began.

use fringeflow::geometry::{Camera, Pose};

use crate::registration::{OrganizedSurface, Registration, RegistrationSettings, SampledPoints, register};

/// Registration of the last cloud directly to the first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Closure {
    /// Pose of the last cloud, from the first and the last cloud only.
    pub direct: Registration,
    /// Distance between the tracked and the direct position of the centre of the last cloud, metres.
    pub drift_m: f64,
    /// Angle between the tracked and the direct rotation, rad.
    pub drift_rad: f64,
}

impl Closure {
    /// Computes the closure of the first and the last surface. `first_from_last` is the tracked pose of the last.
    /// Returns `None` if they overlap too little.
    pub(super) fn new(
        camera: &Camera,
        first: &SampledPoints,
        last: &OrganizedSurface,
        first_from_last: &Pose,
        settings: &RegistrationSettings,
    ) -> Option<Self> {
        // If too few points of the first have a partner in the last, the scan has not returned.
        let direct = register(camera, first, last, first_from_last, settings).ok()?;
        let centre = last.centre();
        Some(Self {
            direct,
            drift_m: (first_from_last * centre - direct.reference_from_moved * centre).norm(),
            drift_rad: first_from_last.rotation.angle_to(&direct.reference_from_moved.rotation),
        })
    }
}
