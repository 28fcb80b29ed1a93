//! The kernel for moving scenes (paper, section 2.1, without motion). In: the samples of a band of rows. Out: their
//! phase, modulation, mean, validity and motion. Cost: see [`super`].
//!
//! The steps run strip by strip, so that intermediate results stay in the cache:
//!
//! ```text
//! for each strip of the band, four rows, and two rows around it:
//!     fit each pixel; moments of the fits over cells of 2 × 2 pixels               fit_strip
//!     for the strip before it, whose surroundings are complete now:                decode_strip
//!         motion of each cell, from the moments of 3 × 3 cells
//!         what depends on the motion alone: removal of its ripple, responses of the residuals
//!         phase, modulation, mean and validity of each pixel
//! ```

use std::ops::Range;

use fringeflow_base::limits::{MAX_IMAGES, MIN_STEPS};
use fringeflow_simd::{HALF, Kernel, LANES, Lanes, first_lanes, store_first};

use crate::phase::Validity;
use crate::phase::map::Modulation;
use crate::phase::residuals::Residuals;
use crate::phase::sample::Sample;

use super::cells::{CELL, Moments, STRIP_ROWS, StripCells, sums_around};
use super::estimate;
use super::follow::Fits;
use super::images::Images;
use super::linear::Fitted;
use super::motion_histogram::{MotionHistogram, is_counted};
use super::moving_cells::MovingCells;
use super::ripple::Turns;

/// Rows on either side that a phase depends on: those of a cell.
const HALO: usize = CELL;
/// Strips whose fits are kept, and strips whose cells are kept.
const FITTED_STRIPS: usize = 2;
const CELL_STRIPS: usize = 3;

/// Scratch memory of a band, and its statistics.
#[derive(Clone, Debug, Default)]
pub(super) struct BandScratch {
    greys: [[f32; LANES]; MAX_IMAGES],
    fitted: Vec<Fitted>,
    /// Residuals of each of these fits, as many as a window may have.
    fit_residuals: Vec<[f32; LANES]>,
    cells: [StripCells; CELL_STRIPS],
    moving: MovingCells,
    pub(super) residuals: Residuals,
    /// Motion of the valid pixels.
    pub(super) motions: MotionHistogram,
}

impl BandScratch {
    fn resize(&mut self, blocks: usize, images: usize) {
        let fits = FITTED_STRIPS * STRIP_ROWS * blocks;
        self.fitted.resize_with(fits, Fitted::default);
        self.fit_residuals.resize(fits * most_residuals(images), [0.0; LANES]);
        self.cells.iter_mut().for_each(|cells| cells.clear(blocks));
        self.residuals = Residuals::default();
        self.motions = MotionHistogram::default();
    }
}

/// Most residuals of the fit of a window.
fn most_residuals(images: usize) -> usize {
    images - MIN_STEPS
}

/// Results of a band.
pub(super) struct Planes<'a> {
    pub(super) phase: &'a mut [u16],
    pub(super) modulation: &'a mut [Modulation],
    pub(super) mean: &'a mut [u8],
    pub(super) valid: &'a mut [bool],
    pub(super) cell_fits: &'a mut [CellFits],
}

/// Motion and residuals of a row of 16 cells.
#[derive(Clone, Debug, Default)]
pub(super) struct CellFits {
    motion_rad: [f32; HALF],
    residual_steps: [[u16; LANES]; CELL],
    saturated: [u32; CELL],
}

impl CellFits {
    /// Steps per grey level of a residual.
    const PER_GREY: f32 = 256.0;

    /// Phase motion of the surface point of a pixel, rad per image; NaN where unknown.
    pub(super) fn motion_rad(&self, column: usize) -> f32 {
        self.motion_rad[column % LANES / CELL]
    }

