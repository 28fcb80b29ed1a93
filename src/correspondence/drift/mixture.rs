//! The candidates of a sample of pixels as a mixture. At most one candidate per pixel is true; its δ is normally
//! distributed about the drift. δ of the others is uniform.
//!
//! ```text
//! refine a guess (mean, coefficients of the modes, sd) until sd settles:
//!     for each pixel, for each candidate:
//!         weight = density of δ − field / (density of false candidates + that of all candidates of the pixel)
//!     solve the weighted normal equations, with the prior, for the change of the coefficients
//!     sd = weighted root mean square of δ − field; it shrinks by a bounded factor, and never grows
//! ```

use std::f64::consts::TAU;
use std::ops::{ControlFlow, Deref, DerefMut};

use nalgebra::{DMatrix, DVector};
use rayon::prelude::*;

use fringeflow_simd::{Kernel, Lanes, Level};

use crate::correspondence::candidates::DecidedCandidate;
use crate::correspondence::decay::decay;
use crate::correspondence::row_view::RowView;
use crate::correspondence::segment_table::SegmentTable;
use crate::correspondence::view::View;
use crate::phase::PhaseMap;

use super::modes::{DriftModes, MAX_MODES};

/// Assumed share of pixels without a true candidate.
const NONE_TRUE: f64 = 0.2;
/// Least weight of a candidate in the sums; less likely ones are false.
const MIN_WEIGHT: f64 = 0.01;
/// Number of independent pixels if at least a quarter of the image has a phase. Neighbours err alike, and a small
/// object shows the field from one side only.
const INDEPENDENT_PIXELS: f64 = 20.0;
const LARGE_SHARE: f64 = 0.25;
/// Expected calibration error of a mode, pixels.
const PRIOR_PX: f64 = 0.5;
/// Weight of the prior where guesses are compared. Over a flat board the field of a wrong order leaves δ as level as
/// the true one, or more so, by errors of 2.6 px instead of 1.0.
const IMPROBABILITY_WEIGHT: f64 = 2.0;
/// Least accepted sd, turns: rounding alone makes more.
const MIN_SD_TURNS: f64 = 0.0006;
/// Limits of improbability, nats, and of the share of pixels with a true candidate for a plausible guess.
const PLAUSIBLE_NATS: f64 = 1.0;
const PLAUSIBLE_SHARE: f64 = 0.6;
/// Smallest factor on sd per step. A faster shrink would settle on the nearest candidates.
const FASTEST_SHRINK: f64 = 0.6;
/// Ratio of sd to the one before at which the steps end.
const SETTLED: f64 = 0.995;

/// A field of δ and the scatter of true candidates about it.
#[derive(Clone, Debug, Default)]
pub(super) struct Guess {
    pub(super) coefficients: Coefficients,
    pub(super) sd_turns: f64,
    /// Share of pixels with a true candidate.
    pub(super) share: f64,
}

/// The mean of a field, turns, then one coefficient per mode, pixels.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Coefficients {
    values: [f64; 1 + MAX_MODES],
    count: usize,
}

impl Coefficients {
    /// Sets their number; further ones are zero.
    pub(super) fn resize(&mut self, count: usize) {
        self.count = count.min(self.values.len());
    }
}

impl FromIterator<f64> for Coefficients {
    fn from_iter<I: IntoIterator<Item = f64>>(all: I) -> Self {
        let mut coefficients = Self::default();
        for (place, value) in coefficients.values.iter_mut().zip(all) {
            *place = value;
            coefficients.count += 1;
        }
        coefficients
    }
}

impl Deref for Coefficients {
    type Target = [f64];

    fn deref(&self) -> &[f64] {
        &self.values[..self.count]
    }
}

impl DerefMut for Coefficients {
    fn deref_mut(&mut self) -> &mut [f64] {
        &mut self.values[..self.count]
    }
}

impl Guess {
    /// Negative logarithm of the prior probability of such a calibration error, nats.
    pub(super) fn improbability(&self) -> f64 {
        self.coefficients[1..].iter().map(|c| c * c).sum::<f64>() / (2.0 * PRIOR_PX * PRIOR_PX)
    }

