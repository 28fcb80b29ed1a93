//! Kernels for several instruction sets: written once over [`Lanes`], compiled for each [`Level`], chosen at run time.
//!
//! ```text
//! run(level, kernel) ──► Portable  Kernel::run(Arrays)
//!                    ├─► Avx2      the same, compiled with AVX2
//!                    └─► Avx512    Kernel::run(Avx512)
//! ```
//!
//! All levels compute the same bits: the operations are on integers, or single additions, multiplications and divisions
//! of IEEE 754, never contracted. [`Level::Portable`] is the reference; tests compare every kernel at the other levels
//! with it.
//!
//! ```
//! use fringeflow_simd::{Kernel, LANES, Lanes, Level, run};
//!
//! struct Sum<'a>(&'a [u8; LANES], &'a [u8; LANES]);
//!
//! impl Kernel for Sum<'_> {
//!     type Output = [u16; LANES];
//!
//!     #[inline(always)]
//!     fn run<L: Lanes>(self, lanes: L) -> [u16; LANES] {
//!         let mut sum = [0; LANES];
//!         lanes.store(lanes.add(lanes.words_of_bytes(self.0), lanes.words_of_bytes(self.1)), &mut sum);
//!         sum
//!     }
//! }
//!
//! assert!(Level::in_use().is_available());
//! assert_eq!(run(Level::in_use(), Sum(&[200; LANES], &[100; LANES])), [300; LANES]);
//! ```

/// Adds `#[inline(always)]` to every function, so that each operation takes one line.
macro_rules! inlined {
    ($(fn $name:ident($($argument:tt)*) -> $output:ty $body:block)*) => {
        $(
            #[inline(always)]
            fn $name($($argument)*) -> $output $body
        )*
    };
}

mod arrays;
#[cfg(target_arch = "x86_64")]
mod avx512;
mod dispatch;
mod level;
mod prefetch;

pub use arrays::Arrays;
#[cfg(target_arch = "x86_64")]
pub use avx512::Avx512;
pub use dispatch::{Kernel, run};
pub use level::Level;
pub use prefetch::prefetch;

/// Pixels that a kernel processes together.
pub const LANES: usize = 32;
/// Half of them.
pub const HALF: usize = LANES / 2;
/// Entries of a table, see [`Lanes::table`].
pub const COLUMNS: usize = 2 * LANES;

/// Weights of four images, for [`Lanes::weigh`].
#[derive(Clone, Copy, Default)]
pub struct FourWeights {
    words: [i16; 4],
    /// A weight is 256·high + low. Each field holds one byte of the weight of each of the four images.
    high: i32,
    low: i32,
}

impl FourWeights {
    /// Weights must be less than 2^15 − 128.
    pub fn new(words: [i16; 4]) -> Self {
        let low = words.map(|word| word as i8);
        let high = std::array::from_fn(|k| ((i32::from(words[k]) - i32::from(low[k])) >> 8) as i8 as u8);
        Self { words, high: i32::from_le_bytes(high), low: i32::from_le_bytes(low.map(|byte| byte as u8)) }
    }
}

/// Returns the first `COUNT` values. If there are fewer, the rest is `other`.
#[inline(always)]
pub fn filled<T: Copy, const COUNT: usize>(values: &[T], other: T) -> [T; COUNT] {
    match values.first_chunk() {
        Some(all) => *all,
        None => {
            let mut all = [other; COUNT];
            all[..values.len()].copy_from_slice(values);
            all
        }
    }
}

/// Stores as many of the values as fit into `to`. The counterpart of [`filled`].
#[inline(always)]
pub fn store_first<T: Copy, const COUNT: usize>(values: &[T; COUNT], to: &mut [T]) {
    match to.first_chunk_mut() {
        Some(all) => *all = *values,
        None => to.copy_from_slice(&values[..to.len()]),
    }
}

/// Returns the sum of the lanes: halves are added to each other.
///
/// ```
/// assert_eq!(fringeflow_simd::total(std::array::from_fn(|k| k as f32)), 496.0);
/// ```
#[inline(always)]
pub fn total(mut lanes: [f32; LANES]) -> f32 {
    let mut half = LANES / 2;
    while half > 0 {
        for k in 0..half {
            lanes[k] += lanes[half + k];
        }
        half /= 2;
    }
    lanes[0]
}

/// Returns the mask bits of the first `count` lanes; all bits if `count` is greater than [`LANES`].
#[inline(always)]
pub fn first_lanes(count: usize) -> u32 {
    if count >= LANES { u32::MAX } else { (1 << count) - 1 }
}

