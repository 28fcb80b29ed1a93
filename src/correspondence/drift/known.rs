//! The drift that one window hands to the next.

use super::modes::MAX_MODES;

/// The drift of an earlier window: it hardly changes from window to window.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KnownDrift {
    /// Mean of the field, turns, then one coefficient per mode, pixels of calibration error; zero for modes that the
    /// rig lacks.
    pub(super) coefficients: [f32; 1 + MAX_MODES],
    /// sd of δ of true candidates about the field, rad.
    pub(super) sd_rad: f32,
}

impl KnownDrift {
    /// Number of numbers in [`Self::to_numbers`].
    pub const NUMBERS: usize = 2 + MAX_MODES;

    /// As numbers: sd of δ about the field, rad; mean, turns; coefficients of the modes, pixels.
    #[must_use]
    pub fn to_numbers(&self) -> [f32; Self::NUMBERS] {
        std::array::from_fn(|i| if i == 0 { self.sd_rad } else { self.coefficients[i - 1] })
    }

    /// From such numbers. `None` if they are not finite or sd is not positive.
    #[must_use]
    pub fn from_numbers([sd_rad, coefficients @ ..]: [f32; Self::NUMBERS]) -> Option<Self> {
        let is_sound = sd_rad > 0.0 && sd_rad.is_finite() && coefficients.iter().all(|number| number.is_finite());
        is_sound.then_some(Self { coefficients, sd_rad })
    }
}