    /// Whether a likely calibration error explains most pixels.
    pub(super) fn is_plausible(&self) -> bool {
        self.improbability() < PLAUSIBLE_NATS && self.share > PLAUSIBLE_SHARE
    }
}

/// A sample of pixels with all their candidates.
#[derive(Clone, Debug, Default)]
pub(super) struct Sample {
    /// Candidates of pixel i are those from `first[i]` to `first[i + 1]`.
    first: Vec<usize>,
    delta_turns: Vec<f64>,
    /// Candidate by candidate: 1, then δ of every mode per pixel of calibration error.
    design: Vec<f64>,
    columns: usize,
    /// Number of independent pixels.
    independent: f64,
    /// Turns over which δ of false candidates spreads.
    spread_turns: f64,
}

impl Sample {
    /// Samples about `pixels` pixels of C1, evenly spread, with the candidates on their segments and up to `beyond_px`
    /// columns beyond. Returns whether there is a candidate.
    pub(super) fn fill(
        &mut self,
        View { cam1, cam2, table }: View<'_>,
        modes: &DriftModes,
        (pixels, beyond_px): (usize, f32),
        usable: &mut Usable,
    ) -> bool {
        usable.find(cam1, table);
        let all = usable.count();
        // An odd stride spreads the pixels over both axes.
        let stride = (all / pixels.max(1)).max(1) | 1;
        let share = all as f64 / cam1.phase.len().max(1) as f64;
        self.begin(modes, share, 1.0);
        for &i in usable.every(stride) {
            let (segment, before) = (table.segment(i), self.delta_turns.len());
            let limits_px = [(segment.begin_px - beyond_px).max(0.0), segment.end_px + beyond_px];
            let columns = limits_px[0] as usize..=limits_px[1].ceil() as usize;
            let (u, v) = (i % cam1.width, i / cam1.width);
            let row = RowView::new(cam2, segment.row_px);
            let _ = row.crossings_of_many(limits_px, cam1.phase[i], columns, |column_px, _| {
                let delta_turns = f64::from(segment.phase_turns(column_px)) - f64::from(cam1.phase[i]) / 65536.0;
                // Beyond the volume Φ may have a pole.
                if delta_turns.is_finite() {
                    self.delta_turns.push(to_half_turn(delta_turns));
                    self.design.push(1.0);
                    modes.by_term.append_deltas([u, v], column_px, &mut self.design);
                }
                ControlFlow::Continue(())
            });
            if self.delta_turns.len() > before {
                self.first.push(self.delta_turns.len());
            }
        }
        self.pixels() > 0
    }

    /// Samples decided candidates. `share` is the share of the image that they cover. Returns whether there is one.
    pub(super) fn fill_decided(
        &mut self,
        modes: &DriftModes,
        decided: &[DecidedCandidate],
        share: f64,
        spread_turns: f64,
    ) -> bool {
        self.begin(modes, share, spread_turns);
        let mut before = None;
        for &DecidedCandidate { pixel, column_px, delta_turns, .. } in decided {
            // Further candidates of the same pixel extend its list.
            if before.replace(pixel) == Some(pixel) {
                self.first.pop();
            }
            self.delta_turns.push(to_half_turn(f64::from(delta_turns)));
            self.design.push(1.0);
            modes.by_term.append_deltas(pixel, column_px, &mut self.design);
            self.first.push(self.delta_turns.len());
        }
        self.pixels() > 0
    }

    fn begin(&mut self, modes: &DriftModes, share: f64, spread_turns: f64) {
        self.clear();
        (self.columns, self.spread_turns) = (1 + modes.fields.len(), spread_turns);
        self.independent = INDEPENDENT_PIXELS * (share / LARGE_SHARE).min(1.0);
    }

    fn clear(&mut self) {
        self.first.clear();
        self.first.push(0);
        self.delta_turns.clear();
        self.design.clear();
    }

