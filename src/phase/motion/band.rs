//! The kernel for moving scenes (paper, section 2.1, without motion). In: the samples of a band of rows. Out: their
//! phase, modulation, mean, validity and motion. Cost: see [`super`].
//!
//! The rounds run as a pipeline over rows, so that intermediate results stay in the cache:
//!
//! ```text
//! for each row v of the band and its surroundings:
//!     fit row v; motion parts of round 0, as if nothing moved            fit_row
//!     for round 1, 2 on row v − 2, v − 4:                                move_row
//!         motion = quotient of the parts of the round before, over 5 × 5 pixels
//!         motion parts without the ripple that this motion causes        find_parts
//!     for round 3 on row v − 6:
//!         motion as above, then phase, modulation, mean and validity     finish
//! ```
//!
//! A round lags two rows behind the one before because 5 × 5 pixels reach two rows down.

use std::ops::Range;

use fringeflow_base::limits::MAX_IMAGES;
use fringeflow_simd::{Kernel, LANES, Lanes, first_lanes};

use crate::phase::Validity;
use crate::phase::map::Modulation;
use crate::phase::residuals::Residuals;
use crate::phase::sample::Sample;

use super::estimate::{ColumnSums, MotionParts, REACH};
use super::follow::Fits;
use super::images::Images;
use super::linear::Fitted;
use super::motion_histogram::MotionHistogram;
use super::ripple::{Turns, splat, without_ripple};

/// Rounds of motion estimation. The first uses the fit including its ripple; the others remove the ripple of the motion
/// found before.
const ROUNDS: usize = 3;
/// Rows on either side that a phase depends on.
const HALO: usize = ROUNDS * REACH;
/// Sizes of the ring buffers of fitted rows and of motion parts.
const FITTED_ROWS: usize = HALO + 1;
const PARTS_ROWS: usize = 2 * REACH + 1;

/// Scratch memory of a band, and its statistics.
#[derive(Clone, Debug, Default)]
pub(super) struct BandScratch {
    greys: [[f32; LANES]; MAX_IMAGES],
    fitted: Vec<Fitted>,
    parts: [Vec<MotionParts>; ROUNDS],
    sums: ColumnSums,
    pub(super) residuals: Residuals,
    /// Motion of the valid pixels.
    pub(super) motions: MotionHistogram,
}

impl BandScratch {
    fn resize(&mut self, blocks: usize) {
        self.fitted.resize_with(FITTED_ROWS * blocks, Fitted::default);
        self.parts.iter_mut().for_each(|parts| parts.resize_with(PARTS_ROWS * blocks, MotionParts::default));
        self.sums.resize(blocks);
        self.residuals = Residuals::default();
        self.motions = MotionHistogram::default();
    }
}

/// Results of a band.
pub(super) struct Planes<'a> {
    pub(super) phase: &'a mut [u16],
    pub(super) modulation: &'a mut [Modulation],
    pub(super) mean: &'a mut [u8],
    pub(super) valid: &'a mut [bool],
    pub(super) block_fits: &'a mut [BlockFit],
}

/// Motion and residual of 32 pixels of a row.
#[derive(Clone, Debug)]
pub(super) struct BlockFit {
    /// Phase motion of the surface point, rad per image; NaN where unknown.
    pub(super) motion_rad: [f32; LANES],
    /// Standard deviation of the samples about the moving sinusoid, grey levels.
    pub(super) residual: [f32; LANES],
    /// Pixels with a saturated sample: bit k for pixel k.
    pub(super) saturated: u32,
}

impl Default for BlockFit {
    fn default() -> Self {
        Self { motion_rad: [0.0; LANES], residual: [0.0; LANES], saturated: 0 }
    }
}

/// Decodes a band of rows.
pub(super) struct Band<'a, 'b, S> {
    pub(super) images: &'a Images<'b, S>,
    pub(super) fits: Fits<'a>,
    pub(super) validity: &'a Validity,
    pub(super) rows: Range<usize>,
    pub(super) scratch: &'a mut BandScratch,
    pub(super) planes: Planes<'a>,
}

impl<S: Sample> Kernel for Band<'_, '_, S> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(mut self, lanes: L) {
        let height = self.images.height;
        self.scratch.resize(self.images.width.div_ceil(LANES));
        let mut turns = Turns::new(lanes);
        let extended = |reach: usize| self.rows.start.saturating_sub(reach)..(self.rows.end + reach).min(height);
        // Rows that each round needs: the later the round, the fewer surrounding rows.
        let rows: [Range<usize>; ROUNDS + 1] = std::array::from_fn(|round| extended(HALO - round * REACH));
        for newest in rows[0].start..self.rows.end + HALO {
            if newest < rows[0].end {
                self.fit_row(lanes, newest);
            }
            for round in 1..=ROUNDS {
                match newest.checked_sub(round * REACH) {
                    Some(row) if rows[round].contains(&row) => self.move_row(lanes, row, round, &mut turns),
                    _ => {}
                }
            }
        }
    }
}

