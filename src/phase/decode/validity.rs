//! When a phase is valid: the criteria, and the same limits in the units of the kernels.

use fringeflow_base::grey::PixelFormat;
use fringeflow_base::limits::MIN_STEPS;

use crate::phase::map::{DIM, Modulation};
use crate::phase::sample::Sample;

/// Criteria for a valid phase.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Validity {
    /// Smallest modulation, grey levels.
    pub min_modulation_grey: f32,
    /// Grey level from which on a sample is saturated and left out of the fit. In deeper images 255 means 255 · 2^(bits
    /// − 8) and more, for example 4080 to 4095 of 12 bits: the values that 8 bits would show as 255.
    pub saturation_grey: u8,
    /// Largest fit residual (standard deviation of the grey levels about the sinusoid) ÷ modulation.
    ///
    /// Gamma and clipping cause residuals of 0.2 to 0.6, and the phase is still useful. A lost or exchanged image or a
    /// moving edge causes more.
    pub max_residual_share: f32,
}

impl Default for Validity {
    fn default() -> Self {
        Self { min_modulation_grey: 5.0, saturation_grey: 255, max_residual_share: 1.0 }
    }
}

/// Limits in the units of the kernel.
#[derive(Clone, Copy)]
pub(super) struct Limits {
    /// Stored value from which on a sample is saturated.
    pub(super) saturation: u16,
    pub(super) grey_per_value: f32,
    /// Smallest modulation of a valid pixel, and of one that is not dim.
    pub(super) least: Modulation,
    pub(super) not_dim: Modulation,
    /// Largest residual ÷ modulation; infinite for three steps, which have no residual.
    pub(super) max_share: f32,
}

impl Limits {
    pub(super) fn new<S: Sample>(format: PixelFormat, validity: &Validity, steps: usize) -> Self {
        let least_grey = validity.min_modulation_grey;
        Self {
            saturation: S::from_grey(validity.saturation_grey, format).value(),
            grey_per_value: format.grey_per_value(),
            least: Modulation::from_grey(least_grey),
            not_dim: Modulation::from_grey(DIM * least_grey),
            max_share: if steps == MIN_STEPS { f32::INFINITY } else { validity.max_residual_share },
        }
    }

    /// Whether a sample is saturated.
    pub(super) fn saturates<S: Sample>(&self, sample: S) -> bool {
        sample.value() >= self.saturation
    }

    /// Whether a fit is good enough.
    pub(super) fn accepts(&self, modulation: Modulation, residual_grey: f32) -> bool {
        modulation >= self.least && residual_grey <= self.max_share.min(f32::MAX) * modulation.grey()
    }
}
