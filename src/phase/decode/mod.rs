//! N-step decoding: sums of sines and cosines first, one arctangent a pixel.
//!
//! *plan*: what the shifts make of the samples; *block*: the kernel; *four step*, *even steps* and *weighted*: its ways to the
//! sums; *octant*: from these to angle and length; *side by side*: two blocks at once; *left out*: pixels with saturated
//! samples; *statistics*: what some thousand pixels tell of all.

mod block;
mod even_steps;
mod four_step;
mod left_out;
mod octant;
mod plan;
mod side_by_side;
mod statistics;
#[cfg(test)]
mod tests;
mod weighted;

use rayon::prelude::*;

use fringeflow_base::grey::{GreyLevels, PixelFormat};
use fringeflow_base::limits::MAX_STEPS;
use fringeflow_simd::Level;

use super::harmonics::AtRest;
use super::map::{Exposure, PhaseMap};
use super::sample::Sample;
use super::shifts::PhaseShifts;

use block::{Band, Limits};
use plan::Plan;

/// Pixels of a task: some rows, so that tasks are many more than threads and their sums few.
const BAND: usize = 16_384;

/// What makes a phase trustworthy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Validity {
    /// Least modulation, grey levels.
    pub min_modulation_grey: f32,
    /// Grey level from which on a sample is saturated and left out of the fit. Of deeper images 255 is 255 · 2^(bits − 8)
    /// and more, such as 4080 to 4095 of 12 bits: what 8 bits of the same light would show as 255.
    pub saturation_grey: u8,
    /// Largest fit residual (standard deviation of the grey levels about the sinusoid) ÷ modulation.
    ///
    /// Gamma and clipping leave residuals of 0.2 to 0.6 with a phase that is still useful; a lost or swapped image, or an
    /// edge that moved, leaves more.
    pub max_residual_share: f32,
}

impl Default for Validity {
    fn default() -> Self {
        Self { min_modulation_grey: 5.0, saturation_grey: 255, max_residual_share: 1.0 }
    }
}

/// Decodes the N images of one camera, each `width · height` grey levels row by row.
///
/// `None` if there are not as many images as shifts, or an image has another size or depth.
///
/// Formula: with the least-squares sums A, C = B·cos φ and S = B·sin φ of [`PhaseShifts`], φ = atan2(S, C) and
/// B = hypot(S, C); for equal spacing this is `atan2(−Σ I_k sin s_k, Σ I_k cos s_k)`. Saturated samples are left
/// out where three or more others remain.
#[must_use]
pub fn decode(
    images: &[GreyLevels<'_>],
    width: usize,
    height: usize,
    shifts: &PhaseShifts,
    validity: &Validity,
) -> Option<PhaseMap> {
    let mut map = PhaseMap::default();
    decode_into(&mut map, images, width, height, shifts, validity)?;
    Some(map)
}

/// As [`decode`], into a map whose memory is used again; it is left as it was where that yields `None`.
#[must_use]
pub fn decode_into(
    map: &mut PhaseMap,
    images: &[GreyLevels<'_>],
    width: usize,
    height: usize,
    shifts: &PhaseShifts,
    validity: &Validity,
) -> Option<()> {
    let pixels = width * height;
    let format = images.first()?.format;
    let fits = |image: &GreyLevels<'_>| image.format == format && image.bytes.len() == pixels * format.bytes();
    if images.len() != shifts.steps() || !images.iter().all(fits) {
        return None;
    }
    map.resize(width, height);
    match format {
        PixelFormat::Grey => {
            let mut samples = [[].as_slice(); MAX_STEPS];
            samples.iter_mut().zip(images).for_each(|(samples, image)| *samples = image.bytes);
            decode_samples::<u8>(&samples[..images.len()], format, shifts, validity, map);
        }
        _ => {
            let mut samples = [[].as_slice(); MAX_STEPS];
            samples.iter_mut().zip(images).for_each(|(samples, image)| *samples = image.bytes.as_chunks().0);
            decode_samples::<[u8; 2]>(&samples[..images.len()], format, shifts, validity, map);
        }
    }
    Some(())
}

/// Decodes all bands in parallel; their counts are whole numbers, which add up the same in any order.
fn decode_samples<S: Sample>(
    images: &[&[S]],
    format: PixelFormat,
    shifts: &PhaseShifts,
    validity: &Validity,
    map: &mut PhaseMap,
) {
    let plan = Plan::new(shifts);
    let limits = Limits::new::<S>(format, validity, shifts.steps());
    let level = Level::in_use();
    let bands = map
        .phase
        .par_chunks_mut(BAND)
        .zip(map.modulation.par_chunks_mut(BAND))
        .zip(map.mean.par_chunks_mut(BAND))
        .zip(map.valid.par_chunks_mut(BAND))
        .enumerate();
    let decoded = bands.map(|(i, (((phase, modulation), mean), valid))| {
        let mut samples = [[].as_slice(); MAX_STEPS];
        samples.iter_mut().zip(images).for_each(|(samples, image)| *samples = &image[i * BAND..][..phase.len()]);
        let samples = &samples[..images.len()];
        Band { samples, plan: &plan, limits: &limits, shifts, phase, modulation, mean, valid }.decode(level)
    });
    let counts = decoded.reduce(Counts::default, Counts::plus);
    map.exposure = counts.exposure;
    statistics::measure(images, format, shifts, &AtRest::new(shifts.shifts_rad()), &limits, counts.valid_pixels, map);
    map.motion = None;
}

/// What is counted over the pixels of an image.
#[derive(Clone, Copy, Default)]
struct Counts {
    valid_pixels: u64,
    exposure: Exposure,
}

impl Counts {
    fn plus(self, other: Self) -> Self {
        Self { valid_pixels: self.valid_pixels + other.valid_pixels, exposure: self.exposure.plus(other.exposure) }
    }
}
