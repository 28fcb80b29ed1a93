//! Lanes of AVX-512: 32 words a register; longs and floats are two registers, in the order in which words unpack.
#![allow(unsafe_code, reason = "instructions of the level; lanes exist only where the machine has them")]

use std::arch::x86_64::*;

use super::{LANES, Lanes, Level};

/// Proof that the machine has AVX-512 with bytes and words.
#[derive(Clone, Copy)]
pub(crate) struct Avx512(());

impl Avx512 {
    /// The lanes, if the machine has them and the level is in use.
    #[inline]
    pub(crate) fn in_use() -> Option<Self> {
        (Level::in_use() == Level::Avx512).then_some(Self(()))
    }

    /// The lanes, if the machine has them.
    #[inline]
    pub(super) fn new() -> Option<Self> {
        Level::Avx512.is_available().then_some(Self(()))
    }
}

type Pair<T> = [T; 2];

/// The same for both registers. No closures: what is not inlined at once would be calls of single instructions.
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

/// Truths of longs as those of words: as many, in the order of words.
#[inline(always)]
fn mask_of_words(masks: Pair<__mmask16>) -> __mmask32 {
    let [a, b] = both!(_mm512_movm_epi32, masks);
    // SAFETY: the lanes prove the instructions.
    unsafe { _mm512_movepi16_mask(_mm512_packs_epi32(a, b)) }
}

// SAFETY of all blocks below: a value of `Avx512` proves that the machine has the instructions; addresses come from references to
// arrays of the length that is read or written, and no instruction asks for alignment.
impl Lanes for Avx512 {
    type Words = __m512i;
    type Longs = Pair<__m512i>;
    type Floats = Pair<__m512>;
    type Mask = __mmask32;

