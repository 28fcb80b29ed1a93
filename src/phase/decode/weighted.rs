//! Decoder for any shifts and sample size: weighted sums, two images at a time, then the residual image by image. Cost:
//! N multiply-adds for each of three sums, and six operations per image for the residual.
//!
//! ```text
//! for each two images a, b:  cosine, sine, offset += weights · (a, b)         whole numbers
//! phase, modulation = angle and length of (cosine, sine)                      octant
//! mean = offset without the bias of the samples, rounded
//! for each image k:  squares += (I_k − offset − cosine·cos s_k + sine·sin s_k)²
//! the pixel misfits if squares > max_share² · (N − 3) · (cosine² + sine²)     never with three images
//! ```

use fringeflow_base::limits::MIN_STEPS;
use fringeflow_simd::{LANES, Lanes};

use crate::phase::sample::Sample;

use super::block::{Block, BlockDecoder};
use super::octant::{Direction, angle, hypotenuse};
use super::plan::Plan;
use super::side_by_side::SideBySide;
use super::validity::Limits;

/// Decodes by the weights of a plan.
pub(super) struct Weighted<'a> {
    pub(super) plan: &'a Plan,
    pub(super) limits: &'a Limits,
}

impl<S: Sample> BlockDecoder<S> for Weighted<'_> {
    const IS_CHAIN: bool = false;

    #[inline(always)]
    fn decode<'a, L: Lanes, const COUNT: usize>(
        &self,
        SideBySide(lanes): SideBySide<L, COUNT>,
        samples_of: impl Fn(usize) -> [&'a [S; LANES]; COUNT],
    ) -> [Block<L>; COUNT] {
        let mut blocks = [self.decode_one(lanes, |k| samples_of(k)[0]); COUNT];
        for i in 1..COUNT {
            blocks[i] = self.decode_one(lanes, |k| samples_of(k)[i]);
        }
        blocks
    }
}

impl Weighted<'_> {
    #[inline(always)]
    fn decode_one<'a, L: Lanes, S: Sample>(&self, lanes: L, samples_of: impl Fn(usize) -> &'a [S; LANES]) -> Block<L> {
        let (plan, limits, l) = (self.plan, self.limits, lanes);
        let zero = l.long(0);
        let (mut offset, mut cosine, mut sine) = (zero, zero, zero);
        let mut greatest = l.word(0);
        for p in 0..plan.steps.div_ceil(2) {
            let weights = &plan.pairs[p];
            let a = S::words(l, samples_of(2 * p));
            // The partner of the last image of an odd number is zero.
            let b = if 2 * p + 1 < plan.steps { S::words(l, samples_of(2 * p + 1)) } else { l.word(S::BIAS) };
            greatest = l.max_unsigned(greatest, l.max_unsigned(S::unsigned(l, a), S::unsigned(l, b)));
            cosine = l.add_weighted(cosine, a, b, weights.cosine);
            sine = l.add_weighted(sine, a, b, weights.sine);
            offset = l.add_weighted(offset, a, b, weights.offset);
        }
        let (cosine_f, sine_f) = (l.floats(cosine), l.floats(sine));
        let (abs_cosine, abs_sine) = (l.abs_float(cosine_f), l.abs_float(sine_f));
        let (small, large) = (l.min_float(abs_cosine, abs_sine), l.max_float(abs_cosine, abs_sine));
        let direction = Direction {
            swapped: [l.is_greater_float(abs_sine, abs_cosine)],
            left: [l.is_negative(cosine)],
            below: [l.is_negative(sine)],
        };
        let one = SideBySide::<L, 1>(l);
        let ([phase], square) = angle(one, [l.share(small, large)], &direction, plan.ahead);
        let grey_per_step = plan.value_per_step * limits.grey_per_value;
        let steps_256 = l.times_float(large, l.float(256.0 * grey_per_step));
        let [modulation] = hypotenuse(one, [l.narrow(l.longs(steps_256))], square);
        // The weights of the offset add up to 1, so the mean still contains the bias of the words.
        let bias_grey = -f32::from(S::BIAS) * limits.grey_per_value;
        let mean = l.times_float(l.floats(offset), l.float(grey_per_step));
        let mean = l.narrow(l.longs(l.min_float(l.add_float(mean, l.float(bias_grey + 0.5)), l.float(255.0))));
        let power = l.add_float(l.times_float(cosine_f, cosine_f), l.times_float(sine_f, sine_f));
        let freedom = (plan.steps - MIN_STEPS) as f32;
        let share_square = limits.max_share * limits.max_share * freedom;
        let value_square = plan.value_per_step * plan.value_per_step;
        let misfits = if plan.steps == MIN_STEPS {
            l.is_greater(l.word(0), l.word(0))
        } else {
            let minus = l.float(-plan.value_per_step);
            let offset = l.times_float(l.floats(offset), minus);
            let (cosine_f, sine_f) = (l.times_float(cosine_f, minus), l.times_float(sine_f, minus));
            // Residual = value − offset − C·cos s + S·sin s. The bias of the words cancels between value and offset.
            let mut squares = l.float(0.0);
            for k in 0..plan.steps {
                let [cos, sin] = plan.angles[k];
                let value = l.floats(l.widen(S::words(l, samples_of(k))));
                let fitted = l.add_float(l.times_float(cosine_f, l.float(cos)), l.times_float(sine_f, l.float(-sin)));
                let residual = l.add_float(l.add_float(value, offset), fitted);
                squares = l.add_float(squares, l.times_float(residual, residual));
            }
            l.is_greater_float(squares, l.times_float(power, l.float(share_square * value_square)))
        };
        Block { phase, modulation, mean, misfits, greatest }
    }
}
