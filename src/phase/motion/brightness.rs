//! Brightness of each image relative to the others: exposure, projector and lamps drift or flicker.
//!
//! In: M images. Out: a brightness per image, which is divided out before anything else is measured. Cost: one pixel in
//! nine, once or twice.
//!
//! If image i is brighter by `1 + γ_i`, the fit of a sinusoid has residuals that depend only on γ, A and z. Linear
//! least squares over blocks of pixels all over the image yield γ; the motion of each block is removed first.
//! Brightness and motion can be separated because only brightness scales A.
//!
//! A γ that is itself a sinusoid of the shifts is not compensated. It adds a sinusoid of constant phase to all pixels,
//! which their fits cannot distinguish from the fringes. Its only trace looks like that of a nonlinear projector.
//!
//! ```text
//! once, or twice if γ is so large that linearization errs:
//!     for each block of 16 × 16 pixels, 48 apart, rows of blocks in parallel:
//!         load grey levels; fit A, z, z' at each pixel; keep lit pixels without edges
//!         motion of the block from z' and z
//!         add its normal equations of γ
//!     solve for γ in the observable directions; divide the images by 1 + γ
//! ```

use nalgebra::{SMatrix, SVector};
use rayon::prelude::*;

use fringeflow_base::limits::MAX_IMAGES;
use fringeflow_simd::{Kernel, LANES, Lanes, Level};

use crate::phase::Validity;
use crate::phase::sample::Sample;

use super::fit::MotionFit;
use super::follow::Fits;
use super::image_times::time;
use super::images::Images;

/// Side of a block, pixels: some fringes, so that all phases occur; and distance between blocks.
const BLOCK: usize = 16;
const PITCH: usize = 48;
/// Pairs of rows of a block, which fill the lanes.
const PAIRS: usize = BLOCK / 2;
const _: () = assert!(2 * BLOCK == LANES, "two rows are loaded at a time");
/// Numbers of the fit that are needed here: A, Re z, Im z, Re z' and Im z'.
const FITTED: usize = 5;
/// Share of the mean diagonal added to the diagonal of the normal matrix: an undetermined γ stays zero.
const RIDGE: f64 = 1e-4;
/// Largest γ that is compensated. More is not a drift.
const LARGEST: f64 = 0.3;
/// Residual ÷ modulation from which on a pixel counts as an edge and is ignored.
const EDGE_SHARE: f32 = 0.25;
/// Most rounds of linearized least squares. One is enough up to this γ: its error is about γ².
const MOST_ROUNDS: usize = 2;
const LINEAR: f64 = 0.01;

/// Divides out the brightness of the images. Returns the largest deviation from their mean, relative to it.
pub(super) fn compensate<S: Sample>(
    level: Level,
    images: &mut Images<'_, S>,
    fits: Fits<'_>,
    validity: &Validity,
    scratch: &mut Vec<BrightnessSums>,
) -> f32 {
    let plain = images.grey_per_value;
    for _ in 0..MOST_ROUNDS {
        let Some(deviations) = deviations(level, images, fits, validity, scratch) else { break };
        for (grey_per_value, deviation) in images.grey_per_value.iter_mut().zip(&deviations) {
            *grey_per_value /= (1.0 + deviation) as f32;
        }
        if deviations.iter().all(|gamma| gamma.abs() <= LINEAR) {
            break;
        }
    }
    let share = |(now, before): (&f32, &f32)| (before / now - 1.0).abs();
    images.grey_per_value.iter().zip(&plain).map(share).fold(0.0, f32::max)
}

/// Normal equations of γ.
#[derive(Clone, Debug)]
pub(super) struct BrightnessSums {
    normal: [[f64; MAX_IMAGES]; MAX_IMAGES],
    right: [f64; MAX_IMAGES],
}

impl Default for BrightnessSums {
    fn default() -> Self {
        Self { normal: [[0.0; MAX_IMAGES]; MAX_IMAGES], right: [0.0; MAX_IMAGES] }
    }
}

impl BrightnessSums {
    fn add(&mut self, other: &Self) {
        let mine = self.normal.as_flattened_mut().iter_mut().chain(&mut self.right);
        mine.zip(other.normal.as_flattened().iter().chain(&other.right)).for_each(|(mine, theirs)| *mine += theirs);
    }
}

