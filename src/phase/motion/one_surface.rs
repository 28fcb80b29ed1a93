//! Pixels whose images show more than one surface, because an edge or a shadow moved across them.
//!
//! In: decoded rows. Out: the same rows, with these pixels decoded again. Cost: some hundred operations for each image
//! of such a pixel, 32 pixels at a time.
//!
//! Candidates are runs of consecutive images that include the centre of the window. The run that fits a moving sinusoid
//! best is used, with the motion of the neighbouring pixels. Saturated samples are left out of every run. If no run
//! fits, the pixel is invalid.

use std::ops::Range;

use fringeflow_simd::{Kernel, LANES, Lanes, filled, first_lanes};

use crate::phase::Validity;
use crate::phase::arctangent::turn_fraction;
use crate::phase::map::{DIM, Exposure, FitStatistics, Modulation};
use crate::phase::sample::Sample;

use super::band::Planes;
use super::cells::CELL;
use super::follow::Fits;
use super::images::Images;
use super::motion_histogram::{MotionHistogram, is_counted};
use super::ripple::Turns;
use super::solve::{BATCH, Batch, Solutions};

/// Images with a residual of more than this multiple of the usual one do not show the same surface.
const LARGE_RESIDUAL: f32 = 4.0;
/// Assumed residual ÷ modulation if the fit has no residual to measure.
const UNKNOWN_SHARE: f32 = 0.02;

/// Input that all rows share.
pub(super) struct OneSurface<'a, S> {
    images: &'a Images<'a, S>,
    validity: &'a Validity,
    fits: Fits<'a>,
    /// Largest residual of a single surface: grey levels, and share of the modulation.
    max_residual: [f32; 2],
}

/// Counts over the repaired rows.
#[derive(Clone, Debug, Default)]
pub(super) struct Repaired {
    /// Pixels decoded from part of their images.
    pub(super) one_surface_pixels: u64,
    /// Lit pixels without a phase.
    pub(super) lost_pixels: u64,
    /// Valid pixels in the end.
    pub(super) valid_pixels: u64,
    /// Exposure of the pixels.
    pub(super) exposure: Exposure,
    /// Changes of the motion histogram, by pixels that became valid or invalid.
    pub(super) motions: MotionHistogram,
}

impl Repaired {
    pub(super) fn merge(&mut self, other: &Self) {
        self.one_surface_pixels += other.one_surface_pixels;
        self.lost_pixels += other.lost_pixels;
        self.valid_pixels += other.valid_pixels;
        self.exposure = self.exposure.plus(other.exposure);
        self.motions.merge(&other.motions);
    }
}

/// Scratch memory for repairing rows.
#[derive(Clone, Debug, Default)]
pub(super) struct RepairScratch {
    /// Columns of a row to decode again.
    columns: Vec<u32>,
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
        let max_residual = [LARGE_RESIDUAL * statistics.noise_grey, LARGE_RESIDUAL * share];
        Self { images, validity, fits, max_residual }
    }
}

/// Decodes pixels of some rows again, where needed.
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
            self.scratch.columns.clear();
            for block in 0..blocks {
                self.select_pixels(lanes, [row, block]);
            }
            let columns = std::mem::take(&mut self.scratch.columns);
            for batch in columns.chunks(BATCH) {
                self.decode_again(lanes, batch, row);
            }
            self.scratch.columns = columns;
        }
    }
}

