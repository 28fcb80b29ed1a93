//! Statistics of the fit residuals over all pixels. In: residual and modulation of each valid pixel. Out:
//! [`FitStatistics`]. Cost: two increments per pixel.

use fringeflow_base::grey::PixelFormat;
use fringeflow_simd::Lanes;

use super::histogram::Histogram;
use super::map::FitStatistics;

/// Standard deviation of rounding to whole grey levels, 1/√12. Deeper images round to fractions of grey levels.
const ROUNDING_NOISE_GREY: f32 = 0.288_675;
/// Bins of the histograms of residual and residual share.
const BINS: usize = 1024;
/// Upper end of the histogram of residual shares; larger ones count in the last bin.
const SHARE_RANGE: f32 = 2.0;
/// Upper end of the histogram of residuals, grey levels.
const RESIDUAL_RANGE_GREY: f32 = 64.0;
/// Bins per unit of share, and per grey level.
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

    /// Adds 32 pixels. Pixel k counts only if bit k of `valid` is set.
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

    /// Statistics of fits with `freedom` degrees of freedom per pixel; `noise_gain` is the standard deviation of the
    /// phase per unit of noise ÷ modulation.
    pub(super) fn statistics(&self, freedom: usize, format: PixelFormat, noise_gain: f32) -> FitStatistics {
        let valid_pixels = self.share.len();
        let rounding_grey = ROUNDING_NOISE_GREY * format.grey_per_value();
        if freedom == 0 || valid_pixels == 0 {
            return FitStatistics { valid_pixels, residual_share: None, noise_grey: rounding_grey, noise_gain };
        }
        // Median of a χ distribution ÷ its standard deviation, in Wilson and Hilferty's approximation.
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
