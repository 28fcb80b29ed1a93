//! Settings of the chain from phase maps to correspondences.

/// How pixels with several candidates are decided.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ResolutionMethod {
    /// The orders of the whole image together, δ about the drift of the calibration.
    #[default]
    SemiGlobal,
    /// Pixel by pixel from decided neighbours, δ about its mean (paper, section 2.2).
    Paper,
}

impl ResolutionMethod {
    /// Both, the usual one first.
    pub const ALL: [Self; 2] = [Self::SemiGlobal, Self::Paper];

    /// Its name on the command line and in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::SemiGlobal => "semi-global",
            Self::Paper => "paper",
        }
    }
}

/// How correspondences are found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MatchSettings {
    /// Standard deviation of δ, rad, where it is not to be measured.
    pub delta_sd_rad: Option<f64>,
    /// Steps N of the cycle of evenly spaced shifts, of which the sequence may have slipped; `None` where slips are not looked
    /// for.
    pub cycle_steps: Option<usize>,
    /// How pixels with several candidates are decided.
    pub method: ResolutionMethod,
    /// How the paper's method weighs and when it stops, and the smallest region of either.
    pub resolution: ResolutionSettings,
    /// Least probability of a point to be true; the paper's method states none.
    pub min_confidence: f32,
}

impl Default for MatchSettings {
    fn default() -> Self {
        let resolution = ResolutionSettings::default();
        Self {
            delta_sd_rad: None,
            cycle_steps: None,
            method: ResolutionMethod::default(),
            resolution,
            min_confidence: 0.8,
        }
    }
}

/// How the paper's method weighs and when it stops.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResolutionSettings {
    /// Rounds of decisions and contradictions.
    pub max_rounds: usize,
    /// Sweeps of one kind in a round.
    pub max_sweeps: usize,
    /// Decided pixels that must support a decision.
    pub min_votes: u16,
    /// Smallest region of agreeing pixels that is kept, pixels.
    pub min_region_px: u32,
}

impl Default for ResolutionSettings {
    fn default() -> Self {
        Self { max_rounds: 3, max_sweeps: 8, min_votes: 3, min_region_px: 30 }
    }
}
