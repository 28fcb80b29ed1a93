//! Weights of the least-squares sums in whole numbers (paper, section 2.1). In: phase shifts. Out: a [`Plan`]. Cost:
//! once per image set.

use std::f64::consts::TAU;

use fringeflow_base::limits::MAX_STEPS;

use crate::phase::shifts::PhaseShifts;

/// Bits of the fraction of a weight. Weights of equally spaced shifts are at most 2/3. So 16 bits hold a weight, and 31
/// bits hold the sums of 16-bit samples.
const WEIGHT_BITS: i32 = 14;
/// Largest sum of the magnitudes of the weights of one sum. It suits 16-bit samples, and no weight of a set that adds
/// up to 0 or 1 then exceeds 1.95.
const MAX_WEIGHT_SUM: f64 = 2.9;

/// Weights of two images in the sums of offset, cosine and sine.
#[derive(Clone, Copy, Default)]
pub(super) struct PairWeights {
    pub(super) offset: [i16; 2],
    pub(super) cosine: [i16; 2],
    pub(super) sine: [i16; 2],
}

/// How the sums are computed, in steps of 2^−bits of a stored value.
pub(super) struct Plan {
    /// Order of the images in the sums. Equally spaced shifts: by rising shift, from the first image.
    pub(super) order: [usize; MAX_STEPS],
    /// Weights of pairs of images in that order. The partner of the last image of an odd number has weight 0.
    pub(super) pairs: [PairWeights; MAX_STEPS / 2],
    /// Cosine and sine of the shifts in that order.
    pub(super) angles: [[f32; 2]; MAX_STEPS],
    pub(super) steps: usize,
    /// Whether the shifts are equally spaced; the angles then begin at 0.
    pub(super) is_even: bool,
    /// Phase of these sums minus the true phase, turns · 65536.
    pub(super) ahead: u16,
    /// Stored values per step of the sums.
    pub(super) value_per_step: f32,
    /// 2^16/2N, rounded up.
    pub(super) half_per_step: u16,
}

impl Plan {
    pub(super) fn new(shifts: &PhaseShifts) -> Self {
        let steps = shifts.steps();
        let (order, begin_rad) = match shifts.even_order() {
            Some(order) => (order, shifts.shifts_rad()[0]),
            None => (std::array::from_fn(|k| k), 0.0),
        };
        let is_even = shifts.even_order().is_some();
        let mut angles_rad = [0.0; MAX_STEPS];
        for (k, angle) in angles_rad.iter_mut().enumerate().take(steps) {
            *angle = if is_even { TAU * k as f64 / steps as f64 } else { shifts.shifts_rad()[k] };
        }
        let weights = shifts.weights_at(&angles_rad[..steps]);
        // Fewer bits if the weights are so large that the sums would overflow.
        let heaviest = weights.iter().map(|w| w.iter().map(|w| w.abs()).sum::<f64>()).fold(1.0, f64::max);
        let bits = WEIGHT_BITS - (heaviest / MAX_WEIGHT_SUM).log2().ceil().max(0.0) as i32;
        let scale = f64::from(bits).exp2();
        let [offset, cosine, sine] =
            [(0, scale), (1, 0.0), (2, 0.0)].map(|(i, sum)| round_weights(&weights[i], scale, sum));
        let mut pairs = [PairWeights::default(); MAX_STEPS / 2];
        for (p, pair) in pairs.iter_mut().enumerate() {
            let of_pair = |w: &[i16; MAX_STEPS]| [w[2 * p], w[2 * p + 1]];
            *pair = PairWeights { offset: of_pair(&offset), cosine: of_pair(&cosine), sine: of_pair(&sine) };
        }
        Self {
            order,
            pairs,
            angles: angles_rad.map(|angle| [angle.cos() as f32, angle.sin() as f32]),
            steps,
            is_even,
            ahead: (begin_rad.rem_euclid(TAU) / TAU * 65536.0).round() as u32 as u16,
            value_per_step: (1.0 / scale) as f32,
            half_per_step: (1_u32 << 16).div_ceil(2 * steps as u32) as u16,
        }
    }
}

/// Rounds weights to whole numbers with exactly the wanted sum; the largest weight takes the rounding error. Because
/// the weights of cosine and sine add up to 0, no offset of the samples leaks into them.
fn round_weights(weights: &[f64], scale: f64, sum: f64) -> [i16; MAX_STEPS] {
    let mut rounded = [0_i16; MAX_STEPS];
    rounded.iter_mut().zip(weights).for_each(|(rounded, weight)| *rounded = (weight * scale).round() as i16);
    let excess = rounded.iter().map(|&w| i64::from(w)).sum::<i64>() - sum as i64;
    if let Some(greatest) = rounded.iter_mut().max_by_key(|w| w.unsigned_abs()) {
        *greatest -= excess as i16;
    }
    rounded
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_weights_are_those_of_the_shifts_and_add_up() {
        let mut sequences: Vec<Vec<f64>> =
            vec![vec![0.0, 0.5, 1.1], vec![0.0, 1.4, 3.3, 4.6], vec![0.1, 0.2, 1.9, 2.0, 2.1]];
        sequences.extend((3..=16).map(|n| (0..n).map(|k| 0.7 + TAU * f64::from(k) / f64::from(n)).collect()));
        for shifts_rad in sequences {
            let shifts = PhaseShifts::new(&shifts_rad).unwrap();
            let plan = Plan::new(&shifts);
            let angles_rad: Vec<f64> =
                plan.angles[..plan.steps].iter().map(|&[cos, sin]| f64::from(sin).atan2(f64::from(cos))).collect();
            let exact = shifts.weights_at(&angles_rad);
            for (k, wanted_sum) in [(0, 1.0), (1, 0.0), (2, 0.0)] {
                let whole = |pair: &PairWeights| [pair.offset, pair.cosine, pair.sine][k];
                let weights: Vec<f64> =
                    plan.pairs.iter().flat_map(whole).map(|w| f64::from(w) * f64::from(plan.value_per_step)).collect();
                assert!((weights.iter().sum::<f64>() - wanted_sum).abs() < 1e-9, "{shifts_rad:?}");
                for (weight, exact) in weights.iter().zip(&exact[k]) {
                    // Rounding; the largest weight also takes the rounding errors of all others.
                    let tolerance = 8.0 * f64::from(plan.value_per_step);
                    assert!((weight - exact).abs() < tolerance, "{shifts_rad:?}: {weight} {exact}");
                }
            }
        }
    }
}
