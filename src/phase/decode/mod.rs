//! N-step decoding of a scene at rest (paper, section 2.1).
//!
//! In: N images. Out: a [`PhaseMap`]. Cost per pixel: N multiply-adds for each of two or three sums, one division and a
//! polynomial arctangent, 32 pixels at a time.
//!
//! ```text
//! plan: phase shifts ─► whole-number weights
//! for each band of pixels, in parallel:
//!     for each block of 32 pixels:
//!         sums of cosine, sine and offset    four_step, even_steps or weighted, by shifts and sample size
//!         ─► angle and length                octant
//!         ─► validity, counts, planes        block, band
//!     if any sample was saturated: solve its pixel again without it       unsaturated
//! fit statistics and harmonics, from some hundred pixels                  statistics
//! ```

mod band;
mod block;
mod even_steps;
mod four_step;
mod octant;
mod plan;
mod side_by_side;
mod statistics;
#[cfg(test)]
mod tests;
mod unsaturated;
mod validity;
mod weighted;

use rayon::prelude::*;

use fringeflow_base::grey::{GreyLevels, PixelFormat};
use fringeflow_base::limits::MAX_STEPS;
use fringeflow_simd::Level;

use super::harmonics::RestingHarmonics;
use super::map::PhaseMap;
use super::sample::Sample;
use super::shifts::PhaseShifts;

use band::Band;
use block::Counts;
use plan::Plan;
use validity::Limits;

pub use validity::Validity;

/// Pixels of a task: some rows. That makes many more tasks than threads, but few partial sums.
const BAND_PX: usize = 16_384;

/// Decodes the N images of one camera, each `width · height` grey levels row by row.
///
/// `None` if the number of images is not the number of shifts, or an image has another size or depth.
///
/// Formula: with the least-squares sums A, C = B·cos φ and S = B·sin φ of [`PhaseShifts`], φ = atan2(S, C) and
/// B = hypot(S, C); for equal spacing this is `atan2(−Σ I_k sin s_k, Σ I_k cos s_k)`. Saturated samples are left out if
/// at least three others remain.
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

/// [`decode`] into the memory of another map, which stays as it is if the result is `None`.
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

/// Decodes all bands in parallel. Their counts are whole numbers, so the order of adding them does not matter.
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
    let planes = (
        map.phase.par_chunks_mut(BAND_PX),
        map.modulation.par_chunks_mut(BAND_PX),
        map.mean.par_chunks_mut(BAND_PX),
        map.valid.par_chunks_mut(BAND_PX),
    );
    let decoded = planes.into_par_iter().enumerate().map(|(i, (phase, modulation, mean, valid))| {
        let mut samples = [[].as_slice(); MAX_STEPS];
        samples.iter_mut().zip(images).for_each(|(samples, image)| *samples = &image[i * BAND_PX..][..phase.len()]);
        let samples = &samples[..images.len()];
        Band { samples, plan: &plan, limits: &limits, shifts, phase, modulation, mean, valid }.decode(level)
    });
    let counts = decoded.reduce(Counts::default, Counts::plus);
    map.exposure = counts.exposure;
    statistics::measure(
        images,
        format,
        shifts,
        &RestingHarmonics::new(shifts.shifts_rad()),
        &limits,
        counts.valid_pixels,
        map,
    );
    map.motion = None;
}
