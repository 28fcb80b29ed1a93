//! Decoder for four equally spaced 8-bit samples: cosine and sine are differences of two samples (paper, section 2.1:
//! 4-phase algorithm). Cost: some forty operations on 16-bit words.
//!
//! ```text
//! cosine = a − c, sine = d − b                                 a, b, c, d: the samples by rising shift
//! mean = (a + b + c + d) / 4, rounded
//! phase, modulation = angle and length of (cosine, sine) / 2   octant
//! the pixel misfits if |a − b + c − d| / 2 > max_share · modulation
//! ```

use fringeflow_simd::{LANES, Lanes};

use crate::phase::sample::Sample;

use super::block::{Block, BlockDecoder};
use super::octant::{Direction, angle, hypotenuse};
use super::plan::Plan;
use super::side_by_side::SideBySide;
use super::validity::Limits;

/// `IS_LOOSE`: whether the largest residual is at least the modulation.
pub(super) struct FourStep<const IS_LOOSE: bool> {
    ahead: u16,
    /// Factor, a fraction of 2^15, of the residual if `IS_LOOSE`, otherwise of the modulation: it must not exceed 1.
    share: i16,
}

impl<const IS_LOOSE: bool> FourStep<IS_LOOSE> {
    pub(super) fn new(plan: &Plan, limits: &Limits) -> Self {
        let share = if IS_LOOSE { 32767.0 / limits.max_share } else { 32767.0 * limits.max_share };
        Self { ahead: plan.ahead, share: share as i16 }
    }
}

impl<S: Sample, const IS_LOOSE: bool> BlockDecoder<S> for FourStep<IS_LOOSE> {
    const IS_CHAIN: bool = true;

    #[inline(always)]
    fn decode<'a, L: Lanes, const COUNT: usize>(
        &self,
        blocks: SideBySide<L, COUNT>,
        samples_of: impl Fn(usize) -> [&'a [S; LANES]; COUNT],
    ) -> [Block<L>; COUNT] {
        let s = blocks;
        let (a, b, c, d) =
            (s.words(samples_of(0)), s.words(samples_of(1)), s.words(samples_of(2)), s.words(samples_of(3)));
        let (cosine, sine) = (s.sub(a, c), s.sub(d, b));
        let (even, odd) = (s.add(a, c), s.add(b, d));
        // A quarter of the sum, rounded.
        let mean = s.times(s.add(even, odd), s.word(1 << 13));
        let greatest = s.max_unsigned(s.max_unsigned(a, b), s.max_unsigned(c, d));
        let (abs_cosine, abs_sine) = (s.abs(cosine), s.abs(sine));
        let (small, large) = (s.min_unsigned(abs_cosine, abs_sine), s.max_unsigned(abs_cosine, abs_sine));
        let direction = Direction {
            swapped: s.is_greater(abs_sine, abs_cosine),
            left: s.is_greater(s.word(0), cosine),
            below: s.is_greater(s.word(0), sine),
        };
        let (phase, square) = angle(s, s.share_of_bytes(small, large), &direction, self.ahead);
        // C = (a − c)/2, in steps of 1/256 grey level: 256/2 = 2^7.
        let modulation = hypotenuse(s, s.shift_left::<7>(large), square);
        // The residual (a − b + c − d)/2, in steps of 1/128 grey level. Both sides of the comparison are signed words.
        let residual = s.shift_left::<6>(s.abs(s.sub(even, odd)));
        let misfits = if IS_LOOSE {
            s.is_greater(s.times(residual, s.word(self.share)), modulation)
        } else {
            s.is_greater(residual, s.times(modulation, s.word(self.share)))
        };
        let block = |i| Block {
            phase: phase[i],
            modulation: modulation[i],
            mean: mean[i],
            misfits: misfits[i],
            greatest: greatest[i],
        };
        std::array::from_fn(block)
    }
}
