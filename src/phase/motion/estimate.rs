//! Motion of the cells. In: moments. Out: phase motion, rad per image. Cost: some three hundred operations per cell.
//!
//! With the true z of a cell, the fit yields `w = H·z + G·z*` in place of z and `w' = H'·z + S·z*` in place of z', where
//! H, G, H' and S depend on the motion ε. If ε is roughly known, `Σ Im((w' − S·z*)·(H·z)*) / Σ |H·z|²` is the slope
//! `Im(H'/H)`, and a table turns it into ε. Both sums follow from the moments of w and w':
//!
//! ```text
//! ε = table(Σ Im(w'·w*) / Σ |w|²)                               as if there were no ripple
//! twice, with the responses H, G and S at ε, D = |H|² − |G|², V = |H|²·(H·Σw²* − 2·G*·Σ|w|²) + (H·G)*·G*·Σw²:
//!     ε = table( (D·Im(|H|²·Σw'w* − (H·G)*·Σw'w) − Im(S·V)) / (|H|²·((|H|² + |G|²)·Σ|w|² − 2·Re(H·G·Σw²*))) )
//! ```

use fringeflow_simd::Lanes;

use super::cells::Moments;
use super::fit::{MOTIONS, MotionFit, TABLE};
use super::ripple::{Complexes, MIN_CONTRAST, Turns, product};

/// Refinements of the motion.
const ROUNDS: usize = 2;

/// Motion of cells, rad per image, and a mask of the cells where it is known: not too fast, and with moments.
#[inline(always)]
pub(super) fn motion<L: Lanes>(
    lanes: L,
    fit: &MotionFit,
    moments: &Moments<L>,
    turns: &mut Turns<L>,
) -> (L::Reals, L::Mask) {
    let l = lanes;
    let mut known = l.is_greater_real(moments.power, l.real(0.0));
    let mut motion_rad = l.real(0.0);
    if l.bits(known) == 0 {
        return (motion_rad, known);
    }
    let (mut slope, mut power) = (moments.slope, moments.power);
    let mut round = 0;
    loop {
        let (found_rad, is_slow) = from_table(l, fit, l.over_real(slope, power));
        known = l.and(known, is_slow);
        motion_rad = l.select_real(known, found_rad, l.real(0.0));
        if round == ROUNDS {
            return (motion_rad, known);
        }
        turns.set(l, fit.images(), motion_rad);
        let responses = turns.sums(l, [&fit.rough.direct, &fit.rough.ripple, &fit.slope_ripple]);
        let has_contrast;
        ([slope, power], has_contrast) = without_ripple(l, moments, responses);
        known = l.and(known, has_contrast);
        round += 1;
    }
}

/// Numerator and denominator of the slope without ripple, and a mask of the cells where z can be told from its ripple.
#[inline(always)]
fn without_ripple<L: Lanes>(
    lanes: L,
    moments: &Moments<L>,
    [direct, ripple, slope_ripple]: [Complexes<L>; 3],
) -> ([L::Reals; 2], L::Mask) {
    let l = lanes;
    let Moments { power, square: [square_re, square_im], slope, product: [product_re, product_im] } = *moments;
    let ([a, b], [c, d], [e, f]) = (direct, ripple, slope_ripple);
    let direct_square = norm(l, direct);
    let ripple_square = norm(l, ripple);
    let contrast = l.sub_real(direct_square, ripple_square);
    let [p, q] = product(l, direct, ripple);
    // (|H|² + |G|²)·Σ|w|² − 2·Re(H·G·Σw²*).
    let crossed = l.add_real(l.times_real(p, square_re), l.times_real(q, square_im));
    let plain = l.times_real(l.add_real(direct_square, ripple_square), power);
    let denominator = l.times_real(direct_square, l.sub_real(plain, l.add_real(crossed, crossed)));
    // Im(|H|²·Σw'w* − (H·G)*·Σw'w).
    let turned = l.sub_real(l.times_real(p, product_im), l.times_real(q, product_re));
    let kept = l.times_real(contrast, l.sub_real(l.times_real(direct_square, slope), turned));
    // H·Σw²* − 2·G*·Σ|w|², and G*·Σw².
    let twice = l.add_real(power, power);
    let re = l.add_real(l.times_real(a, square_re), l.times_real(b, square_im));
    let im = l.sub_real(l.times_real(b, square_re), l.times_real(a, square_im));
    let re = l.times_real(direct_square, l.sub_real(re, l.times_real(twice, c)));
    let im = l.times_real(direct_square, l.add_real(im, l.times_real(twice, d)));
    let x = l.add_real(l.times_real(c, square_re), l.times_real(d, square_im));
    let y = l.sub_real(l.times_real(c, square_im), l.times_real(d, square_re));
    let re = l.add_real(re, l.add_real(l.times_real(p, x), l.times_real(q, y)));
    let im = l.add_real(im, l.sub_real(l.times_real(p, y), l.times_real(q, x)));
    let ripple = l.add_real(l.times_real(e, im), l.times_real(f, re));
    ([l.sub_real(kept, ripple), denominator], l.is_at_least_real(contrast, l.real(MIN_CONTRAST)))
}

/// |z|².
#[inline(always)]
fn norm<L: Lanes>(lanes: L, [re, im]: Complexes<L>) -> L::Reals {
    lanes.add_real(lanes.times_real(re, re), lanes.times_real(im, im))
}

/// Motion of slopes, by linear interpolation in the table of their sign, and a mask of the slopes in its range.
#[inline(always)]
fn from_table<L: Lanes>(lanes: L, fit: &MotionFit, slope: L::Reals) -> (L::Reals, L::Mask) {
    let l = lanes;
    let is_ahead = l.is_at_least_real(slope, l.real(0.0));
    let limit = l.select_real(is_ahead, l.real(fit.limits[0]), l.real(fit.limits[1]));
    let place = l.times_real(l.over_real(l.abs_real(slope), limit), l.real(TABLE as f32));
    let below = l.truncate(l.min_real(place, l.real(TABLE as f32)));
    let entry = l.select_real(is_ahead, below, l.add_real(below, l.real(MOTIONS as f32)));
    let low = l.look_up_real(&fit.motions_rad, entry);
    let high = l.look_up_real(&fit.motions_rad[1..], entry);
    let motion_rad = l.add_real(low, l.times_real(l.sub_real(high, low), l.sub_real(place, below)));
    let motion_rad = l.select_real(is_ahead, motion_rad, l.sub_real(l.real(0.0), motion_rad));
    (motion_rad, l.is_greater_real(l.real(TABLE as f32), below))
}
