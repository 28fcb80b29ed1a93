//! Rows of C2 in registers, and where the phases of pixels are crossed in them.
#![allow(unsafe_code, reason = "values whose bits are all zero")]

use std::arch::x86_64::*;

use super::super::epipolar_image::{EpipolarImage, MAX_NEIGHBOUR_STEP};
use super::super::row_view::MAX_COLUMN_STEP;
use super::words::{join, load_slice, narrow};

/// Columns that two registers hold.
pub(in super::super) const COLUMNS: i32 = 64;

/// Two rows of C2 for each lane: the first or the second and the one below.
pub(in super::super) struct Rows {
    /// Where the rows begin.
    begins: [usize; 3],
    /// Lanes whose upper row is the second.
    second: u32,
    /// Whether there are any.
    straddles: bool,
    /// Share of the lower row, 1/65536.
    below: __m512i,
}

impl Rows {
    /// The rows of C2 that the lanes look into.
    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
    pub(in super::super) fn of(image: &EpipolarImage, row: [__m512; 2], regular: u32, irregular: &mut u32) -> Self {
        let width = image.width;
        let last = (image.phase.len() / width - 1) as i32;
        let upper = [0, 1].map(|h| _mm512_min_epi32(_mm512_cvttps_epi32(row[h]), _mm512_set1_epi32(last)));
        let least = |h: usize| _mm512_mask_reduce_min_epi32((regular >> (16 * h)) as u16, upper[h]);
        let first = least(0).min(least(1)).clamp(0, last);
        let is_second = |h: usize| _mm512_cmpeq_epi32_mask(upper[h], _mm512_set1_epi32(first + 1));
        let is_first = |h: usize| _mm512_cmpeq_epi32_mask(upper[h], _mm512_set1_epi32(first));
        let (one, two) = (join([is_first(0), is_first(1)]), join([is_second(0), is_second(1)]));
        *irregular |= regular & !(one | two);
        let below = |h: usize| {
            let share = _mm512_sub_ps(row[h], _mm512_cvtepi32_ps(upper[h]));
            _mm512_cvttps_epi32(_mm512_mul_ps(share, _mm512_set1_ps(65536.0)))
        };
        let begins = [0, 1, 2].map(|r| ((first + r).min(last) as usize) * width);
        Self { begins, second: two, straddles: two & regular != 0, below: narrow([below(0), below(1)]) }
    }

    /// 64 columns of each row from a place on.
    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
    #[inline]
    pub(in super::super) fn tables(&self, image: &EpipolarImage, base: usize) -> [[__m512i; 2]; 3] {
        let [first, second, third] = self.begins;
        [columns(image, first + base), columns(image, second + base), columns(image, third + base)]
    }

    /// The phase at places of the tables less that of the pixels, as [`super::super::row_view::RowView`] has it.
    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
    #[inline]
    pub(in super::super) fn difference(
        &self,
        tables: &[[__m512i; 2]; 3],
        place: __m512i,
        phases: __m512i,
    ) -> Differences {
        let of = |row: usize| _mm512_permutex2var_epi16(tables[row][0], place, tables[row][1]);
        let (mut upper, mut lower) = (of(0), of(1));
        if self.straddles {
            upper = _mm512_mask_blend_epi16(self.second, upper, lower);
            lower = _mm512_mask_blend_epi16(self.second, lower, of(2));
        }
        let none = _mm512_set1_epi16(EpipolarImage::NO_PHASE as i16);
        let (has_upper, has_lower) = (_mm512_cmpneq_epi16_mask(upper, none), _mm512_cmpneq_epi16_mask(lower, none));
        let step = _mm512_sub_epi16(lower, upper);
        // |−32768| is 32768 of unsigned words.
        let small = _mm512_cmple_epu16_mask(_mm512_abs_epi16(step), _mm512_set1_epi16(MAX_NEIGHBOUR_STEP as i16));
        let mixed = has_upper & has_lower & small;
        let part = _mm512_add_epi16(
            high_of_signed(step, self.below),
            _mm512_srli_epi16::<15>(_mm512_mullo_epi16(step, self.below)),
        );
        let upper_nearer = _mm512_cmpge_epi16_mask(self.below, _mm512_setzero_si512());
        let nearest = _mm512_mask_blend_epi16(upper_nearer, lower, upper);
        let has_nearest = (upper_nearer & has_upper) | (!upper_nearer & has_lower);
        let phase = _mm512_mask_add_epi16(nearest, mixed, upper, part);
        Differences { value: _mm512_sub_epi16(phase, phases), known: mixed | has_nearest }
    }
}

/// 64 columns of a row from a place on; those beyond the image are those of its end.
#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
fn columns(image: &EpipolarImage, begin: usize) -> [__m512i; 2] {
    let columns = COLUMNS as usize;
    let all = &image.phase;
    let begin_at = begin.min(all.len().saturating_sub(1));
    match all[begin_at..].first_chunk::<64>() {
        Some(chunk) => {
            let (low, high) = chunk.split_at(columns / 2);
            [load_slice(low), load_slice(high)]
        }
        None => {
            let mut chunk = [EpipolarImage::NO_PHASE; 64];
            chunk[..all.len() - begin_at].copy_from_slice(&all[begin_at..]);
            let (low, high) = chunk.split_at(columns / 2);
            [load_slice(low), load_slice(high)]
        }
    }
}

/// The high word of the product of a signed and an unsigned word.
#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
#[inline]
fn high_of_signed(signed: __m512i, unsigned: __m512i) -> __m512i {
    let correction = _mm512_and_si512(_mm512_srai_epi16::<15>(signed), unsigned);
    _mm512_sub_epi16(_mm512_mulhi_epu16(signed, unsigned), correction)
}

/// Phases less those of the pixels, and where there are any.
#[derive(Clone, Copy)]
pub(in super::super) struct Differences {
    pub(in super::super) value: __m512i,
    pub(in super::super) known: u32,
}

impl Differences {
    // SAFETY: all bits zero is a value of these.
    pub(in super::super) const NONE: Self = unsafe { std::mem::zeroed() };
}

/// Between which neighbours the phase of the pixel lies.
#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
#[inline]
pub(in super::super) fn crosses(before: Differences, after: Differences) -> u32 {
    let zero = _mm512_setzero_si512();
    let rises = _mm512_cmpgt_epi16_mask(after.value, zero);
    let changes_sign = _mm512_cmpgt_epi16_mask(before.value, zero) ^ rises;
    let step = _mm512_sub_epi16(after.value, before.value);
    let step = _mm512_mask_sub_epi16(step, !rises, zero, step);
    before.known & after.known & changes_sign & _mm512_cmple_epu16_mask(step, _mm512_set1_epi16(MAX_COLUMN_STEP as i16))
}

/// One crossing a lane.
pub(in super::super) struct Crossing {
    pub(in super::super) hit: u32,
    pub(in super::super) before: __m512i,
    pub(in super::super) after: __m512i,
    /// Place of the column after it.
    pub(in super::super) after_at: __m512i,
}

impl Crossing {
    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
    #[inline]
    pub(in super::super) fn none() -> Self {
        let zero = _mm512_setzero_si512();
        Self { hit: 0, before: zero, after: zero, after_at: zero }
    }

    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
    #[inline]
    pub(in super::super) fn take(&mut self, lanes: u32, before: __m512i, after: __m512i, at: __m512i) {
        self.hit |= lanes;
        self.before = _mm512_mask_mov_epi16(self.before, lanes, before);
        self.after = _mm512_mask_mov_epi16(self.after, lanes, after);
        self.after_at = _mm512_mask_mov_epi16(self.after_at, lanes, at);
    }
}
