//! The brightness of each image compared with the others: exposure, projector and lamps drift or flicker.
//!
//! A sinusoid whose images differ in brightness by `1 + γ_i` leaves residuals that depend on A and z alone. Blocks of pixels
//! all over the image, each freed from its own motion, give γ of all images by linear least squares; the brightness is
//! divided out before anything else is measured. What brightness and motion do differs: the first scales A as well.
//!
//! A γ that goes round with the shifts is left alone. It adds a sinusoid of one phase to all pixels, which the fit of each
//! takes for its own; all that betrays it is what a projector that is not linear makes as well.

use nalgebra::{SMatrix, SVector};
use rayon::prelude::*;

use fringeflow_base::limits::MAX_IMAGES;
use fringeflow_simd::{Kernel, LANES, Lanes, Level};

use crate::phase::Validity;
use crate::phase::sample::Sample;

use super::fit::{MotionFit, time, unexplained};
use super::follow::Fits;
use super::images::Images;

/// Side of a block, pixels: some fringes, so that phases of all kinds occur; and distance from one to the next.
const BLOCK: usize = 16;
const PITCH: usize = 48;
/// Pixels of a block.
const PIXELS: usize = BLOCK * BLOCK;
const _: () = assert!(2 * BLOCK == LANES, "two rows are taken at a time");
/// Partial sums over pixels: always the same, so that their rounding is.
const PARTS: usize = 8;
/// Share of the mean diagonal that is added to the diagonal: a drift that nothing tells stays zero.
const RIDGE: f64 = 1e-4;
/// Largest departure that is compensated: more is no drift.
const LARGEST: f64 = 0.3;
/// Residual ÷ modulation from which on a pixel is at an edge and says nothing.
const EDGE_SHARE: f64 = 0.25;
/// Rounds: the second finds what the first left by being linear.
const ROUNDS: usize = 2;

/// Divides the brightness of the images out; the greatest departure from their mean, as a share.
pub(super) fn compensate<S: Sample>(
    level: Level,
    images: &mut Images<'_, S>,
    fits: Fits<'_>,
    validity: &Validity,
    scratch: &mut Vec<Sums>,
) -> f32 {
    let plain = images.grey_per_value;
    for _ in 0..ROUNDS {
        let Some(departures) = departures(level, images, fits, validity, scratch) else { break };
        for (grey_per_value, departure) in images.grey_per_value.iter_mut().zip(&departures) {
            *grey_per_value /= (1.0 + departure) as f32;
        }
    }
    let share = |(now, before): (&f32, &f32)| (before / now - 1.0).abs();
    images.grey_per_value.iter().zip(&plain).map(share).fold(0.0, f32::max)
}

/// Sums over pixels: normal equations of γ, of as many images as there are.
#[derive(Clone, Debug)]
pub(super) struct Sums {
    normal: [[f64; MAX_IMAGES]; MAX_IMAGES],
    right: [f64; MAX_IMAGES],
}

impl Default for Sums {
    fn default() -> Self {
        Self { normal: [[0.0; MAX_IMAGES]; MAX_IMAGES], right: [0.0; MAX_IMAGES] }
    }
}

impl Sums {
    fn add(&mut self, other: &Self) {
        let mine = self.normal.as_flattened_mut().iter_mut().chain(&mut self.right);
        mine.zip(other.normal.as_flattened().iter().chain(&other.right)).for_each(|(mine, theirs)| *mine += theirs);
    }
}

/// γ of every image; `None` without enough pixels to tell.
fn departures<S: Sample>(
    level: Level,
    images: &Images<'_, S>,
    fits: Fits<'_>,
    validity: &Validity,
    scratch: &mut Vec<Sums>,
) -> Option<[f64; MAX_IMAGES]> {
    let count = images.count;
    let told = &fits.any().levelling.as_ref()?.told;
    let starts = |length: usize| (0..(length + 1).saturating_sub(BLOCK)).step_by(PITCH);
    scratch.clear();
    scratch.resize_with(starts(images.height).len(), Sums::default);
    let images: &Images<'_, S> = images;
    scratch.par_iter_mut().enumerate().for_each(|(row, sums)| {
        let mut samples = BlockSamples::default();
        for u in starts(images.width) {
            let (v, centre) = (row * PITCH, BLOCK / 2);
            let (fit, _) = fits.of([v + centre, (u + centre) / LANES]);
            let Some(Levelling { projector, .. }) = &fit.levelling else { continue };
            let first = v * images.width + u;
            let block = Block { images, fit, validity, projector, first, samples: &mut samples, sums };
            fringeflow_simd::run(level, block);
        }
    });
    let mut sums = Sums::default();
    scratch.iter().for_each(|of_row| sums.add(of_row));
    let product = |a: &[f64], b: &[f64]| -> f64 {
        (0..count).map(|i| (0..count).map(|j| a[i] * sums.normal[i][j] * b[j]).sum::<f64>()).sum()
    };
    let trace: f64 = (0..count).map(|i| sums.normal[i][i]).sum();
    let ridge = RIDGE * trace / count as f64;
    if ridge <= 0.0 {
        return None;
    }
    // Beyond the directions that are told stands what changes nothing.
    let mut reduced = SMatrix::<f64, MAX_IMAGES, MAX_IMAGES>::identity();
    let mut solution = SVector::<f64, MAX_IMAGES>::zeros();
    for (k, direction) in told.iter().enumerate() {
        told.iter().enumerate().for_each(|(l, other)| reduced[(k, l)] = product(direction, other));
        reduced[(k, k)] += ridge;
        solution[k] = direction.iter().zip(&sums.right).map(|(a, b)| a * b).sum();
    }
    reduced.cholesky()?.solve_mut(&mut solution);
    let mut departures = [0.0; MAX_IMAGES];
    for (i, departure) in departures.iter_mut().enumerate().take(count) {
        *departure = told.iter().zip(&solution).map(|(direction, part)| part * direction[i]).sum();
    }
    departures.iter().all(|gamma| gamma.abs() <= LARGEST).then_some(departures)
}