impl<S: Sample> Repair<'_, S> {
    /// Selects the pixels of a block to decode again, and counts the others.
    #[inline(always)]
    fn select_pixels<L: Lanes>(&mut self, lanes: L, [row, block]: [usize; 2]) {
        let (l, one_surface) = (lanes, self.one_surface);
        let width = one_surface.images.width;
        let (count, blocks) = ((width - block * LANES).min(LANES), width.div_ceil(LANES));
        let begin = row * width + block * LANES;
        let used = first_lanes(count);
        let fits = &self.planes.cell_fits[row / CELL * blocks + block];
        let steps = filled(bytemuck::cast_slice(&self.planes.modulation[begin..][..count]), 0);
        let valid = filled(bytemuck::cast_slice(&self.planes.valid[begin..][..count]), 0);
        let modulation = l.times_real(l.reals_of_words(&steps), l.real(1.0 / Modulation::PER_GREY));
        let least = one_surface.validity.min_modulation_grey;
        let is_lit = l.bits(l.is_at_least_real(modulation, l.real(least))) & used;
        let is_dim = is_lit & !l.bits(l.is_at_least_real(modulation, l.real(DIM * least)));
        let [grey, share] = one_surface.max_residual;
        let max_residual = l.max_real(l.real(grey), l.times_real(l.real(share), modulation));
        let is_fitted = l.bits(l.is_at_least_real(max_residual, fits.residual(l, row)));
        let is_valid = l.bits(l.is_greater(l.words_of_bytes(&valid), l.word(0)));
        let again = (fits.saturated(row) | (is_lit & !(is_fitted & is_valid))) & used;
        self.scratch.repaired.valid_pixels += u64::from((is_valid & !again).count_ones());
        let exposure = &mut self.scratch.repaired.exposure;
        exposure.lit_pixels += u64::from((is_lit & !again).count_ones());
        exposure.dim_pixels += u64::from((is_dim & !again).count_ones());
        let mut remaining = again;
        while remaining != 0 {
            self.scratch.columns.push((block * LANES) as u32 + remaining.trailing_zeros());
            remaining &= remaining - 1;
        }
    }

    /// Decodes pixels of a row again, at most `BATCH`.
    ///
    /// ```text
    /// load the samples and the motion of every pixel; saturated samples do not count
    /// for each run of images that includes the centre: fit all pixels; keep the best fit of each
    /// store the best fits; a pixel without one becomes invalid
    /// count: one surface, lost, exposure, motion
    /// ```
    #[inline(always)]
    fn decode_again<L: Lanes>(&mut self, lanes: L, columns: &[u32], row: usize) {
        let (l, one_surface) = (lanes, self.one_surface);
        let OneSurface { images, fits, .. } = *one_surface;
        let width = images.width;
        let blocks = width.div_ceil(LANES);
        let mut is_saturated = [false; BATCH];
        let batch = &mut self.scratch.batch;
        // Load samples and motion. Samples outside the image are marked as saturated too, but are not overexposed.
        for (p, &u) in columns.iter().enumerate() {
            let (u, v) = (u as usize, self.rows.start + row);
            let ((fit, _), followed_rad) = (fits.for_block([v, u / LANES]), fits.followed_rad([v, u / LANES]));
            let motion_rad = self.planes.cell_fits[row / CELL * blocks + u / LANES].motion_rad(u) - followed_rad;
            batch.set_motion(p, if motion_rad.is_finite() { motion_rad } else { 0.0 });
            for (image, &shift) in fit.turns.iter().enumerate() {
                let saturated = images.is_saturated(image, v * width + u);
                is_saturated[p] |= saturated && fits.is_inside(images, image, [u, v]);
                batch.set_sample([image, p], images.grey(image, v * width + u), !saturated, shift);
            }
        }
        batch.prepare(l, images.count, &mut Turns::new(l));
        // The best run of every pixel.
        let mut best = Best::new(l);
        for &run in &fits.common().runs {
            best.update(l, &batch.solve(l, run), one_surface);
        }
        let best = best.to_planes(l);
        // Store and count.
        for (p, &u) in columns.iter().enumerate() {
            let pixel = row * width + u as usize;
            let found = best.share[p] < f32::INFINITY;
            let was_valid = std::mem::replace(&mut self.planes.valid[pixel], found);
            let cell_fits = &self.planes.cell_fits[row / CELL * blocks + u as usize / LANES];
            let followed_rad = fits.followed_rad([self.rows.start + row, u as usize / LANES]);
            let unfollowed_rad = cell_fits.motion_rad(u as usize) - followed_rad;
            if is_counted(self.rows.start + row) {
                self.scratch.repaired.motions.change(unfollowed_rad, was_valid, found);
            }
            self.scratch.repaired.valid_pixels += u64::from(found);
            if found {
                let [re, im] = [best.z[0][p], best.z[1][p]];
                self.planes.phase[pixel] = turn_fraction(im, re);
                self.planes.modulation[pixel] = Modulation::from_grey((re * re + im * im).sqrt());
                self.planes.mean[pixel] = (best.offset[p] + 0.5) as u8;
            }
            let (repaired, modulation) = (&mut self.scratch.repaired, self.planes.modulation[pixel].grey());
            repaired.exposure.add(is_saturated[p], modulation, one_surface.validity.min_modulation_grey);
            // Saturated pixels suffer from too much light, not from motion.
            if !is_saturated[p] {
                *if found { &mut repaired.one_surface_pixels } else { &mut repaired.lost_pixels } += 1;
            }
        }
    }
}

/// The best solution of each pixel.
struct Best<L: Lanes> {
    /// Residual ÷ modulation; infinite if no solution fits.
    share: L::Reals,
    offset: L::Reals,
    z: [L::Reals; 2],
}

/// The same as numbers.
struct BestPlanes {
    share: [f32; BATCH],
    offset: [f32; BATCH],
    z: [[f32; BATCH]; 2],
}

impl<L: Lanes> Best<L> {
    #[inline(always)]
    fn new(lanes: L) -> Self {
        let zero = lanes.real(0.0);
        Self { share: lanes.real(f32::INFINITY), offset: zero, z: [zero; 2] }
    }

    /// Keeps the better solution of each pixel.
    #[inline(always)]
    fn update<S: Sample>(&mut self, lanes: L, others: &Solutions<L>, one_surface: &OneSurface<'_, S>) {
        let (l, [re, im]) = (lanes, others.z);
        let validity = one_surface.validity;
        let modulation = l.root_real(l.add_real(l.times_real(re, re), l.times_real(im, im)));
        let [grey, share] = one_surface.max_residual;
        let limit = l.times_real(l.real(share.max(validity.max_residual_share)), modulation);
        let limit = l.max_real(l.real(grey), limit);
        let is_lit = l.is_at_least_real(modulation, l.real(validity.min_modulation_grey));
        let fits = l.and(l.and(others.determined, is_lit), l.is_at_least_real(limit, others.residual));
        let share = l.over_real(others.residual, modulation);
        let is_better = l.and(fits, l.is_greater_real(self.share, share));
        self.share = l.select_real(is_better, share, self.share);
        self.offset = l.select_real(is_better, others.offset, self.offset);
        self.z = [l.select_real(is_better, re, self.z[0]), l.select_real(is_better, im, self.z[1])];
    }

    #[inline(always)]
    fn to_planes(&self, lanes: L) -> BestPlanes {
        let plane = [0.0; BATCH];
        let mut planes = BestPlanes { share: plane, offset: plane, z: [plane; 2] };
        lanes.store_reals(self.share, &mut planes.share);
        lanes.store_reals(self.offset, &mut planes.offset);
        lanes.store_reals(self.z[0], &mut planes.z[0]);
        lanes.store_reals(self.z[1], &mut planes.z[1]);
        planes
    }
}
