//! Lanes of AVX-512: 32 words per register. Longs and floats take two registers, in the order in which words unpack.
#![allow(unsafe_code, reason = "uses instructions of the level; the lanes exist only if the processor has them")]

use std::arch::asm;
use std::arch::x86_64::*;

use super::{COLUMNS, FourWeights, HALF, LANES, Lanes, Level};

/// Proof that the processor has AVX-512.
#[derive(Clone, Copy)]
pub struct Avx512(());

impl Avx512 {
    /// Returns the lanes if the processor supports them.
    #[inline]
    pub(super) fn new() -> Option<Self> {
        Level::Avx512.is_available().then_some(Self(()))
    }
}

type Pair<T> = [T; 2];

/// Applies an instruction to both registers. This is a macro and not a function with a closure, because each closure
/// that is not inlined would cost a call per instruction.
macro_rules! both {
    ($of:path, $a:expr) => {{
        let [a, b] = $a;
        unsafe { [$of(a), $of(b)] }
    }};
    ($of:path, $a:expr, $b:expr) => {{
        let ([a0, a1], [b0, b1]) = ($a, $b);
        unsafe { [$of(a0, b0), $of(a1, b1)] }
    }};
}

/// Operand of `vrangeps`: the smaller or the larger absolute value, without sign.
const MIN_AMOUNT: i32 = 0b1010;
const MAX_AMOUNT: i32 = 0b1011;

/// Bits of a word mask that belong to the longs of the first and of the second register.
const OF_REGISTERS: Pair<u32> = [0x0f0f_0f0f, 0xf0f0_f0f0];

/// Indices of the bytes of four images in two registers, for the longs of the first and of the second register, in the
/// order in which words unpack.
const OF_FOURS: Pair<[u8; 2 * LANES]> = [of_fours(0), of_fours(4)];

const fn of_fours(first: usize) -> [u8; 2 * LANES] {
    let mut places = [0; 2 * LANES];
    let mut k = 0;
    while k < 2 * LANES {
        let (long, image) = (k / 4, k % 4);
        places[k] = (image * LANES + first + long / 4 * 8 + long % 4) as u8;
        k += 1;
    }
    places
}

/// Returns the mask of reals, which are already in the order of memory.
#[inline(always)]
fn mask_of_reals([a, b]: Pair<__mmask16>) -> __mmask32 {
    u32::from(a) | u32::from(b) << 16
}

/// Returns which longs are negative, in the order of words. Narrowing keeps their signs.
#[inline(always)]
fn signs([a, b]: Pair<__m512i>) -> __mmask32 {
    // SAFETY: the lanes exist only if the processor has these instructions.
    unsafe { _mm512_movepi16_mask(_mm512_packs_epi32(a, b)) }
}

/// Returns the absolute values of signed words. It is written in assembly, because the compiler would turn the absolute
/// difference of widened bytes into a maximum, a minimum and another difference.
#[inline]
#[target_feature(enable = "avx512f,avx512bw")]
fn amounts(a: __m512i) -> __m512i {
    let amount;
    // SAFETY: the instruction belongs to the target features of this function and uses only registers.
    unsafe {
        asm!("vpabsw {}, {}", lateout(zmm_reg) amount, in(zmm_reg) a, options(pure, nomem, nostack, preserves_flags));
    };
    amount
}

// SAFETY of all blocks below: a value of `Avx512` proves that the processor has the instructions. Addresses come from
// references to arrays of the length that is read or written. No instruction requires alignment.
impl Lanes for Avx512 {
    type Words = __m512i;
    type Longs = Pair<__m512i>;
    type Floats = Pair<__m512>;
    type Reals = Pair<__m512>;
    type Mask = __mmask32;
    type Truths = Pair<__mmask16>;
    type Table<'a> = Pair<__m512i>;
    type Bytes = __m256i;
    type Fours = Pair<__m512i>;
    const TWO_AT_ONCE: bool = true;

