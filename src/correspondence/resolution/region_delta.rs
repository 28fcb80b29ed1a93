//! What δ says about a whole region.
//!
//! A wrong fringe order can agree with its neighbours just as well as the right one: where the right candidate is hidden
//! or lies outside the measurement volume, the wrong one is alone. But δ tells them apart. Over a right region δ is
//! noise about a calibration error that varies slowly over the image. Over a wrong region it runs steadily from pixel to
//! pixel until it leaves the test, or it stays near the threshold all over a piece too narrow to run.

use rayon::prelude::*;

use crate::simd::{self, Kernel, LANES, Lanes};

use super::super::delta_statistics::MAX_CHANGE_OVER_IMAGE_SD;
use super::super::grid::{Grid, words};
use super::super::neighbourhood::TURN;
use super::regions::{Regions, Run};
use super::scene::Scene;
use super::steepness::Steepness;

/// Least share of a region that passes the back-projection test proper.
const MIN_PASSING_SHARE: f64 = 0.7;
/// Largest share of a region over which δ is steep.
const MAX_STEEP_SHARE: f64 = 0.7;
/// Largest distance of a region's mean δ from the mean of all, in sd.
const MAX_MEAN_SD: f64 = 2.0;
/// Variance of δ, in sd², that a plane may explain where it rises faster than any calibration error: a ramp through
/// 2.4·sd has as much, one through the whole test 3.
const MAX_RAMP_VARIANCE: f64 = 0.5;
/// Pixels along either axis of which one is asked whether δ is steep there, in regions up to so many pixels and beyond.
const STEEP_STRIDES: [usize; 2] = [2, 8];
const MANY_PX: u32 = 10_000;

/// Judges regions by their δ.
#[derive(Clone, Debug, Default)]
pub(super) struct RegionJudge {
    of_runs: Vec<RegionDelta>,
    of_regions: Vec<RegionDelta>,
}

impl RegionJudge {
    /// For each region whether its δ is level, as over a right one; regions below the least size tell too little and pass.
    pub(super) fn level(&mut self, scene: &Scene<'_>, regions: &Regions, is_level: &mut Vec<bool>) {
        let (grid, gate, delta) = (scene.continuity.grid, scene.evidence.gate, scene.decisions.delta);
        let steepness = Steepness::new(scene, regions);
        let [least, greatest] = scene.gate_bounds;
        let is_asked = |region: usize| regions.sizes[region] >= scene.min_region_px;
        let of_run = |run: &Run| {
            let region = run.region as usize;
            if !is_asked(region) {
                return RegionDelta::default();
            }
            let stride = STEEP_STRIDES[usize::from(regions.sizes[region] > MANY_PX)];
            let mut sums = simd::run(scene.level, DeltaOfRun { grid, delta, bounds: scene.gate_bounds, run: *run });
            let [u, v] = grid.column_and_row(run.place as usize);
            if v.is_multiple_of(stride) {
                let first = u.next_multiple_of(stride) - u;
                for place in run.places().skip(first).step_by(stride) {
                    if (least..=greatest).contains(&delta[place]) {
                        sums.add_slope(steepness.is_steep(place));
                    }
                }
            }
            sums
        };
        regions.runs.par_iter().map(of_run).collect_into_vec(&mut self.of_runs);
        self.of_regions.clear();
        self.of_regions.resize(regions.sizes.len(), RegionDelta::default());
        for (run, sums) in regions.runs.iter().zip(&self.of_runs) {
            self.of_regions[run.region as usize].join(sums);
        }
        // thr is 3·sd.
        let sd = f64::from(gate.threshold_turns) * f64::from(TURN) / 3.0;
        let mean = f64::from(gate.mean_turns) * f64::from(TURN);
        let fastest = MAX_CHANGE_OVER_IMAGE_SD * sd / grid.width() as f64;
        let judge = |(region, delta): (usize, &RegionDelta)| {
            !is_asked(region) || {
                let (slope, explained) = delta.ramp();
                delta.count as f64 >= MIN_PASSING_SHARE * f64::from(regions.sizes[region])
                    && delta.steep as f64 <= MAX_STEEP_SHARE * delta.sampled as f64
                    && (delta.mean() - mean).abs() <= MAX_MEAN_SD * sd
                    && (slope <= fastest || explained <= MAX_RAMP_VARIANCE * sd * sd)
            }
        };
        is_level.clear();
        is_level.extend(self.of_regions.iter().enumerate().map(judge));
    }
}