    /// Number of pixels.
    pub(super) fn pixels(&self) -> usize {
        self.first.len() - 1
    }

    /// About `pixels` of its pixels, evenly spread.
    pub(super) fn thinned(&self, pixels: usize) -> Self {
        let mut thinned = Self::default();
        self.thin(pixels, &mut thinned);
        thinned
    }

    /// As [`Self::thinned`], into the memory of another sample.
    pub(super) fn thin(&self, pixels: usize, thinned: &mut Self) {
        let step = (self.pixels() / pixels.max(1)).max(1);
        thinned.clear();
        (thinned.columns, thinned.independent) = (self.columns, self.independent);
        thinned.spread_turns = self.spread_turns;
        for pixel in (0..self.pixels()).step_by(step) {
            let range = self.first[pixel]..self.first[pixel + 1];
            thinned.design.extend(&self.design[range.start * self.columns..range.end * self.columns]);
            thinned.delta_turns.extend(&self.delta_turns[range]);
            thinned.first.push(thinned.delta_turns.len());
        }
    }

    fn mean_candidates(&self) -> f64 {
        self.delta_turns.len() as f64 / self.pixels() as f64
    }

    #[inline(always)]
    fn row(&self, candidate: usize) -> &[f64] {
        &self.design[candidate * self.columns..(candidate + 1) * self.columns]
    }

    /// δ less the field, wrapped to half a turn.
    #[inline(always)]
    fn residual_turns(&self, candidate: usize, coefficients: &[f64]) -> f64 {
        let field: f64 = self.row(candidate).iter().zip(coefficients).map(|(d, c)| d * c).sum();
        to_half_turn(self.delta_turns[candidate] - field)
    }

    /// Log likelihood of a guess, nats, less its improbability.
    pub(super) fn score(&self, guess: &Guess) -> f64 {
        let peak = 1.0 / (TAU.sqrt() * guess.sd_turns);
        let of_pixel = |ends: &[usize]| {
            let density = |j: usize| {
                let z = self.residual_turns(j, &guess.coefficients) / guess.sd_turns;
                peak * bell(z)
            };
            let mean = (ends[0]..ends[1]).map(density).sum::<f64>() / (ends[1] - ends[0]) as f64;
            NONE_TRUE + (1.0 - NONE_TRUE) * mean
        };
        let mean = ln_of_product(self.first.windows(2).map(of_pixel)) / self.pixels() as f64;
        self.independent * mean - IMPROBABILITY_WEIGHT * guess.improbability()
    }

    /// Improves a guess by expectation maximization until it settles, for at most `max_steps` steps.
    pub(super) fn refine(&self, guess: &mut Guess, max_steps: usize, solver: &mut Solver) {
        for _ in 0..max_steps {
            fringeflow_simd::run(Level::in_use(), SumKernel { sample: self, guess, solver });
            if !solver.solve(guess, (self.pixels() as f64 / self.independent).max(1.0)) {
                return;
            }
            let sums = &solver.sums;
            guess.coefficients.iter_mut().zip(solver.change.iter()).for_each(|(c, d)| *c += d);
            let before = guess.sd_turns;
            let sd_turns = (sums.squares / sums.weight).sqrt().max(MIN_SD_TURNS);
            guess.share = sums.weight / self.pixels() as f64;
            // sd only shrinks: while it is wide, many candidates count, and no start is left too early.
            guess.sd_turns = sd_turns.max(FASTEST_SHRINK * before).min(before);
            if sd_turns / before > SETTLED {
                return;
            }
        }
    }
}

/// Sums the normal equations over all candidates, each weighted by the probability that it is the true one of its
/// pixel.
struct SumKernel<'a> {
    sample: &'a Sample,
    guess: &'a Guess,
    solver: &'a mut Solver,
}