    inlined! {
        fn word(self, value: i16) -> __m512i { unsafe { _mm512_set1_epi16(value) } }
        fn load(self, words: &[u16; LANES]) -> __m512i { unsafe { _mm512_loadu_si512(words.as_ptr().cast()) } }
        fn load_signed(self, words: &[i16; LANES]) -> __m512i { unsafe { _mm512_loadu_si512(words.as_ptr().cast()) } }
        fn add(self, a: __m512i, b: __m512i) -> __m512i { unsafe { _mm512_add_epi16(a, b) } }
        fn sub(self, a: __m512i, b: __m512i) -> __m512i { unsafe { _mm512_sub_epi16(a, b) } }
        fn abs(self, a: __m512i) -> __m512i { unsafe { amounts(a) } }
        fn max_unsigned(self, a: __m512i, b: __m512i) -> __m512i { unsafe { _mm512_max_epu16(a, b) } }
        fn min_unsigned(self, a: __m512i, b: __m512i) -> __m512i { unsafe { _mm512_min_epu16(a, b) } }
        fn times(self, a: __m512i, b: __m512i) -> __m512i { unsafe { _mm512_mulhrs_epi16(a, b) } }
        fn times_low(self, a: __m512i, b: __m512i) -> __m512i { unsafe { _mm512_mullo_epi16(a, b) } }
        fn times_high(self, a: __m512i, b: __m512i) -> __m512i { unsafe { _mm512_mulhi_epu16(a, b) } }
        fn half_up(self, a: __m512i) -> __m512i { unsafe { _mm512_avg_epu16(a, _mm512_setzero_si512()) } }
        fn is_equal(self, a: __m512i, b: __m512i) -> __mmask32 { unsafe { _mm512_cmpeq_epi16_mask(a, b) } }
        fn is_greater(self, a: __m512i, b: __m512i) -> __mmask32 { unsafe { _mm512_cmpgt_epi16_mask(a, b) } }
        fn is_at_least(self, a: __m512i, b: __m512i) -> __mmask32 { unsafe { _mm512_cmpge_epu16_mask(a, b) } }
        fn and(self, a: __mmask32, b: __mmask32) -> __mmask32 { a & b }
        fn and_not(self, a: __mmask32, b: __mmask32) -> __mmask32 { a & !b }
        fn or(self, a: __mmask32, b: __mmask32) -> __mmask32 { a | b }
        fn any(self, a: __mmask32) -> bool { a != 0 }
        fn mask(self, bits: u32) -> __mmask32 { bits }
        fn bits(self, mask: __mmask32) -> u32 { mask }
    }
    #[inline(always)]
    fn words_of_bytes(self, bytes: &[u8; LANES]) -> __m512i {
        unsafe { _mm512_cvtepu8_epi16(_mm256_loadu_si256(bytes.as_ptr().cast())) }
    }
    #[inline(always)]
    fn words_of_le(self, words: &[[u8; 2]; LANES]) -> __m512i {
        unsafe { _mm512_loadu_si512(words.as_ptr().cast()) }
    }
    #[inline(always)]
    fn share_of_bytes(self, small: __m512i, large: __m512i) -> __m512i {
        const WHOLE: f32 = 32767.0;
        // The float with this high word and a low word w is 2^23 + w.
        const HIGH_WORD: i16 = 0x4b00;
        const ADDED: f32 = 8_388_608.0;
        let high = self.word(HIGH_WORD);
        unsafe {
            let small = [_mm512_unpacklo_epi16(small, high), _mm512_unpackhi_epi16(small, high)];
            let large = [_mm512_unpacklo_epi16(large, high), _mm512_unpackhi_epi16(large, high)];
            let [a, b] = [_mm512_castsi512_ps(small[0]), _mm512_castsi512_ps(small[1])];
            // Whole numbers below 2^23: small · 32767 is exact.
            let (whole, taken) = (_mm512_set1_ps(WHOLE), _mm512_set1_ps(-WHOLE * ADDED));
            let products = [_mm512_fmadd_ps(a, whole, taken), _mm512_fmadd_ps(b, whole, taken)];
            let large = [_mm512_castsi512_ps(large[0]), _mm512_castsi512_ps(large[1])];
            let large = self.sub_float(large, self.float(ADDED));
            // 0/0 is NaN. It converts to the minimum long, which narrows to 0.
            self.narrow(self.longs(self.add_float(self.over(products, large), self.float(0.5))))
        }
    }
    #[inline(always)]
    fn shift_left<const BITS: u32>(self, a: __m512i) -> __m512i {
        unsafe { _mm512_slli_epi16::<BITS>(a) }
    }
    #[inline(always)]
    fn shift_right<const BITS: u32>(self, a: __m512i) -> __m512i {
        unsafe { _mm512_srli_epi16::<BITS>(a) }
    }
    #[inline(always)]
    fn select(self, mask: __mmask32, yes: __m512i, no: __m512i) -> __m512i {
        unsafe { _mm512_mask_blend_epi16(mask, no, yes) }
    }
    #[inline(always)]
    fn least_of(self, some: __mmask32, a: __m512i) -> i16 {
        unsafe {
            let words = _mm512_mask_mov_epi16(_mm512_set1_epi16(i16::MAX), some, a);
            let half = _mm256_min_epu16(_mm512_castsi512_si256(words), _mm512_extracti64x4_epi64::<1>(words));
            let quarter = _mm_min_epu16(_mm256_castsi256_si128(half), _mm256_extracti128_si256::<1>(half));
            _mm_cvtsi128_si32(_mm_minpos_epu16(quarter)) as i16
        }
    }
    #[inline(always)]
    fn table(self, words: &[u16; COLUMNS]) -> Pair<__m512i> {
        let (low, high) = words.split_at(LANES);
        unsafe { [_mm512_loadu_si512(low.as_ptr().cast()), _mm512_loadu_si512(high.as_ptr().cast())] }
    }
    #[inline(always)]
    fn look_up(self, [low, high]: Pair<__m512i>, places: __m512i) -> __m512i {
        unsafe { _mm512_permutex2var_epi16(low, places, high) }
    }
    #[inline(always)]
    fn store(self, a: __m512i, to: &mut [u16; LANES]) {
        unsafe { _mm512_storeu_si512(to.as_mut_ptr().cast(), a) }
    }
    #[inline(always)]
    fn store_signed(self, a: __m512i, to: &mut [i16; LANES]) {
        unsafe { _mm512_storeu_si512(to.as_mut_ptr().cast(), a) }
    }
    #[inline(always)]
    fn store_bytes(self, a: __m512i, to: &mut [u8; LANES]) {
        unsafe { _mm256_storeu_si256(to.as_mut_ptr().cast(), _mm512_cvtepi16_epi8(a)) }
    }
    #[inline(always)]
    fn store_mask(self, mask: __mmask32, to: &mut [bool; LANES]) {
        // A `bool` is a byte of 0 or 1.
        unsafe { _mm256_storeu_si256(to.as_mut_ptr().cast(), _mm256_maskz_set1_epi8(mask, 1)) }
    }

