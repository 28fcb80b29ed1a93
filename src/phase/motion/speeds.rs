//! How fast the pixels of an image moved: histograms that add up in any order, and what they say.

use crate::phase::residuals::quantile;
use crate::simd::{LANES, Lanes};

/// Bins of a histogram, and the range to either side that they cover, rad.
const BINS: usize = 1024;
const RANGE_RAD: f32 = 1.5;

/// Histograms of the motion, rad an image, with its sense and without.
#[derive(Clone, Debug)]
pub(super) struct Speeds {
    signed: [u32; BINS],
    amount: [u32; BINS],
}

impl Default for Speeds {
    fn default() -> Self {
        Self { signed: [0; BINS], amount: [0; BINS] }
    }
}

impl Speeds {
    /// Adds the motions of those pixels of a block that are valid and whose motion is known, which is not NaN.
    #[inline(always)]
    pub(super) fn add<L: Lanes>(&mut self, lanes: L, motion_rad: &[f32; LANES], valid: &[bool]) {
        let l = lanes;
        let (last, bins) = (l.real((BINS - 1) as f32), l.real(BINS as f32));
        let motion = l.load_reals(motion_rad);
        let is_known = l.bits(l.is_greater_real(l.real(f32::INFINITY), l.abs_real(motion)));
        let share = |of| l.over_real(of, l.real(RANGE_RAD));
        let signed = l.add_real(l.real(0.5), share(l.times_real(l.real(0.5), motion)));
        let signed = l.max_real(l.min_real(l.times_real(signed, bins), last), l.real(0.0));
        let amount = l.min_real(l.times_real(share(l.abs_real(motion)), bins), last);
        let (mut signed_bins, mut amount_bins) = ([0; LANES], [0; LANES]);
        l.store_real_words(signed, &mut signed_bins);
        l.store_real_words(amount, &mut amount_bins);
        for (k, _) in valid.iter().enumerate().filter(|&(k, &valid)| valid & (is_known >> k & 1 == 1)) {
            self.signed[usize::from(signed_bins[k]) % BINS] += 1;
            self.amount[usize::from(amount_bins[k]) % BINS] += 1;
        }
    }

    pub(super) fn merge(&mut self, other: &Self) {
        let pairs = [(&mut self.signed, &other.signed), (&mut self.amount, &other.amount)];
        for (mine, theirs) in pairs {
            mine.iter_mut().zip(theirs).for_each(|(m, t)| *m += t);
        }
    }

    /// The median motion, and what the amount of it exceeds at one pixel in twenty, rad an image.
    pub(super) fn median_and_fast_rad(&self) -> [f32; 2] {
        if self.signed.iter().all(|&n| n == 0) {
            return [0.0; 2];
        }
        let median = (quantile(&self.signed, 0.5) - 0.5) * 2.0 * RANGE_RAD;
        [median, quantile(&self.amount, 0.95) * RANGE_RAD]
    }
}