/// Vectors of [`LANES`] numbers, one per pixel, and their operations.
///
/// *Words* are 16-bit integers, signed or unsigned as stated for the operation. *Longs* are 32-bit signed integers,
/// *floats* are `f32`. The order of the lanes of longs and floats depends on the level: they are created from words and
/// converted back to words. *Reals* are `f32` in the order of memory, for planes of them.
pub trait Lanes: Copy {
    /// 16 bits per lane.
    type Words: Copy;
    /// 32 bits per lane, signed.
    type Longs: Copy;
    /// `f32` per lane.
    type Floats: Copy;
    /// `f32` per lane, in the order of memory.
    type Reals: Copy;
    /// One boolean per lane.
    type Mask: Copy;
    /// One boolean per long or float, in their order.
    type Truths: Copy;
    /// 8 bits per lane.
    type Bytes: Copy;
    /// The bytes of four images per lane.
    type Fours: Copy;
    /// Whether it is faster to process two blocks at once than one after the other, because there are enough registers
    /// for both.
    const TWO_AT_ONCE: bool;
    /// A table of [`COLUMNS`] words.
    type Table<'a>: Copy;

    /// The same word in all lanes.
    fn word(self, value: i16) -> Self::Words;
    /// Bytes widened to words.
    fn words_of_bytes(self, bytes: &[u8; LANES]) -> Self::Words;
    /// Words from memory.
    fn load(self, words: &[u16; LANES]) -> Self::Words;
    /// Signed words from memory.
    fn load_signed(self, words: &[i16; LANES]) -> Self::Words;
    /// Little-endian words from any address.
    fn words_of_le(self, words: &[[u8; 2]; LANES]) -> Self::Words;
    /// a + b, wrapping.
    fn add(self, a: Self::Words, b: Self::Words) -> Self::Words;
    /// a − b, wrapping.
    fn sub(self, a: Self::Words, b: Self::Words) -> Self::Words;
    /// |a| of signed words.
    fn abs(self, a: Self::Words) -> Self::Words;
    /// The larger of unsigned words.
    fn max_unsigned(self, a: Self::Words, b: Self::Words) -> Self::Words;
    /// The smaller of unsigned words.
    fn min_unsigned(self, a: Self::Words, b: Self::Words) -> Self::Words;
    /// a·b of signed words as fractions of 2^15, rounded.
    fn times(self, a: Self::Words, b: Self::Words) -> Self::Words;
    /// The low word of a·b.
    fn times_low(self, a: Self::Words, b: Self::Words) -> Self::Words;
    /// The high word of a·b, unsigned.
    fn times_high(self, a: Self::Words, b: Self::Words) -> Self::Words;
    /// a/2 of unsigned words, rounded up.
    fn half_up(self, a: Self::Words) -> Self::Words;
    /// small/large as rounded fractions of 2^15 − 1; 0 if both are 0. Words are 0 to 255, and `small` is at most
    /// `large`.
    fn share_of_bytes(self, small: Self::Words, large: Self::Words) -> Self::Words;
    /// a·2^BITS.
    fn shift_left<const BITS: u32>(self, a: Self::Words) -> Self::Words;
    /// a/2^BITS of unsigned words, rounded down.
    fn shift_right<const BITS: u32>(self, a: Self::Words) -> Self::Words;
    /// a = b.
    fn is_equal(self, a: Self::Words, b: Self::Words) -> Self::Mask;
    /// a > b, signed.
    fn is_greater(self, a: Self::Words, b: Self::Words) -> Self::Mask;
    /// a ≥ b, unsigned.
    fn is_at_least(self, a: Self::Words, b: Self::Words) -> Self::Mask;
    /// `yes` if the mask is set, otherwise `no`.
    fn select(self, mask: Self::Mask, yes: Self::Words, no: Self::Words) -> Self::Words;
    /// a ∧ b.
    fn and(self, a: Self::Mask, b: Self::Mask) -> Self::Mask;
    /// a ∧ ¬b.
    fn and_not(self, a: Self::Mask, b: Self::Mask) -> Self::Mask;
    /// a ∨ b.
    fn or(self, a: Self::Mask, b: Self::Mask) -> Self::Mask;
    /// Whether any lane is true.
    fn any(self, a: Self::Mask) -> bool;
    /// The smallest of the words in the lanes of `some`; words must not be negative.
    fn least_of(self, some: Self::Mask, a: Self::Words) -> i16;
    /// A table of words for [`Self::look_up`].
    fn table(self, words: &[u16; COLUMNS]) -> Self::Table<'_>;
    /// The words of a table at some indices; lanes with an index of [`COLUMNS`] or more are unspecified.
    fn look_up(self, table: Self::Table<'_>, places: Self::Words) -> Self::Words;
    /// The words of a table at some indices, and the words after them. Indices must not be negative; an index beyond
    /// the last pair yields the last pair.
    fn pairs(self, table: &[u16], places: Self::Longs) -> [Self::Words; 2];
    /// Lane k is set if bit k is set.
    fn mask(self, bits: u32) -> Self::Mask;
    /// Bit k is set if lane k is set.
    fn bits(self, mask: Self::Mask) -> u32;
    /// Stores words.
    fn store(self, a: Self::Words, to: &mut [u16; LANES]);
    /// Stores signed words.
    fn store_signed(self, a: Self::Words, to: &mut [i16; LANES]);
    /// Stores the low bytes of words.
    fn store_bytes(self, a: Self::Words, to: &mut [u8; LANES]);
    /// Stores a mask.
    fn store_mask(self, mask: Self::Mask, to: &mut [bool; LANES]);

    /// Bytes from memory.
    fn bytes(self, bytes: &[u8; LANES]) -> Self::Bytes;
    /// The larger of two bytes.
    fn max_bytes(self, a: Self::Bytes, b: Self::Bytes) -> Self::Bytes;
    /// Bytes as words.
    fn widen_bytes(self, a: Self::Bytes) -> Self::Words;
    /// The bytes of four images side by side.
    fn fours(self, images: [Self::Bytes; 4]) -> Self::Fours;
    /// Σ byte·weight of all images.
    fn weigh<const COUNT: usize>(self, fours: &[Self::Fours; COUNT], weights: &[FourWeights; COUNT]) -> Self::Longs;
    /// Σ byte and Σ byte² of all images, at most 16.
    fn sums_and_squares<const COUNT: usize>(self, fours: &[Self::Fours; COUNT]) -> [Self::Longs; 2];

    /// The same long in all lanes.
    fn long(self, value: i32) -> Self::Longs;
    /// Signed words as longs.
    fn widen(self, a: Self::Words) -> Self::Longs;
    /// a + b, wrapping.
    fn add_long(self, a: Self::Longs, b: Self::Longs) -> Self::Longs;
    /// Unsigned words as longs.
    fn widen_unsigned(self, a: Self::Words) -> Self::Longs;
    /// sum + a·`weights[0]` + b·`weights[1]` of signed words, wrapping.
    fn add_weighted(self, sum: Self::Longs, a: Self::Words, b: Self::Words, weights: [i16; 2]) -> Self::Longs;
    /// Which longs are below zero.
    fn is_negative(self, a: Self::Longs) -> Self::Mask;
    /// Longs as words, clamped to 0 … 65535.
    fn narrow(self, a: Self::Longs) -> Self::Words;
    /// Longs as words, clamped to the range of signed words.
    fn narrow_signed(self, a: Self::Longs) -> Self::Words;
    /// Longs from high words and low words.
    fn join(self, high: Self::Words, low: Self::Words) -> Self::Longs;
    /// a − b, wrapping.
    fn sub_long(self, a: Self::Longs, b: Self::Longs) -> Self::Longs;
    /// `yes` if the mask is set, otherwise `no`.
    fn select_long(self, truths: Self::Truths, yes: Self::Longs, no: Self::Longs) -> Self::Longs;
    /// The entries of a table at some indices. Indices must not be negative; an index beyond the table yields the last
    /// entry.
    fn numbers(self, table: &[i32], places: Self::Longs) -> Self::Longs;
    /// Stores longs.
    fn store_longs(self, a: Self::Longs, to: &mut [i32; LANES]);
    /// Longs as floats, rounded to nearest.
    fn floats(self, a: Self::Longs) -> Self::Floats;

    /// The same float in all lanes.
    fn float(self, value: f32) -> Self::Floats;
    /// |a|.
    fn abs_float(self, a: Self::Floats) -> Self::Floats;
    /// a + b.
    fn add_float(self, a: Self::Floats, b: Self::Floats) -> Self::Floats;
    /// a − b.
    fn sub_float(self, a: Self::Floats, b: Self::Floats) -> Self::Floats;
    /// a·b.
    fn times_float(self, a: Self::Floats, b: Self::Floats) -> Self::Floats;
    /// a / b.
    fn over(self, a: Self::Floats, b: Self::Floats) -> Self::Floats;
    /// The larger of two, neither NaN.
    fn max_float(self, a: Self::Floats, b: Self::Floats) -> Self::Floats;
    /// The smaller of two, neither NaN.
    fn min_float(self, a: Self::Floats, b: Self::Floats) -> Self::Floats;
    /// min(|a|, |b|), neither NaN.
    fn min_amount(self, a: Self::Floats, b: Self::Floats) -> Self::Floats;
    /// max(|a|, |b|), neither NaN.
    fn max_amount(self, a: Self::Floats, b: Self::Floats) -> Self::Floats;
    /// small/large as rounded fractions of 2^15 − 1; 0 if both are 0. Both are integers, not negative, and `small` is
    /// at most `large`.
    fn share(self, small: Self::Floats, large: Self::Floats) -> Self::Words;
    /// a > b of finite floats.
    fn is_greater_float(self, a: Self::Floats, b: Self::Floats) -> Self::Mask;
    /// Floats as longs, rounded towards zero; they must be in the range of longs.
    fn longs(self, a: Self::Floats) -> Self::Longs;

    /// The same real in all lanes.
    fn real(self, value: f32) -> Self::Reals;
    /// Reals from memory.
    fn load_reals(self, reals: &[f32; LANES]) -> Self::Reals;
    /// Reals from two places in memory.
    fn load_halves(self, first: &[f32; HALF], second: &[f32; HALF]) -> Self::Reals;
    /// Stores reals to two places.
    fn store_halves(self, a: Self::Reals, first: &mut [f32; HALF], second: &mut [f32; HALF]);
    /// Stores reals.
    fn store_reals(self, a: Self::Reals, to: &mut [f32; LANES]);
    /// Bytes as reals.
    fn reals_of_bytes(self, bytes: &[u8; LANES]) -> Self::Reals;
    /// Little-endian words from any address as reals.
    fn reals_of_le(self, words: &[[u8; 2]; LANES]) -> Self::Reals;
    /// Unsigned words from memory as reals.
    fn reals_of_words(self, words: &[u16; LANES]) -> Self::Reals;
    /// |a|.
    fn abs_real(self, a: Self::Reals) -> Self::Reals;
    /// a + b.
    fn add_real(self, a: Self::Reals, b: Self::Reals) -> Self::Reals;
    /// a − b.
    fn sub_real(self, a: Self::Reals, b: Self::Reals) -> Self::Reals;
    /// a·b.
    fn times_real(self, a: Self::Reals, b: Self::Reals) -> Self::Reals;
    /// a / b.
    fn over_real(self, a: Self::Reals, b: Self::Reals) -> Self::Reals;
    /// √a.
    fn root_real(self, a: Self::Reals) -> Self::Reals;
    /// a if a > b, otherwise b; b if either is NaN.
    fn max_real(self, a: Self::Reals, b: Self::Reals) -> Self::Reals;
    /// a if a < b, otherwise b; b if either is NaN.
    fn min_real(self, a: Self::Reals, b: Self::Reals) -> Self::Reals;
    /// a > b; false if either is NaN.
    fn is_greater_real(self, a: Self::Reals, b: Self::Reals) -> Self::Mask;
    /// a ≥ b; false if either is NaN.
    fn is_at_least_real(self, a: Self::Reals, b: Self::Reals) -> Self::Mask;
    /// `yes` if the mask is set, otherwise `no`.
    fn select_real(self, mask: Self::Mask, yes: Self::Reals, no: Self::Reals) -> Self::Reals;
    /// Reals rounded towards zero; they must be in the range of longs.
    fn truncate(self, a: Self::Reals) -> Self::Reals;
    /// The entries of a table at indices given as reals: integers less than its length.
    fn look_up_real(self, table: &[f32], places: Self::Reals) -> Self::Reals;
    /// The sums of each two neighbouring lanes, first those of a, then those of b.
    fn pair_sums(self, a: Self::Reals, b: Self::Reals) -> Self::Reals;
    /// Each lane twice: the first half of the lanes, then the second half.
    fn doubled(self, a: Self::Reals) -> [Self::Reals; 2];
    /// Stores the low words of reals rounded towards zero; they must be in the range of longs.
    fn store_real_words(self, a: Self::Reals, to: &mut [u16; LANES]);
    /// Stores reals from 0 to 255 as bytes, rounded towards zero.
    fn store_real_bytes(self, a: Self::Reals, to: &mut [u8; LANES]);

    /// Floats from memory.
    fn load_floats(self, floats: &[f32; LANES]) -> Self::Floats;
    /// Stores floats.
    fn store_floats(self, a: Self::Floats, to: &mut [f32; LANES]);
    /// The magnitude of the first with the sign of the second.
    fn with_sign(self, magnitude: Self::Floats, sign: Self::Floats) -> Self::Floats;
    /// a > b.
    fn exceeds(self, a: Self::Floats, b: Self::Floats) -> Self::Truths;
    /// a ≥ b.
    fn reaches(self, a: Self::Floats, b: Self::Floats) -> Self::Truths;
    /// `yes` if the mask is set, otherwise `no`.
    fn select_float(self, truths: Self::Truths, yes: Self::Floats, no: Self::Floats) -> Self::Floats;
    /// a ∧ b.
    fn both(self, a: Self::Truths, b: Self::Truths) -> Self::Truths;
    /// The mask of words as one of longs.
    fn truths(self, mask: Self::Mask) -> Self::Truths;
    /// The mask of longs as one of words.
    fn mask_of(self, truths: Self::Truths) -> Self::Mask;
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Shares of bytes, weighted bytes of eight images, their sums and sums of squares, at a level.
    struct ByteOperations<'a> {
        small: &'a [u8; LANES],
        large: &'a [u8; LANES],
        images: &'a [[u8; LANES]; 8],
        weights: [[i16; 4]; 2],
    }

