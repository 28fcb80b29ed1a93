//! Histogram of the motion of the pixels of an image. In: motions. Out: median and 95 % quantile. Cost: an increment
//! per counted pixel.

use fringeflow_simd::Lanes;

use crate::phase::histogram::{Histogram, quantile};

/// Range of the histogram on either side of zero, rad per image, and its bins on one side.
const RANGE_RAD: f32 = 1.5;
const BINS: usize = 1024;

/// Distance of the rows whose pixels count. Their quantiles are as good as those of the whole image.
const ROW_PITCH: usize = 16;

/// Whether the pixels of a row count in the statistics of the image.
pub(super) fn is_counted(row: usize) -> bool {
    row.is_multiple_of(ROW_PITCH)
}

/// Histogram of the motion. NaN counts nowhere.
#[derive(Clone, Debug, Default)]
pub(super) struct MotionHistogram(Histogram<{ 2 * BINS }>);

impl MotionHistogram {
    /// Adds 32 pixels. Pixel k counts only if bit k of `valid` is set.
    #[inline(always)]
    pub(super) fn add_block<L: Lanes>(&mut self, lanes: L, motion_rad: L::Reals, valid: u32) {
        let l = lanes;
        let share = l.over_real(motion_rad, l.real(RANGE_RAD));
        let is_known = l.bits(l.is_greater_real(l.real(f32::INFINITY), l.abs_real(share)));
        let bins = l.times_real(l.abs_real(share), l.real(BINS as f32));
        let bin = l.truncate(l.min_real(bins, l.real((BINS - 1) as f32)));
        let (ahead, back) = (l.add_real(bin, l.real(BINS as f32)), l.sub_real(l.real((BINS - 1) as f32), bin));
        let signed = l.add_real(l.real(0.5), l.times_real(l.real(0.5), share));
        let is_ahead = l.is_at_least_real(signed, l.real(0.5));
        self.0.add_block(l, l.select_real(is_ahead, ahead, back), valid & is_known);
    }

    /// Counts a pixel that became valid; no longer counts one that became invalid.
    pub(super) fn change(&mut self, motion_rad: f32, was_valid: bool, is_valid: bool) {
        if was_valid == is_valid || !motion_rad.is_finite() {
            return;
        }
        let share = motion_rad / RANGE_RAD;
        let bin = (share.abs() * BINS as f32).trunc().min((BINS - 1) as f32);
        let bin = if 0.5 + 0.5 * share >= 0.5 { bin + BINS as f32 } else { (BINS - 1) as f32 - bin };
        if is_valid { self.0.add(bin) } else { self.0.remove(bin) }
    }

    pub(super) fn merge(&mut self, other: &Self) {
        self.0.merge(&other.0);
    }

    /// Median of the motion, and 95 % quantile of its magnitude, rad per image.
    pub(super) fn median_and_fast_rad(&self) -> [f32; 2] {
        if self.0.len() == 0 {
            return [0.0; 2];
        }
        let signed = (0..BINS).map(|bin| self.0.count(2 * bin) + self.0.count(2 * bin + 1));
        let magnitude = (0..BINS).map(|bin| self.0.count(BINS + bin) + self.0.count(BINS - 1 - bin));
        [(quantile(signed, 0.5) - 0.5) * 2.0 * RANGE_RAD, quantile(magnitude, 0.95) * RANGE_RAD]
    }
}
