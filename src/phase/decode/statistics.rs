//! Fit statistics and harmonics of an image from a sample of its pixels. In: images and validity. Out:
//! [`FitStatistics`] and harmonics. Cost: 640 valid pixels, independent of the size of the image.
//!
//! ```text
//! for each sixteen of the pixels that are spread over the image:
//!     load the samples of the valid, unsaturated ones
//!     for each of them: fit, add its residual to the histograms and its normal equations to the harmonics
//! ```

use fringeflow_base::grey::PixelFormat;
use fringeflow_base::limits::{MAX_STEPS, MIN_STEPS};

use crate::phase::harmonics::{HarmonicSums, RestingHarmonics, spread_pixels};
use crate::phase::map::{FitStatistics, PhaseMap};
use crate::phase::residuals::Residuals;
use crate::phase::sample::Sample;
use crate::phase::shifts::PhaseShifts;

use super::validity::Limits;

/// Sampled valid pixels. At usual noise, medians are then exact to 5 %, harmonics to 0.1 % of the modulation.
const PIXELS: usize = 640;
/// Most pixels tried per sampled one. If the scene fills less of the image than that, fewer pixels are sampled.
const MAX_TRIES: usize = 32;
/// Pixels loaded before any of them is used, so that their cache misses overlap.
const TOGETHER: usize = 16;

/// Fills in fit statistics and harmonics of a map whose planes are complete.
pub(super) fn measure<S: Sample>(
    images: &[&[S]],
    format: PixelFormat,
    shifts: &PhaseShifts,
    harmonics: &RestingHarmonics,
    limits: &Limits,
    valid_pixels: u64,
    map: &mut PhaseMap,
) {
    let pixels = map.phase.len();
    let tries = (PIXELS as u64 * pixels as u64).div_ceil(valid_pixels.max(1)).min((MAX_TRIES * PIXELS) as u64);
    let freedom = shifts.steps() - MIN_STEPS;
    let (mut sums, mut residuals) = (HarmonicSums::default(), Residuals::default());
    let mut together = [[0.0; MAX_STEPS]; TOGETHER];
    let mut candidates = spread_pixels(pixels, tries as usize);
    while candidates.len() > 0 {
        let mut count = 0;
        for pixel in candidates.by_ref().take(TOGETHER).filter(|&pixel| map.valid[pixel]) {
            let mut is_saturated = false;
            for (sample, image) in together[count].iter_mut().zip(images) {
                is_saturated |= limits.saturates(image[pixel]);
                *sample = f64::from(image[pixel].grey(limits.grey_per_value));
            }
            count += usize::from(!is_saturated);
        }
        for samples in &together[..count] {
            let fit = harmonics.add(samples, &mut sums);
            if freedom > 0 {
                residuals.add((fit.squares / freedom as f64).sqrt() as f32, fit.modulation as f32);
            }
        }
    }
    let statistics = residuals.statistics(freedom, format, shifts.noise_gain() as f32);
    map.fit = FitStatistics { valid_pixels, ..statistics };
    map.harmonics = harmonics.solve(sums);
}
