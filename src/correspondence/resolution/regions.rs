//! Regions of pixels whose absolute phases run on from one to the next, and what speaks for a whole region.
//!
//! A wrong fringe order can agree with its neighbours just as well as the right one: where the right candidate is hidden
//! or lies outside the measurement volume, the wrong one is alone. But δ tells them apart. Over a right region δ is
//! noise about a calibration error that varies slowly over the image. Over a wrong region it changes steadily from pixel
//! to pixel, and the region ends where it leaves the test: there δ is spread evenly over ±3·sd, with standard deviation
//! √3·sd, and crosses that range within a fraction of the image.

use super::super::delta_statistics::MAX_CHANGE_OVER_IMAGE_SD;
use super::super::neighbourhood::{Decided, TURN, UNDECIDED};
use super::Resolver;

/// Largest difference of absolute phase between neighbours of one region.
const MAX_STEP: i32 = 3 * TURN / 8;
/// Systematic variance of δ, in sd², at which a normal and an even distribution over ±3·sd are equally likely:
/// 2·ln(6/√(2π)).
const MAX_SYSTEMATIC_VARIANCE: f64 = 1.746;
/// Share of a region that must pass the back-projection test proper.
const MIN_PASSING_SHARE: f64 = 0.7;
/// A pixel without region.
const NONE: u32 = u32::MAX;

/// Division of the decided pixels into regions.
pub(super) struct Regions {
    label: Vec<u32>,
    /// Pixels of each region.
    pub(super) sizes: Vec<u32>,
    width: usize,
}

impl Regions {
    /// Regions of an image: neighbours belong together if their absolute phases run on and their δ differ by no more than
    /// `tolerance`.
    pub(super) fn of(decided: Decided<'_>, tolerance: i32, width: usize) -> Self {
        let absolute = decided.absolute;
        let mut regions = Self { label: vec![NONE; absolute.len()], sizes: Vec::new(), width };
        let mut frontier = Vec::new();
        for seed in 0..absolute.len() {
            if absolute[seed] != UNDECIDED && regions.label[seed] == NONE {
                let size = regions.fill(seed, decided, tolerance, &mut frontier);
                regions.sizes.push(size);
            }
        }
        regions
    }

    /// Region of a pixel, if it is decided.
    #[inline]
    pub(super) fn region_of(&self, pixel: usize) -> Option<usize> {
        let label = self.label.get(pixel).copied().unwrap_or(NONE);
        (label != NONE).then_some(label as usize)
    }

    /// Labels all pixels connected to `seed`; yields how many.
    fn fill(&mut self, seed: usize, decided: Decided<'_>, tolerance: i32, frontier: &mut Vec<usize>) -> u32 {
        let Decided { absolute, delta } = decided;
        let label = self.sizes.len() as u32;
        self.label[seed] = label;
        frontier.push(seed);
        let mut size = 0;
        while let Some(pixel) = frontier.pop() {
            size += 1;
            for next in neighbours(pixel, self.width, absolute.len()).into_iter().flatten() {
                let linked = absolute[next] != UNDECIDED
                    && (absolute[next] - absolute[pixel]).abs() <= MAX_STEP
                    && (i32::from(delta[next]) - i32::from(delta[pixel])).abs() <= tolerance;
                if linked && self.label[next] == NONE {
                    self.label[next] = label;
                    frontier.push(next);
                }
            }
        }
        size
    }

    /// Which regions δ and size speak for.
    pub(super) fn credible(&self, resolver: &Resolver<'_>) -> Vec<bool> {
        let mut statistics = vec![DeltaOfRegion::default(); self.sizes.len()];
        for pixel in 0..self.label.len() {
            let Some(region) = self.region_of(pixel) else { continue };
            let Some(delta) = passing_delta(resolver, pixel) else { continue };
            let same = |next: usize| next < self.label.len() && self.label[next] == self.label[pixel];
            let neighbour = |next: usize| if same(next) { passing_delta(resolver, next) } else { None };
            statistics[region].add(delta, [neighbour(pixel + 1), neighbour(pixel + self.width)]);
        }
        // thr is 3·sd.
        let sd = f64::from(resolver.evidence.gate.threshold_turns) * f64::from(TURN) / 3.0;
        let judge = |(statistics, &size): (&DeltaOfRegion, &u32)| {
            size >= resolver.settings.min_region_px
                && statistics.count as f64 >= MIN_PASSING_SHARE * f64::from(size)
                && !(statistics.systematic_variance() > MAX_SYSTEMATIC_VARIANCE * sd * sd
                    && statistics.gradient() * self.width as f64 > MAX_CHANGE_OVER_IMAGE_SD * sd)
        };
        statistics.iter().zip(&self.sizes).map(judge).collect()
    }
}

