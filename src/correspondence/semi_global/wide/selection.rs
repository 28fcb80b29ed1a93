//! The best candidates of one order of each of 32 pixels.
#![allow(unsafe_code, reason = "instructions of the level")]

use std::arch::x86_64::*;

use crate::simd::Avx512;

use super::super::super::registers::{
    BLOCK, COLUMNS, Crossing, Differences, crosses, join, least_word, load_signed, narrow, signed_half, store_floats,
    store_narrow, unsigned_half,
};
use super::super::super::row_view::{MAX_RIM_BEND, RIM_SLOPES};
use super::super::selection::{ABSENT, REACH_SD, REACH_TURNS, RIM_COLUMNS};
use super::half::{Half, MAX_WIDTH, crossing_of, nearest_whole};
use super::{Block, Room};

/// Columns beside an interval that are looked at for rims: those of the rims, and their neighbours.
const BESIDE: i32 = RIM_COLUMNS as i32 + 1;
/// Differences that are kept of an interval.
pub(super) const MAX_DIFFERENCES: usize = (MAX_WIDTH + 2 * BESIDE + 2) as usize;

/// The selected candidates of 32 pixels.
pub(in super::super) struct Found {
    /// Pixels left to the scalar form.
    pub(in super::super) irregular: u32,
    /// Absolute phases of those that have one.
    pub(in super::super) absolute: [i32; BLOCK],
    /// Whether it lies in the volume.
    pub(in super::super) in_volume: [bool; BLOCK],
    pub(in super::super) column_px: [f32; BLOCK],
    pub(in super::super) z: [f32; BLOCK],
    pub(in super::super) delta: [i16; BLOCK],
    pub(in super::super) slope: [i16; BLOCK],
}

impl Found {
    pub(in super::super) const NONE: Self = Self {
        irregular: 0,
        absolute: [ABSENT; BLOCK],
        in_volume: [false; BLOCK],
        column_px: [0.0; BLOCK],
        z: [0.0; BLOCK],
        delta: [0; BLOCK],
        slope: [0; BLOCK],
    };
}

