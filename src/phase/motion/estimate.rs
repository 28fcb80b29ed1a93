//! Motion of every pixel, averaged over 5 × 5 pixels. In: fits. Out: phase motion, rad per image. Cost: some fifty
//! operations per pixel.
//!
//! The motion is `Σ w·Im(z'·z*) / Σ w·|z|²`, corrected by a table for large motions. Pixels at edges have little weight
//! w.

use fringeflow_simd::{LANES, Lanes};

use super::fit::{MOTIONS, MotionFit, TABLE};
use super::linear::Fitted;
use super::ripple::{Complexes, product, without_ripple};

/// Pixels averaged on either side.
pub(super) const REACH: usize = 2;

/// Weighted `Im(z'·z*)` and `|z|²` of 32 pixels, without ripple.
#[derive(Clone, Copy, Debug)]
pub(super) struct MotionParts {
    slope: [f32; LANES],
    power: [f32; LANES],
}

impl Default for MotionParts {
    fn default() -> Self {
        Self { slope: [0.0; LANES], power: [0.0; LANES] }
    }
}

impl MotionParts {
    /// Sets the parts of fitted pixels. The responses at their motion are H, G and that of z' to the conjugate of z.
    #[inline(always)]
    pub(super) fn set<L: Lanes>(
        &mut self,
        lanes: L,
        fitted: &Fitted,
        [direct, ripple, slope_ripple]: [Complexes<L>; 3],
        known: L::Mask,
        expected_rad: f32,
    ) {
        let l = lanes;
        let z = [l.load_reals(&fitted.z[0]), l.load_reals(&fitted.z[1])];
        let ([x, y], has_contrast) = without_ripple(l, [direct, ripple], z);
        // Remove the ripple of z', and use H·z instead of z: both then respond alike to the motion, and only the
        // quotient matters.
        let [re, im] = product(l, direct, [x, y]);
        let [c, d] = slope_ripple;
        let re_ripple = l.add_real(l.times_real(c, x), l.times_real(d, y));
        let im_ripple = l.sub_real(l.times_real(d, x), l.times_real(c, y));
        let re_clean = l.sub_real(l.load_reals(&fitted.slope[0]), re_ripple);
        let im_clean = l.sub_real(l.load_reals(&fitted.slope[1]), im_ripple);
        let weight = l.select_real(l.and(known, has_contrast), l.load_reals(&fitted.weight), l.real(0.0));
        let power = l.times_real(weight, l.add_real(l.times_real(re, re), l.times_real(im, im)));
        let slope = l.times_real(weight, l.sub_real(l.times_real(im_clean, re), l.times_real(re_clean, im)));
        // Neighbours may follow another motion. Only deviations from the expected motion are comparable.
        let slope = l.sub_real(slope, l.times_real(power, l.real(expected_rad)));
        l.store_reals(power, &mut self.power);
        l.store_reals(slope, &mut self.slope);
    }
}

/// Column sums of motion parts over some rows, with `REACH` zeros on either side.
#[derive(Clone, Debug, Default)]
pub(super) struct ColumnSums {
    slopes: Vec<f32>,
    powers: Vec<f32>,
}

impl ColumnSums {
    /// Makes room for rows of `blocks` blocks.
    pub(super) fn resize(&mut self, blocks: usize) {
        for sums in [&mut self.slopes, &mut self.powers] {
            sums.clear();
            sums.resize(blocks * LANES + 2 * REACH, 0.0);
        }
    }

    /// Adds up the parts of rows, each a slice of blocks.
    #[inline(always)]
    pub(super) fn set<L: Lanes>(&mut self, lanes: L, rows: &[&[MotionParts]]) {
        let l = lanes;
        let Some((first, others)) = rows.split_first() else { return };
        let (slopes, _) = self.slopes[REACH..].as_chunks_mut();
        let (powers, _) = self.powers[REACH..].as_chunks_mut();
        for (b, (parts, (slopes, powers))) in first.iter().zip(slopes.iter_mut().zip(powers)).enumerate() {
            let (mut slope, mut power) = (l.load_reals(&parts.slope), l.load_reals(&parts.power));
            for row in others {
                slope = l.add_real(slope, l.load_reals(&row[b].slope));
                power = l.add_real(power, l.load_reals(&row[b].power));
            }
            l.store_reals(slope, slopes);
            l.store_reals(power, powers);
        }
    }

    /// Motion of the pixels of a block beyond the followed motion, rad per image; NaN where it is unknown or too fast.
    #[inline(always)]
    pub(super) fn motion_rad<L: Lanes>(
        &self,
        lanes: L,
        (fit, expected_rad): (&MotionFit, f32),
        block: usize,
    ) -> L::Reals {
        let l = lanes;
        let (slope, power) = (sum_around(l, &self.slopes, block), sum_around(l, &self.powers, block));
        let unknown = l.real(f32::NAN);
        let is_known = l.is_greater_real(power, l.real(0.0));
        if l.bits(is_known) == 0 {
            return unknown;
        }
        // Linear interpolation in the table of the sign of the motion.
        let slope = l.add_real(l.over_real(slope, power), l.real(expected_rad));
        let is_ahead = l.is_at_least_real(slope, l.real(0.0));
        let limit = l.select_real(is_ahead, l.real(fit.limits[0]), l.real(fit.limits[1]));
        let place = l.times_real(l.over_real(l.abs_real(slope), limit), l.real(TABLE as f32));
        let below = l.truncate(l.min_real(place, l.real(TABLE as f32)));
        let entry = l.select_real(is_ahead, below, l.add_real(below, l.real(MOTIONS as f32)));
        let low = l.look_up_real(&fit.motions_rad, entry);
        let high = l.look_up_real(&fit.motions_rad[1..], entry);
        let motion = l.add_real(low, l.times_real(l.sub_real(high, low), l.sub_real(place, below)));
        let motion = l.select_real(is_ahead, motion, l.sub_real(l.real(0.0), motion));
        let is_known = l.and(is_known, l.is_greater_real(l.real(TABLE as f32), below));
        l.select_real(is_known, motion, unknown)
    }
}

/// Sums over the `2 · REACH + 1` columns around each pixel of a block.
#[inline(always)]
fn sum_around<L: Lanes>(lanes: L, values: &[f32], block: usize) -> L::Reals {
    let values = &values[block * LANES..][..LANES + 2 * REACH];
    let mut sum = lanes.real(0.0);
    let mut k = 0;
    while k < 2 * REACH + 1 {
        if let Some(shifted) = values[k..].first_chunk() {
            sum = lanes.add_real(sum, lanes.load_reals(shifted));
        }
        k += 1;
    }
    sum
}
