//! What some of the pixels tell of all: how well sinusoids fit, and what harmonics the fringes have.

use fringeflow_base::grey::PixelFormat;
use fringeflow_base::limits::{MAX_STEPS, MIN_STEPS};

use crate::phase::harmonics::{AtRest, Sums, spread};
use crate::phase::map::{FitStatistics, PhaseMap};
use crate::phase::residuals::Residuals;
use crate::phase::sample::Sample;
use crate::phase::shifts::PhaseShifts;

use super::block::Limits;

/// Valid pixels that are asked: their medians err by a twentieth, and harmonics by a thousandth of the modulation at usual noise.
const PIXELS: usize = 640;
/// Pixels looked at for one that is asked, at most: where the scene fills less of the image, fewer are asked.
const MOST_TRIES: usize = 32;

/// Pixels whose samples are fetched before any of them is used: memory is waited for once.
const TOGETHER: usize = 16;

/// Fills in fit statistics and harmonics of a map whose planes are there and that has so many valid pixels.
pub(super) fn measure<S: Sample>(
    images: &[&[S]],
    format: PixelFormat,
    shifts: &PhaseShifts,
    at_rest: &AtRest,
    limits: &Limits,
    valid_pixels: u64,
    map: &mut PhaseMap,
) {
    let pixels = map.phase.len();
    let tries = (PIXELS as u64 * pixels as u64).div_ceil(valid_pixels.max(1)).min((MOST_TRIES * PIXELS) as u64);
    let freedom = shifts.steps() - MIN_STEPS;
    let (mut sums, mut residuals) = (Sums::default(), Residuals::default());
    let mut together = [[0.0; MAX_STEPS]; TOGETHER];
    let mut places = spread(pixels, tries as usize);
    while places.len() > 0 {
        let mut count = 0;
        for pixel in places.by_ref().take(TOGETHER).filter(|&pixel| map.valid[pixel]) {
            let mut is_saturated = false;
            for (sample, image) in together[count].iter_mut().zip(images) {
                is_saturated |= limits.saturates(image[pixel]);
                *sample = f64::from(image[pixel].grey(limits.grey_per_value));
            }
            count += usize::from(!is_saturated);
        }
        for samples in &together[..count] {
            let beside = at_rest.add(samples, &mut sums);
            if freedom > 0 {
                residuals.add((beside.squares / freedom as f64).sqrt() as f32, beside.modulation as f32);
            }
        }
    }
    let statistics = residuals.statistics(freedom, format, shifts.noise_gain() as f32);
    map.fit = FitStatistics { valid_pixels, ..statistics };
    map.harmonics = at_rest.solve(sums);
}