/// Sums the δ of a run that pass the back-projection test.
struct DeltaOfRun<'a> {
    grid: Grid,
    delta: &'a [i16],
    /// Least and greatest δ that pass.
    bounds: [i16; 2],
    run: Run,
}

impl Kernel for DeltaOfRun<'_> {
    type Output = RegionDelta;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> RegionDelta {
        let mut sums = RegionDelta::default();
        let [u, v] = self.grid.column_and_row(self.run.place as usize);
        let (u, v) = (u as i64 - i64::from(self.run.place), v as i64);
        let [least, greatest] = self.bounds;
        let (zero, one, number) = (lanes.word(0), lanes.word(1), lanes.load(&NUMBERS));
        for (block, of_run) in self.run.blocks() {
            let first = block * LANES;
            let delta = lanes.load(words(self.delta, first));
            let fails = lanes.bits(lanes.is_greater(lanes.word(least), delta))
                | lanes.bits(lanes.is_greater(delta, lanes.word(greatest)));
            let passing = lanes.mask(of_run & !fails);
            let [delta, number, one] = [
                lanes.select(passing, delta, zero),
                lanes.select(passing, number, zero),
                lanes.select(passing, one, zero),
            ];
            let count = i64::from(lanes.dot(one, one));
            let (of_number, squares) = (i64::from(lanes.dot(one, number)), i64::from(lanes.dot(number, number)));
            let (sum, number_delta) = (i64::from(lanes.dot(delta, one)), i64::from(lanes.dot(delta, number)));
            // Columns are counted from that of the block.
            let column = u + first as i64;
            let of_column = column * count + of_number;
            sums.count += count;
            sums.sum += sum;
            sums.place[0] += of_column;
            sums.place_delta[0] += column * sum + number_delta;
            sums.place_place[0] += column * column * count + 2 * column * of_number + squares;
        }
        sums.place[1] = v * sums.count;
        sums.place_delta[1] = v * sums.sum;
        sums.place_place[1] = v * sums.place[0];
        sums.place_place[2] = v * v * sums.count;
        sums
    }
}

/// Numbers of the lanes.
const NUMBERS: [u16; LANES] = {
    let mut numbers = [0; LANES];
    let mut k = 0;
    while k < LANES {
        numbers[k] = k as u16;
        k += 1;
    }
    numbers
};

/// Sums over those pixels of a region that pass the test, in whole numbers: they are the same in any order.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct RegionDelta {
    count: i64,
    sum: i64,
    /// Sums of column and row, and of each times δ.
    place: [i64; 2],
    place_delta: [i64; 2],
    /// Sums of column², column·row and row².
    place_place: [i64; 3],
    /// Pixels that were asked for their slope, and those where it is steep.
    sampled: i64,
    steep: i64,
}

impl RegionDelta {
    /// Adds the sums over other pixels.
    fn join(&mut self, other: &Self) {
        let add = |to: &mut [i64], of: &[i64]| to.iter_mut().zip(of).for_each(|(to, of)| *to += of);
        add(&mut self.place, &other.place);
        add(&mut self.place_delta, &other.place_delta);
        add(&mut self.place_place, &other.place_place);
        self.count += other.count;
        self.sum += other.sum;
        self.sampled += other.sampled;
        self.steep += other.steep;
    }

    fn add_slope(&mut self, steep: bool) {
        self.sampled += 1;
        self.steep += i64::from(steep);
    }

    fn mean(&self) -> f64 {
        self.sum as f64 / self.count.max(1) as f64
    }