impl<S: Sample> Band<'_, '_, S> {
    /// Fits a row and computes its motion parts as if nothing moved.
    #[inline(always)]
    fn fit_row<L: Lanes>(&mut self, lanes: L, row: usize) {
        let all = lanes.mask(u32::MAX);
        let (width, blocks) = (self.images.width, self.images.width.div_ceil(LANES));
        let fitted = &mut self.scratch.fitted[row % FITTED_ROWS * blocks..][..blocks];
        let parts = &mut self.scratch.parts[0][row % PARTS_ROWS * blocks..][..blocks];
        for (b, (fitted, parts)) in fitted.iter_mut().zip(parts).enumerate() {
            let count = (width - b * LANES).min(LANES);
            let place = [row * width + b * LANES, count];
            let (fit, expected_rad) = self.fits.for_block([row, b]);
            fitted.fit(lanes, self.images, fit, self.validity, place, &mut self.scratch.greys);
            if fitted.has_motion {
                let resting = [&fit.rough.direct, &fit.rough.ripple, &fit.slope_ripple];
                parts.set(lanes, fitted, resting.map(|sum| splat(lanes, sum.resting)), all, expected_rad);
            } else {
                *parts = MotionParts::default();
            }
        }
    }

    /// Computes the motion of a row from the parts of the round before; then the parts of this round or, in the last
    /// round, the phase.
    #[inline(always)]
    fn move_row<L: Lanes>(&mut self, lanes: L, row: usize, round: usize, turns: &mut Turns<L>) {
        let blocks = self.images.width.div_ceil(LANES);
        self.sum_columns(lanes, row, round - 1);
        for block in 0..blocks {
            let motion_rad = self.scratch.sums.motion_rad(lanes, self.fits.for_block([row, block]), block);
            if round < ROUNDS {
                self.find_parts(lanes, [row, block], round, motion_rad, turns);
            } else {
                self.finish(lanes, [row, block], motion_rad, turns);
            }
        }
    }

    /// Adds up the motion parts of the five rows around `row`.
    #[inline(always)]
    fn sum_columns<L: Lanes>(&mut self, lanes: L, row: usize, round: usize) {
        let blocks = self.images.width.div_ceil(LANES);
        let (first, last) = (row.saturating_sub(REACH), (row + REACH).min(self.images.height - 1));
        let mut rows = [[].as_slice(); PARTS_ROWS];
        for (rows, other) in rows.iter_mut().zip(first..=last) {
            *rows = &self.scratch.parts[round][other % PARTS_ROWS * blocks..][..blocks];
        }
        self.scratch.sums.set(lanes, &rows[..=last - first]);
    }

    /// Computes the motion parts of a block without the ripple of its motion.
    #[inline(always)]
    fn find_parts<L: Lanes>(
        &mut self,
        lanes: L,
        [row, block]: [usize; 2],
        round: usize,
        motion_rad: L::Reals,
        turns: &mut Turns<L>,
    ) {
        let ((fit, expected_rad), blocks) = (self.fits.for_block([row, block]), self.images.width.div_ceil(LANES));
        let fitted = &self.scratch.fitted[row % FITTED_ROWS * blocks + block];
        let parts = &mut self.scratch.parts[round][row % PARTS_ROWS * blocks + block];
        if fitted.has_motion {
            let (known, angle) = known_motion(lanes, motion_rad);
            turns.set(lanes, fit.images(), angle);
            let sums = turns.sums(lanes, [&fit.rough.direct, &fit.rough.ripple, &fit.slope_ripple]);
            parts.set(lanes, fitted, sums, known, expected_rad);
        } else {
            *parts = MotionParts::default();
        }
    }