/// What the levelling of images with some shifts needs to know of these.
#[derive(Clone, Debug)]
pub(super) struct Levelling {
    pub(super) projector: Vec<Vec<f64>>,
    /// Directions of γ that go not round with the shifts.
    told: Vec<Vec<f64>>,
}

impl Levelling {
    /// `None` where the shifts determine no sinusoid.
    pub(super) fn new(shifts_rad: &[f64]) -> Option<Self> {
        let basis: Vec<[f64; 3]> = shifts_rad.iter().map(|s| [1.0, s.cos(), s.sin()]).collect();
        Some(Self { projector: residual_projector(shifts_rad)?, told: unexplained(&basis) })
    }
}

/// What projects the samples of a pixel onto what no sinusoid with these shifts explains; row by row.
fn residual_projector(shifts_rad: &[f64]) -> Option<Vec<Vec<f64>>> {
    let rows: Vec<nalgebra::Vector3<f64>> =
        shifts_rad.iter().map(|s| nalgebra::Vector3::new(1.0, s.cos(), -s.sin())).collect();
    let inverse = rows.iter().map(|row| row * row.transpose()).sum::<nalgebra::Matrix3<f64>>().try_inverse()?;
    let entry = |i: usize, j: usize| f64::from(u8::from(i == j)) - rows[i].dot(&(inverse * rows[j]));
    Some((0..rows.len()).map(|i| (0..rows.len()).map(|j| entry(i, j)).collect()).collect())
}

/// A number a pixel of a block.
type Plane = [f64; PIXELS];

/// Samples of a block, and what is fitted to them.
struct BlockSamples {
    greys: [Plane; MAX_IMAGES],
    /// 1 where no sample is saturated, 0 elsewhere.
    unsaturated: Plane,
    /// A, Re z, Im z, Re z' and Im z'.
    fitted: [Plane; 5],
    squares: Plane,
    /// A, Re z and Im z where the pixel is well lit and away from edges, 0 elsewhere.
    kept: [Plane; 3],
}

impl Default for BlockSamples {
    fn default() -> Self {
        let plane = [0.0; PIXELS];
        Self { greys: [plane; MAX_IMAGES], unsaturated: plane, fitted: [plane; 5], squares: plane, kept: [plane; 3] }
    }
}

/// Adds a block, freed from its motion, to the sums.
struct Block<'a, S> {
    images: &'a Images<'a, S>,
    fit: &'a MotionFit,
    validity: &'a Validity,
    projector: &'a [Vec<f64>],
    /// Its first pixel.
    first: usize,
    samples: &'a mut BlockSamples,
    sums: &'a mut Sums,
}