    #[inline(always)]
    fn word(self, value: i16) -> __m512i {
        unsafe { _mm512_set1_epi16(value) }
    }
    #[inline(always)]
    fn words_of_bytes(self, bytes: &[u8; LANES]) -> __m512i {
        unsafe { _mm512_cvtepu8_epi16(_mm256_loadu_si256(bytes.as_ptr().cast())) }
    }
    #[inline(always)]
    fn load(self, words: &[u16; LANES]) -> __m512i {
        unsafe { _mm512_loadu_si512(words.as_ptr().cast()) }
    }
    #[inline(always)]
    fn words_of_le(self, words: &[[u8; 2]; LANES]) -> __m512i {
        unsafe { _mm512_loadu_si512(words.as_ptr().cast()) }
    }
    #[inline(always)]
    fn add(self, a: __m512i, b: __m512i) -> __m512i {
        unsafe { _mm512_add_epi16(a, b) }
    }
    #[inline(always)]
    fn sub(self, a: __m512i, b: __m512i) -> __m512i {
        unsafe { _mm512_sub_epi16(a, b) }
    }
    #[inline(always)]
    fn sub_saturating(self, a: __m512i, b: __m512i) -> __m512i {
        unsafe { _mm512_subs_epi16(a, b) }
    }
    #[inline(always)]
    fn abs(self, a: __m512i) -> __m512i {
        unsafe { _mm512_abs_epi16(a) }
    }
    #[inline(always)]
    fn max_unsigned(self, a: __m512i, b: __m512i) -> __m512i {
        unsafe { _mm512_max_epu16(a, b) }
    }
    #[inline(always)]
    fn min_unsigned(self, a: __m512i, b: __m512i) -> __m512i {
        unsafe { _mm512_min_epu16(a, b) }
    }
    #[inline(always)]
    fn times(self, a: __m512i, b: __m512i) -> __m512i {
        unsafe { _mm512_mulhrs_epi16(a, b) }
    }
    #[inline(always)]
    fn times_low(self, a: __m512i, b: __m512i) -> __m512i {
        unsafe { _mm512_mullo_epi16(a, b) }
    }
    #[inline(always)]
    fn times_high(self, a: __m512i, b: __m512i) -> __m512i {
        unsafe { _mm512_mulhi_epu16(a, b) }
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
    fn dot(self, a: __m512i, b: __m512i) -> i32 {
        unsafe { _mm512_reduce_add_epi32(_mm512_madd_epi16(a, b)) }
    }
    #[inline(always)]
    fn is_equal(self, a: __m512i, b: __m512i) -> __mmask32 {
        unsafe { _mm512_cmpeq_epi16_mask(a, b) }
    }
    #[inline(always)]
    fn is_greater(self, a: __m512i, b: __m512i) -> __mmask32 {
        unsafe { _mm512_cmpgt_epi16_mask(a, b) }
    }
    #[inline(always)]
    fn is_at_least(self, a: __m512i, b: __m512i) -> __mmask32 {
        unsafe { _mm512_cmpge_epu16_mask(a, b) }
    }
    #[inline(always)]
    fn select(self, mask: __mmask32, yes: __m512i, no: __m512i) -> __m512i {
        unsafe { _mm512_mask_blend_epi16(mask, no, yes) }
    }
    #[inline(always)]
    fn and_not(self, a: __mmask32, b: __mmask32) -> __mmask32 {
        a & !b
    }
    #[inline(always)]
    fn mask(self, bits: u32) -> __mmask32 {
        bits
    }
    #[inline(always)]
    fn bits(self, mask: __mmask32) -> u32 {
        mask
    }
    #[inline(always)]
    fn store(self, a: __m512i, to: &mut [u16; LANES]) {
        unsafe { _mm512_storeu_si512(to.as_mut_ptr().cast(), a) }
    }
    #[inline(always)]
    fn store_bytes(self, a: __m512i, to: &mut [u8; LANES]) {
        unsafe { _mm256_storeu_si256(to.as_mut_ptr().cast(), _mm512_cvtepi16_epi8(a)) }
    }
    #[inline(always)]
    fn store_mask(self, mask: __mmask32, to: &mut [bool; LANES]) {
        // Bytes of 0 and 1 are truths.
        unsafe { _mm256_storeu_si256(to.as_mut_ptr().cast(), _mm256_maskz_set1_epi8(mask, 1)) }
    }

    #[inline(always)]
    fn long(self, value: i32) -> Pair<__m512i> {
        unsafe { [_mm512_set1_epi32(value); 2] }
    }
    #[inline(always)]
    fn widen(self, a: __m512i) -> Pair<__m512i> {
        unsafe {
            let sign = _mm512_srai_epi16::<15>(a);
            [_mm512_unpacklo_epi16(a, sign), _mm512_unpackhi_epi16(a, sign)]
        }
    }
    #[inline(always)]
    fn weighted(self, a: __m512i, b: __m512i, [of_a, of_b]: [i16; 2]) -> Pair<__m512i> {
        let weights = unsafe { [_mm512_set1_epi32((i32::from(of_b) << 16) | i32::from(of_a as u16)); 2] };
        let pairs = unsafe { [_mm512_unpacklo_epi16(a, b), _mm512_unpackhi_epi16(a, b)] };
        both!(_mm512_madd_epi16, pairs, weights)
    }
    #[inline(always)]
    fn squares(self, a: __m512i, b: __m512i) -> Pair<__m512i> {
        let pairs = unsafe { [_mm512_unpacklo_epi16(a, b), _mm512_unpackhi_epi16(a, b)] };
        both!(_mm512_madd_epi16, pairs, pairs)
    }
    #[inline(always)]
    fn add_long(self, a: Pair<__m512i>, b: Pair<__m512i>) -> Pair<__m512i> {
        both!(_mm512_add_epi32, a, b)
    }
    #[inline(always)]
    fn is_negative(self, a: Pair<__m512i>) -> __mmask32 {
        mask_of_words(both!(_mm512_movepi32_mask, a))
    }
    #[inline(always)]
    fn narrow(self, [a, b]: Pair<__m512i>) -> __m512i {
        unsafe { _mm512_packus_epi32(a, b) }
    }
    #[inline(always)]
    fn floats(self, a: Pair<__m512i>) -> Pair<__m512> {
        both!(_mm512_cvtepi32_ps, a)
    }

    #[inline(always)]
    fn float(self, value: f32) -> Pair<__m512> {
        unsafe { [_mm512_set1_ps(value); 2] }
    }
    #[inline(always)]
    fn abs_float(self, a: Pair<__m512>) -> Pair<__m512> {
        both!(_mm512_abs_ps, a)
    }
    #[inline(always)]
    fn add_float(self, a: Pair<__m512>, b: Pair<__m512>) -> Pair<__m512> {
        both!(_mm512_add_ps, a, b)
    }
    #[inline(always)]
    fn times_float(self, a: Pair<__m512>, b: Pair<__m512>) -> Pair<__m512> {
        both!(_mm512_mul_ps, a, b)
    }
    #[inline(always)]
    fn over(self, a: Pair<__m512>, b: Pair<__m512>) -> Pair<__m512> {
        both!(_mm512_div_ps, a, b)
    }
    #[inline(always)]
    fn max_float(self, a: Pair<__m512>, b: Pair<__m512>) -> Pair<__m512> {
        both!(_mm512_max_ps, a, b)
    }
    #[inline(always)]
    fn min_float(self, a: Pair<__m512>, b: Pair<__m512>) -> Pair<__m512> {
        both!(_mm512_min_ps, a, b)
    }
    #[inline(always)]
    fn is_greater_float(self, a: Pair<__m512>, b: Pair<__m512>) -> __mmask32 {
        mask_of_words(both!(_mm512_cmp_ps_mask::<_CMP_GT_OQ>, a, b))
    }
    #[inline(always)]
    fn longs(self, a: Pair<__m512>) -> Pair<__m512i> {
        both!(_mm512_cvttps_epi32, a)
    }

    #[inline(always)]
    fn least(self, words: &[u16; LANES / 2]) -> [u16; LANES / 2] {
        let mut least = [0; LANES / 2];
        unsafe {
            let all = _mm256_loadu_si256(words.as_ptr().cast());
            let half = _mm_min_epu16(_mm256_castsi256_si128(all), _mm256_extracti128_si256::<1>(all));
            _mm256_storeu_si256(least.as_mut_ptr().cast(), _mm256_broadcastw_epi16(_mm_minpos_epu16(half)));
        }
        least
    }
}
