//! Tests δ over whole regions: an additional decision of the kind that the paper leaves open (2.2.3: "Decisions must be
//! realized using other criteria").
//!
//! A wrong fringe order can agree with its neighbours as well as the right one: where the right candidate is hidden or
//! outside the measurement volume, the wrong one is unique. δ distinguishes them. Over a right region δ is noise about
//! a calibration error that varies slowly over the image. Over a wrong region it rises steadily from pixel to pixel
//! until it fails the test, or it stays near the threshold over a piece too narrow for that.

use std::f64::consts::TAU;

use super::image::Image;
use super::regions::Regions;
use crate::correspondence::neighbourhood::TURN;

/// Change of δ over the width of the image, in sd, that exceeds any calibration error: three times the range ±3·sd that
/// contains nearly all of it.
const MAX_CHANGE_OVER_IMAGE_SD: f64 = 20.0;
/// Slope of δ over seven pixels that exceeds noise, in sd of the slope: 5/√28.
const STEEP_NOISE_SD: f64 = 1.0;
/// Pixels on either side over which the slope of δ is measured.
const REACH_PX: isize = 3;
/// Least share of a region that passes the back-projection test with 3·sd.
const MIN_PASSING_SHARE: f64 = 0.7;
/// Largest share of a region with a steep δ.
const MAX_STEEP_SHARE: f64 = 0.7;
/// Largest distance of the mean δ of a region from the mean of all, in sd.
const MAX_MEAN_SD: f64 = 2.0;
/// Variance of δ, in sd², that a plane may explain if it rises faster than any calibration error: a ramp through 2.4·sd
/// has as much, one through the whole test 3.
const MAX_RAMP_VARIANCE: f64 = 0.5;
/// Distance of the pixels tested for a steep δ along both axes, in regions up to this size and in larger ones.
const STEEP_STRIDES: [usize; 2] = [2, 8];
const MANY_PX: u32 = 10_000;

/// The regions of an image: decided pixels of continuous absolute phase and δ.
pub(super) struct Division {
    pub(super) regions: Regions,
    /// Region of each pixel; beyond all regions while undecided.
    pub(super) of_pixels: Vec<u32>,
}

impl Image<'_> {
    /// Divides the decided pixels into regions. Neighbours belong together if their absolute phases continue and their
    /// δ differ by no more than `tolerance`, turns · 65536.
    pub(super) fn divide(&self, tolerance: i32) -> Division {
        let mut regions = Regions::default();
        let delta: Vec<f32> = self.delta.iter().map(|&delta| f32::from(delta)).collect();
        regions.find(self.scene.view.cam1.width.max(1), &self.absolute, &delta, tolerance as f32);
        let mut of_pixels = vec![u32::MAX; self.absolute.len()];
        regions.runs.all.iter().for_each(|run| of_pixels[run.pixels()].fill(run.set));
        Division { regions, of_pixels }
    }

    /// For each region whether its δ is level, as over a right one. Regions below the least size tell too little and
    /// pass.
    pub(super) fn level(&self, division: &Division) -> Vec<bool> {
        let (width, sizes) = (self.scene.view.cam1.width, &division.regions.size_px);
        let mut sums = vec![RegionDelta::default(); sizes.len()];
        for run in &division.regions.runs.all {
            let sums = &mut sums[run.set as usize];
            let stride = STEEP_STRIDES[usize::from(sizes[run.set as usize] > MANY_PX)];
            for pixel in run.pixels().filter(|&pixel| self.gate.passes(self.delta[pixel])) {
                let (u, v) = (pixel % width, pixel / width);
                sums.add([u as f64, v as f64], f64::from(self.delta[pixel]));
                if u.is_multiple_of(stride) && v.is_multiple_of(stride) {
                    sums.sampled += 1;
                    sums.steep += u32::from(self.is_steep(division, pixel));
                }
            }
        }
        // thr is 3·sd.
        let sd = f64::from(self.gate.threshold_turns) * f64::from(TURN) / 3.0;
        let mean = f64::from(self.gate.mean_turns) * f64::from(TURN);
        let fastest = MAX_CHANGE_OVER_IMAGE_SD * sd / width as f64;
        let is_level = |(delta, &size): (&RegionDelta, &u32)| {
            let (slope, explained) = delta.ramp();
            size < self.scene.settings.min_region_px
                || (delta.count >= MIN_PASSING_SHARE * f64::from(size)
                    && f64::from(delta.steep) <= MAX_STEEP_SHARE * f64::from(delta.sampled)
                    && (delta.mean() - mean).abs() <= MAX_MEAN_SD * sd
                    && (slope <= fastest || explained <= MAX_RAMP_VARIANCE * sd * sd))
        };
        sums.iter().zip(sizes).map(is_level).collect()
    }

    /// Whether δ changes steadily along the row or the column of a decided pixel: its least-squares slope over the
    /// pixels of the region around it exceeds calibration error and noise. Too few pixels have no slope.
    pub(super) fn is_steep(&self, division: &Division, pixel: usize) -> bool {
        let (statistics, width) = (self.scene.delta, self.scene.view.cam1.width);
        let of_calibration_rad = MAX_CHANGE_OVER_IMAGE_SD * statistics.sd_rad / width as f64;
        let limit = (of_calibration_rad + STEEP_NOISE_SD * statistics.noise_sd_rad) / TAU * f64::from(TURN);
        [1, width as isize].into_iter().any(|stride| {
            let is_of_region = |step: &isize| {
                let other = pixel.checked_add_signed(step * stride).and_then(|other| division.of_pixels.get(other));
                other == Some(&division.of_pixels[pixel])
            };
            let before = (1..=REACH_PX).map(|step| -step).take_while(is_of_region).count() as isize;
            let after = (1..=REACH_PX).take_while(is_of_region).count() as isize;
            if before + after < REACH_PX {
                return false;
            }
            let middle = 0.5 * (after - before) as f64;
            let (mut moment, mut spread) = (0.0, 0.0);
            for step in -before..=after {
                let offset = step as f64 - middle;
                moment += offset * f64::from(self.delta[pixel.wrapping_add_signed(step * stride)]);
                spread += offset * offset;
            }
            (moment / spread).abs() > limit
        })
    }
}