    inlined! {
        fn bytes(self, bytes: &[u8; LANES]) -> __m256i { unsafe { _mm256_loadu_si256(bytes.as_ptr().cast()) } }
        fn max_bytes(self, a: __m256i, b: __m256i) -> __m256i { unsafe { _mm256_max_epu8(a, b) } }
        fn widen_bytes(self, a: __m256i) -> __m512i { unsafe { _mm512_cvtepu8_epi16(a) } }
    }
    #[inline(always)]
    fn fours(self, [a, b, c, d]: [__m256i; 4]) -> Pair<__m512i> {
        unsafe {
            let low = _mm512_inserti64x4::<1>(_mm512_castsi256_si512(a), b);
            let high = _mm512_inserti64x4::<1>(_mm512_castsi256_si512(c), d);
            let places =
                [_mm512_loadu_si512(OF_FOURS[0].as_ptr().cast()), _mm512_loadu_si512(OF_FOURS[1].as_ptr().cast())];
            [_mm512_permutex2var_epi8(low, places[0], high), _mm512_permutex2var_epi8(low, places[1], high)]
        }
    }
    #[inline(always)]
    fn weigh<const COUNT: usize>(
        self,
        fours: &[Pair<__m512i>; COUNT],
        weights: &[FourWeights; COUNT],
    ) -> Pair<__m512i> {
        unsafe {
            let mut sum = self.long(0);
            for i in 0..COUNT {
                let high = _mm512_set1_epi32(weights[i].high);
                sum = [_mm512_dpbusd_epi32(sum[0], fours[i][0], high), _mm512_dpbusd_epi32(sum[1], fours[i][1], high)];
            }
            sum = [_mm512_slli_epi32::<8>(sum[0]), _mm512_slli_epi32::<8>(sum[1])];
            for i in 0..COUNT {
                let low = _mm512_set1_epi32(weights[i].low);
                sum = [_mm512_dpbusd_epi32(sum[0], fours[i][0], low), _mm512_dpbusd_epi32(sum[1], fours[i][1], low)];
            }
            sum
        }
    }
    #[inline(always)]
    fn sums_and_squares<const COUNT: usize>(self, fours: &[Pair<__m512i>; COUNT]) -> [Pair<__m512i>; 2] {
        unsafe {
            let (ones, middle) = (_mm512_set1_epi8(1), _mm512_set1_epi8(i8::MIN));
            let (mut sum, mut products) = (self.long(0), self.long(0));
            for &[a, b] in fours {
                sum = [_mm512_dpbusd_epi32(sum[0], a, ones), _mm512_dpbusd_epi32(sum[1], b, ones)];
                // The second factor of the instruction is signed: byte · (byte − 128).
                let (of_a, of_b) = (_mm512_xor_si512(a, middle), _mm512_xor_si512(b, middle));
                products = [_mm512_dpbusd_epi32(products[0], a, of_a), _mm512_dpbusd_epi32(products[1], b, of_b)];
            }
            let taken = [_mm512_slli_epi32::<7>(sum[0]), _mm512_slli_epi32::<7>(sum[1])];
            [sum, self.add_long(products, taken)]
        }
    }

