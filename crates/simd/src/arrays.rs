//! Lanes as arrays: the reference implementation, which the compiler vectorizes for each level.

use super::{COLUMNS, FourWeights, HALF, LANES, Lanes};

/// Lanes that work on every computer.
#[derive(Clone, Copy)]
pub struct Arrays;

type Words = [i16; LANES];
type Longs = [i32; LANES];
type Floats = [f32; LANES];
/// All bits of a true lane are set.
type Mask = [i16; LANES];
type Truths = [i32; LANES];

#[inline(always)]
fn map<A: Copy, R: Copy + Default>(a: [A; LANES], f: impl Fn(A) -> R) -> [R; LANES] {
    let mut out = [R::default(); LANES];
    for i in 0..LANES {
        out[i] = f(a[i]);
    }
    out
}

#[inline(always)]
fn zip<A: Copy, B: Copy, R: Copy + Default>(a: [A; LANES], b: [B; LANES], f: impl Fn(A, B) -> R) -> [R; LANES] {
    let mut out = [R::default(); LANES];
    for i in 0..LANES {
        out[i] = f(a[i], b[i]);
    }
    out
}

#[inline(always)]
fn truth(value: bool) -> i16 {
    -i16::from(value)
}

#[inline(always)]
fn truth_of_long(value: bool) -> i32 {
    -i32::from(value)
}

/// sum + a² + b².
#[inline(always)]
fn add_squares(sum: Longs, a: Words, b: Words) -> Longs {
    zip(sum, zip(a, b, |a, b| i32::from(a) * i32::from(a) + i32::from(b) * i32::from(b)), i32::wrapping_add)
}

impl Lanes for Arrays {
    type Words = Words;
    type Longs = Longs;
    type Floats = Floats;
    type Reals = Floats;
    type Mask = Mask;
    type Truths = Truths;
    type Table<'a> = &'a [u16; COLUMNS];
    type Bytes = [u8; LANES];
    type Fours = [Words; 4];
    const TWO_AT_ONCE: bool = false;

    inlined! {
        fn word(self, value: i16) -> Words { [value; LANES] }
        fn words_of_bytes(self, bytes: &[u8; LANES]) -> Words { map(*bytes, i16::from) }
        fn load(self, words: &[u16; LANES]) -> Words { map(*words, |word| word as i16) }
        fn load_signed(self, words: &[i16; LANES]) -> Words { *words }
        fn words_of_le(self, words: &[[u8; 2]; LANES]) -> Words { map(*words, i16::from_le_bytes) }
        fn add(self, a: Words, b: Words) -> Words { zip(a, b, i16::wrapping_add) }
        fn sub(self, a: Words, b: Words) -> Words { zip(a, b, i16::wrapping_sub) }
        fn abs(self, a: Words) -> Words { map(a, i16::wrapping_abs) }
        fn max_unsigned(self, a: Words, b: Words) -> Words { zip(a, b, |a, b| (a as u16).max(b as u16) as i16) }
        fn min_unsigned(self, a: Words, b: Words) -> Words { zip(a, b, |a, b| (a as u16).min(b as u16) as i16) }
        fn times_low(self, a: Words, b: Words) -> Words { zip(a, b, i16::wrapping_mul) }
        fn half_up(self, a: Words) -> Words { map(a, |a| u32::from(a as u16).div_ceil(2) as i16) }
        fn is_equal(self, a: Words, b: Words) -> Mask { zip(a, b, |a, b| truth(a == b)) }
        fn is_greater(self, a: Words, b: Words) -> Mask { zip(a, b, |a, b| truth(a > b)) }
        fn is_at_least(self, a: Words, b: Words) -> Mask { zip(a, b, |a, b| truth(a as u16 >= b as u16)) }
        fn and(self, a: Mask, b: Mask) -> Mask { zip(a, b, |a, b| a & b) }
        fn and_not(self, a: Mask, b: Mask) -> Mask { zip(a, b, |a, b| a & !b) }
        fn or(self, a: Mask, b: Mask) -> Mask { zip(a, b, |a, b| a | b) }
        fn any(self, a: Mask) -> bool { a.into_iter().fold(0, |any, a| any | a) != 0 }
        fn table(self, words: &[u16; COLUMNS]) -> &[u16; COLUMNS] { words }
    }
    #[inline(always)]
    fn times(self, a: Words, b: Words) -> Words {
        zip(a, b, |a, b| ((i32::from(a) * i32::from(b) + (1 << 14)) >> 15) as i16)
    }
    #[inline(always)]
    fn times_high(self, a: Words, b: Words) -> Words {
        zip(a, b, |a, b| ((u32::from(a as u16) * u32::from(b as u16)) >> 16) as i16)
    }
    #[inline(always)]
    fn share_of_bytes(self, small: Words, large: Words) -> Words {
        self.share(self.floats(self.widen(small)), self.floats(self.widen(large)))
    }
    #[inline(always)]
    fn shift_left<const BITS: u32>(self, a: Words) -> Words {
        map(a, |a| a << BITS)
    }
    #[inline(always)]
    fn shift_right<const BITS: u32>(self, a: Words) -> Words {
        map(a, |a| (a as u16 >> BITS) as i16)
    }
    #[inline(always)]
    fn select(self, mask: Mask, yes: Words, no: Words) -> Words {
        let mut out = no;
        for i in 0..LANES {
            out[i] = (yes[i] & mask[i]) | (no[i] & !mask[i]);
        }
        out
    }
    #[inline(always)]
    fn least_of(self, some: Mask, a: Words) -> i16 {
        self.select(some, a, [i16::MAX; LANES]).into_iter().fold(i16::MAX, i16::min)
    }
    #[inline(always)]
    fn look_up(self, table: &[u16; COLUMNS], places: Words) -> Words {
        map(places, |place| table[place as usize % COLUMNS] as i16)
    }
    #[inline(always)]
    fn mask(self, bits: u32) -> Mask {
        let mut out = [0; LANES];
        for k in 0..LANES {
            out[k] = truth(bits >> k & 1 == 1);
        }
        out
    }
    #[inline(always)]
    fn bits(self, mask: Mask) -> u32 {
        mask.iter().enumerate().fold(0, |bits, (k, &m)| bits | ((m as u32 & 1) << k))
    }
    #[inline(always)]
    fn store(self, a: Words, to: &mut [u16; LANES]) {
        *to = map(a, |a| a as u16);
    }
    #[inline(always)]
    fn store_signed(self, a: Words, to: &mut [i16; LANES]) {
        *to = a;
    }
    #[inline(always)]
    fn store_bytes(self, a: Words, to: &mut [u8; LANES]) {
        *to = map(a, |a| a as u8);
    }
    #[inline(always)]
    fn store_mask(self, mask: Mask, to: &mut [bool; LANES]) {
        *to = map(mask, |m| m != 0);
    }

