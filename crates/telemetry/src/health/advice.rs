//! Advice to the operator for each health quantity.

use super::Quantity;

impl Quantity {
    /// What to do when the quantity is above its limits.
    #[must_use]
    pub fn remedy(self) -> &'static str {
        match self {
            Self::Drift => {
                "measure an artefact (`fringeflow verify RECORDING --artefact ...`) and calibrate again if it is outside its \
                 limits; `fringeflow rig CALIBRATION --images RECORDING` shows the drift"
            }
            Self::DeltaSd => "calibration and images may not belong together, or the scanner moves too fast",
            Self::DeltaNoise => "use more light, move more slowly, or make the projector linear",
            Self::DeltaMean => "set pattern.phase_offset_rad, or check that projector and cameras are in step",
            Self::ResidualCam1 | Self::ResidualCam2 => {
                "check exposure and gamma, move more slowly, and check that each image shows its declared phase shift"
            }
            Self::HarmonicsCam1 | Self::HarmonicsCam2 => "make the projector linear (its gamma), or lower the exposure",
            Self::SaturatedCam1 | Self::SaturatedCam2 => "lower the exposure, the gain or the light",
            Self::DimCam1 | Self::DimCam2 => "raise the exposure or the light, or move closer",
            Self::Skew => "trigger both cameras by one signal",
            Self::Motion | Self::OneSurface | Self::Lost => "move more slowly, or take images faster",
            Self::Brightness => "keep exposure and light constant, and shield from other light",
            Self::Slipped => "check the trigger between projector and cameras, and pattern.phase_offset_rad",
            Self::Unexplained => {
                "calibration and images may not belong together, or most of the scene lies far outside the measurement \
                 volume"
            }
            Self::UnlitCam1 | Self::UnlitCam2 => {
                "uncover the lens, switch on the projector, and aim at the object; images that are bright all the same \
                 are alike, and each must show another phase shift"
            }
            Self::UnusedRangeCam1 | Self::UnusedRangeCam2 => {
                "raise the exposure or the light; if the values have fewer bits than their format, say how many (bits in \
                 meta.json, cameras.format)"
            }
            Self::FalseCandidates => "calibrate again, or use a shallower volume or fewer fringes",
        }
    }
}
