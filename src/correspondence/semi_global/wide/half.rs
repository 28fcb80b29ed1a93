//! Sixteen pixels: their segments, the drift along them, and what follows at a column.
#![allow(unsafe_code, reason = "values whose bits are all zero")]

use std::arch::x86_64::*;

use super::super::super::registers::{Crossing, signed_half, unsigned_half};
use super::super::outlook::COLUMN_MARGIN_PX;

/// Most columns of an interval.
pub(super) const MAX_WIDTH: i32 = 24;

/// Sixteen pixels.
#[derive(Clone, Copy)]
pub(super) struct Half {
    pub(super) begin: __m512,
    pub(super) end: __m512,
    pub(super) first_px: __m512,
    pub(super) last_px: __m512,
    pub(super) reference: __m512,
    pub(super) a: __m512,
    pub(super) b: __m512,
    pub(super) d: __m512,
    pub(super) row: __m512,
    /// b − a·d.
    pub(super) rise: __m512,
    /// Least and greatest Φ within the limits.
    pub(super) least: __m512,
    pub(super) most: __m512,
    pub(super) phase_turns: __m512,
    pub(super) drift: [__m512; 6],
    pub(super) middle_px: __m512,
    pub(super) per_px: __m512,
    pub(super) sd_turns: __m512,
}

/// Columns in which candidates can lie.
pub(super) struct Interval {
    pub(super) begin: __m512i,
    /// The last column, rounded down and up.
    pub(super) end_floor: __m512i,
    pub(super) end_ceil: __m512i,
    /// Pixels that have such columns, and those for which they are few.
    pub(super) some: u16,
    pub(super) narrow: u16,
}

impl Half {
    // SAFETY: all bits zero is a value of these.
    pub(super) const NONE: Self = unsafe { std::mem::zeroed() };

    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
    #[inline]
    pub(super) fn phase_turns_at(&self, column_px: __m512) -> __m512 {
        let s = _mm512_sub_ps(column_px, self.reference);
        let above = _mm512_add_ps(self.a, _mm512_mul_ps(self.b, s));
        let below = _mm512_add_ps(_mm512_set1_ps(1.0), _mm512_mul_ps(self.d, s));
        _mm512_div_ps(above, below)
    }

    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
    #[inline]
    pub(super) fn drift_at(&self, column_px: __m512) -> __m512 {
        let d = _mm512_mul_ps(_mm512_sub_ps(column_px, self.middle_px), self.per_px);
        let [c0, c1, c2, c3, c4, c5] = self.drift;
        let then = |sum: __m512, c: __m512| _mm512_add_ps(_mm512_mul_ps(sum, d), c);
        then(then(then(then(then(c5, c4), c3), c2), c1), c0)
    }

    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
    #[inline]
    pub(super) fn order_and_rest(&self, column_px: __m512) -> (__m512i, __m512) {
        let turns = _mm512_sub_ps(self.phase_turns_at(column_px), self.drift_at(column_px));
        let turns = _mm512_sub_ps(turns, self.phase_turns);
        let half = _mm512_or_ps(_mm512_and_ps(turns, _mm512_set1_ps(-0.0)), _mm512_set1_ps(0.5));
        let order = _mm512_cvttps_epi32(_mm512_add_ps(turns, half));
        (order, _mm512_sub_ps(turns, _mm512_cvtepi32_ps(order)))
    }

    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
    #[inline]
    pub(super) fn is_in_volume(&self, column_px: __m512) -> u16 {
        _mm512_cmp_ps_mask::<_CMP_GE_OQ>(column_px, self.begin) & _mm512_cmp_ps_mask::<_CMP_LE_OQ>(column_px, self.end)
    }

    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
    #[inline]
    pub(super) fn is_within_limits(&self, column_px: __m512) -> u16 {
        _mm512_cmp_ps_mask::<_CMP_GE_OQ>(column_px, self.first_px)
            & _mm512_cmp_ps_mask::<_CMP_LE_OQ>(column_px, self.last_px)
    }

