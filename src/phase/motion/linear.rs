//! The linear fit of a pixel: sums of its samples.

use fringeflow_base::limits::MAX_IMAGES;
use fringeflow_simd::{LANES, Lanes, first_lanes};

use crate::phase::Validity;
use crate::phase::sample::Sample;

use super::fit::{MotionFit, SUMS};
use super::images::Images;

/// What the fit leaves at 32 pixels, grey levels.
#[derive(Clone, Debug)]
pub(super) struct Fitted {
    /// Offset A.
    pub(super) offset: [f32; LANES],
    /// z and z' as they are fitted without A', ripple and all.
    pub(super) z: [[f32; LANES]; 2],
    pub(super) slope: [[f32; LANES]; 2],
    /// z as it is fitted with A', ripple and all.
    pub(super) phase_z: [[f32; LANES]; 2],
    /// How much a pixel says of the motion, 0 to 1: those at edges, whose images show two surfaces, say little.
    pub(super) weight: [f32; LANES],
    /// Whether any of them says something.
    pub(super) tells_motion: bool,
    /// Which have a saturated sample: pixel k is bit k.
    pub(super) saturated: u32,
}

impl Default for Fitted {
    fn default() -> Self {
        let plane = [0.0; LANES];
        Self {
            offset: plane,
            z: [plane; 2],
            slope: [plane; 2],
            phase_z: [plane; 2],
            weight: plane,
            tells_motion: false,
            saturated: 0,
        }
    }
}

impl Fitted {
    /// Fits `count` pixels of a row, from `pixel` on; the others say nothing. `greys` is scratch memory for their grey levels.
    #[inline(always)]
    pub(super) fn fit<L: Lanes, S: Sample>(
        &mut self,
        lanes: L,
        images: &Images<'_, S>,
        fit: &MotionFit,
        validity: &Validity,
        [pixel, count]: [usize; 2],
        greys: &mut [[f32; LANES]; MAX_IMAGES],
    ) {
        let l = lanes;
        let (mut sums, mut greatest) = ([l.real(0.0); SUMS], l.word(0));
        for (i, weights) in fit.weights.iter().enumerate() {
            let grey = images.greys(l, i, [pixel, count], &mut greatest);
            if !fit.residuals.is_empty() {
                l.store_reals(grey, &mut greys[i]);
            }
            let mut k = 0;
            while k < SUMS {
                sums[k] = l.add_real(sums[k], l.times_real(grey, l.real(weights[k])));
                k += 1;
            }
        }
        let [offset, re, im, re_slope, im_slope, phase_re, phase_im, left] = sums;
        let mut squares = l.times_real(left, left);
        for weights in &fit.residuals {
            let mut left = l.real(0.0);
            for (grey, &weight) in greys.iter().zip(weights) {
                left = l.add_real(left, l.times_real(l.load_reals(grey), l.real(weight)));
            }
            squares = l.add_real(squares, l.times_real(left, left));
        }
        let saturated = images.saturates(l, greatest);
        let weight = weight(l, [re, im], squares, saturated, validity);
        let used = l.mask(first_lanes(count));
        let weight = l.select_real(used, weight, l.real(0.0));
        self.tells_motion = l.bits(l.is_greater_real(weight, l.real(0.0))) != 0;
        self.saturated = l.bits(l.and(saturated, used));
        l.store_reals(offset, &mut self.offset);
        l.store_reals(re, &mut self.z[0]);
        l.store_reals(im, &mut self.z[1]);
        l.store_reals(re_slope, &mut self.slope[0]);
        l.store_reals(im_slope, &mut self.slope[1]);
        l.store_reals(phase_re, &mut self.phase_z[0]);
        l.store_reals(phase_im, &mut self.phase_z[1]);
        l.store_reals(weight, &mut self.weight);
    }
}

/// How much pixels say of the motion, by z and the squares of what no motion explains.
#[inline(always)]
fn weight<L: Lanes>(
    lanes: L,
    [re, im]: [L::Reals; 2],
    squares: L::Reals,
    saturated: L::Mask,
    validity: &Validity,
) -> L::Reals {
    /// Residual ÷ modulation at which the weight has fallen to a half.
    const HALF_WEIGHT_SHARE: f32 = 0.1;
    /// Clipping distorts z' more than z: such pixels are asked where there are no others.
    const SATURATED_WEIGHT: f32 = 1e-3;
    let l = lanes;
    let least = validity.min_modulation_grey * validity.min_modulation_grey;
    let square = l.add_real(l.times_real(re, re), l.times_real(im, im));
    let half = l.times_real(l.real(HALF_WEIGHT_SHARE * HALF_WEIGHT_SHARE), square);
    let trusted = l.select_real(saturated, l.real(SATURATED_WEIGHT), l.real(1.0));
    let weight = l.over_real(l.times_real(trusted, half), l.add_real(half, squares));
    l.select_real(l.is_at_least_real(square, l.real(least)), weight, l.real(0.0))
}