    /// Standard deviation of the samples of 32 pixels about moving sinusoids, grey levels.
    #[inline(always)]
    pub(super) fn residual<L: Lanes>(&self, lanes: L, row: usize) -> L::Reals {
        let steps = lanes.reals_of_words(&self.residual_steps[row % CELL]);
        lanes.times_real(steps, lanes.real(1.0 / Self::PER_GREY))
    }

    /// Pixels of a row with a saturated sample: bit k for pixel k.
    pub(super) fn saturated(&self, row: usize) -> u32 {
        self.saturated[row % CELL]
    }
}

/// Decodes a band of rows, which begins with a strip.
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
        self.scratch.resize(self.images.width.div_ceil(LANES), self.images.count);
        let mut turns = Turns::new(lanes);
        // Strips are counted from the one before the image, which has no rows.
        let (first, last) = (self.rows.start / STRIP_ROWS, self.rows.end.div_ceil(STRIP_ROWS) + 1);
        for strip in first..=last {
            self.fit_strip(lanes, strip);
            if strip > first + 1 {
                self.decode_strip(lanes, strip - 1, &mut turns);
            }
        }
    }
}

impl<S: Sample> Band<'_, '_, S> {
    /// Fits the rows of a strip that are needed and sets its cells.
    #[inline(always)]
    fn fit_strip<L: Lanes>(&mut self, lanes: L, strip: usize) {
        let needed = self.rows.start.saturating_sub(HALO)..(self.rows.end + HALO).min(self.images.height);
        let (width, blocks) = (self.images.width, self.images.width.div_ceil(LANES));
        let most = most_residuals(self.images.count);
        for half in 0..STRIP_ROWS / CELL {
            for block in 0..blocks {
                let count = (width - block * LANES).min(LANES);
                let (mut sums, mut expected_rad) = (Moments::zero(lanes), 0.0);
                for k in half * CELL..(half + 1) * CELL {
                    let row = (strip * STRIP_ROWS + k).checked_sub(STRIP_ROWS).filter(|row| needed.contains(row));
                    let Some(row) = row else { continue };
                    let (fit, expected) = self.fits.for_block([row, block]);
                    let place = [row * width + block * LANES, count];
                    let slot = (strip % FITTED_STRIPS * STRIP_ROWS + k) * blocks + block;
                    let BandScratch { fitted, fit_residuals, greys, .. } = &mut *self.scratch;
                    let residuals = &mut fit_residuals[slot * most..][..fit.freedom()];
                    let moments = fitted[slot].fit(lanes, self.images, fit, self.validity, place, residuals, greys);
                    sums = sums.plus(lanes, moments);
                    expected_rad = expected;
                }
                self.scratch.cells[strip % CELL_STRIPS].set(lanes, [half, block], sums, expected_rad);
            }
        }
    }

    /// Decodes the rows of a strip.
    #[inline(always)]
    fn decode_strip<L: Lanes>(&mut self, lanes: L, strip: usize, turns: &mut Turns<L>) {
        let first = (strip - 1) * STRIP_ROWS;
        let blocks = self.images.width.div_ceil(LANES);
        for block in 0..blocks {
            let (fit, expected_rad) = self.fits.for_block([first, block]);
            let cells = |strip: usize| &self.scratch.cells[strip % CELL_STRIPS];
            let moments = sums_around(lanes, [cells(strip - 1), cells(strip), cells(strip + 1)], block, expected_rad);
            let (motion_rad, known) = estimate::motion(lanes, fit, &moments, turns);
            self.scratch.moving.set(lanes, fit, motion_rad, known, turns);
            self.store_motion(lanes, [first, block], motion_rad, known);
            for row in first..(first + STRIP_ROWS).min(self.rows.end) {
                self.finish(lanes, [row, block]);
            }
        }
    }