    inlined! {
        fn long(self, value: i32) -> Pair<__m512i> { unsafe { [_mm512_set1_epi32(value); 2] } }
        fn add_long(self, a: Pair<__m512i>, b: Pair<__m512i>) -> Pair<__m512i> { both!(_mm512_add_epi32, a, b) }
        fn is_negative(self, a: Pair<__m512i>) -> __mmask32 { signs(a) }
        fn narrow(self, [a, b]: Pair<__m512i>) -> __m512i { unsafe { _mm512_packus_epi32(a, b) } }
        fn narrow_signed(self, [a, b]: Pair<__m512i>) -> __m512i { unsafe { _mm512_packs_epi32(a, b) } }
        fn sub_long(self, a: Pair<__m512i>, b: Pair<__m512i>) -> Pair<__m512i> { both!(_mm512_sub_epi32, a, b) }
        fn floats(self, a: Pair<__m512i>) -> Pair<__m512> { both!(_mm512_cvtepi32_ps, a) }
    }
    #[inline(always)]
    fn widen(self, a: __m512i) -> Pair<__m512i> {
        unsafe {
            let sign = _mm512_srai_epi16::<15>(a);
            [_mm512_unpacklo_epi16(a, sign), _mm512_unpackhi_epi16(a, sign)]
        }
    }
    #[inline(always)]
    fn widen_unsigned(self, a: __m512i) -> Pair<__m512i> {
        unsafe {
            let zero = _mm512_setzero_si512();
            [_mm512_unpacklo_epi16(a, zero), _mm512_unpackhi_epi16(a, zero)]
        }
    }
    #[inline(always)]
    fn add_weighted(self, [low, high]: Pair<__m512i>, a: __m512i, b: __m512i, [of_a, of_b]: [i16; 2]) -> Pair<__m512i> {
        unsafe {
            let weights = _mm512_set1_epi32((i32::from(of_b) << 16) | i32::from(of_a as u16));
            [
                _mm512_dpwssd_epi32(low, _mm512_unpacklo_epi16(a, b), weights),
                _mm512_dpwssd_epi32(high, _mm512_unpackhi_epi16(a, b), weights),
            ]
        }
    }
    #[inline(always)]
    fn join(self, high: __m512i, low: __m512i) -> Pair<__m512i> {
        unsafe { [_mm512_unpacklo_epi16(low, high), _mm512_unpackhi_epi16(low, high)] }
    }
    #[inline(always)]
    fn select_long(self, [t0, t1]: Pair<__mmask16>, yes: Pair<__m512i>, no: Pair<__m512i>) -> Pair<__m512i> {
        unsafe { [_mm512_mask_mov_epi32(no[0], t0, yes[0]), _mm512_mask_mov_epi32(no[1], t1, yes[1])] }
    }
    #[inline(always)]
    fn numbers(self, table: &[i32], places: Pair<__m512i>) -> Pair<__m512i> {
        let last = self.long(table.len() as i32 - 1);
        let [a, b] = both!(_mm512_min_epu32, places, last);
        // Limits the indices to the last entry.
        unsafe {
            [
                _mm512_i32gather_epi32::<4>(a, table.as_ptr().cast()),
                _mm512_i32gather_epi32::<4>(b, table.as_ptr().cast()),
            ]
        }
    }
    #[inline(always)]
    fn pairs(self, table: &[u16], places: Pair<__m512i>) -> [__m512i; 2] {
        assert!(table.len() >= 2);
        let last = self.long(table.len() as i32 - 2);
        let [a, b] = both!(_mm512_min_epu32, places, last);
        // Limits the indices to the last pair.
        unsafe {
            let a = _mm512_i32gather_epi32::<2>(a, table.as_ptr().cast());
            let b = _mm512_i32gather_epi32::<2>(b, table.as_ptr().cast());
            let low = _mm512_set1_epi32(0xffff);
            [
                _mm512_packus_epi32(_mm512_and_si512(a, low), _mm512_and_si512(b, low)),
                _mm512_packus_epi32(_mm512_srli_epi32::<16>(a), _mm512_srli_epi32::<16>(b)),
            ]
        }
    }
    #[inline(always)]
    fn store_longs(self, [a, b]: Pair<__m512i>, to: &mut [i32; LANES]) {
        unsafe {
            let (low, high) = (_mm512_shuffle_i32x4::<0x44>(a, b), _mm512_shuffle_i32x4::<0xee>(a, b));
            let in_order = [_mm512_shuffle_i32x4::<0xd8>(low, low), _mm512_shuffle_i32x4::<0xd8>(high, high)];
            _mm512_storeu_si512(to.as_mut_ptr().cast(), in_order[0]);
            _mm512_storeu_si512(to[LANES / 2..].as_mut_ptr().cast(), in_order[1]);
        }
    }