    /// The plane through δ by least squares: its rise a pixel, and the variance of δ that it explains; zero where the
    /// pixels lie in one line.
    fn ramp(&self) -> (f64, f64) {
        let count = self.count.max(1) as f64;
        let [u, v] = self.place.map(|sum| sum as f64 / count);
        let [uu, uv, vv] = self.place_place.map(|sum| sum as f64 / count);
        let (uu, uv, vv) = (uu - u * u, uv - u * v, vv - v * v);
        let [ud, vd] = self.place_delta.map(|sum| sum as f64 / count);
        let (ud, vd) = (ud - u * self.mean(), vd - v * self.mean());
        let determinant = uu * vv - uv * uv;
        if determinant < 1e-6 {
            return (0.0, 0.0);
        }
        let (rise_u, rise_v) = ((vv * ud - uv * vd) / determinant, (uu * vd - uv * ud) / determinant);
        (rise_u.hypot(rise_v), rise_u * ud + rise_v * vd)
    }
}

#[cfg(test)]
mod tests {
    use crate::simd::Level;

    use super::*;

    /// Sums over a region of 40 by 20 pixels, run by run.
    fn region(delta: impl Fn(i64, i64) -> i64) -> RegionDelta {
        sums_of([600, 400], [40, 20], delta, Level::in_use())
    }

    fn sums_of(
        [u0, v0]: [usize; 2],
        [width, height]: [usize; 2],
        delta: impl Fn(i64, i64) -> i64,
        level: Level,
    ) -> RegionDelta {
        let grid = Grid::new([u0 + width, v0 + height]);
        let mut plane = vec![0; grid.places()];
        let mut sums = RegionDelta::default();
        for v in v0..v0 + height {
            let place = grid.row(v) + u0;
            for u in 0..width {
                plane[place + u] = delta(u as i64, (v - v0) as i64) as i16;
            }
            let run = Run { place: place as u32, length: width as u32, region: 0 };
            sums.join(&simd::run(level, DeltaOfRun { grid, delta: &plane, bounds: [-900, 900], run }));
        }
        sums
    }

    #[test]
    fn sums_are_those_of_the_pixels_that_pass() {
        let delta = |u: i64, v: i64| (u * 7919 + v * 104_729) % 2001 - 1000;
        let ([u0, v0], [width, height]) = ([21, 3], [77, 5]);
        let none = RegionDelta::default();
        let mut expected = none;
        for (u, v) in (0..width).flat_map(|u| (0..height).map(move |v| (u, v))) {
            let (delta, u, v) = (delta(u, v), u0 + u, v0 + v);
            if delta.abs() <= 900 {
                let place_place = [u * u, u * v, v * v];
                let place_delta = [u * delta, v * delta];
                expected.join(&RegionDelta { count: 1, sum: delta, place: [u, v], place_delta, place_place, ..none });
            }
        }
        for level in Level::ALL {
            let sums = sums_of([u0 as usize, v0 as usize], [width as usize, height as usize], delta, level);
            assert_eq!(sums, expected);
        }
    }

    #[test]
    fn a_ramp_is_told_from_noise() {
        // Even over a range of 390 in u and 95 in v.
        let (rise, explained) = region(|u, v| 10 * u + 5 * v - 60).ramp();
        assert!((rise - 10_f64.hypot(5.0)).abs() < 1e-6, "{rise}");
        let variance = (100.0 * (40.0_f64.powi(2) - 1.0) + 25.0 * (20.0_f64.powi(2) - 1.0)) / 12.0;
        assert!((explained / variance - 1.0).abs() < 1e-6, "{explained}");
        let coin = |u: i64, v: i64| ((u * 40 + v) as u32).wrapping_mul(2_654_435_761).count_ones().is_multiple_of(2);
        let noise = region(|u, v| if coin(u, v) { 300 } else { -300 });
        assert!(noise.ramp().1 < 0.02 * 300.0 * 300.0, "{:?}", noise.ramp());
    }

    #[test]
    fn pixels_in_one_line_have_no_plane() {
        let sums = sums_of([7, 7], [8, 1], |u, _| 100 * u, Level::in_use());
        assert_eq!(sums.ramp(), (0.0, 0.0));
        assert_eq!(sums.mean(), 350.0);
    }
}
