//! Decoder for equally spaced 8-bit samples: weighted sums, the bytes of four images at a time. Cost: one byte
//! multiply-add per four images for each sum.
//!
//! ```text
//! gather the bytes of four images side by side; keep the largest sample
//! for each block: cosine, sine = weighted sums; sum = Σ I, squares = Σ I²     whole numbers
//!     mean = sum / N, rounded
//!     the pixel misfits if N·squares − sum² exceeds the part of the sinusoid by too much    never with three images
//! for all blocks: phase, modulation = angle and length of (cosine, sine)      octant
//! ```

use fringeflow_base::limits::MIN_STEPS;
use fringeflow_simd::{FourWeights, LANES, Lanes};

use crate::phase::sample::Sample;

use super::block::{Block, BlockDecoder};
use super::octant::{Direction, angle, hypotenuse};
use super::plan::{PairWeights, Plan};
use super::side_by_side::SideBySide;
use super::validity::Limits;

/// `FOURS` groups of four images; the last may be incomplete. A single group means three images, which have no
/// residual.
pub(super) struct EvenSteps<const FOURS: usize> {
    cosine: [FourWeights; FOURS],
    sine: [FourWeights; FOURS],
    ahead: u16,
    steps: usize,
    half_per_step: u16,
    /// Steps of the sums in steps of 1/256 grey level.
    steps_256: f32,
    /// Largest N²·variance of the samples, relative to the squared sums.
    max_variance: f32,
}

impl<const FOURS: usize> EvenSteps<FOURS> {
    pub(super) fn new(plan: &Plan, limits: &Limits) -> Self {
        let weights = |part: fn(&PairWeights) -> [i16; 2]| {
            std::array::from_fn(|k| {
                let ([a, b], [c, d]) = (part(&plan.pairs[2 * k]), part(&plan.pairs[2 * k + 1]));
                FourWeights::new([a, b, c, d])
            })
        };
        let steps = plan.steps as f32;
        let share_square = limits.max_share * limits.max_share * (plan.steps - MIN_STEPS) as f32;
        let value_square = plan.value_per_step * plan.value_per_step;
        Self {
            cosine: weights(|pair| pair.cosine),
            sine: weights(|pair| pair.sine),
            ahead: plan.ahead,
            steps: plan.steps,
            half_per_step: plan.half_per_step,
            steps_256: 256.0 * (plan.value_per_step * limits.grey_per_value),
            max_variance: steps * (0.5 * steps + share_square) * value_square,
        }
    }
}

impl<S: Sample, const FOURS: usize> BlockDecoder<S> for EvenSteps<FOURS> {
    const IS_CHAIN: bool = true;

    #[inline(always)]
    fn decode<'a, L: Lanes, const COUNT: usize>(
        &self,
        blocks: SideBySide<L, COUNT>,
        samples_of: impl Fn(usize) -> [&'a [S; LANES]; COUNT],
    ) -> [Block<L>; COUNT] {
        let l = blocks.0;
        // Gather the bytes of four images side by side; missing images are zero.
        let none = l.bytes(&[0; LANES]);
        let mut greatest = [none; COUNT];
        let mut fours = [[l.fours([none; 4]); FOURS]; COUNT];
        for k in 0..FOURS {
            let mut bytes = [[none; 4]; COUNT];
            for image in 4 * k..4 * k + 4 {
                if image < self.steps {
                    let samples = samples_of(image);
                    for i in 0..COUNT {
                        bytes[i][image % 4] = S::bytes(l, samples[i]);
                        greatest[i] = l.max_bytes(greatest[i], bytes[i][image % 4]);
                    }
                }
            }
            for i in 0..COUNT {
                fours[i][k] = l.fours(bytes[i]);
            }
        }
        // Weighted sums, octant of (cosine, sine), mean and residual of each block.
        let no = [l.is_greater(l.word(0), l.word(0)); COUNT];
        let (mut share, mut large_256, mut mean) = (blocks.word(0), blocks.word(0), blocks.word(0));
        let mut direction = Direction { swapped: no, left: no, below: no };
        let mut misfits = no;
        for i in 0..COUNT {
            let (cosine, sine) = (l.weigh(&fours[i], &self.cosine), l.weigh(&fours[i], &self.sine));
            let [sum, squares] = l.sums_and_squares(&fours[i]);
            let (cosine_f, sine_f) = (l.floats(cosine), l.floats(sine));
            let (small, large) = (l.min_amount(cosine_f, sine_f), l.max_amount(cosine_f, sine_f));
            direction.swapped[i] = l.is_greater_float(large, l.abs_float(cosine_f));
            direction.left[i] = l.is_negative(cosine);
            direction.below[i] = l.is_negative(sine);
            share[i] = l.share(small, large);
            large_256[i] = l.narrow(l.longs(l.times_float(large, l.float(self.steps_256))));
            // The mean, rounded: (2·sum + N)/2N, rounded down. With 13 and 15 steps a mean ending in 0.46 or more may
            // be rounded up.
            let twice = l.add(l.shift_left::<1>(l.narrow(sum)), l.word(self.steps as i16));
            mean[i] = l.times_high(twice, l.word(self.half_per_step as i16));
            if FOURS > 1 {
                // N·Σ I² − (Σ I)² is N²·variance, exactly. The sinusoid contributes N²/2·B²; the rest is residual.
                let (sum, all) = (l.floats(sum), l.times_float(l.floats(squares), l.float(self.steps as f32)));
                let about_mean = l.sub_float(all, l.times_float(sum, sum));
                let power = l.add_float(l.times_float(cosine_f, cosine_f), l.times_float(sine_f, sine_f));
                misfits[i] = l.is_greater_float(about_mean, l.times_float(power, l.float(self.max_variance)));
            }
        }
        let (phase, square) = angle(blocks, share, &direction, self.ahead);
        let modulation = hypotenuse(blocks, large_256, square);
        let block = |i| Block {
            phase: phase[i],
            modulation: modulation[i],
            mean: mean[i],
            misfits: misfits[i],
            greatest: l.widen_bytes(greatest[i]),
        };
        std::array::from_fn(block)
    }
}
