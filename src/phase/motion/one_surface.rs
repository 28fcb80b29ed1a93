//! Pixels whose images show more than one surface: something moved across them, an edge or a shadow.
//!
//! Of the runs of images that include the centre of the window, the one is taken that fits a moving sinusoid best; the motion
//! is that of the neighbours. Saturated samples are left out of every run. Where no run fits, the pixel is left out.

use std::ops::Range;

use fringeflow_simd::{Kernel, LANES, Lanes, first_lanes};

use crate::phase::Validity;
use crate::phase::arctangent::turn_fraction;
use crate::phase::map::{DIM, Exposure, FitStatistics, Modulation};
use crate::phase::sample::Sample;

use super::band::{Beside, Planes};
use super::fit::LEAST_FITTED;
use super::follow::Fits;
use super::images::Images;
use super::solve::{BATCH, Batch, Solutions};
use super::speeds::Speeds;

/// A residual this many times the usual one shows that the images do not belong together.
const LARGE_RESIDUAL: f32 = 4.0;
/// Usual residual ÷ modulation where three images leave none to measure.
const UNKNOWN_SHARE: f32 = 0.02;

/// What finds the images that show one surface.
pub(super) struct OneSurface<'a, S> {
    images: &'a Images<'a, S>,
    validity: &'a Validity,
    fits: Fits<'a>,
    /// Largest residual that is usual: grey levels, and a share of the modulation.
    usual: [f32; 2],
}

/// What is counted on the way.
#[derive(Clone, Debug, Default)]
pub(super) struct Repaired {
    /// Pixels decoded from part of their images.
    pub(super) one_surface_pixels: u64,
    /// Pixels left out.
    pub(super) lost_pixels: u64,
    /// Pixels that are valid in the end.
    pub(super) valid_pixels: u64,
    /// How the pixels are lit.
    pub(super) exposure: Exposure,
    /// How those moved that were valid before and are not, and the other way round.
    pub(super) speeds: Speeds,
}

impl Repaired {
    pub(super) fn merge(&mut self, other: &Self) {
        self.one_surface_pixels += other.one_surface_pixels;
        self.lost_pixels += other.lost_pixels;
        self.valid_pixels += other.valid_pixels;
        self.exposure = self.exposure.plus(other.exposure);
        self.speeds.merge(&other.speeds);
    }
}

/// Scratch for what is decoded again.
#[derive(Clone, Debug, Default)]
pub(super) struct RepairScratch {
    /// Pixels of a row that are to be decoded again.
    asked: Vec<u32>,
    batch: Batch,
    pub(super) repaired: Repaired,
}

impl<'a, S: Sample> OneSurface<'a, S> {
    pub(super) fn new(
        images: &'a Images<'a, S>,
        fits: Fits<'a>,
        validity: &'a Validity,
        statistics: &FitStatistics,
    ) -> Self {
        let share = statistics.residual_share.unwrap_or(UNKNOWN_SHARE);
        Self { images, validity, fits, usual: [LARGE_RESIDUAL * statistics.noise_grey, LARGE_RESIDUAL * share] }
    }

    /// Largest residual of images that belong together.
    fn largest(&self, modulation: f32) -> f32 {
        self.usual[0].max(self.usual[1] * modulation)
    }
}

/// Decodes the pixels of some rows again that need it.
pub(super) struct Repair<'a, S> {
    pub(super) one_surface: &'a OneSurface<'a, S>,
    pub(super) rows: Range<usize>,
    pub(super) scratch: &'a mut RepairScratch,
    pub(super) planes: Planes<'a>,
}

impl<S: Sample> Kernel for Repair<'_, S> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(mut self, lanes: L) {
        let width = self.one_surface.images.width;
        let blocks = width.div_ceil(LANES);
        self.scratch.repaired = Repaired::default();
        for row in 0..self.rows.len() {
            self.scratch.asked.clear();
            for block in 0..blocks {
                self.judge(lanes, [row, block]);
            }
            let mut asked = std::mem::take(&mut self.scratch.asked);
            for pixels in asked.chunks(BATCH) {
                self.decode_again(pixels, row);
            }
            asked.clear();
            self.scratch.asked = asked;
        }
    }
}