impl Block<'_> {
    /// The candidate of an order of each pixel with the least |δ − drift|.
    #[inline]
    pub(in super::super) fn select(&mut self, _: Avx512, order: &[i16; BLOCK], room: &mut Room, found: &mut Found) {
        // SAFETY: the lanes prove that the machine has the instructions.
        unsafe { self.select_of_level(order, room, found) }
    }

    #[target_feature(
        enable = "avx512f,avx512bw,avx512dq,avx512vl,avx512cd,avx512vbmi,avx512vnni,bmi1,bmi2,lzcnt,popcnt"
    )]
    fn select_of_level(&mut self, order: &[i16; BLOCK], room: &mut Room, found: &mut Found) {
        let order = load_signed(order);
        let reach = [0, 1].map(|h| {
            let of_sd = _mm512_mul_ps(_mm512_set1_ps(REACH_SD), self.halves[h].sd_turns);
            _mm512_max_ps(_mm512_set1_ps(REACH_TURNS), of_sd)
        });
        let mut best = [0, 1].map(|h| Best::none(order[h], reach[h]));
        let interval = [self.halves[0].columns_of(order[0], reach[0]), self.halves[1].columns_of(order[1], reach[1])];
        let has = self.regular & join([interval[0].some, interval[1].some]);
        let begin = narrow([interval[0].begin, interval[1].begin]);
        let floor = narrow([interval[0].end_floor, interval[1].end_floor]);
        let ceil = narrow([interval[0].end_ceil, interval[1].end_ceil]);
        // So that no column of these is beyond the image.
        let beside = _mm512_set1_epi16(BESIDE as i16);
        let last_floor = _mm512_set1_epi16((self.image.width as i32 - 2 - BESIDE).max(0) as i16);
        let inner = _mm512_cmpge_epi16_mask(begin, beside) & _mm512_cmple_epi16_mask(floor, last_floor);
        let odd = has & !(join([interval[0].narrow, interval[1].narrow]) & inner);
        self.give_up(odd);
        let mut todo = has & !odd;
        let start = _mm512_sub_epi16(begin, beside);
        // One more than the last column of a rim.
        let stop = _mm512_add_epi16(floor, _mm512_set1_epi16(1 + BESIDE as i16));
        while todo != 0 {
            let base = least_word(todo, start);
            let bases = _mm512_set1_epi16(base as i16);
            let (place, last) = (_mm512_sub_epi16(start, bases), _mm512_sub_epi16(stop, bases));
            let here = _mm512_mask_cmplt_epi16_mask(todo, last, _mm512_set1_epi16(COLUMNS as i16));
            todo &= !here;
            self.consider_all(base, place, [begin, ceil, stop], here, &mut room.differences, &mut best);
        }
        for h in 0..2 {
            let (half, best) = (&self.halves[h], &best[h]);
            let present = best.present & (self.regular >> (16 * h)) as u16;
            let absolute = _mm512_add_epi32(_mm512_slli_epi32::<16>(best.order), unsigned_half(self.phases, h));
            let absolute = _mm512_mask_mov_epi32(_mm512_set1_epi32(ABSENT), present, absolute);
            let in_volume = _mm_maskz_set1_epi8(present & half.is_in_volume(best.column_px), 1);
            // SAFETY: sixteen longs are written, and sixteen truths that are 0 or 1.
            unsafe {
                _mm512_storeu_si512(found.absolute[16 * h..][..16].as_mut_ptr().cast(), absolute);
                _mm_storeu_si128(found.in_volume[16 * h..][..16].as_mut_ptr().cast(), in_volume);
            }
            let delta_turns = _mm512_add_ps(best.rest, half.drift_at(best.column_px));
            let delta = nearest_whole(_mm512_mul_ps(delta_turns, _mm512_set1_ps(65536.0)));
            let delta = _mm512_max_epi32(_mm512_min_epi32(delta, _mm512_set1_epi32(32767)), _mm512_set1_epi32(-32768));
            store_floats(best.column_px, &mut found.column_px[16 * h..]);
            store_floats(_mm512_div_ps(best.rest, half.sd_turns), &mut found.z[16 * h..]);
            store_narrow(delta, &mut found.delta[16 * h..]);
            store_narrow(best.slope, &mut found.slope[16 * h..]);
        }
        found.irregular = self.irregular;
    }

    /// Considers the crossings and the rims of intervals that lie within 64 columns from `base` on, and whose first columns
    /// are at `place`: crossings from `begin` to `ceil`, rims up to the column before `stop`.
    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
    #[inline]
    fn consider_all(
        &self,
        base: i32,
        place: __m512i,
        [begin, ceil, stop]: [__m512i; 3],
        here: u32,
        differences: &mut [Differences; MAX_DIFFERENCES],
        best: &mut [Best; 2],
    ) {
        let tables = self.rows.tables(self.image, base as usize);
        let (one, bases) = (_mm512_set1_epi16(1), _mm512_set1_epi16(base as i16));
        let mut column = _mm512_add_epi16(place, bases);
        let first_column = column;
        let mut crossing = Crossing::none();
        let mut count = 0;
        let mut within = here;
        let mut rims = 0;
        while within != 0 {
            differences[count] = self.rows.difference(&tables, _mm512_sub_epi16(column, bases), self.phases);
            let after = differences[count];
            if count >= 1 {
                let before = differences[count - 1];
                let is_pair = _mm512_cmpgt_epi16_mask(column, begin) & _mm512_cmple_epi16_mask(column, ceil);
                let hit = crosses(before, after) & within & is_pair;
                if hit & crossing.hit != 0 {
                    self.consider_crossing(&crossing, best);
                    crossing = Crossing::none();
                }
                crossing.take(hit, before.value, after.value, column);
                if count >= 2 {
                    let inner = differences[count - 2];
                    rims |= within & (beyond_rim(inner, before, after) | beyond_rim(after, before, inner));
                }
            }
            count += 1;
            column = _mm512_add_epi16(column, one);
            within &= _mm512_cmple_epi16_mask(column, stop);
        }
        if crossing.hit != 0 {
            self.consider_crossing(&crossing, best);
        }
        if rims == 0 {
            return;
        }
        let mut column = _mm512_add_epi16(first_column, one);
        let mut within = here & rims;
        for around in differences[..count].windows(3) {
            let [left, middle, right] = [around[0], around[1], around[2]];
            within &= _mm512_cmplt_epi16_mask(column, stop);
            let at_left = within & beyond_rim(left, middle, right);
            if at_left != 0 {
                self.consider_rim(middle, right, column, at_left, -1.0, best);
            }
            let at_right = within & beyond_rim(right, middle, left);
            if at_right != 0 {
                self.consider_rim(middle, left, column, at_right, 1.0, best);
            }
            column = _mm512_add_epi16(column, one);
        }
    }

    /// Considers crossings whose columns are told.
    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
    #[inline]
    fn consider_crossing(&self, crossing: &Crossing, best: &mut [Best; 2]) {
        for h in 0..2 {
            let (column_px, slope) = crossing_of(crossing, h);
            best[h].consider(&self.halves[h], column_px, slope, (crossing.hit >> (16 * h)) as u16);
        }
    }

    /// Considers where surfaces that end at a column would have the phase beyond it.
    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
    #[inline]
    fn consider_rim(
        &self,
        middle: Differences,
        inner: Differences,
        column: __m512i,
        lanes: u32,
        sense: f32,
        best: &mut [Best; 2],
    ) {
        let outwards = _mm512_sub_epi16(middle.value, inner.value);
        for h in 0..2 {
            let outwards = _mm512_cvtepi32_ps(signed_half(outwards, h));
            let middle = _mm512_cvtepi32_ps(signed_half(middle.value, h));
            let distance_px = _mm512_div_ps(_mm512_sub_ps(_mm512_setzero_ps(), middle), outwards);
            let sense = _mm512_set1_ps(sense);
            let offset_px = _mm512_mul_ps(sense, distance_px);
            let column_px = _mm512_add_ps(_mm512_cvtepi32_ps(signed_half(column, h)), offset_px);
            let slope = _mm512_cvttps_epi32(_mm512_mul_ps(sense, outwards));
            best[h].consider(&self.halves[h], column_px, slope, (lanes >> (16 * h)) as u16);
        }
    }
}

