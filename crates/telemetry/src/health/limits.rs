//! Limits of the health quantities.

use super::Quantity;

/// Limits of a quantity; `warn` is below `bad`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// Above this level the state is [`super::HealthState::Warn`].
    pub warn: f64,
    /// Above this level the state is [`super::HealthState::Bad`].
    pub bad: f64,
}

/// Limits of all quantities, and the rules for levels and states.
#[derive(Clone, Debug, PartialEq)]
pub struct HealthLimits {
    /// Limits, in the order of [`Quantity::ALL`].
    limits: [Limits; Quantity::ALL.len()],
    /// Number of windows that a level covers.
    pub windows: usize,
    /// Minimum number of windows for a level.
    pub fewest_windows: usize,
    /// A state ends when the level falls below this share of its limit.
    pub release_share: f64,
}

impl Default for HealthLimits {
    /// The defaults that `configs/reconstruct.toml` explains.
    fn default() -> Self {
        let limits = |[warn, bad]: [f64; 2]| Limits { warn, bad };
        let defaults = |quantity: Quantity| match quantity {
            Quantity::Drift => [0.1, 0.2],
            Quantity::DeltaSd => [0.1, 0.2],
            Quantity::DeltaNoise => [0.03, 0.06],
            Quantity::DeltaMean => [0.2, 0.4],
            Quantity::ResidualCam1 | Quantity::ResidualCam2 => [0.1, 0.2],
            Quantity::HarmonicsCam1 | Quantity::HarmonicsCam2 => [0.04, 0.1],
            Quantity::SaturatedCam1 | Quantity::SaturatedCam2 => [0.02, 0.1],
            Quantity::DimCam1 | Quantity::DimCam2 => [0.7, 0.9],
            Quantity::Skew => [1.0, 5.0],
            Quantity::Motion => [0.4, 0.8],
            Quantity::Brightness => [0.03, 0.1],
            Quantity::OneSurface => [0.2, 0.4],
            Quantity::Lost => [0.05, 0.15],
            Quantity::Slipped => [0.1, 0.5],
            Quantity::Unexplained => [0.5, 0.8],
            Quantity::FalseCandidates => [1.5, 3.0],
            Quantity::UnlitCam1 | Quantity::UnlitCam2 => [0.99, 0.999],
            Quantity::UnusedRangeCam1 | Quantity::UnusedRangeCam2 => [0.75, 0.9],
        };
        Self {
            limits: Quantity::ALL.map(|quantity| limits(defaults(quantity))),
            windows: 9,
            fewest_windows: 5,
            release_share: 0.8,
        }
    }
}

impl HealthLimits {
    /// These limits for a level that is the value of one window.
    #[must_use]
    pub fn for_one_window(&self) -> Self {
        Self { windows: 1, fewest_windows: 1, ..self.clone() }
    }

    /// Returns the limits of a quantity.
    #[must_use]
    pub fn limits_of(&self, quantity: Quantity) -> Limits {
        self.limits[quantity as usize]
    }

    /// Sets the limits of all quantities that share a configuration key.
    pub fn set(&mut self, key: &str, limits: Limits) {
        for quantity in Quantity::ALL.into_iter().filter(|quantity| quantity.key() == key) {
            self.limits[quantity as usize] = limits;
        }
    }
}
