//! The motion of every pixel: the slopes of the fits over 5 × 5 pixels, of which edges say little.

use fringeflow_simd::{LANES, Lanes};

use super::fit::{MOTIONS, MotionFit, TABLE};
use super::linear::Fitted;
use super::moved::{Complexes, product, without_ripple};

/// Pixels to either side that are asked.
pub(super) const REACH: usize = 2;
const _: () = assert!(REACH == 2, "`around` adds five");

/// Weighted `Im(z'·z*)` and `|z|²` of 32 pixels, without ripple: their quotient over some pixels is the motion.
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
    /// Those of fitted pixels, by the responses H, G and that of z' to the conjugate of z at their motion, which comes on top of
    /// the one that is followed.
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
        // z' is freed of its own ripple, z is what the fit gives of it: both are then those of a single turning z.
        let [re, im] = product(l, direct, [x, y]);
        let [c, d] = slope_ripple;
        let re_ripple = l.add_real(l.times_real(c, x), l.times_real(d, y));
        let im_ripple = l.sub_real(l.times_real(d, x), l.times_real(c, y));
        let re_clean = l.sub_real(l.load_reals(&fitted.slope[0]), re_ripple);
        let im_clean = l.sub_real(l.load_reals(&fitted.slope[1]), im_ripple);
        let weight = l.select_real(l.and(known, has_contrast), l.load_reals(&fitted.weight), l.real(0.0));
        let power = l.times_real(weight, l.add_real(l.times_real(re, re), l.times_real(im, im)));
        let slope = l.times_real(weight, l.sub_real(l.times_real(im_clean, re), l.times_real(re_clean, im)));
        // Neighbours may follow another motion: what they have in common is by how much it is not the expected one.
        let slope = l.sub_real(slope, l.times_real(power, l.real(expected_rad)));
        l.store_reals(power, &mut self.power);
        l.store_reals(slope, &mut self.slope);
    }
}

/// Sums of the parts of some rows, with room to either side.
#[derive(Clone, Debug, Default)]
pub(super) struct ColumnSums {
    slopes: Vec<f32>,
    powers: Vec<f32>,
}

impl ColumnSums {
    /// Makes room for rows of so many blocks.
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

    /// Motion of the pixels of a block on top of the one that is followed, rad an image; NaN where nothing tells it, or where it
    /// is too fast.
    #[inline(always)]
    pub(super) fn motion_rad<L: Lanes>(
        &self,
        lanes: L,
        (fit, expected_rad): (&MotionFit, f32),
        block: usize,
    ) -> L::Reals {
        let l = lanes;
        let (slope, power) = (around(l, &self.slopes, block), around(l, &self.powers, block));
        let nothing = l.real(f32::NAN);
        let is_told = l.is_greater_real(power, l.real(0.0));
        if l.bits(is_told) == 0 {
            return nothing;
        }
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
        let is_told = l.and(is_told, l.is_greater_real(l.real(TABLE as f32), below));
        l.select_real(is_told, motion, nothing)
    }
}

/// Sums over the pixels around those of a block.
#[inline(always)]
fn around<L: Lanes>(lanes: L, values: &[f32], block: usize) -> L::Reals {
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