    inlined! {
        fn bytes(self, bytes: &[u8; LANES]) -> [u8; LANES] { *bytes }
        fn max_bytes(self, a: [u8; LANES], b: [u8; LANES]) -> [u8; LANES] { zip(a, b, u8::max) }
        fn widen_bytes(self, a: [u8; LANES]) -> Words { map(a, i16::from) }
    }
    #[inline(always)]
    fn fours(self, images: [[u8; LANES]; 4]) -> [Words; 4] {
        let mut fours = [[0; LANES]; 4];
        for k in 0..4 {
            fours[k] = self.widen_bytes(images[k]);
        }
        fours
    }
    #[inline(always)]
    fn weigh<const COUNT: usize>(self, fours: &[[Words; 4]; COUNT], weights: &[FourWeights; COUNT]) -> Longs {
        let mut sum = self.long(0);
        for i in 0..COUNT {
            let ([a, b, c, d], [of_a, of_b, of_c, of_d]) = (fours[i], weights[i].words);
            sum = self.add_weighted(self.add_weighted(sum, a, b, [of_a, of_b]), c, d, [of_c, of_d]);
        }
        sum
    }
    #[inline(always)]
    fn sums_and_squares<const COUNT: usize>(self, fours: &[[Words; 4]; COUNT]) -> [Longs; 2] {
        let (mut sum, mut squares) = (self.word(0), self.long(0));
        for [a, b, c, d] in fours {
            sum = self.add(sum, self.add(self.add(*a, *b), self.add(*c, *d)));
            squares = add_squares(add_squares(squares, *a, *b), *c, *d);
        }
        [self.widen(sum), squares]
    }

