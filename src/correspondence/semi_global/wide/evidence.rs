//! Energies of all orders of 32 pixels.
#![allow(unsafe_code, reason = "instructions of the level")]

use std::arch::x86_64::*;

use crate::simd::Avx512;

use super::super::super::registers::{
    BLOCK, COLUMNS, Crossing, crosses, greatest_byte, join, least_word, load_bytes, load_signed, narrow, store_bytes,
};
use super::super::evidence::{Energies, MAX_Z, MISSING, NO_ORDER, OUTSIDE, STEPS_PER_Z};
use super::super::windows::LANE_STEP;
use super::half::crossing_of;
use super::{Block, Room};

impl Block<'_> {
    /// Energies of sixteen orders of each pixel, from so many after order `first` on, of all `count` that it has, into `tile`,
    /// where those of each pixel begin `lanes` after those of the one before; and how many of them pass, added to `passing`.
    #[inline]
    pub(in super::super) fn evidence(
        &mut self,
        _: Avx512,
        skipped: usize,
        first: &[i16; BLOCK],
        count: &[u8; BLOCK],
        energies: &Energies,
        room: &mut Room,
        (tile, lanes): (&mut [u8], usize),
        passing: &mut [u8; BLOCK],
    ) {
        // SAFETY: the lanes prove that the machine has the instructions.
        unsafe { self.evidence_of_level(skipped, first, count, energies, room, (tile, lanes), passing) }
    }

    #[target_feature(
        enable = "avx512f,avx512bw,avx512dq,avx512vl,avx512cd,avx512vbmi,avx512vnni,bmi1,bmi2,lzcnt,popcnt"
    )]
    fn evidence_of_level(
        &mut self,
        skipped: usize,
        first: &[i16; BLOCK],
        count: &[u8; BLOCK],
        energies: &Energies,
        room: &mut Room,
        (tile, lanes): (&mut [u8], usize),
        passing: &mut [u8; BLOCK],
    ) {
        let skip = _mm512_set1_epi32(skipped as i32);
        let firsts = load_signed(first).map(|first| _mm512_add_epi32(first, skip));
        let counts = _mm256_subs_epu8(load_bytes(count), _mm256_set1_epi8(skipped as i8));
        let orders = usize::from(greatest_byte(counts)).min(LANE_STEP);
        let reach = [0, 1].map(|h| _mm512_mul_ps(_mm512_set1_ps(MAX_Z), self.halves[h].sd_turns));
        // Each step for all orders: what one waits for, the others compute.
        let Room { columns, crossings, .. } = room;
        crossings.lost = 0;
        let mut wide = 0;
        for (lane, columns) in columns.iter_mut().enumerate().take(orders) {
            let own = _mm256_cmpgt_epu8_mask(counts, _mm256_set1_epi8(lane as i8)) & self.regular;
            let lane = _mm512_set1_epi32(lane as i32);
            let low = self.halves[0].columns_of(_mm512_add_epi32(firsts[0], lane), reach[0]);
            let high = self.halves[1].columns_of(_mm512_add_epi32(firsts[1], lane), reach[1]);
            let some = own & join([low.some, high.some]);
            wide |= some & !join([low.narrow, high.narrow]);
            let begin = narrow([low.begin, high.begin]);
            let end = narrow([low.end_ceil, high.end_ceil]);
            *columns = Columns { own, some, begin, end };
        }
        self.give_up(wide);
        let mut best = [[_mm512_set1_epi32(i32::from(MISSING)); 2]; LANE_STEP];
        for (lane, columns) in columns.iter().enumerate().take(orders) {
            self.cross(lane, columns, crossings);
            if crossings.count > LANE_STEP {
                self.weigh(crossings, firsts, energies, &mut best);
            }
        }
        self.weigh(crossings, firsts, energies, &mut best);
        self.give_up(crossings.lost);
        let none = _mm256_set1_epi8(NO_ORDER as i8);
        let mut by_order = [none; LANE_STEP];
        let limit = _mm256_set1_epi8(energies.limit as i8);
        let mut passes = load_bytes(passing);
        for lane in 0..orders {
            let own = columns[lane].own & self.regular;
            let bytes = _mm256_inserti128_si256::<1>(
                _mm256_castsi128_si256(_mm512_cvtepi32_epi8(best[lane][0])),
                _mm512_cvtepi32_epi8(best[lane][1]),
            );
            by_order[lane] = _mm256_mask_mov_epi8(none, own, bytes);
            let pass = _mm256_mask_cmplt_epu8_mask(own, bytes, limit);
            passes = _mm256_mask_add_epi8(passes, pass, passes, _mm256_set1_epi8(1));
        }
        // SAFETY: 32 bytes are written.
        unsafe { _mm256_storeu_si256(passing.as_mut_ptr().cast(), passes) };
        transpose(&by_order, tile, lanes);
    }

    /// Finds where the phases of the pixels are crossed in the columns of an order.
    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
    #[inline]
    fn cross(&self, lane: usize, columns: &Columns, crossings: &mut Crossings) {
        let last_column = _mm512_set1_epi16((self.image.width - 1) as i16);
        let (begin, end) = (columns.begin, _mm512_min_epi16(columns.end, last_column));
        let one = _mm512_set1_epi16(1);
        let mut todo = columns.some & self.regular;
        while todo != 0 {
            let base = least_word(todo, begin);
            let bases = _mm512_set1_epi16(base as i16);
            let (place, last) = (_mm512_sub_epi16(begin, bases), _mm512_sub_epi16(end, bases));
            let here = _mm512_mask_cmplt_epi16_mask(todo, last, _mm512_set1_epi16(COLUMNS as i16));
            todo &= !here;
            let tables = self.rows.tables(self.image, base as usize);
            let mut before = self.rows.difference(&tables, place, self.phases);
            let mut at = _mm512_add_epi16(place, one);
            let mut within = here & _mm512_cmple_epi16_mask(at, last);
            let mut crossing = Crossing::none();
            while within != 0 {
                let after = self.rows.difference(&tables, at, self.phases);
                let hit = crosses(before, after) & within;
                if hit & crossing.hit != 0 {
                    crossings.push(lane, crossing, bases);
                    crossing = Crossing::none();
                }
                crossing.take(hit, before.value, after.value, at);
                before = after;
                at = _mm512_add_epi16(at, one);
                within &= _mm512_cmple_epi16_mask(at, last);
            }
            crossings.push(lane, crossing, bases);
        }
    }

    /// Takes the energies of crossings into account, and forgets these.
    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
    #[inline]
    fn weigh(
        &self,
        crossings: &mut Crossings,
        first: [__m512i; 2],
        energies: &Energies,
        best: &mut [[__m512i; 2]; LANE_STEP],
    ) {
        for (crossing, lane) in crossings.all[..crossings.count].iter().zip(crossings.lanes) {
            let best = &mut best[usize::from(lane)];
            for h in 0..2 {
                let half = &self.halves[h];
                let order = _mm512_add_epi32(first[h], _mm512_set1_epi32(i32::from(lane)));
                let (column_px, _) = crossing_of(crossing, h);
                let (found, rest) = half.order_and_rest(column_px);
                let hit = (crossing.hit >> (16 * h)) as u16;
                let fits = hit & half.is_within_limits(column_px) & _mm512_cmpeq_epi32_mask(found, order);
                let z = _mm512_div_ps(_mm512_abs_ps(rest), half.sd_turns);
                let step = _mm512_mul_ps(z, _mm512_set1_ps(STEPS_PER_Z));
                let step = _mm512_min_ps(step, _mm512_set1_ps(Energies::STEPS as f32));
                let step = _mm512_maskz_cvttps_epi32(fits, step);
                let outside = _mm512_maskz_set1_epi32(!half.is_in_volume(column_px), i32::from(OUTSIDE));
                // SAFETY: steps run from 0 to the number of steps, where the table has its last number.
                let energy = unsafe { _mm512_i32gather_epi32::<4>(step, energies.of_step.as_ptr().cast()) };
                best[h] = _mm512_mask_min_epi32(best[h], fits, best[h], _mm512_add_epi32(energy, outside));
            }
        }
        crossings.count = 0;
    }
}