impl Kernel for SumKernel<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let Self { sample, guess, solver: Solver { sums, likely, .. } } = self;
        sums.begin(sample.columns);
        // Density of false candidates, relative to the peak of the true one.
        let false_density = TAU.sqrt() * guess.sd_turns * sample.mean_candidates() / (2.0 * sample.spread_turns);
        for ends in sample.first.windows(2) {
            likely.clear();
            for j in ends[0]..ends[1] {
                let residual = sample.residual_turns(j, &guess.coefficients);
                likely.push((residual, bell(residual / guess.sd_turns)));
            }
            let total = false_density + likely.iter().map(|l| l.1).sum::<f64>();
            for (j, &(residual, density)) in (ends[0]..ends[1]).zip(&*likely) {
                let weight = density / total;
                if weight >= MIN_WEIGHT {
                    sums.add(sample.row(j), residual, weight);
                }
            }
        }
    }
}

/// Pixels with a phase and a segment.
#[derive(Clone, Debug, Default)]
pub(super) struct Usable {
    /// 1 or 0 per pixel.
    is_usable: Vec<u8>,
    width: usize,
    /// Number in each row.
    counts: Vec<usize>,
    /// The pixels returned last.
    pixels: Vec<usize>,
}

impl Usable {
    fn find(&mut self, cam1: &PhaseMap, table: &SegmentTable) {
        let width = cam1.width.max(1);
        self.width = width;
        self.is_usable.resize(cam1.phase.len(), 0);
        self.counts.resize(cam1.height, 0);
        let rows = self.is_usable.par_chunks_mut(width).zip(&mut self.counts).enumerate();
        rows.for_each(|(v, (is_usable, count))| {
            table.mark_segments(v, is_usable);
            let valid = &cam1.valid[v * width..(v + 1) * width];
            is_usable.iter_mut().zip(valid).for_each(|(usable, &valid)| *usable &= u8::from(valid));
            *count = is_usable.iter().map(|&usable| usize::from(usable)).sum();
        });
    }

    fn count(&self) -> usize {
        self.counts.iter().sum()
    }

    /// Every `stride`-th usable pixel, from the first on.
    fn every(&mut self, stride: usize) -> &[usize] {
        let Self { is_usable, width, counts, pixels } = self;
        pixels.clear();
        let mut skip = 0;
        for (v, (row, &count)) in is_usable.chunks(*width).zip(&*counts).enumerate() {
            let (mut seen, mut columns) = (0, 0..row.len());
            while skip < count - seen {
                let wanted = columns.by_ref().filter(|&u| row[u] == 1).nth(skip);
                pixels.extend(wanted.map(|u| v * *width + u));
                seen += skip + 1;
                skip = stride - 1;
            }
            skip -= count - seen;
        }
        pixels
    }
}

/// Wraps to half a turn on either side of zero. `f64::round` would call the C library.
#[inline(always)]
fn to_half_turn(turns: f64) -> f64 {
    turns - (turns + 0.5_f64.copysign(turns)) as i64 as f64
}

/// Natural logarithm of a product of positive numbers, at most 0.06 too small, and increasing with the product. Unlike
/// that of the C library it is the same on every machine.
fn ln_of_product(factors: impl Iterator<Item = f64>) -> f64 {
    const EXPONENT: u64 = 0x7ff << 52;
    const ONE: u64 = 1023 << 52;
    let (mut octaves, mut mantissa) = (0_i64, 1.0_f64);
    for factor in factors {
        let bits = (mantissa * factor).to_bits();
        octaves += (bits >> 52) as i64 - 1023;
        mantissa = f64::from_bits(bits & !EXPONENT | ONE);
    }
    // Between powers of two the logarithm is taken as linear.
    (octaves as f64 + mantissa - 1.0) * std::f64::consts::LN_2
}

/// Density of the normal distribution at z, relative to that at 0.
#[inline(always)]
fn bell(z: f64) -> f64 {
    decay(0.5 * z * z)
}

/// Solver of the normal equations, reusing its memory.
#[derive(Clone, Debug, Default)]
pub(super) struct Solver {
    sums: Sums,
    /// Residuals and densities of the candidates of a pixel.
    likely: Vec<(f64, f64)>,
    normal: DMatrix<f64>,
    /// The right side, then the solution.
    change: DVector<f64>,
}