/// Sums over the pixels of a region that pass the test.
#[derive(Clone, Debug, Default)]
struct RegionDelta {
    count: f64,
    sum: f64,
    /// Sums of column and row, and of each times δ.
    place: [f64; 2],
    place_delta: [f64; 2],
    /// Sums of column², column·row and row².
    place_place: [f64; 3],
    /// Pixels tested for their slope, and those where it is steep.
    sampled: u32,
    steep: u32,
}

impl RegionDelta {
    fn add(&mut self, [u, v]: [f64; 2], delta: f64) {
        let add = |sums: &mut [f64], terms: &[f64]| sums.iter_mut().zip(terms).for_each(|(sum, term)| *sum += term);
        self.count += 1.0;
        self.sum += delta;
        add(&mut self.place, &[u, v]);
        add(&mut self.place_delta, &[u * delta, v * delta]);
        add(&mut self.place_place, &[u * u, u * v, v * v]);
    }

    fn mean(&self) -> f64 {
        self.sum / self.count.max(1.0)
    }

    /// The least-squares plane through δ: its rise per pixel, and the variance of δ that it explains; zero if the
    /// pixels lie in one line.
    fn ramp(&self) -> (f64, f64) {
        let mean = |sum: f64| sum / self.count.max(1.0);
        let [u, v] = self.place.map(mean);
        let [uu, uv, vv] = self.place_place.map(mean);
        let (uu, uv, vv) = (uu - u * u, uv - u * v, vv - v * v);
        let [ud, vd] = self.place_delta.map(mean);
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

    /// Sums over a region of 40 by 20 pixels.
    fn region(delta: impl Fn(usize, usize) -> f64) -> RegionDelta {
        let mut sums = RegionDelta::default();
        for (u, v) in (0..40).flat_map(|u| (0..20).map(move |v| (u, v))) {
            sums.add([600.0 + u as f64, 400.0 + v as f64], delta(u, v));
        }
        sums
    }

    #[test]
    fn a_ramp_is_told_from_noise() {
        // Even over a range of 390 in u and 95 in v.
        let (rise, explained) = region(|u, v| 10.0 * u as f64 + 5.0 * v as f64 - 60.0).ramp();
        assert!((rise - 10_f64.hypot(5.0)).abs() < 1e-6, "{rise}");
        let variance = (100.0 * (40.0_f64.powi(2) - 1.0) + 25.0 * (20.0_f64.powi(2) - 1.0)) / 12.0;
        assert!((explained / variance - 1.0).abs() < 1e-6, "{explained}");
        let coin =
            |u: usize, v: usize| ((u * 40 + v) as u32).wrapping_mul(2_654_435_761).count_ones().is_multiple_of(2);
        let noise = region(|u, v| if coin(u, v) { 300.0 } else { -300.0 });
        assert!(noise.ramp().1 < 0.02 * 300.0 * 300.0, "{:?}", noise.ramp());
    }

    #[test]
    fn pixels_in_one_line_have_no_plane() {
        let mut sums = RegionDelta::default();
        (0..8).for_each(|u| sums.add([7.0 + f64::from(u), 7.0], 100.0 * f64::from(u)));
        assert_eq!(sums.ramp(), (0.0, 0.0));
        assert_eq!(sums.mean(), 350.0);
    }
}
