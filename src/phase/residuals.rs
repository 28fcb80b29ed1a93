//! How well sinusoids fit the images, over all pixels: histograms that add up in any order, and what they say.

use fringeflow_base::grey::PixelFormat;
use fringeflow_simd::Lanes;

use super::histogram::Histogram;
use super::map::FitStatistics;

/// Standard deviation of rounding to whole grey levels, 1/√12; deeper images round to fractions of them.
const ROUNDING_NOISE_GREY: f32 = 0.288_675;
/// Bins of the histograms of residual and residual share.
const BINS: usize = 1024;
/// Residual shares up to this are told apart; worse ones share the last bin.
const SHARE_RANGE: f32 = 2.0;
/// Residuals up to this many grey levels are told apart.
const RESIDUAL_RANGE_GREY: f32 = 64.0;
/// Bins of a share of 1, and of a grey level.
const BINS_PER_SHARE: f32 = BINS as f32 / SHARE_RANGE;
const BINS_PER_GREY: f32 = BINS as f32 / RESIDUAL_RANGE_GREY;

/// Histograms of the residual over the valid pixels, absolute and as a share of the modulation.
#[derive(Clone, Debug, Default)]
pub(super) struct Residuals {
    share: Histogram<BINS>,
    residual: Histogram<BINS>,
}

impl Residuals {
    pub(super) fn add(&mut self, residual_grey: f32, modulation_grey: f32) {
        self.share.add(residual_grey / modulation_grey * BINS_PER_SHARE);
        self.residual.add(residual_grey * BINS_PER_GREY);
    }

    /// Adds those of 32 pixels that are valid: bit k says it of pixel k.
    #[inline(always)]
    pub(super) fn add_block<L: Lanes>(&mut self, lanes: L, residual: L::Reals, modulation: L::Reals, valid: u32) {
        let l = lanes;
        let share = l.over_real(residual, modulation);
        self.share.add_block(l, l.times_real(share, l.real(BINS_PER_SHARE)), valid);
        self.residual.add_block(l, l.times_real(residual, l.real(BINS_PER_GREY)), valid);
    }

    pub(super) fn merge(&mut self, other: &Self) {
        self.share.merge(&other.share);
        self.residual.merge(&other.residual);
    }

    /// Statistics of fits that leave so many degrees of freedom to the images of a format, and make `noise_gain` of noise ÷
    /// modulation.
    pub(super) fn statistics(&self, freedom: usize, format: PixelFormat, noise_gain: f32) -> FitStatistics {
        let valid_pixels = self.share.len();
        let rounding_grey = ROUNDING_NOISE_GREY * format.grey_per_value();
        if freedom == 0 || valid_pixels == 0 {
            return FitStatistics { valid_pixels, residual_share: None, noise_grey: rounding_grey, noise_gain };
        }
        // Median of a χ distribution over its standard deviation, Wilson and Hilferty's approximation.
        let freedom = freedom as f32;
        let median_of_unit_noise = (1.0 - 2.0 / (9.0 * freedom)).powi(3).sqrt();
        let noise_grey = self.residual.quantile(0.5) * RESIDUAL_RANGE_GREY / median_of_unit_noise;
        FitStatistics {
            valid_pixels,
            residual_share: Some(self.share.quantile(0.5) * SHARE_RANGE),
            noise_grey: noise_grey.max(rounding_grey),
            noise_gain,
        }
    }
}
