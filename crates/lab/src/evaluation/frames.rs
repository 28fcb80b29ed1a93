//! The frames in which a cloud and its truth are compared.

use fringeflow::geometry::Pose;
use fringeflow_dataset::Setup;

/// The frames in which a cloud and the truth are compared.
///
/// The calibration of a cloud has a small error, so its camera frame differs slightly from that of the truth. Both are
/// transformed into the frame of the measurement volume, each with its own pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Frames {
    /// Pose of the volume in the frame of the cloud.
    pub cam1_from_volume: Pose,
    /// Pose of the volume in the frame of the truth.
    pub exact_cam1_from_volume: Pose,
    /// Metres per unit of the truth.
    pub unit_m: f64,
}

impl Frames {
    /// Returns the frames of a dataset or a recording. Without a measurement volume, both are the frame of C1.
    #[must_use]
    pub fn from_setup(setup: &Setup) -> Self {
        let cam1_from_volume = setup.volume.as_ref().map_or_else(Pose::identity, |v| *v.cam1_from_volume());
        Self {
            cam1_from_volume,
            exact_cam1_from_volume: setup.exact_cam1_from_volume.unwrap_or(cam1_from_volume),
            unit_m: setup.unit.in_metres(),
        }
    }
}