    inlined! {
        fn float(self, value: f32) -> Pair<__m512> { unsafe { [_mm512_set1_ps(value); 2] } }
        fn abs_float(self, a: Pair<__m512>) -> Pair<__m512> { both!(_mm512_abs_ps, a) }
        fn add_float(self, a: Pair<__m512>, b: Pair<__m512>) -> Pair<__m512> { both!(_mm512_add_ps, a, b) }
        fn sub_float(self, a: Pair<__m512>, b: Pair<__m512>) -> Pair<__m512> { both!(_mm512_sub_ps, a, b) }
        fn times_float(self, a: Pair<__m512>, b: Pair<__m512>) -> Pair<__m512> { both!(_mm512_mul_ps, a, b) }
        fn over(self, a: Pair<__m512>, b: Pair<__m512>) -> Pair<__m512> { both!(_mm512_div_ps, a, b) }
        fn max_float(self, a: Pair<__m512>, b: Pair<__m512>) -> Pair<__m512> { both!(_mm512_max_ps, a, b) }
        fn min_float(self, a: Pair<__m512>, b: Pair<__m512>) -> Pair<__m512> { both!(_mm512_min_ps, a, b) }
        fn longs(self, a: Pair<__m512>) -> Pair<__m512i> { both!(_mm512_cvttps_epi32, a) }
    }
    #[inline(always)]
    fn min_amount(self, a: Pair<__m512>, b: Pair<__m512>) -> Pair<__m512> {
        both!(_mm512_range_ps::<MIN_AMOUNT>, a, b)
    }
    #[inline(always)]
    fn max_amount(self, a: Pair<__m512>, b: Pair<__m512>) -> Pair<__m512> {
        both!(_mm512_range_ps::<MAX_AMOUNT>, a, b)
    }
    #[inline(always)]
    fn share(self, small: Pair<__m512>, large: Pair<__m512>) -> __m512i {
        // 0/0 is NaN. It converts to the minimum long, which narrows to 0.
        let share = self.over(self.times_float(small, self.float(32767.0)), large);
        self.narrow(self.longs(self.add_float(share, self.float(0.5))))
    }
    #[inline(always)]
    fn is_greater_float(self, a: Pair<__m512>, b: Pair<__m512>) -> __mmask32 {
        // The sign of the difference; the difference is not zero if the operands differ.
        signs(both!(_mm512_castps_si512, both!(_mm512_sub_ps, b, a)))
    }

