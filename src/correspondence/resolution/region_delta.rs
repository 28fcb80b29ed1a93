//! What δ says about a whole region.
//!
//! A wrong fringe order can agree with its neighbours just as well as the right one: where the right candidate is hidden
//! or lies outside the measurement volume, the wrong one is alone. But δ tells them apart. Over a right region δ is
//! noise about a calibration error that varies slowly over the image. Over a wrong region it runs steadily from pixel to
//! pixel until it leaves the test, or it stays near the threshold all over a piece too narrow to run.

use super::super::delta_statistics::MAX_CHANGE_OVER_IMAGE_SD;
use super::super::neighbourhood::TURN;
use super::Resolver;
use super::regions::Regions;
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

/// For each region whether its δ is level, as over a right one; regions below the least size tell too little and pass.
pub(super) fn level_regions(resolver: &Resolver<'_>, regions: &Regions) -> Vec<bool> {
    let width = resolver.evidence.cam1.width;
    let steepness = Steepness::new(resolver, regions);
    let mut all = vec![RegionDelta::default(); regions.sizes.len()];
    for pixel in 0..resolver.absolute.len() {
        let Some(region) = regions.region_of(pixel) else { continue };
        let delta = resolver.delta[pixel];
        if !resolver.evidence.gate.passes(delta) {
            continue;
        }
        let (u, v) = (pixel % width, pixel / width);
        all[region].add([u as i64, v as i64], i64::from(delta));
        let stride = STEEP_STRIDES[usize::from(regions.sizes[region] > MANY_PX)];
        if u.is_multiple_of(stride) && v.is_multiple_of(stride) {
            all[region].add_slope(steepness.is_steep(pixel));
        }
    }
    let gate = resolver.evidence.gate;
    // thr is 3·sd.
    let sd = f64::from(gate.threshold_turns) * f64::from(TURN) / 3.0;
    let mean = f64::from(gate.mean_turns) * f64::from(TURN);
    let fastest = MAX_CHANGE_OVER_IMAGE_SD * sd / width as f64;
    let judge = |(delta, &size): (&RegionDelta, &u32)| {
        size < resolver.settings.min_region_px || {
            let (slope, explained) = delta.ramp();
            delta.count as f64 >= MIN_PASSING_SHARE * f64::from(size)
                && delta.steep as f64 <= MAX_STEEP_SHARE * delta.sampled as f64
                && (delta.mean() - mean).abs() <= MAX_MEAN_SD * sd
                && (slope <= fastest || explained <= MAX_RAMP_VARIANCE * sd * sd)
        }
    };
    all.iter().zip(&regions.sizes).map(judge).collect()
}

/// Sums over those pixels of a region that pass the test, in whole numbers: they are the same in any order.
#[derive(Clone, Copy, Default)]
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
    fn add(&mut self, place: [i64; 2], delta: i64) {
        let [u, v] = place;
        self.count += 1;
        self.sum += delta;
        self.place = [self.place[0] + u, self.place[1] + v];
        self.place_delta = [self.place_delta[0] + u * delta, self.place_delta[1] + v * delta];
        let [uu, uv, vv] = self.place_place;
        self.place_place = [uu + u * u, uv + u * v, vv + v * v];
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
    use super::*;

    fn region(delta: impl Fn(i64, i64) -> i64) -> RegionDelta {
        let mut sums = RegionDelta::default();
        for (u, v) in (0..40).flat_map(|u| (0..20).map(move |v| (u, v))) {
            sums.add([600 + u, 400 + v], delta(u, v));
        }
        sums
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
        let mut sums = RegionDelta::default();
        (0..50).for_each(|u| sums.add([u, 2 * u], 100 * u));
        assert_eq!(sums.ramp(), (0.0, 0.0));
        assert_eq!(sums.mean(), 2450.0);
    }
}
