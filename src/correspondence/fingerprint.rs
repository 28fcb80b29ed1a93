//! Identifies the rig that a segment table belongs to.

use sha2::{Digest, Sha256};

use crate::geometry::{FringePattern, MeasurementVolume, Pose, Rig};

/// Hash of everything that a segment table depends on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Fingerprint(pub [u8; 32]);

impl std::fmt::Display for Fingerprint {
    /// As hexadecimal digits.
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl Fingerprint {
    /// Hash of calibration, measurement volume, pattern and image sizes.
    #[must_use]
    pub fn new(rig: &Rig, volume: &MeasurementVolume, pattern: &FringePattern) -> Self {
        let mut hash = Sha256::new();
        let mut add = |values: &[f64]| values.iter().for_each(|v| hash.update(v.to_le_bytes()));
        for camera in [&rig.cam1, &rig.cam2, &rig.projector] {
            add(&camera.focal_px());
            add(&camera.principal_px());
            add(&[camera.skew_px(), camera.width_px() as f64, camera.height_px() as f64]);
            add(&camera.distortion().to_opencv());
        }
        for pose in [&rig.cam2_from_cam1, &rig.projector_from_cam1, volume.cam1_from_volume()] {
            add(&pose_numbers(pose));
        }
        add(volume.min().coords.as_slice());
        add(volume.max().coords.as_slice());
        add(&[pattern.period_px, pattern.sign, pattern.offset_rad]);
        Self(hash.finalize().into())
    }
}

fn pose_numbers(pose: &Pose) -> [f64; 7] {
    let (q, t) = (pose.rotation.coords, pose.translation.vector);
    [q.x, q.y, q.z, q.w, t.x, t.y, t.z]
}
