//! Lanes of several blocks of 32 pixels at once. In, out: one vector per block. Each operation runs for all blocks in
//! turn, so that their chains of dependent operations overlap in the processor.

use fringeflow_simd::{LANES, Lanes};

use crate::phase::sample::Sample;

/// Lanes of `COUNT` blocks, at least one.
#[derive(Clone, Copy)]
pub(super) struct SideBySide<L: Lanes, const COUNT: usize>(pub(super) L);

/// Operations of [`Lanes`] on the words and masks of all blocks.
macro_rules! for_each_block {
    ($($name:ident($($operand:ident: $of:ident),+) -> $result:ident;)+) => {$(
        #[inline(always)]
        pub(super) fn $name(self, $($operand: [L::$of; COUNT]),+) -> [L::$result; COUNT] {
            let mut results = [self.0.$name($($operand[0]),+); COUNT];
            for i in 1..COUNT {
                results[i] = self.0.$name($($operand[i]),+);
            }
            results
        }
    )+};
}

impl<L: Lanes, const COUNT: usize> SideBySide<L, COUNT> {
    for_each_block! {
        add(a: Words, b: Words) -> Words;
        sub(a: Words, b: Words) -> Words;
        abs(a: Words) -> Words;
        max_unsigned(a: Words, b: Words) -> Words;
        min_unsigned(a: Words, b: Words) -> Words;
        times(a: Words, b: Words) -> Words;
        times_high(a: Words, b: Words) -> Words;
        half_up(a: Words) -> Words;
        share_of_bytes(small: Words, large: Words) -> Words;
        is_greater(a: Words, b: Words) -> Mask;
        select(mask: Mask, yes: Words, no: Words) -> Words;
    }

    /// The same word in all lanes.
    #[inline(always)]
    pub(super) fn word(self, value: i16) -> [L::Words; COUNT] {
        [self.0.word(value); COUNT]
    }

    /// Samples as words.
    #[inline(always)]
    pub(super) fn words<S: Sample>(self, samples: [&[S; LANES]; COUNT]) -> [L::Words; COUNT] {
        let mut words = self.word(0);
        for i in 0..COUNT {
            words[i] = S::words(self.0, samples[i]);
        }
        words
    }

    /// a·2^BITS.
    #[inline(always)]
    pub(super) fn shift_left<const BITS: u32>(self, a: [L::Words; COUNT]) -> [L::Words; COUNT] {
        let mut results = a;
        for result in &mut results {
            *result = self.0.shift_left::<BITS>(*result);
        }
        results
    }
}