/// γ of every image; `None` without usable pixels.
fn deviations<S: Sample>(
    level: Level,
    images: &Images<'_, S>,
    fits: Fits<'_>,
    validity: &Validity,
    scratch: &mut Vec<BrightnessSums>,
) -> Option<[f64; MAX_IMAGES]> {
    let count = images.count;
    let observable = &fits.common().equalization.observable;
    let starts = |length: usize| (0..(length + 1).saturating_sub(BLOCK)).step_by(PITCH);
    scratch.clear();
    scratch.resize_with(starts(images.height).len(), BrightnessSums::default);
    scratch.par_iter_mut().enumerate().for_each(|(row, sums)| {
        let mut samples = BlockSamples::default();
        for u in starts(images.width) {
            let (v, centre) = (row * PITCH, BLOCK / 2);
            let (fit, _) = fits.for_block([v + centre, (u + centre) / LANES]);
            let projector = &fit.equalization.projector;
            let first = v * images.width + u;
            let block = Block { images, fit, validity, projector, first, samples: &mut samples, sums };
            fringeflow_simd::run(level, block);
        }
    });
    // Added up in the order of the rows, not of the threads.
    let mut sums = BrightnessSums::default();
    scratch.iter().for_each(|row| sums.add(row));
    let product = |a: &[f64], b: &[f64]| -> f64 {
        (0..count).map(|i| (0..count).map(|j| a[i] * sums.normal[i][j] * b[j]).sum::<f64>()).sum()
    };
    let trace: f64 = (0..count).map(|i| sums.normal[i][i]).sum();
    let ridge = RIDGE * trace / count as f64;
    if ridge <= 0.0 {
        return None;
    }
    // The unused rest of the matrix stays the identity, so that it does not affect the solution.
    let mut reduced = SMatrix::<f64, MAX_IMAGES, MAX_IMAGES>::identity();
    let mut solution = SVector::<f64, MAX_IMAGES>::zeros();
    for (k, direction) in observable.iter().enumerate() {
        observable.iter().enumerate().for_each(|(l, other)| reduced[(k, l)] = product(direction, other));
        reduced[(k, k)] += ridge;
        solution[k] = direction.iter().zip(&sums.right).map(|(a, b)| a * b).sum();
    }
    reduced.cholesky()?.solve_mut(&mut solution);
    let mut deviations = [0.0; MAX_IMAGES];
    for (i, deviation) in deviations.iter_mut().enumerate().take(count) {
        *deviation = observable.iter().zip(&solution).map(|(direction, part)| part * direction[i]).sum();
    }
    deviations.iter().all(|gamma| gamma.abs() <= LARGEST).then_some(deviations)
}

/// One number per pixel of a block.
type Plane = [[f32; LANES]; PAIRS];

/// Samples of a block and their fit.
#[derive(Default)]
struct BlockSamples {
    greys: [Plane; MAX_IMAGES],
    /// A, Re z and Im z of pixels that are well lit and not at an edge, otherwise 0.
    kept: [Plane; 3],
}

/// Adds the normal equations of a block, without its motion, to the sums.
///
/// ```text
/// load and fit the block; keep lit pixels without edges; stop if their motion is unknown
/// moments of A, Re z and Im z with each other and with each image, the motion taken out
/// for each pair of images i, j, with Q the projection onto the complement of all sinusoids:
///     right[i]     += Q[i][j] · ⟨model of i, grey levels of j⟩
///     normal[i][j] += Q[i][j] · ⟨model of i, model of j⟩
/// ```
struct Block<'a, S> {
    images: &'a Images<'a, S>,
    fit: &'a MotionFit,
    validity: &'a Validity,
    projector: &'a [Vec<f64>],
    /// Its first pixel.
    first: usize,
    samples: &'a mut BlockSamples,
    sums: &'a mut BrightnessSums,
}

impl<S: Sample> Kernel for Block<'_, S> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let l = lanes;
        let Self { images, fit, projector, samples, sums, .. } = self;
        let [slope, power] = samples.load(lanes, images, fit, self.validity, self.first);
        let motion_rad = if power > 0.0 { fit.motion_rad((slope / power) as f32) } else { f32::NAN };
        if motion_rad.is_nan() {
            return;
        }
        let [offset, re, im] = &samples.kept;
        let [oo, or, oi, rr, ri, ii] = [
            dot(l, offset, offset),
            dot(l, offset, re),
            dot(l, offset, im),
            dot(l, re, re),
            dot(l, re, im),
            dot(l, im, im),
        ];
        // The model of image i at a pixel is A + cos·Re z − sin·Im z. Sums over pixels of a model times anything follow
        // from the moments of A, Re z and Im z, so no loop below runs over pixels.
        let mut models = [[0.0; 2]; MAX_IMAGES];
        let mut still_moments = [[0.0; 3]; MAX_IMAGES];
        for (i, shift) in fit.shifts_rad().iter().enumerate() {
            let [cos, sin] = fit.turns[i].map(f64::from);
            models[i] = [cos, sin];
            // Moments of the grey levels as if the block had not moved: minus the change of the model by its motion.
            let moved = shift + f64::from(motion_rad) * time(i, images.count);
            let [cos, sin] = [moved.cos() - shift.cos(), moved.sin() - shift.sin()];
            let grey = &samples.greys[i];
            still_moments[i] = [
                dot(l, offset, grey) - (or * cos - oi * sin),
                dot(l, re, grey) - (rr * cos - ri * sin),
                dot(l, im, grey) - (ri * cos - ii * sin),
            ];
        }
        for (i, row) in projector.iter().enumerate() {
            let [cos, sin] = models[i];
            // Moments of the model of image i with A, Re z and Im z. The right side projects the grey levels, the
            // normal matrix the models of the other images.
            let moments = [oo + or * cos - oi * sin, or + rr * cos - ri * sin, oi + ri * cos - ii * sin];
            for (j, q) in row.iter().enumerate() {
                let [of_offset, of_re, of_im] = still_moments[j];
                sums.right[i] += q * (of_offset + of_re * cos - of_im * sin);
                let [cos, sin] = models[j];
                sums.normal[i][j] += q * (moments[0] + moments[1] * cos - moments[2] * sin);
            }
        }
    }
}

