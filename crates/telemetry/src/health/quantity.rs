//! The health quantities.

/// A quantity that shows how well the scanner measures. Higher is worse. Causes come before their consequences: first what
/// the images show by themselves.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(usize)]
pub enum Quantity {
    /// Share of the range of grey levels above the brightest one of camera 1.
    UnusedRangeCam1 = 0,
    /// The same in camera 2.
    UnusedRangeCam2,
    /// Share of the pixels of camera 1 without fringes.
    UnlitCam1,
    /// The same in camera 2.
    UnlitCam2,
    /// Share of the lit pixels of camera 1 with saturated samples.
    SaturatedCam1,
    /// The same in camera 2.
    SaturatedCam2,
    /// Share of the lit pixels of camera 1 that are barely lit.
    DimCam1,
    /// The same in camera 2.
    DimCam2,
    /// Fit residual ÷ modulation of camera 1.
    ResidualCam1,
    /// The same in camera 2.
    ResidualCam2,
    /// Harmonics of the fringes ÷ modulation in camera 1.
    HarmonicsCam1,
    /// The same in camera 2.
    HarmonicsCam2,
    /// Drift of the calibration over the measurement volume, rms of δ.
    Drift,
    /// Standard deviation of δ about its mean.
    DeltaSd,
    /// Standard deviation of δ about the drift: the part due to noise.
    DeltaNoise,
    /// Absolute mean of δ: the phase offset of the projector.
    DeltaMean,
    /// Start of the images of camera 2 relative to camera 1: mean absolute value over the window.
    Skew,
    /// Phase motion from image to image that 5 % of the pixels exceed; the larger of both cameras.
    Motion,
    /// Largest deviation of the brightness of an image from the mean, in either camera.
    Brightness,
    /// Share of the valid pixels decoded from part of their images; the larger of both cameras.
    OneSurface,
    /// Share of the lit pixels dropped because of motion; the larger of both cameras.
    Lost,
    /// Whether the images of the window were ahead of the declared phase shifts: 0 or 1.
    Slipped,
    /// Share of the pixels without a candidate that agrees with the drift, inside or outside the measurement volume.
    Unexplained,
    /// Expected false candidates for each true one, about the drift: efc of Eq. (1).
    FalseCandidates,
}

/// How the level of a quantity is computed from its last windows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Averaging {
    /// The median: single windows do not matter.
    Median,
    /// The mean: each window counts.
    Mean,
}

/// Every quantity with its name, configuration key and title, at the index of its discriminant.
#[rustfmt::skip]
const TABLE: [(Quantity, &str, &str, &str); 24] = [
    (Quantity::UnusedRangeCam1, "unused_range_cam1", "health.unused_range_share", "unused grey levels, camera 1"),
    (Quantity::UnusedRangeCam2, "unused_range_cam2", "health.unused_range_share", "unused grey levels, camera 2"),
    (Quantity::UnlitCam1, "unlit_cam1", "health.unlit_share", "pixels without fringes, camera 1"),
    (Quantity::UnlitCam2, "unlit_cam2", "health.unlit_share", "pixels without fringes, camera 2"),
    (Quantity::SaturatedCam1, "saturated_cam1", "health.saturated_share", "saturated pixels, camera 1"),
    (Quantity::SaturatedCam2, "saturated_cam2", "health.saturated_share", "saturated pixels, camera 2"),
    (Quantity::DimCam1, "dim_cam1", "health.dim_share", "dim pixels, camera 1"),
    (Quantity::DimCam2, "dim_cam2", "health.dim_share", "dim pixels, camera 2"),
    (Quantity::ResidualCam1, "residual_cam1", "health.residual_share", "fit residual, camera 1"),
    (Quantity::ResidualCam2, "residual_cam2", "health.residual_share", "fit residual, camera 2"),
    (Quantity::HarmonicsCam1, "harmonics_cam1", "health.harmonics_share", "harmonics of the fringes, camera 1"),
    (Quantity::HarmonicsCam2, "harmonics_cam2", "health.harmonics_share", "harmonics of the fringes, camera 2"),
    (Quantity::Drift, "drift", "health.drift_rad", "drift of the calibration"),
    (Quantity::DeltaSd, "delta_sd", "health.delta_sd_rad", "sd of δ"),
    (Quantity::DeltaNoise, "delta_noise", "health.delta_noise_rad", "noise of δ"),
    (Quantity::DeltaMean, "delta_mean", "health.delta_mean_rad", "mean of δ"),
    (Quantity::Skew, "skew", "health.skew_ms", "skew of the cameras"),
    (Quantity::Motion, "motion", "health.motion_rad", "phase motion per image"),
    (Quantity::Brightness, "brightness", "health.brightness_share", "change of brightness"),
    (Quantity::OneSurface, "one_surface", "health.one_surface_share", "pixels decoded from part of their images"),
    (Quantity::Lost, "lost", "health.lost_share", "pixels lost to motion"),
    (Quantity::Slipped, "slipped", "health.slipped_share", "slipped windows"),
    (Quantity::Unexplained, "unexplained", "health.unexplained_share", "unexplained pixels"),
    (Quantity::FalseCandidates, "false_candidates", "health.false_candidates", "expected false candidates"),
];

impl Quantity {
    /// All quantities, each at the index of its discriminant.
    pub const ALL: [Self; TABLE.len()] = {
        let mut all = [Self::UnusedRangeCam1; TABLE.len()];
        let mut index = 0;
        while index < all.len() {
            all[index] = TABLE[index].0;
            index += 1;
        }
        all
    };

    /// Name in messages, metrics and recordings.
    #[must_use]
    pub fn name(self) -> &'static str {
        TABLE[self as usize].1
    }

    /// Configuration key of its limits. Both cameras share one key.
    #[must_use]
    pub fn key(self) -> &'static str {
        TABLE[self as usize].2
    }

    /// Title shown to people.
    #[must_use]
    pub fn title(self) -> &'static str {
        TABLE[self as usize].3
    }

    /// Unit of its values, taken from the suffix of [`Self::key`]; empty for shares.
    #[must_use]
    pub fn unit(self) -> &'static str {
        let key = self.key();
        ["rad", "ms"].into_iter().find(|unit| key.ends_with(unit)).unwrap_or_default()
    }

    /// How its level is computed from its last windows.
    #[must_use]
    pub fn averaging(self) -> Averaging {
        if self == Self::Slipped { Averaging::Mean } else { Averaging::Median }
    }

    /// Returns the quantity with this name, or `None` if the name is unknown.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|quantity| quantity.name() == name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_quantity_is_at_its_index_and_has_a_unique_name() {
        for (index, quantity) in Quantity::ALL.into_iter().enumerate() {
            assert_eq!(quantity as usize, index);
            assert_eq!(Quantity::from_name(quantity.name()), Some(quantity));
        }
        assert_eq!([Quantity::Drift, Quantity::Skew, Quantity::Lost].map(Quantity::unit), ["rad", "ms", ""]);
    }
}