/// The best candidates of sixteen pixels so far.
struct Best {
    order: __m512i,
    reach: __m512,
    present: u16,
    rest: __m512,
    column_px: __m512,
    slope: __m512i,
}

impl Best {
    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
    #[inline]
    fn none(order: __m512i, reach: __m512) -> Self {
        let zero = _mm512_setzero_ps();
        Self { order, reach, present: 0, rest: zero, column_px: zero, slope: _mm512_setzero_si512() }
    }

    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
    #[inline]
    fn consider(&mut self, half: &Half, column_px: __m512, slope: __m512i, lanes: u16) {
        let (found, rest) = half.order_and_rest(column_px);
        let off = _mm512_abs_ps(rest);
        let fits = lanes
            & half.is_within_limits(column_px)
            & _mm512_cmpeq_epi32_mask(found, self.order)
            & _mm512_cmp_ps_mask::<_CMP_LE_OQ>(off, self.reach);
        let better = fits & (!self.present | _mm512_cmp_ps_mask::<_CMP_LT_OQ>(off, _mm512_abs_ps(self.rest)));
        self.present |= better;
        self.rest = _mm512_mask_mov_ps(self.rest, better, rest);
        self.column_px = _mm512_mask_mov_ps(self.column_px, better, column_px);
        self.slope = _mm512_mask_mov_epi32(self.slope, better, slope);
    }
}

/// Where a surface ends at a column and would have the phase within a pixel beyond it, see
/// [`super::super::super::row_view`]: `outer` does not continue what `inner` and the column show.
#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
#[inline]
fn beyond_rim(outer: Differences, here: Differences, inner: Differences) -> u32 {
    let outwards = _mm512_sub_epi16(here.value, inner.value);
    let bend = _mm512_abs_epi16(_mm512_subs_epi16(_mm512_sub_epi16(outer.value, here.value), outwards));
    // |−32768| is 32768 of unsigned words.
    let continued = outer.known & _mm512_cmple_epu16_mask(bend, _mm512_set1_epi16(MAX_RIM_BEND as i16));
    let steepness = _mm512_abs_epi16(outwards);
    let steep = _mm512_cmpge_epu16_mask(steepness, _mm512_set1_epi16(*RIM_SLOPES.start() as i16))
        & _mm512_cmple_epu16_mask(steepness, _mm512_set1_epi16(*RIM_SLOPES.end() as i16));
    // −here/outwards lies between 0 and 1.
    let zero = _mm512_setzero_si512();
    let opposite = _mm512_movepi16_mask(_mm512_xor_si512(here.value, outwards));
    let near =
        _mm512_cmpneq_epi16_mask(here.value, zero) & _mm512_cmple_epu16_mask(_mm512_abs_epi16(here.value), steepness);
    here.known & inner.known & !continued & steep & opposite & near
}