    /// Computes phase, modulation, mean and validity of a block.
    ///
    /// ```text
    /// z = fitted z without the ripple that the motion causes
    /// offset, residual = of the samples about the sinusoid z that moves like this
    /// valid if the motion is known, z is determined, |z| large enough and residual ≤ max_residual_share · |z|
    /// store phase, modulation, mean, validity, motion and residual; add the valid pixels to the statistics
    /// ```
    #[inline(always)]
    fn finish<L: Lanes>(&mut self, lanes: L, [row, block]: [usize; 2], motion_rad: L::Reals, turns: &mut Turns<L>) {
        let l = lanes;
        let ((fit, _), followed_rad) = (self.fits.for_block([row, block]), self.fits.followed_rad([row, block]));
        let (width, blocks) = (self.images.width, self.images.width.div_ceil(LANES));
        let count = (width - block * LANES).min(LANES);
        let fitted = &self.scratch.fitted[row % FITTED_ROWS * blocks + block];
        // z without ripple, and the residual of the sinusoid that moves like this.
        let (known, angle) = known_motion(l, motion_rad);
        turns.set(l, fit.images(), angle);
        let responses = turns.sums(l, [&fit.fine.direct, &fit.fine.ripple]);
        let z = [l.load_reals(&fitted.phase_z[0]), l.load_reals(&fitted.phase_z[1])];
        let (z, has_contrast) = without_ripple(l, responses, z);
        let place = [row * width + block * LANES, count];
        let [offset, residual] = turns.residual(l, self.images, fit, place, l.load_reals(&fitted.offset), z);
        let [re, im] = z;
        let modulation = l.root_real(l.add_real(l.times_real(re, re), l.times_real(im, im)));
        let is_lit = l.is_at_least_real(modulation, l.real(self.validity.min_modulation_grey));
        let fits = l.is_at_least_real(l.times_real(l.real(self.validity.max_residual_share), modulation), residual);
        let valid = l.and(l.and(known, has_contrast), l.and(is_lit, fits));
        let valid = l.and(valid, l.mask(first_lanes(count)));
        let steps = l.min_real(l.times_real(modulation, l.real(Modulation::PER_GREY)), l.real(65535.0));
        let mean = l.max_real(l.min_real(l.add_real(offset, l.real(0.5)), l.real(255.0)), l.real(0.0));
        let block_fit = &mut self.planes.block_fits[(row - self.rows.start) * blocks + block];
        l.store_reals(l.add_real(motion_rad, l.real(followed_rad)), &mut block_fit.motion_rad);
        l.store_reals(residual, &mut block_fit.residual);
        block_fit.saturated = fitted.saturated;
        let mut decoded = DecodedBlock::default();
        l.store_real_words(turn_fractions(l, z), &mut decoded.phase);
        l.store_real_words(steps, &mut decoded.modulation);
        l.store_real_bytes(mean, &mut decoded.mean);
        l.store_mask(valid, &mut decoded.valid);
        decoded.copy_to(&mut self.planes, (row - self.rows.start) * width + block * LANES, count);
        // Statistics use the rounded modulation, as every later reader of the map does.
        let modulation = l.times_real(l.reals_of_words(&decoded.modulation), l.real(1.0 / Modulation::PER_GREY));
        self.scratch.residuals.add_block(l, residual, modulation, l.bits(valid));
        self.scratch.motions.add_block(l, motion_rad, l.bits(valid));
    }
}

/// Phase, modulation, mean and validity of 32 pixels.
#[derive(Default)]
struct DecodedBlock {
    phase: [u16; LANES],
    modulation: [u16; LANES],
    mean: [u8; LANES],
    valid: [bool; LANES],
}

impl DecodedBlock {
    /// Stores the first `count` pixels, from index `pixel` on.
    #[inline(always)]
    fn copy_to(&self, planes: &mut Planes<'_>, pixel: usize, count: usize) {
        let places = pixel..pixel + count;
        let modulation: &mut [u16] = bytemuck::cast_slice_mut(&mut planes.modulation[places.clone()]);
        let (phase, mean, valid) =
            (&mut planes.phase[places.clone()], &mut planes.mean[places.clone()], &mut planes.valid[places]);
        // Copies of constant length are single instructions.
        if count == LANES {
            phase.copy_from_slice(&self.phase);
            modulation.copy_from_slice(&self.modulation);
            mean.copy_from_slice(&self.mean);
            valid.copy_from_slice(&self.valid);
        } else {
            phase.copy_from_slice(&self.phase[..count]);
            modulation.copy_from_slice(&self.modulation[..count]);
            mean.copy_from_slice(&self.mean[..count]);
            valid.copy_from_slice(&self.valid[..count]);
        }
    }
}

/// Mask of known motions, and the motions with 0 in place of unknown ones.
#[inline(always)]
fn known_motion<L: Lanes>(lanes: L, motion_rad: L::Reals) -> (L::Mask, L::Reals) {
    let known = lanes.is_greater_real(lanes.real(f32::INFINITY), lanes.abs_real(motion_rad));
    (known, lanes.select_real(known, motion_rad, lanes.real(0.0)))
}

/// Angles of complex numbers, in turns · 65536 before truncation; see [`crate::phase::arctangent::turn_fraction`].
/// Angles just below a full turn give 65536, which wraps to 0.
#[inline(always)]
fn turn_fractions<L: Lanes>(lanes: L, [x, y]: [L::Reals; 2]) -> L::Reals {
    use crate::phase::arctangent::COEFFICIENTS;
    let l = lanes;
    let (ax, ay) = (l.abs_real(x), l.abs_real(y));
    let (small, large) = (l.min_real(ax, ay), l.max_real(ax, ay));
    let zero = l.real(0.0);
    let t = l.select_real(l.is_greater_real(large, zero), l.over_real(small, large), zero);
    let u = l.times_real(t, t);
    let mut sum = l.real(COEFFICIENTS[COEFFICIENTS.len() - 1]);
    let mut k = COEFFICIENTS.len() - 1;
    while k > 0 {
        k -= 1;
        sum = l.add_real(l.real(COEFFICIENTS[k]), l.times_real(u, sum));
    }
    let octant = l.times_real(t, sum);
    let quadrant = l.select_real(l.is_greater_real(ay, ax), l.sub_real(l.real(0.25), octant), octant);
    let half = l.select_real(l.is_greater_real(zero, x), l.sub_real(l.real(0.5), quadrant), quadrant);
    let turns = l.select_real(l.is_greater_real(zero, y), l.sub_real(l.real(1.0), half), half);
    l.add_real(l.times_real(turns, l.real(65536.0)), l.real(0.5))
}