    inlined! {
        fn long(self, value: i32) -> Longs { [value; LANES] }
        fn widen(self, a: Words) -> Longs { map(a, i32::from) }
        fn add_long(self, a: Longs, b: Longs) -> Longs { zip(a, b, i32::wrapping_add) }
        fn widen_unsigned(self, a: Words) -> Longs { map(a, |a| i32::from(a as u16)) }
        fn is_negative(self, a: Longs) -> Mask { map(a, |a| truth(a < 0)) }
        fn narrow(self, a: Longs) -> Words { map(a, |a| a.clamp(0, 0xffff) as u16 as i16) }
        fn narrow_signed(self, a: Longs) -> Words { map(a, |a| a.clamp(-0x8000, 0x7fff) as i16) }
        fn sub_long(self, a: Longs, b: Longs) -> Longs { zip(a, b, i32::wrapping_sub) }
        fn floats(self, a: Longs) -> Floats { map(a, |a| a as f32) }
    }
    #[inline(always)]
    fn add_weighted(self, sum: Longs, a: Words, b: Words, [of_a, of_b]: [i16; 2]) -> Longs {
        let weighted = zip(a, b, |a, b| i32::from(a) * i32::from(of_a) + i32::from(b) * i32::from(of_b));
        zip(sum, weighted, i32::wrapping_add)
    }
    #[inline(always)]
    fn join(self, high: Words, low: Words) -> Longs {
        zip(high, low, |high, low| i32::from(high) << 16 | i32::from(low as u16))
    }
    #[inline(always)]
    fn select_long(self, truths: Truths, yes: Longs, no: Longs) -> Longs {
        let mut out = no;
        for i in 0..LANES {
            out[i] = (yes[i] & truths[i]) | (no[i] & !truths[i]);
        }
        out
    }
    #[inline(always)]
    fn numbers(self, table: &[i32], places: Longs) -> Longs {
        let last = table.len() - 1;
        map(places, |place| table[(place as usize).min(last)])
    }
    #[inline(always)]
    fn pairs(self, table: &[u16], places: Longs) -> [Words; 2] {
        let last = table.len() - 2;
        // Both words of a pair are loaded at once, and separated by vectors.
        let mut pairs = [0_u32; LANES];
        for k in 0..LANES {
            let place = (places[k] as u32 as usize).min(last);
            pairs[k] = u32::from(table[place]) | u32::from(table[place + 1]) << 16;
        }
        [map(pairs, |pair| pair as i16), map(pairs, |pair| (pair >> 16) as i16)]
    }
    #[inline(always)]
    fn store_longs(self, a: Longs, to: &mut [i32; LANES]) {
        *to = a;
    }

    inlined! {
        fn float(self, value: f32) -> Floats { [value; LANES] }
        fn abs_float(self, a: Floats) -> Floats { map(a, f32::abs) }
        fn add_float(self, a: Floats, b: Floats) -> Floats { zip(a, b, |a, b| a + b) }
        fn sub_float(self, a: Floats, b: Floats) -> Floats { zip(a, b, |a, b| a - b) }
        fn times_float(self, a: Floats, b: Floats) -> Floats { zip(a, b, |a, b| a * b) }
        fn over(self, a: Floats, b: Floats) -> Floats { zip(a, b, |a, b| a / b) }
        fn max_float(self, a: Floats, b: Floats) -> Floats { zip(a, b, |a, b| if a > b { a } else { b }) }
        fn min_float(self, a: Floats, b: Floats) -> Floats { zip(a, b, |a, b| if a < b { a } else { b }) }
        fn min_amount(self, a: Floats, b: Floats) -> Floats { self.min_float(self.abs_float(a), self.abs_float(b)) }
        fn max_amount(self, a: Floats, b: Floats) -> Floats { self.max_float(self.abs_float(a), self.abs_float(b)) }
        fn is_greater_float(self, a: Floats, b: Floats) -> Mask { zip(a, b, |a, b| truth(a > b)) }
    }
    #[inline(always)]
    fn share(self, small: Floats, large: Floats) -> Words {
        let share = zip(small, large, |small, large| small * 32767.0 / if large > 1.0 { large } else { 1.0 } + 0.5);
        self.narrow(self.longs(share))
    }
    #[inline(always)]
    #[allow(unsafe_code, reason = "a saturating conversion is several times slower")]
    fn longs(self, a: Floats) -> Longs {
        // SAFETY: the caller guarantees values in the range of `i32`.
        map(a, |a| unsafe { a.to_int_unchecked() })
    }

