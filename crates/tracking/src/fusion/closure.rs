//! Whether a scan that ends where it began says so itself.

use fringeflow::geometry::{Camera, Pose};

use crate::registration::{OrganizedSurface, Registration, RegistrationSettings, register};

/// Least share of the last cloud's points that meet the first: below, the scan has not come back.
const MIN_SHARE: f64 = 0.5;

/// The last cloud, registered to the first without anything between.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Closure {
    /// The last pose, by the first and the last cloud alone.
    pub direct: Registration,
    /// How far the tracked pose puts the middle of the last cloud from there, metres.
    pub drift_m: f64,
    /// How far the tracked pose is turned against that one, rad.
    pub drift_rad: f64,
}

impl Closure {
    /// Of the first and the last surface, the last tracked at a pose; `None` where they have too little in common.
    pub(super) fn new(
        camera: &Camera,
        [first, last]: [&OrganizedSurface; 2],
        first_from_last: &Pose,
        settings: &RegistrationSettings,
    ) -> Option<Self> {
        let settings = RegistrationSettings { min_share: MIN_SHARE, ..*settings };
        let direct = register(camera, first, last, first_from_last, &settings).ok()?;
        let centre = last.centre();
        Some(Self {
            direct,
            drift_m: (first_from_last * centre - direct.reference_from_moved * centre).norm(),
            drift_rad: first_from_last.rotation.angle_to(&direct.reference_from_moved.rotation),
        })
    }
}