/// δ of a decided pixel if it passes the test proper, turns · 65536.
fn passing_delta(resolver: &Resolver<'_>, pixel: usize) -> Option<i64> {
    let delta = resolver.delta[pixel];
    resolver.evidence.gate.passes(delta).then(|| i64::from(delta))
}

/// The four neighbours of a pixel, as far as they lie in the image.
fn neighbours(pixel: usize, width: usize, pixels: usize) -> [Option<usize>; 4] {
    let column = pixel % width;
    [
        (column > 0).then(|| pixel - 1),
        (column + 1 < width).then(|| pixel + 1),
        (pixel >= width).then(|| pixel - width),
        (pixel + width < pixels).then(|| pixel + width),
    ]
}

/// Sums of δ over a region, in whole numbers.
#[derive(Clone, Copy, Default)]
struct DeltaOfRegion {
    count: i64,
    sum: i64,
    sum_of_squares: i64,
    /// Pairs of neighbours to the right and below, with the sum and the sum of squares of the differences.
    pairs: [i64; 2],
    rise: [i64; 2],
    squared_steps: [i64; 2],
}

impl DeltaOfRegion {
    /// Adds a pixel with its neighbours to the right and below, as far as they belong to the region.
    fn add(&mut self, delta: i64, neighbours: [Option<i64>; 2]) {
        self.count += 1;
        self.sum += delta;
        self.sum_of_squares += delta * delta;
        for (direction, neighbour) in neighbours.into_iter().enumerate() {
            if let Some(neighbour) = neighbour {
                self.pairs[direction] += 1;
                self.rise[direction] += neighbour - delta;
                self.squared_steps[direction] += (neighbour - delta).pow(2);
            }
        }
    }

    /// Variance of δ about the region's mean, less what differs from pixel to pixel: noise is no sign of a wrong order.
    fn systematic_variance(&self) -> f64 {
        let count = self.count.max(1) as f64;
        let variance = self.sum_of_squares as f64 / count - (self.sum as f64 / count).powi(2);
        let pairs = self.pairs.iter().sum::<i64>().max(1) as f64;
        variance - 0.5 * self.squared_steps.iter().sum::<i64>() as f64 / pairs
    }

    /// Mean change of δ a pixel, along its steepest direction.
    fn gradient(&self) -> f64 {
        let mean_rise = |direction: usize| self.rise[direction] as f64 / self.pairs[direction].max(1) as f64;
        mean_rise(0).hypot(mean_rise(1))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn regions_end_where_the_absolute_phase_or_delta_jumps() {
        let absolute = [0, 6000, 12000, UNDECIDED, 18000, 18000 + TURN, 25000 + TURN, 31000 + TURN];
        let delta = [0, 0, 5, 0, 0, 0, 9, 50];
        let regions = Regions::of(Decided { absolute: &absolute, delta: &delta }, 10, absolute.len());
        assert_eq!(regions.sizes, [3, 1, 2, 1]);
        assert_eq!(regions.region_of(3), None);
        assert_eq!(regions.region_of(6), regions.region_of(5));
    }

    #[test]
    fn only_steady_change_counts_as_systematic() {
        let statistics = |deltas: &[i64]| {
            let mut statistics = DeltaOfRegion::default();
            for (i, &delta) in deltas.iter().enumerate() {
                statistics.add(delta, [deltas.get(i + 1).copied(), None]);
            }
            statistics.systematic_variance()
        };
        let ramp: Vec<i64> = (-300..=300).collect();
        // Even over ±300: variance 300²/3.
        assert!((statistics(&ramp) / 30_000.0 - 1.0).abs() < 0.01);
        let coin = |i: u32| i.wrapping_mul(2_654_435_761).count_ones().is_multiple_of(2);
        let noise: Vec<i64> = (0..600).map(|i| if coin(i) { 300 } else { -300 }).collect();
        assert!(statistics(&noise) < 0.2 * 90_000.0, "{}", statistics(&noise));
    }
}