    inlined! {
        fn real(self, value: f32) -> Floats { [value; LANES] }
        fn load_reals(self, reals: &[f32; LANES]) -> Floats { *reals }
        fn reals_of_bytes(self, bytes: &[u8; LANES]) -> Floats { map(*bytes, f32::from) }
        fn reals_of_words(self, words: &[u16; LANES]) -> Floats { map(*words, f32::from) }
        fn abs_real(self, a: Floats) -> Floats { map(a, f32::abs) }
        fn add_real(self, a: Floats, b: Floats) -> Floats { zip(a, b, |a, b| a + b) }
        fn sub_real(self, a: Floats, b: Floats) -> Floats { zip(a, b, |a, b| a - b) }
        fn times_real(self, a: Floats, b: Floats) -> Floats { zip(a, b, |a, b| a * b) }
        fn over_real(self, a: Floats, b: Floats) -> Floats { zip(a, b, |a, b| a / b) }
        fn root_real(self, a: Floats) -> Floats { map(a, f32::sqrt) }
        fn max_real(self, a: Floats, b: Floats) -> Floats { zip(a, b, |a, b| if a > b { a } else { b }) }
        fn min_real(self, a: Floats, b: Floats) -> Floats { zip(a, b, |a, b| if a < b { a } else { b }) }
        fn is_greater_real(self, a: Floats, b: Floats) -> Mask { zip(a, b, |a, b| truth(a > b)) }
        fn is_at_least_real(self, a: Floats, b: Floats) -> Mask { zip(a, b, |a, b| truth(a >= b)) }
        fn truncate(self, a: Floats) -> Floats { self.floats(self.longs(a)) }
        fn look_up_real(self, table: &[f32], places: Floats) -> Floats { map(places, |place| table[place as usize]) }
    }
    #[inline(always)]
    fn load_halves(self, first: &[f32; HALF], second: &[f32; HALF]) -> Floats {
        let mut out = [0.0; LANES];
        out[..HALF].copy_from_slice(first);
        out[HALF..].copy_from_slice(second);
        out
    }
    #[inline(always)]
    fn store_halves(self, a: Floats, first: &mut [f32; HALF], second: &mut [f32; HALF]) {
        first.copy_from_slice(&a[..HALF]);
        second.copy_from_slice(&a[HALF..]);
    }
    #[inline(always)]
    fn pair_sums(self, a: Floats, b: Floats) -> Floats {
        let mut out = [0.0; LANES];
        for k in 0..HALF {
            out[k] = a[2 * k] + a[2 * k + 1];
            out[HALF + k] = b[2 * k] + b[2 * k + 1];
        }
        out
    }
    #[inline(always)]
    fn doubled(self, a: Floats) -> [Floats; 2] {
        let mut out = [[0.0; LANES]; 2];
        for k in 0..LANES {
            out[0][k] = a[k / 2];
            out[1][k] = a[HALF + k / 2];
        }
        out
    }
    #[inline(always)]
    fn store_reals(self, a: Floats, to: &mut [f32; LANES]) {
        *to = a;
    }
    #[inline(always)]
    fn reals_of_le(self, words: &[[u8; 2]; LANES]) -> Floats {
        map(*words, |word| f32::from(u16::from_le_bytes(word)))
    }
    #[inline(always)]
    fn select_real(self, mask: Mask, yes: Floats, no: Floats) -> Floats {
        let mut out = no;
        for i in 0..LANES {
            out[i] = if mask[i] != 0 { yes[i] } else { no[i] };
        }
        out
    }
    #[inline(always)]
    fn store_real_words(self, a: Floats, to: &mut [u16; LANES]) {
        *to = map(self.longs(a), |a| a as u16);
    }
    #[inline(always)]
    fn store_real_bytes(self, a: Floats, to: &mut [u8; LANES]) {
        *to = map(self.longs(a), |a| a as u8);
    }

    inlined! {
        fn load_floats(self, floats: &[f32; LANES]) -> Floats { *floats }
        fn with_sign(self, magnitude: Floats, sign: Floats) -> Floats { zip(magnitude, sign, f32::copysign) }
        fn exceeds(self, a: Floats, b: Floats) -> Truths { zip(a, b, |a, b| truth_of_long(a > b)) }
        fn reaches(self, a: Floats, b: Floats) -> Truths { zip(a, b, |a, b| truth_of_long(a >= b)) }
        fn both(self, a: Truths, b: Truths) -> Truths { zip(a, b, |a, b| a & b) }
        fn truths(self, mask: Mask) -> Truths { map(mask, i32::from) }
        fn mask_of(self, truths: Truths) -> Mask { map(truths, |truth| truth as i16) }
    }
    #[inline(always)]
    fn store_floats(self, a: Floats, to: &mut [f32; LANES]) {
        *to = a;
    }
    #[inline(always)]
    fn select_float(self, truths: Truths, yes: Floats, no: Floats) -> Floats {
        let mut out = no;
        for i in 0..LANES {
            out[i] = f32::from_bits((yes[i].to_bits() & truths[i] as u32) | (no[i].to_bits() & !truths[i] as u32));
        }
        out
    }
}
