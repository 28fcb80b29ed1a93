//! The linear fit of 32 pixels. In: samples. Out: A and z of the phase, and the weighted products of z and z' that show
//! the motion. Cost: eight multiply-adds per sample, and one more for each further residual.
//!
//! ```text
//! for each image i:  sums += weights[i] · grey level          A, z, z', what only A' explains, first two residuals
//! squares = (what only A' explains)² + Σ (further residual)²  what no motion explains: an edge
//! weight = half / (half + squares), half = (0.1·|z|)²         0 for dark pixels, 1e-3 of it for saturated ones
//! moments = weight · (|z|², z², Im(z'·z*), z'·z)
//! ```

use fringeflow_base::limits::MAX_IMAGES;
use fringeflow_simd::{LANES, Lanes, first_lanes};

use crate::phase::Validity;
use crate::phase::sample::Sample;

use super::cells::Moments;
use super::fit::{IN_SUMS, MotionFit, SUMS};
use super::images::Images;

/// Fitted values of 32 pixels, grey levels.
#[derive(Clone, Debug, Default)]
pub(super) struct Fitted {
    /// Offset A.
    pub(super) offset: [f32; LANES],
    /// z of the fit for the phase, including ripple.
    pub(super) z: [[f32; LANES]; 2],
    /// Pixels with a saturated sample: bit k for pixel k.
    pub(super) saturated: u32,
}

impl Fitted {
    /// Fits `count` pixels of a row, from `pixel` on, and returns their moments; the others get no weight. Stores their
    /// residuals. `greys` is scratch memory.
    #[inline(always)]
    pub(super) fn fit<L: Lanes, S: Sample>(
        &mut self,
        lanes: L,
        images: &Images<'_, S>,
        fit: &MotionFit,
        validity: &Validity,
        [pixel, count]: [usize; 2],
        residuals: &mut [[f32; LANES]],
        greys: &mut [[f32; LANES]; MAX_IMAGES],
    ) -> Moments<L> {
        let l = lanes;
        let (mut sums, mut greatest) = ([l.real(0.0); SUMS], l.word(0));
        for (i, weights) in fit.weights.iter().enumerate() {
            let grey = images.greys(l, i, [pixel, count], &mut greatest);
            if fit.residuals.len() > IN_SUMS {
                l.store_reals(grey, &mut greys[i]);
            }
            let mut k = 0;
            while k < SUMS {
                sums[k] = l.add_real(sums[k], l.times_real(grey, l.real(weights[k])));
                k += 1;
            }
        }
        let [offset, re, im, re_slope, im_slope, trend, first, second] = sums;
        let (of_slope, further) = residuals.split_at_mut(IN_SUMS);
        l.store_reals(first, &mut of_slope[0]);
        l.store_reals(second, &mut of_slope[1]);
        // Squared residual of the fit without A'. Most windows have no further residuals.
        let mut squares = l.times_real(trend, trend);
        for (weights, further) in fit.residuals[IN_SUMS..].iter().zip(further) {
            let mut residual = l.real(0.0);
            for (grey, &weight) in greys.iter().zip(weights) {
                residual = l.add_real(residual, l.times_real(l.load_reals(grey), l.real(weight)));
            }
            l.store_reals(residual, further);
            squares = l.add_real(squares, l.times_real(residual, residual));
        }
        let saturated = images.saturates(l, greatest);
        let weight = motion_weight(l, [re, im], squares, saturated, validity);
        let used = l.mask(first_lanes(count));
        let weight = l.select_real(used, weight, l.real(0.0));
        self.saturated = l.bits(l.and(saturated, used));
        l.store_reals(offset, &mut self.offset);
        let [trend_in_re, trend_in_im] = fit.trend_in_z;
        l.store_reals(l.add_real(re, l.times_real(l.real(trend_in_re), trend)), &mut self.z[0]);
        l.store_reals(l.add_real(im, l.times_real(l.real(trend_in_im), trend)), &mut self.z[1]);
        // Weighted products.
        let (weighted_re, weighted_im) = (l.times_real(weight, re), l.times_real(weight, im));
        let (re_re, im_im) = (l.times_real(weighted_re, re), l.times_real(weighted_im, im));
        let re_im = l.times_real(weighted_re, im);
        let (forth, back) = (l.times_real(weighted_re, im_slope), l.times_real(weighted_im, re_slope));
        Moments {
            power: l.add_real(re_re, im_im),
            square: [l.sub_real(re_re, im_im), l.add_real(re_im, re_im)],
            slope: l.sub_real(forth, back),
            product: [
                l.sub_real(l.times_real(weighted_re, re_slope), l.times_real(weighted_im, im_slope)),
                l.add_real(forth, back),
            ],
        }
    }
}

/// Weight of pixels in the motion, from z and the squared residual that no motion explains.
#[inline(always)]
fn motion_weight<L: Lanes>(
    lanes: L,
    [re, im]: [L::Reals; 2],
    squares: L::Reals,
    saturated: L::Mask,
    validity: &Validity,
) -> L::Reals {
    /// Residual ÷ modulation at which the weight is one half.
    const HALF_WEIGHT_SHARE: f32 = 0.1;
    /// Clipping distorts z' more than z. So saturated pixels matter only if there are no others.
    const SATURATED_WEIGHT: f32 = 1e-3;
    let l = lanes;
    let least = validity.min_modulation_grey * validity.min_modulation_grey;
    let square = l.add_real(l.times_real(re, re), l.times_real(im, im));
    let half = l.times_real(l.real(HALF_WEIGHT_SHARE * HALF_WEIGHT_SHARE), square);
    let trusted = l.select_real(saturated, l.real(SATURATED_WEIGHT), l.real(1.0));
    let weight = l.over_real(l.times_real(trusted, half), l.add_real(half, squares));
    l.select_real(l.is_at_least_real(square, l.real(least)), weight, l.real(0.0))
}