    inlined! {
        fn real(self, value: f32) -> Pair<__m512> { unsafe { [_mm512_set1_ps(value); 2] } }
        fn reals_of_words(self, words: &[u16; LANES]) -> Pair<__m512> { self.reals_of_le(bytemuck::cast_ref(words)) }
        fn abs_real(self, a: Pair<__m512>) -> Pair<__m512> { both!(_mm512_abs_ps, a) }
        fn add_real(self, a: Pair<__m512>, b: Pair<__m512>) -> Pair<__m512> { both!(_mm512_add_ps, a, b) }
        fn sub_real(self, a: Pair<__m512>, b: Pair<__m512>) -> Pair<__m512> { both!(_mm512_sub_ps, a, b) }
        fn times_real(self, a: Pair<__m512>, b: Pair<__m512>) -> Pair<__m512> { both!(_mm512_mul_ps, a, b) }
        fn over_real(self, a: Pair<__m512>, b: Pair<__m512>) -> Pair<__m512> { both!(_mm512_div_ps, a, b) }
        fn root_real(self, a: Pair<__m512>) -> Pair<__m512> { both!(_mm512_sqrt_ps, a) }
        fn max_real(self, a: Pair<__m512>, b: Pair<__m512>) -> Pair<__m512> { both!(_mm512_max_ps, a, b) }
        fn min_real(self, a: Pair<__m512>, b: Pair<__m512>) -> Pair<__m512> { both!(_mm512_min_ps, a, b) }
        fn truncate(self, a: Pair<__m512>) -> Pair<__m512> { both!(_mm512_cvtepi32_ps, both!(_mm512_cvttps_epi32, a)) }
    }
    #[inline(always)]
    fn load_reals(self, reals: &[f32; LANES]) -> Pair<__m512> {
        let (halves, _) = reals.as_chunks::<{ LANES / 2 }>();
        unsafe { [_mm512_loadu_ps(halves[0].as_ptr()), _mm512_loadu_ps(halves[1].as_ptr())] }
    }
    #[inline(always)]
    fn store_reals(self, [a, b]: Pair<__m512>, to: &mut [f32; LANES]) {
        let (halves, _) = to.as_chunks_mut::<{ LANES / 2 }>();
        unsafe {
            _mm512_storeu_ps(halves[0].as_mut_ptr(), a);
            _mm512_storeu_ps(halves[1].as_mut_ptr(), b);
        }
    }
    #[inline(always)]
    fn reals_of_bytes(self, bytes: &[u8; LANES]) -> Pair<__m512> {
        let (halves, _) = bytes.as_chunks::<{ LANES / 2 }>();
        let [a, b] =
            unsafe { [_mm_loadu_si128(halves[0].as_ptr().cast()), _mm_loadu_si128(halves[1].as_ptr().cast())] };
        both!(_mm512_cvtepi32_ps, both!(_mm512_cvtepu8_epi32, [a, b]))
    }
    #[inline(always)]
    fn reals_of_le(self, words: &[[u8; 2]; LANES]) -> Pair<__m512> {
        let (halves, _) = words.as_chunks::<{ LANES / 2 }>();
        let [a, b] =
            unsafe { [_mm256_loadu_si256(halves[0].as_ptr().cast()), _mm256_loadu_si256(halves[1].as_ptr().cast())] };
        both!(_mm512_cvtepi32_ps, both!(_mm512_cvtepu16_epi32, [a, b]))
    }
    #[inline(always)]
    fn is_greater_real(self, a: Pair<__m512>, b: Pair<__m512>) -> __mmask32 {
        mask_of_reals(both!(_mm512_cmp_ps_mask::<_CMP_GT_OQ>, a, b))
    }
    #[inline(always)]
    fn is_at_least_real(self, a: Pair<__m512>, b: Pair<__m512>) -> __mmask32 {
        mask_of_reals(both!(_mm512_cmp_ps_mask::<_CMP_GE_OQ>, a, b))
    }
    #[inline(always)]
    fn select_real(self, mask: __mmask32, [a, b]: Pair<__m512>, [c, d]: Pair<__m512>) -> Pair<__m512> {
        unsafe { [_mm512_mask_blend_ps(mask as u16, c, a), _mm512_mask_blend_ps((mask >> 16) as u16, d, b)] }
    }
    #[inline(always)]
    fn look_up_real(self, table: &[f32], places: Pair<__m512>) -> Pair<__m512> {
        assert!(!table.is_empty(), "the table must not be empty");
        // Memory beyond the table must not be read.
        let last = unsafe { [_mm512_set1_epi32(table.len() as i32 - 1); 2] };
        let [a, b] = both!(_mm512_min_epu32, both!(_mm512_cvttps_epi32, places), last);
        unsafe {
            [_mm512_i32gather_ps::<4>(a, table.as_ptr().cast()), _mm512_i32gather_ps::<4>(b, table.as_ptr().cast())]
        }
    }
    #[inline(always)]
    fn load_halves(self, first: &[f32; HALF], second: &[f32; HALF]) -> Pair<__m512> {
        unsafe { [_mm512_loadu_ps(first.as_ptr()), _mm512_loadu_ps(second.as_ptr())] }
    }
    #[inline(always)]
    fn store_halves(self, [a, b]: Pair<__m512>, first: &mut [f32; HALF], second: &mut [f32; HALF]) {
        unsafe {
            _mm512_storeu_ps(first.as_mut_ptr(), a);
            _mm512_storeu_ps(second.as_mut_ptr(), b);
        }
    }
    #[inline(always)]
    fn pair_sums(self, [a0, a1]: Pair<__m512>, [b0, b1]: Pair<__m512>) -> Pair<__m512> {
        unsafe {
            let even = _mm512_setr_epi32(0, 2, 4, 6, 8, 10, 12, 14, 16, 18, 20, 22, 24, 26, 28, 30);
            let odd = _mm512_add_epi32(even, _mm512_set1_epi32(1));
            [
                _mm512_add_ps(_mm512_permutex2var_ps(a0, even, a1), _mm512_permutex2var_ps(a0, odd, a1)),
                _mm512_add_ps(_mm512_permutex2var_ps(b0, even, b1), _mm512_permutex2var_ps(b0, odd, b1)),
            ]
        }
    }
    #[inline(always)]
    fn doubled(self, [a, b]: Pair<__m512>) -> [Pair<__m512>; 2] {
        unsafe {
            let low = _mm512_setr_epi32(0, 0, 1, 1, 2, 2, 3, 3, 4, 4, 5, 5, 6, 6, 7, 7);
            let high = _mm512_add_epi32(low, _mm512_set1_epi32(8));
            [
                [_mm512_permutexvar_ps(low, a), _mm512_permutexvar_ps(high, a)],
                [_mm512_permutexvar_ps(low, b), _mm512_permutexvar_ps(high, b)],
            ]
        }
    }
    #[inline(always)]
    fn store_real_words(self, a: Pair<__m512>, to: &mut [u16; LANES]) {
        let [a, b] = both!(_mm512_cvtepi32_epi16, both!(_mm512_cvttps_epi32, a));
        let (halves, _) = to.as_chunks_mut::<{ LANES / 2 }>();
        unsafe {
            _mm256_storeu_si256(halves[0].as_mut_ptr().cast(), a);
            _mm256_storeu_si256(halves[1].as_mut_ptr().cast(), b);
        }
    }
    #[inline(always)]
    fn store_real_bytes(self, a: Pair<__m512>, to: &mut [u8; LANES]) {
        let [a, b] = both!(_mm512_cvtepi32_epi8, both!(_mm512_cvttps_epi32, a));
        let (halves, _) = to.as_chunks_mut::<{ LANES / 2 }>();
        unsafe {
            _mm_storeu_si128(halves[0].as_mut_ptr().cast(), a);
            _mm_storeu_si128(halves[1].as_mut_ptr().cast(), b);
        }
    }