    /// Stores the motion of the cells of a block.
    #[inline(always)]
    fn store_motion<L: Lanes>(&mut self, lanes: L, [first, block]: [usize; 2], motion_rad: L::Reals, known: L::Mask) {
        let blocks = self.images.width.div_ceil(LANES);
        let followed_rad = lanes.real(self.fits.followed_rad([first, block]));
        let motion_rad = lanes.select_real(known, lanes.add_real(motion_rad, followed_rad), lanes.real(f32::NAN));
        let (upper, lower) = self.planes.cell_fits[(first - self.rows.start) / CELL * blocks..].split_at_mut(blocks);
        lanes.store_halves(motion_rad, &mut upper[block].motion_rad, &mut lower[block].motion_rad);
    }

    /// Computes phase, modulation, mean and validity of a block of known motion.
    ///
    /// ```text
    /// z = fitted z without the ripple that the motion causes
    /// offset, residual = of the samples about the sinusoid z that moves like this
    /// valid if the motion is known, z is determined, |z| large enough and residual ≤ max_residual_share · |z|
    /// store phase, modulation, mean, validity, motion and residual; add the valid pixels to the statistics
    /// ```
    #[inline(always)]
    fn finish<L: Lanes>(&mut self, lanes: L, [row, block]: [usize; 2]) {
        let l = lanes;
        let (width, blocks) = (self.images.width, self.images.width.div_ceil(LANES));
        let count = (width - block * LANES).min(LANES);
        let moving = self.scratch.moving.row(row % STRIP_ROWS / CELL);
        let strip = row / STRIP_ROWS + 1;
        let slot = (strip % FITTED_STRIPS * STRIP_ROWS + row % STRIP_ROWS) * blocks + block;
        let fitted = &self.scratch.fitted[slot];
        let (fit, _) = self.fits.for_block([row, block]);
        let residuals = &self.scratch.fit_residuals[slot * most_residuals(self.images.count)..][..fit.freedom()];
        let z = moving.without_ripple(l, [l.load_reals(&fitted.z[0]), l.load_reals(&fitted.z[1])]);
        let [offset, residual] = moving.residual(l, (&fitted.offset, residuals), z);
        let [re, im] = z;
        let modulation = l.root_real(l.add_real(l.times_real(re, re), l.times_real(im, im)));
        let is_lit = l.is_at_least_real(modulation, l.real(self.validity.min_modulation_grey));
        let fits = l.is_at_least_real(l.times_real(l.real(self.validity.max_residual_share), modulation), residual);
        let valid = l.and(moving.is_determined(l), l.and(is_lit, fits));
        let valid = l.and(valid, l.mask(first_lanes(count)));
        let steps = l.min_real(l.times_real(modulation, l.real(Modulation::PER_GREY)), l.real(65535.0));
        let mean = l.max_real(l.min_real(l.add_real(offset, l.real(0.5)), l.real(255.0)), l.real(0.0));
        let cell_fits = &mut self.planes.cell_fits[(row - self.rows.start) / CELL * blocks + block];
        let residual_steps = l.min_real(l.times_real(residual, l.real(CellFits::PER_GREY)), l.real(65535.0));
        l.store_real_words(residual_steps, &mut cell_fits.residual_steps[row % CELL]);
        cell_fits.saturated[row % CELL] = fitted.saturated;
        let mut decoded = DecodedBlock::default();
        l.store_real_words(turn_fractions(l, z), &mut decoded.phase);
        l.store_real_words(steps, &mut decoded.modulation);
        l.store_real_bytes(mean, &mut decoded.mean);
        l.store_mask(valid, &mut decoded.valid);
        decoded.copy_to(&mut self.planes, (row - self.rows.start) * width + block * LANES, count);
        if is_counted(row) {
            self.scratch.residuals.add_block(l, residual, modulation, l.bits(valid));
            self.scratch.motions.add_block(l, moving.motion_rad(l), l.bits(valid));
        }
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
        store_first(&self.phase, &mut planes.phase[places.clone()]);
        store_first(&self.modulation, bytemuck::cast_slice_mut(&mut planes.modulation[places.clone()]));
        store_first(&self.mean, &mut planes.mean[places.clone()]);
        store_first(&self.valid, &mut planes.valid[places]);
    }
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
