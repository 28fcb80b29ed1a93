//! How well sinusoids fit the images, over all pixels: histograms that add up in any order, and what they say.

use crate::grey::PixelFormat;

use super::map::FitStatistics;

/// Standard deviation of rounding to whole grey levels, 1/√12; deeper images round to fractions of them.
const ROUNDING_NOISE_GREY: f32 = 0.288_675;
/// Bins of the histograms of residual and residual share.
pub(super) const BINS: usize = 1024;
/// Residual shares up to this are told apart; worse ones share the last bin.
const SHARE_RANGE: f32 = 2.0;
/// Residuals up to this many grey levels are told apart.
const RESIDUAL_RANGE_GREY: f32 = 64.0;

/// Bins of a residual share of 1, and of a residual of a grey level.
pub(super) const BINS_PER_SHARE: f32 = BINS as f32 / SHARE_RANGE;
pub(super) const BINS_PER_GREY: f32 = BINS as f32 / RESIDUAL_RANGE_GREY;

/// Histograms of the residual over the valid pixels, absolute and as a share of the modulation.
#[derive(Clone, Debug)]
pub(super) struct Residuals {
    share: [u32; BINS],
    residual: [u32; BINS],
}

impl Default for Residuals {
    fn default() -> Self {
        Self { share: [0; BINS], residual: [0; BINS] }
    }
}

impl Residuals {
    pub(super) fn add(&mut self, residual_grey: f32, modulation_grey: f32) {
        let bin = |bins: f32| (bins as usize).min(BINS - 1);
        self.add_bins(bin(residual_grey / modulation_grey * BINS_PER_SHARE), bin(residual_grey * BINS_PER_GREY));
    }

    /// Adds a pixel whose bins, below [`BINS`], are known.
    #[inline(always)]
    pub(super) fn add_bins(&mut self, share: usize, residual: usize) {
        self.share[share] += 1;
        self.residual[residual] += 1;
    }

    pub(super) fn merge(&mut self, other: &Self) {
        let pairs = [(&mut self.share, &other.share), (&mut self.residual, &other.residual)];
        for (mine, theirs) in pairs {
            mine.iter_mut().zip(theirs).for_each(|(m, t)| *m += t);
        }
    }

    /// Statistics of fits that leave so many degrees of freedom to the images of a format, and make `noise_gain` of noise ÷
    /// modulation.
    pub(super) fn statistics(&self, freedom: usize, format: PixelFormat, noise_gain: f32) -> FitStatistics {
        let valid_pixels = self.share.iter().map(|&n| u64::from(n)).sum();
        let rounding_grey = ROUNDING_NOISE_GREY * format.grey_per_value();
        if freedom == 0 || valid_pixels == 0 {
            return FitStatistics { valid_pixels, residual_share: None, noise_grey: rounding_grey, noise_gain };
        }
        // Median of a χ distribution over its standard deviation, Wilson and Hilferty's approximation.
        let freedom = freedom as f32;
        let median_of_unit_noise = (1.0 - 2.0 / (9.0 * freedom)).powi(3).sqrt();
        let noise_grey = median(&self.residual) * RESIDUAL_RANGE_GREY / median_of_unit_noise;
        FitStatistics {
            valid_pixels,
            residual_share: Some(median(&self.share) * SHARE_RANGE),
            noise_grey: noise_grey.max(rounding_grey),
            noise_gain,
        }
    }
}

/// Median of a histogram, as a fraction of its range.
pub(super) fn median(histogram: &[u32]) -> f32 {
    quantile(histogram, 0.5)
}

/// The value that a share of what a histogram counts does not exceed, as a fraction of its range.
pub(super) fn quantile(histogram: &[u32], share: f64) -> f32 {
    let all: u64 = histogram.iter().map(|&n| u64::from(n)).sum();
    let wanted = (all as f64 * share).ceil() as u64;
    let mut below = 0;
    let bin = histogram.iter().position(|&n| {
        below += u64::from(n);
        below >= wanted
    });
    (bin.unwrap_or(0) as f32 + 0.5) / histogram.len() as f32
}
