//! What is watched.

/// A quantity that tells how well the scanner measures; the more of it, the worse.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord)]
#[repr(usize)]
pub enum Quantity {
    /// Drift of the calibration over the measurement volume, rms of δ.
    Drift = 0,
    /// Standard deviation of δ about its mean.
    DeltaSd,
    /// Standard deviation of δ about the drift: what is left for noise.
    DeltaNoise,
    /// Amount of the mean of δ: what the projector's phase is off.
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
    /// By how much images of camera 2 begin later or earlier than those of camera 1, mean of the window.
    Skew,
    /// Phase moved from image to image that a pixel in twenty exceeds, the greater of both cameras.
    Motion,
    /// Greatest departure of the brightness of an image from the mean, of both cameras.
    Brightness,
    /// Share of the valid pixels decoded from part of their images, the greater of both cameras.
    OneSurface,
    /// Share of the lit pixels left out for their motion, the greater of both cameras.
    Lost,
    /// Windows whose pattern was steps ahead of what was said of it.
    Slipped,
    /// Share of the pixels of which no candidate agrees with the drift, in the measurement volume or beyond it.
    Unexplained,
    /// Expected false candidates for each true one about the drift: efc of Eq. (1).
    FalseCandidates,
}

/// How the level of a quantity follows from its last windows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Level {
    /// The middle one: single windows mean nothing.
    Median,
    /// Their mean: each window counts.
    Mean,
}

impl Quantity {
    /// All quantities, each at its place.
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

    /// Its name in messages, metrics and recordings.
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

    /// Key of its limits in a configuration; both cameras share one.
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

    /// Unit of its values, by its end in [`Self::key`]; empty for shares.
    #[must_use]
    pub fn unit(self) -> &'static str {
        let key = self.key();
        ["rad", "ms"].into_iter().find(|unit| key.ends_with(unit)).unwrap_or_default()
    }

    /// What it is, for people.
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

    /// What to do about it.
    #[must_use]
    pub fn remedy(self) -> &'static str {
        match self {
            Self::Drift => "calibrate again; `fringeflow rig CALIBRATION --images RECORDING` shows the drift",
            Self::DeltaSd => "calibration and images may not belong together, or the scanner moves too fast",
            Self::DeltaNoise => "more light, slower motion, or a linear projector",
            Self::DeltaMean => "set pattern.phase_offset_rad, or see whether projector and cameras are in step",
            Self::ResidualCam1 | Self::ResidualCam2 => {
                "check exposure and gamma, move more slowly, and check that each image shows its declared step"
            }
            Self::HarmonicsCam1 | Self::HarmonicsCam2 => "make the projector linear (its gamma), or lower the exposure",
            Self::SaturatedCam1 | Self::SaturatedCam2 => "lower the exposure, the gain or the light",
            Self::DimCam1 | Self::DimCam2 => "raise the exposure or the light, or come nearer",
            Self::Skew => "trigger both cameras together",
            Self::Motion | Self::OneSurface | Self::Lost => "move more slowly, or take images faster",
            Self::Brightness => "keep exposure and light constant, and other light out",
            Self::Slipped => "see to the trigger between projector and cameras",
            Self::Unexplained => {
                "calibration and images may not belong together, or most of what is seen lies far outside the measurement volume"
            }
            Self::FalseCandidates => "calibrate again, or use a shallower volume or fewer fringes",
        }
    }

    /// How its level follows from its last windows.
    #[must_use]
    pub fn level(self) -> Level {
        if self == Self::Slipped { Level::Mean } else { Level::Median }
    }

    /// The quantity of a name; `None` for one that is none.
    #[must_use]
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|quantity| quantity.name() == name)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_stands_at_its_place_under_a_name_of_its_own() {
        for (place, quantity) in Quantity::ALL.into_iter().enumerate() {
            assert_eq!(quantity as usize, place);
            assert_eq!(Quantity::named(quantity.name()), Some(quantity));
        }
        assert_eq!([Quantity::Drift, Quantity::Skew, Quantity::Lost].map(Quantity::unit), ["rad", "ms", ""]);
    }
}
