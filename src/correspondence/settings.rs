//! Settings of the matching.

use super::moments::Model;

/// How pixels with several candidates are decided.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ResolutionMethod {
    /// The orders of whole surfaces, from the moments of δ about the drift of the calibration.
    #[default]
    Moments,
    /// Pixel by pixel from decided neighbours, with δ about its mean (paper, section 2.2).
    Paper,
}

impl ResolutionMethod {
    /// Both, the default first.
    pub const ALL: [Self; 2] = [Self::Moments, Self::Paper];

    /// Its name on the command line and in files.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Moments => "moments",
            Self::Paper => "paper",
        }
    }
}

/// How correspondences are found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MatchSettings {
    /// Standard deviation of δ, rad; `None` to measure it.
    pub delta_sd_rad: Option<f64>,
    /// Number N of evenly spaced phase shifts in a cycle, for finding slips of the pattern sequence; `None` to skip
    /// that.
    pub cycle_steps: Option<usize>,
    /// How pixels with several candidates are decided.
    pub method: ResolutionMethod,
    /// Settings of the paper's method, and the smallest region of both.
    pub resolution: ResolutionSettings,
    /// Least probability of a point to be true. The paper's method states none.
    pub min_confidence: f32,
    /// Constants of the order decision by moments.
    pub model: Model,
}

impl Default for MatchSettings {
    fn default() -> Self {
        let (method, resolution) = (ResolutionMethod::default(), ResolutionSettings::default());
        Self { delta_sd_rad: None, cycle_steps: None, method, resolution, min_confidence: 0.8, model: Model::USUAL }
    }
}

/// Settings of the paper's method.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResolutionSettings {
    /// Rounds of decisions and contradictions.
    pub max_rounds: usize,
    /// Sweeps per round.
    pub max_sweeps: usize,
    /// Decided pixels that must support a decision.
    pub min_votes: u16,
    /// Smallest accepted region of continuous absolute phase, pixels.
    pub min_region_px: u32,
}

impl Default for ResolutionSettings {
    fn default() -> Self {
        Self { max_rounds: 3, max_sweeps: 8, min_votes: 3, min_region_px: 30 }
    }
}