    inlined! {
        fn both(self, a: Pair<__mmask16>, b: Pair<__mmask16>) -> Pair<__mmask16> { [a[0] & b[0], a[1] & b[1]] }
    }
    #[inline(always)]
    fn load_floats(self, floats: &[f32; LANES]) -> Pair<__m512> {
        unsafe {
            let (low, high) = (_mm512_loadu_ps(floats.as_ptr()), _mm512_loadu_ps(floats[LANES / 2..].as_ptr()));
            [_mm512_shuffle_f32x4::<0x88>(low, high), _mm512_shuffle_f32x4::<0xdd>(low, high)]
        }
    }
    #[inline(always)]
    fn store_floats(self, [a, b]: Pair<__m512>, to: &mut [f32; LANES]) {
        unsafe {
            let (low, high) = (_mm512_shuffle_f32x4::<0x44>(a, b), _mm512_shuffle_f32x4::<0xee>(a, b));
            _mm512_storeu_ps(to.as_mut_ptr(), _mm512_shuffle_f32x4::<0xd8>(low, low));
            _mm512_storeu_ps(to[LANES / 2..].as_mut_ptr(), _mm512_shuffle_f32x4::<0xd8>(high, high));
        }
    }
    #[inline(always)]
    fn with_sign(self, magnitude: Pair<__m512>, sign: Pair<__m512>) -> Pair<__m512> {
        let bit = self.float(-0.0);
        let magnitude = both!(_mm512_andnot_ps, bit, magnitude);
        let sign = both!(_mm512_and_ps, bit, sign);
        both!(_mm512_or_ps, magnitude, sign)
    }
    #[inline(always)]
    fn exceeds(self, a: Pair<__m512>, b: Pair<__m512>) -> Pair<__mmask16> {
        both!(_mm512_cmp_ps_mask::<_CMP_GT_OQ>, a, b)
    }
    #[inline(always)]
    fn reaches(self, a: Pair<__m512>, b: Pair<__m512>) -> Pair<__mmask16> {
        both!(_mm512_cmp_ps_mask::<_CMP_GE_OQ>, a, b)
    }
    #[inline(always)]
    fn select_float(self, [t0, t1]: Pair<__mmask16>, yes: Pair<__m512>, no: Pair<__m512>) -> Pair<__m512> {
        unsafe { [_mm512_mask_mov_ps(no[0], t0, yes[0]), _mm512_mask_mov_ps(no[1], t1, yes[1])] }
    }
    #[inline(always)]
    fn truths(self, mask: __mmask32) -> Pair<__mmask16> {
        unsafe { [_pext_u32(mask, OF_REGISTERS[0]) as __mmask16, _pext_u32(mask, OF_REGISTERS[1]) as __mmask16] }
    }
    #[inline(always)]
    fn mask_of(self, [a, b]: Pair<__mmask16>) -> __mmask32 {
        unsafe { _pdep_u32(u32::from(a), OF_REGISTERS[0]) | _pdep_u32(u32::from(b), OF_REGISTERS[1]) }
    }
}