impl BlockSamples {
    /// Loads the grey levels of a block and fits them. Keeps the pixels that are well lit and not at an edge, and returns
    /// their `Σ Im(z'·z*)` and `Σ |z|²`.
    #[inline(always)]
    fn load<L: Lanes, S: Sample>(
        &mut self,
        lanes: L,
        images: &Images<'_, S>,
        fit: &MotionFit,
        validity: &Validity,
        first: usize,
    ) -> [f64; 2] {
        let l = lanes;
        let least = 4.0 * validity.min_modulation_grey * validity.min_modulation_grey;
        let edge = EDGE_SHARE * EDGE_SHARE * images.count as f32;
        // All at once: the samples come from the main memory.
        let mut greatest = [l.word(0); PAIRS];
        for (pair, greatest) in greatest.iter_mut().enumerate() {
            for (image, greys) in self.greys.iter_mut().enumerate().take(images.count) {
                let row = |row: usize| images.samples_from(image, first + (2 * pair + row) * images.width);
                let [Some(upper), Some(lower)] = [row(0).first_chunk::<BLOCK>(), row(1).first_chunk::<BLOCK>()] else {
                    // Blocks lie inside the image.
                    continue;
                };
                let mut samples = [S::default(); LANES];
                samples[..BLOCK].copy_from_slice(upper);
                samples[BLOCK..].copy_from_slice(lower);
                *greatest = l.max_unsigned(*greatest, S::unsigned(l, S::words(l, &samples)));
                let grey = l.times_real(S::reals(l, &samples), l.real(images.grey_per_value[image]));
                l.store_reals(grey, &mut greys[pair]);
            }
        }
        let (mut slope, mut power) = (l.real(0.0), l.real(0.0));
        for (pair, greatest) in greatest.into_iter().enumerate() {
            let mut fitted = [l.real(0.0); FITTED];
            for (greys, weights) in self.greys.iter().zip(&fit.weights) {
                let grey = l.load_reals(&greys[pair]);
                let mut k = 0;
                while k < FITTED {
                    fitted[k] = l.add_real(fitted[k], l.times_real(grey, l.real(weights[k])));
                    k += 1;
                }
            }
            let [offset, re, im, re_slope, im_slope] = fitted;
            let mut squares = l.real(0.0);
            for (image, &[cos, sin]) in fit.turns.iter().enumerate() {
                let (grey, t) = (l.load_reals(&self.greys[image][pair]), l.real(time(image, images.count) as f32));
                let re = l.add_real(re, l.times_real(t, re_slope));
                let im = l.add_real(im, l.times_real(t, im_slope));
                let model = l.sub_real(l.times_real(re, l.real(cos)), l.times_real(im, l.real(sin)));
                let residual = l.sub_real(l.sub_real(grey, offset), model);
                squares = l.add_real(squares, l.times_real(residual, residual));
            }
            let square = l.add_real(l.times_real(re, re), l.times_real(im, im));
            let is_lit = l.is_at_least_real(square, l.real(least));
            let is_good = l.and(is_lit, l.is_greater_real(l.times_real(l.real(edge), square), squares));
            let is_kept = l.and_not(is_good, images.saturates(l, greatest));
            let zero = l.real(0.0);
            l.store_reals(l.select_real(is_kept, offset, zero), &mut self.kept[0][pair]);
            l.store_reals(l.select_real(is_kept, re, zero), &mut self.kept[1][pair]);
            l.store_reals(l.select_real(is_kept, im, zero), &mut self.kept[2][pair]);
            let turned = l.sub_real(l.times_real(im_slope, re), l.times_real(re_slope, im));
            slope = l.add_real(slope, l.select_real(is_kept, turned, zero));
            power = l.add_real(power, l.select_real(is_kept, square, zero));
        }
        [sum(l, slope), sum(l, power)]
    }
}

/// Σ a·b.
#[inline(always)]
fn dot<L: Lanes>(lanes: L, a: &Plane, b: &Plane) -> f64 {
    let mut products = lanes.real(0.0);
    for (a, b) in a.iter().zip(b) {
        products = lanes.add_real(products, lanes.times_real(lanes.load_reals(a), lanes.load_reals(b)));
    }
    sum(lanes, products)
}

/// Sum of the lanes.
#[inline(always)]
fn sum<L: Lanes>(lanes: L, reals: L::Reals) -> f64 {
    let mut parts = [0.0; LANES];
    lanes.store_reals(reals, &mut parts);
    // Eight at once, then those.
    let mut sums = [0.0; 8];
    for parts in parts.as_chunks().0 {
        let parts: &[f32; 8] = parts;
        sums.iter_mut().zip(parts).for_each(|(sum, &part)| *sum += f64::from(part));
    }
    sums.iter().sum()
}