impl<S: Sample> Kernel for Block<'_, S> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let Self { images, fit, projector, samples, sums, .. } = self;
        samples.take(lanes, images, self.first);
        samples.fit(fit);
        let [slope, power] = samples.keep(fit, self.validity);
        let motion_rad = if power > 0.0 { fit.motion_rad((slope / power) as f32) } else { f32::NAN };
        if motion_rad.is_nan() {
            return;
        }
        let [offset, re, im] = &samples.kept;
        let [oo, or, oi, rr, ri, ii] =
            [(offset, offset), (offset, re), (offset, im), (re, re), (re, im), (im, im)].map(|(a, b)| dot(a, b));
        // Σ (a + b·re − c·im)·x of pixels with these moments of A, Re z and Im z with x.
        let mut models = [[0.0; 2]; MAX_IMAGES];
        let mut still_moments = [[0.0; 3]; MAX_IMAGES];
        for (i, shift) in fit.shifts_rad().iter().enumerate() {
            let [cos, sin] = fit.turns[i].map(f64::from);
            models[i] = [cos, sin];
            // As if it had not moved.
            let moved = shift + f64::from(motion_rad) * time(i, images.count);
            let [cos, sin] = [moved.cos() - shift.cos(), moved.sin() - shift.sin()];
            let grey = &samples.greys[i];
            still_moments[i] = [
                dot(offset, grey) - (or * cos - oi * sin),
                dot(re, grey) - (rr * cos - ri * sin),
                dot(im, grey) - (ri * cos - ii * sin),
            ];
        }
        for (i, row) in projector.iter().enumerate() {
            let [cos, sin] = models[i];
            // Moments of the model of image i with A, Re z and Im z.
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
    /// Takes the grey levels of a block, two rows at a time.
    #[inline(always)]
    fn take<L: Lanes, S: Sample>(&mut self, lanes: L, images: &Images<'_, S>, first: usize) {
        let l = lanes;
        for pair in 0..PIXELS / LANES {
            let mut greatest = l.word(0);
            for image in 0..images.count {
                let mut samples = [S::default(); LANES];
                for (row, samples) in samples.chunks_exact_mut(BLOCK).enumerate() {
                    let begin = first + (2 * pair + row) * images.width;
                    samples.copy_from_slice(&images.samples_from(image, begin)[..BLOCK]);
                }
                greatest = l.max_unsigned(greatest, S::unsigned(l, S::words(l, &samples)));
                let mut greys = [0.0; LANES];
                l.store_reals(l.times_real(S::reals(l, &samples), l.real(images.grey_per_value[image])), &mut greys);
                let to = &mut self.greys[image][pair * LANES..][..LANES];
                for (to, grey) in to.iter_mut().zip(greys) {
                    *to = f64::from(grey);
                }
            }
            let saturated = l.bits(images.saturates(l, greatest));
            let to = &mut self.unsaturated[pair * LANES..][..LANES];
            to.iter_mut().enumerate().for_each(|(k, to)| *to = f64::from(!saturated >> k & 1));
        }
    }

    /// Fits every pixel, and sums up the squares of what that leaves.
    #[inline(always)]
    fn fit(&mut self, fit: &MotionFit) {
        self.fitted = [[0.0; PIXELS]; 5];
        self.squares = [0.0; PIXELS];
        for (i, weights) in fit.weights.iter().enumerate() {
            let grey = &self.greys[i];
            for (fitted, &weight) in self.fitted.iter_mut().zip(weights) {
                let weight = f64::from(weight);
                for p in 0..PIXELS {
                    fitted[p] += grey[p] * weight;
                }
            }
        }
        let images = fit.images();
        let [offset, re, im, a, b] = &self.fitted;
        for (i, turn) in fit.turns.iter().enumerate() {
            let (grey, [cos, sin], t) = (&self.greys[i], turn.map(f64::from), time(i, images));
            for p in 0..PIXELS {
                let off = grey[p] - offset[p] - (re[p] + t * a[p]) * cos + (im[p] + t * b[p]) * sin;
                self.squares[p] += off * off;
            }
        }
    }

    /// Keeps the pixels that are well lit and away from edges; their `Σ Im(z'·z*)` and `Σ |z|²`.
    #[inline(always)]
    fn keep(&mut self, fit: &MotionFit, validity: &Validity) -> [f64; 2] {
        let least = 2.0 * f64::from(validity.min_modulation_grey);
        let edge = EDGE_SHARE * EDGE_SHARE * fit.images() as f64;
        let [offset, re, im, a, b] = &self.fitted;
        let (mut slope, mut power) = ([0.0; PIXELS], [0.0; PIXELS]);
        for p in 0..PIXELS {
            let square = re[p] * re[p] + im[p] * im[p];
            let is_good = square >= least * least && self.squares[p] < edge * square;
            let kept = if is_good { self.unsaturated[p] } else { 0.0 };
            self.kept[0][p] = kept * offset[p];
            self.kept[1][p] = kept * re[p];
            self.kept[2][p] = kept * im[p];
            slope[p] = kept * (b[p] * re[p] - a[p] * im[p]);
            power[p] = kept * square;
        }
        [sum(&slope), sum(&power)]
    }
}

/// Σ a·b.
#[inline(always)]
fn dot(a: &Plane, b: &Plane) -> f64 {
    let mut parts = [0.0; PARTS];
    for first in (0..PIXELS).step_by(PARTS) {
        for k in 0..PARTS {
            parts[k] += a[first + k] * b[first + k];
        }
    }
    parts.iter().sum()
}

/// Σ a.
#[inline(always)]
fn sum(a: &Plane) -> f64 {
    let mut parts = [0.0; PARTS];
    for first in (0..PIXELS).step_by(PARTS) {
        for k in 0..PARTS {
            parts[k] += a[first + k];
        }
    }
    parts.iter().sum()
}