impl Solver {
    /// Solves for the change of the coefficients. The prior draws them towards zero; `dependence` pixels count as one
    /// independent pixel. Returns whether there is a solution.
    fn solve(&mut self, guess: &Guess, dependence: f64) -> bool {
        let Self { sums, normal, change, .. } = self;
        let prior = dependence * (guess.sd_turns / PRIOR_PX).powi(2);
        let columns = sums.right.len();
        let mut matrix = std::mem::take(normal);
        if matrix.nrows() != columns {
            (matrix, *change) = (DMatrix::zeros(columns, columns), DVector::zeros(columns));
        }
        // The decomposition reads the lower triangle alone.
        matrix.iter_mut().enumerate().for_each(|(k, entry)| *entry = sums.normal[k % columns * columns + k / columns]);
        change.copy_from_slice(&sums.right);
        matrix[(0, 0)] += f64::EPSILON;
        for i in 1..columns {
            matrix[(i, i)] += prior;
            change[i] -= prior * guess.coefficients[i];
        }
        let Some(decomposed) = matrix.cholesky() else { return false };
        decomposed.solve_mut(change);
        *normal = decomposed.unpack_dirty();
        sums.weight > 0.0
    }
}

/// Sums of weighted normal equations.
#[derive(Clone, Debug, Default)]
struct Sums {
    /// Lower triangle of the normal matrix, in full rows.
    normal: Vec<f64>,
    right: Vec<f64>,
    weight: f64,
    squares: f64,
}

impl Sums {
    fn begin(&mut self, columns: usize) {
        self.normal.clear();
        self.normal.resize(columns * columns, 0.0);
        self.right.clear();
        self.right.resize(columns, 0.0);
        (self.weight, self.squares) = (0.0, 0.0);
    }

    #[inline(always)]
    fn add(&mut self, row: &[f64], residual: f64, weight: f64) {
        self.weight += weight;
        self.squares += weight * residual * residual;
        let rows = self.normal.chunks_exact_mut(row.len()).zip(&mut self.right);
        for (i, (normal, right)) in rows.enumerate() {
            let weighted = weight * row[i];
            *right += weighted * residual;
            for (sum, value) in normal.iter_mut().zip(&row[..=i]) {
                *sum += weighted * value;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_nth_pixel_equals_stepping_through_all() {
        let width = 13;
        let is_usable: Vec<u8> = (0..13 * 17).map(|i| u8::from(i * i % 7 < 4 && i / 13 != 5)).collect();
        let counts = is_usable.chunks(width).map(|row| row.iter().filter(|&&u| u == 1).count()).collect();
        let mut usable = Usable { is_usable, width, counts, pixels: Vec::new() };
        let all: Vec<usize> = (0..usable.is_usable.len()).filter(|&i| usable.is_usable[i] == 1).collect();
        assert_eq!(usable.count(), all.len());
        for stride in [1, 3, 8, 21, 500] {
            let wanted: Vec<usize> = all.iter().copied().step_by(stride).collect();
            assert_eq!(usable.every(stride), wanted, "{stride}");
        }
    }

    #[test]
    fn the_logarithm_of_a_product_is_the_sum_of_logarithms() {
        let factors = || (1..400).map(|i| f64::from(i % 37 + 1) / 12.0);
        let exact: f64 = factors().map(f64::ln).sum();
        let found = ln_of_product(factors());
        assert!(found <= exact + 1e-9 && exact - found < 0.06, "{found} {exact}");
        assert_eq!(ln_of_product(std::iter::empty()), 0.0);
    }

    #[test]
    fn the_bell_is_that_of_the_normal_distribution() {
        for step in 0..=600 {
            let z = f64::from(step) / 100.0;
            let exact = (-0.5 * z * z).exp();
            assert!((bell(z) - exact).abs() < 1e-6 && bell(z) == bell(-z), "{z}: {} {exact}", bell(z));
        }
        assert_eq!(bell(7.0), 0.0);
    }
}