impl<S: Sample> Repair<'_, S> {
    /// Takes those pixels of a block that need to be decoded again, and counts how the others are lit.
    #[inline(always)]
    fn judge<L: Lanes>(&mut self, lanes: L, [row, block]: [usize; 2]) {
        let (l, of) = (lanes, self.one_surface);
        let width = of.images.width;
        let (count, blocks) = ((width - block * LANES).min(LANES), width.div_ceil(LANES));
        let begin = row * width + block * LANES;
        let used = first_lanes(count);
        let Beside { residual, saturated, .. } = &self.planes.beside[row * blocks + block];
        let (mut steps, mut valid) = ([0; LANES], [0; LANES]);
        let modulation: &[u16] = bytemuck::cast_slice(&self.planes.modulation[begin..][..count]);
        steps[..count].copy_from_slice(modulation);
        valid[..count].copy_from_slice(bytemuck::cast_slice(&self.planes.valid[begin..][..count]));
        let modulation = l.times_real(l.reals_of_words(&steps), l.real(1.0 / Modulation::PER_GREY));
        let least = of.validity.min_modulation_grey;
        let is_lit = l.bits(l.is_at_least_real(modulation, l.real(least))) & used;
        let is_dim = is_lit & !l.bits(l.is_at_least_real(modulation, l.real(DIM * least)));
        let largest = l.max_real(l.real(of.usual[0]), l.times_real(l.real(of.usual[1]), modulation));
        let fits = l.bits(l.is_at_least_real(largest, l.load_reals(residual)));
        let is_valid = l.bits(l.is_greater(l.words_of_bytes(&valid), l.word(0)));
        let again = (*saturated | (is_lit & !(fits & is_valid))) & used;
        self.scratch.repaired.valid_pixels += u64::from((is_valid & !again).count_ones());
        let exposure = &mut self.scratch.repaired.exposure;
        exposure.lit_pixels += u64::from((is_lit & !again).count_ones());
        exposure.dim_pixels += u64::from((is_dim & !again).count_ones());
        let mut left = again;
        while left != 0 {
            self.scratch.asked.push((block * LANES) as u32 + left.trailing_zeros());
            left &= left - 1;
        }
    }

    /// Decodes some pixels of a row again.
    #[inline(always)]
    fn decode_again(&mut self, asked: &[u32], row: usize) {
        let of = self.one_surface;
        let (images, width) = (of.images, of.images.width);
        let blocks = width.div_ceil(LANES);
        let (mut motion_rad, mut is_saturated) = ([0.0; BATCH], [false; BATCH]);
        let batch = &mut self.scratch.batch;
        for (p, &u) in asked.iter().enumerate() {
            let u = u as usize;
            let motion = self.planes.beside[row * blocks + u / LANES].motion_rad[u % LANES];
            let followed_rad = of.fits.followed_rad([self.rows.start + row, u / LANES]);
            motion_rad[p] = if motion.is_finite() { motion } else { followed_rad };
            let pixel = (self.rows.start + row) * width + u;
            for image in 0..images.count {
                let saturated = images.is_saturated(image, pixel);
                is_saturated[p] |= saturated && of.fits.holds(images, image, [u, self.rows.start + row]);
                batch.set(image, p, images.grey(image, pixel), !saturated);
            }
        }
        for (image, &moment) in of.fits.any().moments.iter().enumerate() {
            batch.turn(image, moment, &motion_rad);
        }
        let mut best = Best::default();
        for &run in &of.fits.any().runs {
            best.try_others(&batch.solve(run), of);
        }
        for (p, &u) in asked.iter().enumerate() {
            let pixel = row * width + u as usize;
            let found = best.share[p] < f32::INFINITY;
            let was_valid = std::mem::replace(&mut self.planes.valid[pixel], found);
            let beside = &self.planes.beside[row * blocks + u as usize / LANES];
            let followed_rad = of.fits.followed_rad([self.rows.start + row, u as usize / LANES]);
            let unfollowed_rad = beside.motion_rad[u as usize % LANES] - followed_rad;
            self.scratch.repaired.speeds.change(unfollowed_rad, was_valid, found);
            self.scratch.repaired.valid_pixels += u64::from(found);
            if found {
                let [re, im] = [best.z[0][p], best.z[1][p]];
                self.planes.phase[pixel] = turn_fraction(im, re);
                self.planes.modulation[pixel] = Modulation::from_grey((re * re + im * im).sqrt());
                self.planes.mean[pixel] = (best.offset[p] + 0.5) as u8;
            }
            let (repaired, modulation) = (&mut self.scratch.repaired, self.planes.modulation[pixel].grey());
            repaired.exposure.add(is_saturated[p], modulation, of.validity.min_modulation_grey);
            if !is_saturated[p] {
                // Otherwise it is too much light, not motion.
                *if found { &mut repaired.one_surface_pixels } else { &mut repaired.lost_pixels } += 1;
            }
        }
    }
}

/// The solution of each pixel that fits best.
struct Best {
    /// Residual ÷ modulation; infinite where none fits.
    share: [f32; BATCH],
    offset: [f32; BATCH],
    z: [[f32; BATCH]; 2],
}

impl Default for Best {
    fn default() -> Self {
        Self { share: [f32::INFINITY; BATCH], offset: [0.0; BATCH], z: [[0.0; BATCH]; 2] }
    }
}

impl Best {
    /// Takes solutions where they fit better.
    #[inline(always)]
    fn try_others<S: Sample>(&mut self, others: &Solutions, of: &OneSurface<'_, S>) {
        for p in 0..BATCH {
            let [re, im] = [others.z[0][p], others.z[1][p]];
            let modulation = (re * re + im * im).sqrt();
            let limit = of.largest(modulation).max(of.validity.max_residual_share * modulation);
            let is_lit = modulation >= of.validity.min_modulation_grey;
            let fits = others.determined[p] & is_lit & (others.residual[p] <= limit);
            let share = others.residual[p] / modulation;
            if fits & (share < self.share[p]) {
                self.share[p] = share;
                self.offset[p] = others.offset[p];
                (self.z[0][p], self.z[1][p]) = (re, im);
            }
        }
    }
}

/// Runs of images that include the centre of the window and leave a residual, the longest first.
pub(super) fn runs(images: usize) -> Vec<[usize; 2]> {
    let centre = |first: usize, last: usize| 2 * first < images && 2 * last + 2 > images;
    let mut lengths: Vec<usize> = [images, images.saturating_sub(2), images.div_ceil(2) + 1].into();
    lengths.retain(|&length| length >= LEAST_FITTED);
    lengths.dedup();
    let of = |length: usize| (0..=images - length).map(move |first| [first, first + length - 1]);
    lengths.into_iter().flat_map(of).filter(|&[first, last]| centre(first, last)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn runs_include_the_centre_and_leave_a_residual() {
        assert_eq!(runs(6), [[0, 5], [0, 3], [1, 4], [2, 5]]);
        assert_eq!(runs(5), [[0, 4], [0, 3], [1, 4]]);
        for images in 5..24 {
            for [first, last] in runs(images) {
                let middle = (images - 1) as f64 / 2.0;
                assert!(first as f64 <= middle + 0.5 && last as f64 >= middle - 0.5 && last < images);
            }
        }
    }
}