/// Where the candidates of an order can lie.
#[derive(Clone, Copy)]
pub(super) struct Columns {
    /// Pixels that have the order, and those of them that have such columns.
    own: u32,
    some: u32,
    /// The first column and the last.
    begin: __m512i,
    end: __m512i,
}

impl Columns {
    // SAFETY: all bits zero is a value of these.
    pub(super) const NONE: Self = unsafe { std::mem::zeroed() };
}

/// Crossings of several orders, of which the columns after are told.
pub(super) struct Crossings {
    all: [Crossing; 2 * LANE_STEP],
    /// Places of their orders.
    lanes: [u8; 2 * LANE_STEP],
    count: usize,
    /// Pixels of crossings that found no room.
    lost: u32,
}

impl Crossings {
    // SAFETY: all bits zero is a value of these.
    pub(super) const NONE: Self = unsafe { std::mem::zeroed() };

    /// Takes crossings of places from columns on, if there are any.
    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
    #[inline]
    fn push(&mut self, lane: usize, mut crossing: Crossing, bases: __m512i) {
        if crossing.hit == 0 {
            return;
        }
        if let Some(place) = self.all.get_mut(self.count) {
            crossing.after_at = _mm512_add_epi16(crossing.after_at, bases);
            *place = crossing;
            self.lanes[self.count] = lane as u8;
            self.count += 1;
        } else {
            self.lost |= crossing.hit;
        }
    }
}

/// Sixteen rows of 32 bytes as 32 rows of sixteen.
#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
#[inline]
fn transpose(rows: &[__m256i; LANE_STEP], tile: &mut [u8], lanes: usize) {
    // Each step interleaves rows that lie half of the rows apart: after four, every byte of a pixel stands with the others.
    let mut rows = *rows;
    for _ in 0..4 {
        let mut next = rows;
        for i in 0..LANE_STEP / 2 {
            next[2 * i] = _mm256_unpacklo_epi8(rows[i], rows[i + LANE_STEP / 2]);
            next[2 * i + 1] = _mm256_unpackhi_epi8(rows[i], rows[i + LANE_STEP / 2]);
        }
        rows = next;
    }
    for (i, row) in rows.iter().enumerate() {
        store_bytes(_mm256_castsi256_si128(*row), &mut tile[i * lanes..]);
        store_bytes(_mm256_extracti128_si256::<1>(*row), &mut tile[(i + LANE_STEP) * lanes..]);
    }
}