    impl Kernel for ByteOperations<'_> {
        type Output = ([u16; LANES], [[i32; LANES]; 3]);

        #[inline(always)]
        fn run<L: Lanes>(self, l: L) -> Self::Output {
            let (mut shares, mut sums) = ([0; LANES], [[0; LANES]; 3]);
            l.store(l.share_of_bytes(l.words_of_bytes(self.small), l.words_of_bytes(self.large)), &mut shares);
            let [a, b, c, d, e, f, g, h] = self.images;
            let fours = [
                l.fours([l.bytes(a), l.bytes(b), l.bytes(c), l.bytes(d)]),
                l.fours([l.bytes(e), l.bytes(f), l.bytes(g), l.bytes(h)]),
            ];
            let [sum, squares] = l.sums_and_squares(&fours);
            l.store_longs(l.weigh(&fours, &self.weights.map(FourWeights::new)), &mut sums[0]);
            l.store_longs(sum, &mut sums[1]);
            l.store_longs(squares, &mut sums[2]);
            (shares, sums)
        }
    }

    #[test]
    fn byte_operations_are_exact_at_every_level() {
        let mut state = 5_u32;
        let mut random = move || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as u16
        };
        // All pairs of bytes with small ≤ large.
        for large in 0..=u8::MAX {
            for begin in (0..=large).step_by(LANES) {
                let small = std::array::from_fn(|k| begin.saturating_add(k as u8).min(large));
                let images = std::array::from_fn(|_| {
                    std::array::from_fn(|_| if random() % 4 == 0 { u8::MAX } else { random() as u8 })
                });
                let weights = [[0; 4]; 2].map(|four| {
                    four.map(|_: i16| if random() % 4 == 0 { 0x7f7f } else { (random() as i16).min(0x7f7f) })
                });
                let sum = |k: usize, f: &dyn Fn(i32, i32) -> i32| -> i32 {
                    images.iter().zip(weights.as_flattened()).map(|(i, &w)| f(i32::from(i[k]), i32::from(w))).sum()
                };
                let expected: [[i32; LANES]; 3] = [
                    std::array::from_fn(|k| sum(k, &|byte, weight| byte * weight)),
                    std::array::from_fn(|k| sum(k, &|byte, _| byte)),
                    std::array::from_fn(|k| sum(k, &|byte, _| byte * byte)),
                ];
                let share = |small: u8| {
                    let large = u32::from(large.max(1));
                    ((2 * 32767 * u32::from(small) + large) / (2 * large)) as u16
                };
                for level in Level::ALL {
                    let (shares, sums) =
                        run(level, ByteOperations { small: &small, large: &[large; LANES], images: &images, weights });
                    assert_eq!(shares, small.map(share), "{level:?}, large {large}");
                    assert!(sums == expected, "{level:?}");
                }
            }
        }
    }
}