    /// Column at which Φ has a value, clamped to the limits, and the inverse of how it changes there.
    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
    #[inline]
    pub(super) fn column_at(&self, turns: __m512) -> (__m512, __m512) {
        let inverse = _mm512_div_ps(_mm512_set1_ps(1.0), _mm512_sub_ps(self.b, _mm512_mul_ps(self.d, turns)));
        let offset = _mm512_mul_ps(_mm512_sub_ps(turns, self.a), inverse);
        let column_px = _mm512_add_ps(self.reference, offset);
        (_mm512_min_ps(_mm512_max_ps(column_px, self.first_px), self.last_px), inverse)
    }

    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
    #[inline]
    pub(super) fn columns_of(&self, order: __m512i, reach: __m512) -> Interval {
        let clamp = |turns: __m512| _mm512_min_ps(_mm512_max_ps(turns, self.least), self.most);
        let target = _mm512_add_ps(_mm512_cvtepi32_ps(order), self.phase_turns);
        let (at_target, _) = self.column_at(clamp(target));
        let middle = _mm512_add_ps(target, self.drift_at(at_target));
        let some = _mm512_cmp_ps_mask::<_CMP_GE_OQ>(_mm512_add_ps(middle, reach), self.least)
            & _mm512_cmp_ps_mask::<_CMP_LE_OQ>(_mm512_sub_ps(middle, reach), self.most);
        let clamped = clamp(middle);
        let (column_px, inverse) = self.column_at(clamped);
        let per_turn = _mm512_abs_ps(_mm512_mul_ps(_mm512_mul_ps(self.rise, inverse), inverse));
        let off = _mm512_abs_ps(_mm512_sub_ps(middle, clamped));
        let half = _mm512_mul_ps(_mm512_add_ps(reach, off), per_turn);
        let half = _mm512_add_ps(half, _mm512_set1_ps(COLUMN_MARGIN_PX));
        let narrow = _mm512_cmp_ps_mask::<_CMP_LE_OQ>(half, _mm512_set1_ps((MAX_WIDTH / 2 - 1) as f32));
        let zero = _mm512_setzero_ps();
        let begin = _mm512_max_ps(_mm512_sub_ps(column_px, half), zero);
        let end = _mm512_max_ps(_mm512_add_ps(column_px, half), zero);
        Interval {
            begin: _mm512_cvttps_epi32(begin),
            end_floor: _mm512_cvttps_epi32(end),
            end_ceil: _mm512_cvttps_epi32(_mm512_roundscale_ps::<0x0a>(end)),
            some,
            narrow,
        }
    }
}

/// Column and slope of crossings.
#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
#[inline]
pub(super) fn crossing_of(crossing: &Crossing, half: usize) -> (__m512, __m512i) {
    let (before, after) = (signed_half(crossing.before, half), signed_half(crossing.after, half));
    let slope = _mm512_sub_epi32(after, before);
    let down = _mm512_cvtepi32_ps(_mm512_sub_epi32(_mm512_setzero_si512(), slope));
    let offset = _mm512_div_ps(_mm512_cvtepi32_ps(before), down);
    let column = _mm512_sub_epi32(unsigned_half(crossing.after_at, half), _mm512_set1_epi32(1));
    (_mm512_add_ps(_mm512_cvtepi32_ps(column), offset), slope)
}

/// Rounded to the nearest whole number, halves away from zero, as `f32::round` does.
#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
#[inline]
pub(super) fn nearest_whole(value: __m512) -> __m512i {
    let whole = _mm512_cvttps_epi32(value);
    let rest = _mm512_sub_ps(value, _mm512_cvtepi32_ps(whole));
    let one = _mm512_set1_epi32(1);
    let up = _mm512_cmp_ps_mask::<_CMP_GE_OQ>(rest, _mm512_set1_ps(0.5));
    let down = _mm512_cmp_ps_mask::<_CMP_LE_OQ>(rest, _mm512_set1_ps(-0.5));
    _mm512_mask_sub_epi32(_mm512_mask_add_epi32(whole, up, whole, one), down, whole, one)
}
