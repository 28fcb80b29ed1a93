//! The health quantities.

/// A quantity that shows how well the scanner measures; the higher, the worse.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(usize)]
pub enum Quantity {
    /// Drift of the calibration over the measurement volume, rms of δ.
    Drift = 0,
    /// Standard deviation of δ about its mean.
    DeltaSd,
    /// Standard deviation of δ about the drift: the part left for noise.
    DeltaNoise,
    /// Absolute mean of δ: the offset of the projector's phase.
    DeltaMean,
    /// Fit residual ÷ modulation of camera 1.
    ResidualCam1,
    /// The same of camera 2.
    ResidualCam2,
    /// Harmonics of the fringes ÷ modulation, seen by camera 1.
    HarmonicsCam1,
    /// The same by camera 2.
    HarmonicsCam2,
    /// Share of the lit pixels of camera 1 with saturated samples.
    SaturatedCam1,
    /// The same of camera 2.
    SaturatedCam2,
    /// Share of the lit pixels of camera 1 that are barely lit.
    DimCam1,
    /// The same of camera 2.
    DimCam2,
    /// Start of an image of camera 2 relative to camera 1, mean absolute value of the window.
    Skew,
    /// Phase motion from image to image that 5 % of the pixels exceed, the greater of both cameras.
    Motion,
    /// Greatest deviation of an image's brightness from the mean, of both cameras.
    Brightness,
    /// Share of the valid pixels decoded from part of their images, the greater of both cameras.
    OneSurface,
    /// Share of the lit pixels left out because of motion, the greater of both cameras.
    Lost,
    /// Windows whose images were ahead of the declared phase shifts.
    Slipped,
    /// Share of the pixels without a candidate that agrees with the drift, inside the measurement volume or outside.
    Unexplained,
    /// Expected false candidates for each true one about the drift: efc of Eq. (1).
    FalseCandidates,
}

/// How the level of a quantity follows from its last windows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Averaging {
    /// Their median: single windows do not matter.
    Median,
    /// Their mean: each window counts.
    Mean,
}

impl Quantity {
    /// All quantities, each at the index of its discriminant.
    pub const ALL: [Self; 20] = [
        Self::Drift,
        Self::DeltaSd,
        Self::DeltaNoise,
        Self::DeltaMean,
        Self::ResidualCam1,
        Self::ResidualCam2,
        Self::HarmonicsCam1,
        Self::HarmonicsCam2,
        Self::SaturatedCam1,
        Self::SaturatedCam2,
        Self::DimCam1,
        Self::DimCam2,
        Self::Skew,
        Self::Motion,
        Self::Brightness,
        Self::OneSurface,
        Self::Lost,
        Self::Slipped,
        Self::Unexplained,
        Self::FalseCandidates,
    ];

    /// Name in messages, metrics and recordings.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Drift => "drift",
            Self::DeltaSd => "delta_sd",
            Self::DeltaNoise => "delta_noise",
            Self::DeltaMean => "delta_mean",
            Self::ResidualCam1 => "residual_cam1",
            Self::ResidualCam2 => "residual_cam2",
            Self::HarmonicsCam1 => "harmonics_cam1",
            Self::HarmonicsCam2 => "harmonics_cam2",
            Self::SaturatedCam1 => "saturated_cam1",
            Self::SaturatedCam2 => "saturated_cam2",
            Self::DimCam1 => "dim_cam1",
            Self::DimCam2 => "dim_cam2",
            Self::Skew => "skew",
            Self::Motion => "motion",
            Self::Brightness => "brightness",
            Self::OneSurface => "one_surface",
            Self::Lost => "lost",
            Self::Slipped => "slipped",
            Self::Unexplained => "unexplained",
            Self::FalseCandidates => "false_candidates",
        }
    }

    /// Configuration key of its limits; both cameras share one.
    #[must_use]
    pub fn key(self) -> &'static str {
        match self {
            Self::Drift => "health.drift_rad",
            Self::DeltaSd => "health.delta_sd_rad",
            Self::DeltaNoise => "health.delta_noise_rad",
            Self::DeltaMean => "health.delta_mean_rad",
            Self::ResidualCam1 | Self::ResidualCam2 => "health.residual_share",
            Self::HarmonicsCam1 | Self::HarmonicsCam2 => "health.harmonics_share",
            Self::SaturatedCam1 | Self::SaturatedCam2 => "health.saturated_share",
            Self::DimCam1 | Self::DimCam2 => "health.dim_share",
            Self::Skew => "health.skew_ms",
            Self::Motion => "health.motion_rad",
            Self::Brightness => "health.brightness_share",
            Self::OneSurface => "health.one_surface_share",
            Self::Lost => "health.lost_share",
            Self::Slipped => "health.slipped_share",
            Self::Unexplained => "health.unexplained_share",
            Self::FalseCandidates => "health.false_candidates",
        }
    }

    /// Unit of its values, taken from the end of [`Self::key`]; empty for shares.
    #[must_use]
    pub fn unit(self) -> &'static str {
        let key = self.key();
        ["rad", "ms"].into_iter().find(|unit| key.ends_with(unit)).unwrap_or_default()
    }

    /// Title for people.
    #[must_use]
    pub fn title(self) -> &'static str {
        match self {
            Self::Drift => "drift of the calibration",
            Self::DeltaSd => "sd of δ",
            Self::DeltaNoise => "noise of δ",
            Self::DeltaMean => "mean of δ",
            Self::ResidualCam1 => "fit residual, camera 1",
            Self::ResidualCam2 => "fit residual, camera 2",
            Self::HarmonicsCam1 => "harmonics of the fringes, camera 1",
            Self::HarmonicsCam2 => "harmonics of the fringes, camera 2",
            Self::SaturatedCam1 => "saturated pixels, camera 1",
            Self::SaturatedCam2 => "saturated pixels, camera 2",
            Self::DimCam1 => "dim pixels, camera 1",
            Self::DimCam2 => "dim pixels, camera 2",
            Self::Skew => "skew of the cameras",
            Self::Motion => "motion of the phase an image",
            Self::Brightness => "change of brightness",
            Self::OneSurface => "pixels with part of their images",
            Self::Lost => "pixels lost to motion",
            Self::Slipped => "slipped windows",
            Self::Unexplained => "pixels that nothing explains",
            Self::FalseCandidates => "expected false candidates",
        }
    }

    /// How its level follows from its last windows.
    #[must_use]
    pub fn averaging(self) -> Averaging {
        if self == Self::Slipped { Averaging::Mean } else { Averaging::Median }
    }

    /// The quantity with this name; `None` for an unknown name.
    #[must_use]
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|quantity| quantity.name() == name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_stands_at_its_index_under_a_unique_name() {
        for (index, quantity) in Quantity::ALL.into_iter().enumerate() {
            assert_eq!(quantity as usize, index);
            assert_eq!(Quantity::from_name(quantity.name()), Some(quantity));
        }
        assert_eq!([Quantity::Drift, Quantity::Skew, Quantity::Lost].map(Quantity::unit), ["rad", "ms", ""]);
    }
}
