//! Loads, stores, and halves of registers.
#![allow(unsafe_code, reason = "loads and stores")]

use std::arch::x86_64::*;

use super::BLOCK;

#[inline]
pub(in super::super) fn join([low, high]: [u16; 2]) -> u32 {
    u32::from(low) | u32::from(high) << 16
}

/// The least of the signed words of some lanes.
#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
#[inline]
pub(in super::super) fn least_word(lanes: u32, words: __m512i) -> i32 {
    let words = _mm512_mask_mov_epi16(_mm512_set1_epi16(i16::MAX), lanes, words);
    let half = _mm256_min_epi16(_mm512_castsi512_si256(words), _mm512_extracti64x4_epi64::<1>(words));
    let quarter = _mm_min_epi16(_mm256_castsi256_si128(half), _mm256_extracti128_si256::<1>(half));
    // None is negative here, so that the unsigned minimum is the signed one.
    _mm_cvtsi128_si32(_mm_minpos_epu16(quarter)) & 0xffff
}

/// Low words of longs.
#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
#[inline]
pub(in super::super) fn narrow([low, high]: [__m512i; 2]) -> __m512i {
    _mm512_inserti64x4::<1>(_mm512_castsi256_si512(_mm512_cvtepi32_epi16(low)), _mm512_cvtepi32_epi16(high))
}

#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
#[inline]
pub(in super::super) fn signed_half(words: __m512i, half: usize) -> __m512i {
    if half == 0 {
        _mm512_cvtepi16_epi32(_mm512_castsi512_si256(words))
    } else {
        _mm512_cvtepi16_epi32(_mm512_extracti64x4_epi64::<1>(words))
    }
}

#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
#[inline]
pub(in super::super) fn unsigned_half(words: __m512i, half: usize) -> __m512i {
    if half == 0 {
        _mm512_cvtepu16_epi32(_mm512_castsi512_si256(words))
    } else {
        _mm512_cvtepu16_epi32(_mm512_extracti64x4_epi64::<1>(words))
    }
}

#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
#[inline]
pub(in super::super) fn widen(words: [u16; 16]) -> __m512i {
    // SAFETY: sixteen words are read.
    _mm512_cvtepu16_epi32(unsafe { _mm256_loadu_si256(words.as_ptr().cast()) })
}

#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
#[inline]
pub(in super::super) fn load_words(words: &[u16; BLOCK]) -> __m512i {
    // SAFETY: 32 words are read.
    unsafe { _mm512_loadu_si512(words.as_ptr().cast()) }
}

#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
#[inline]
pub(in super::super) fn load_slice(words: &[u16]) -> __m512i {
    assert!(words.len() == BLOCK);
    // SAFETY: 32 words are read.
    unsafe { _mm512_loadu_si512(words.as_ptr().cast()) }
}

#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
#[inline]
pub(in super::super) fn load_floats(floats: &[f32]) -> __m512 {
    assert!(floats.len() == 16);
    // SAFETY: sixteen floats are read.
    unsafe { _mm512_loadu_ps(floats.as_ptr()) }
}

#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
#[inline]
pub(in super::super) fn store_floats(floats: __m512, to: &mut [f32]) {
    let to = &mut to[..16];
    // SAFETY: sixteen floats are written.
    unsafe { _mm512_storeu_ps(to.as_mut_ptr(), floats) }
}

#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
#[inline]
pub(in super::super) fn store_narrow(longs: __m512i, to: &mut [i16]) {
    let to = &mut to[..16];
    // SAFETY: sixteen words are written.
    unsafe { _mm256_storeu_si256(to.as_mut_ptr().cast(), _mm512_cvtepi32_epi16(longs)) }
}
