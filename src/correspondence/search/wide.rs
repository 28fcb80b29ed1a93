//! The projector-side search of 32 pixels of a row at once, by AVX-512.
//!
//! Neighbouring pixels look for one fringe order in neighbouring columns of the same rows of C2: all columns that 32 pixels
//! need lie within 64, so that two registers a row hold them and are looked up by shuffles, without a load for each pixel.
//! Of every order the pairs of columns are asked that the scalar search would ask, and a pair more on either side; what
//! passes the gate is the same. Pixels of which that cannot be said are *irregular*, and left to the scalar search: columns
//! too far apart, orders too close together, too wide a gate, several crossings about one order.
#![allow(unsafe_code, reason = "loads and instructions of the level")]

use std::arch::x86_64::*;

use crate::simd::Avx512;

use super::super::candidates::{COLUMN_MARGIN_PX, Candidate, DeltaGate, FLAT_TURNS, PHASE_MARGIN_TURNS};
use super::super::epipolar_image::EpipolarImage;
pub(super) use super::super::registers::BLOCK;
use super::super::registers::{
    COLUMNS, Crossing, Differences, Rows, crosses, join, least_word, load_floats, load_words, narrow, signed_half,
    store_floats, store_narrow, unsigned_half, widen,
};
use super::super::segment::SegmentRow;
use super::Row;

/// Crossings of a pixel that are kept.
const SLOTS: usize = 4;
/// Widest gate, columns on either side of where an order is expected.
const MAX_REACH_PX: f32 = 3.0;
/// Fewest columns from one order to the next: with fewer, crossings of one are those of others too.
const MIN_COLUMNS_PER_TURN: f32 = 4.0;
/// Most orders asked about in a block.
const MAX_ORDERS: i32 = 64;

/// The candidates of a block.
pub(super) struct Found {
    /// Lanes left to the scalar search.
    pub(super) irregular: u32,
    /// Of each slot the lanes whose crossing passes the gate.
    pub(super) passing: [u32; SLOTS],
    column_px: [[f32; BLOCK]; SLOTS],
    order: [[i16; BLOCK]; SLOTS],
    delta: [[i16; BLOCK]; SLOTS],
    slope: [[i16; BLOCK]; SLOTS],
    /// Columns of the first slot, rounded to the nearest.
    column: [i16; BLOCK],
}

impl Found {
    pub(super) fn new() -> Self {
        Self {
            irregular: 0,
            passing: [0; SLOTS],
            column_px: [[0.0; BLOCK]; SLOTS],
            order: [[0; BLOCK]; SLOTS],
            delta: [[0; BLOCK]; SLOTS],
            slope: [[0; BLOCK]; SLOTS],
            column: [0; BLOCK],
        }
    }

    /// The candidate of a lane in a slot.
    #[inline]
    pub(super) fn candidate(&self, slot: usize, lane: usize) -> Candidate {
        Candidate {
            column_px: self.column_px[slot][lane],
            order: self.order[slot][lane],
            delta: self.delta[slot][lane],
            slope: self.slope[slot][lane],
        }
    }

    /// Makes the candidates of the first slot those of some pixels of a row that have none yet.
    #[inline]
    pub(super) fn enter(&self, first: usize, lanes: u32, row: &mut Row<'_>) {
        let (block, places) = (first / BLOCK + 1, first + BLOCK..first + 2 * BLOCK);
        row.any[block] = lanes;
        row.order[places.clone()].copy_from_slice(&self.order[0]);
        row.delta[places.clone()].copy_from_slice(&self.delta[0]);
        row.column[places].copy_from_slice(bytemuck::cast_slice(&self.column));
        row.chosen.put(first, &self.column_px[0], [&self.order[0], &self.delta[0], &self.slope[0]]);
    }
}

/// What a row of pixels is searched in.
pub(super) struct Search<'a> {
    pub(super) image: &'a EpipolarImage,
    pub(super) segments: &'a SegmentRow,
    pub(super) gate: &'a DeltaGate,
}

impl Search<'_> {
    /// Searches the pixels from `first` on, of these phases; `wanted` are those that have a phase and a segment.
    #[inline]
    pub(super) fn block(&self, _: Avx512, first: usize, phase: &[u16; BLOCK], wanted: u32, found: &mut Found) {
        // SAFETY: the lanes prove that the machine has the instructions.
        unsafe { self.search(first, phase, wanted, found) }
    }

    #[target_feature(
        enable = "avx512f,avx512bw,avx512dq,avx512vl,avx512cd,avx512vbmi,avx512vnni,bmi1,bmi2,lzcnt,popcnt"
    )]
    fn search(&self, first: usize, phase: &[u16; BLOCK], wanted: u32, found: &mut Found) {
        let halves = [self.half(first, phase, wanted as u16), self.half(first + 16, phase, (wanted >> 16) as u16)];
        let mut irregular = join([halves[0].irregular, halves[1].irregular]);
        found.irregular = 0;
        found.passing = [0; SLOTS];
        let regular = wanted & !irregular;
        let rows = Rows::of(self.image, [halves[0].row, halves[1].row], regular, &mut irregular);
        let regular = wanted & !irregular;
        let (mut reach, mut orders) = (0, 0);
        for half in &halves {
            reach = reach.max(half.reach);
            orders = orders.max(half.orders);
        }
        if regular == 0 || orders > MAX_ORDERS {
            found.irregular = wanted;
            return;
        }
        let phases = load_words(phase);
        let mut slots = Slots::new();
        for j in 0..orders {
            let expected = [halves[0].expected(j), halves[1].expected(j)];
            let active = join([expected[0].1, expected[1].1]) & regular & !irregular;
            if active == 0 {
                continue;
            }
            self.order(&rows, [expected[0].0, expected[1].0], reach, active, phases, &mut slots, &mut irregular);
        }
        irregular |= slots.overflown;
        found.irregular = irregular;
        for slot in 0..SLOTS {
            let used = slots.used[slot] & !irregular;
            if used == 0 {
                break;
            }
            self.back_project(&halves, phases, &slots, slot, used, found);
        }
    }

    /// The segments of sixteen pixels, and where their orders are.
    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
    fn half(&self, first: usize, phase: &[u16; BLOCK], wanted: u16) -> Half {
        let s = self.segments;
        let load = |from: &[f32]| load_floats(&from[first..first + 16]);
        let (begin, end, reference) = (load(&s.begin_px), load(&s.end_px), load(&s.reference_px));
        let (a, b, d) = (load(&s.a), load(&s.b), load(&s.d));
        let half = first % BLOCK;
        let words: [u16; 16] = std::array::from_fn(|k| phase[half + k]);
        let phase_turns = _mm512_mul_ps(_mm512_cvtepi32_ps(widen(words)), _mm512_set1_ps(1.0 / 65536.0));
        let one = _mm512_set1_ps(1.0);
        let phi = |column: __m512| {
            let s = _mm512_sub_ps(column, reference);
            _mm512_div_ps(_mm512_fmadd_ps(b, s, a), _mm512_fmadd_ps(d, s, one))
        };
        let (at_begin, at_end) = (phi(begin), phi(end));
        let (least, most) = (_mm512_min_ps(at_begin, at_end), _mm512_max_ps(at_begin, at_end));
        let reach_turns = _mm512_set1_ps(self.gate.threshold_turns + PHASE_MARGIN_TURNS);
        let middle = _mm512_add_ps(phase_turns, _mm512_set1_ps(self.gate.mean_turns));
        let lowest = _mm512_roundscale_ps::<0x0a>(_mm512_sub_ps(_mm512_sub_ps(least, middle), reach_turns));
        let highest = _mm512_roundscale_ps::<0x09>(_mm512_add_ps(_mm512_sub_ps(most, middle), reach_turns));
        let count = _mm512_add_ps(_mm512_sub_ps(highest, lowest), one);
        let forward = _mm512_cmp_ps_mask::<_CMP_LE_OQ>(at_begin, at_end);
        let from = _mm512_mask_blend_ps(forward, highest, lowest);
        let step = _mm512_mask_blend_ps(forward, _mm512_set1_ps(-1.0), one);
        let square = |at: __m512| {
            let inverse = _mm512_fnmadd_ps(d, at, b);
            _mm512_mul_ps(inverse, inverse)
        };
        let (x, y) = (square(at_begin), square(at_end));
        let rise = _mm512_abs_ps(_mm512_fnmadd_ps(a, d, b));
        let most_per_turn = _mm512_div_ps(rise, _mm512_min_ps(x, y));
        let least_per_turn = _mm512_div_ps(rise, _mm512_max_ps(x, y));
        let reach_px = _mm512_fmadd_ps(reach_turns, most_per_turn, _mm512_set1_ps(2.0 * COLUMN_MARGIN_PX));
        let flat = _mm512_cmp_ps_mask::<_CMP_LE_OQ>(_mm512_sub_ps(most, least), _mm512_set1_ps(2.0 * FLAT_TURNS));
        let narrow = _mm512_cmp_ps_mask::<_CMP_LE_OQ>(reach_px, _mm512_set1_ps(MAX_REACH_PX));
        let apart = _mm512_cmp_ps_mask::<_CMP_GT_OQ>(least_per_turn, _mm512_set1_ps(MIN_COLUMNS_PER_TURN));
        let irregular = wanted & !(narrow & apart & !flat);
        let regular = wanted & !irregular;
        Half {
            begin,
            end,
            reference,
            a,
            b,
            d,
            row: load(&s.row_px),
            middle,
            least,
            most,
            from,
            step,
            count,
            irregular,
            reach: _mm512_mask_reduce_max_ps(regular, _mm512_roundscale_ps::<0x0a>(reach_px)).max(0.0) as i32,
            orders: _mm512_mask_reduce_max_ps(regular, count).clamp(0.0, 1e6) as i32,
        }
    }

    /// Looks for crossings about where an order is expected.
    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
    fn order(
        &self,
        rows: &Rows,
        expected: [__m512; 2],
        reach: i32,
        active: u32,
        phases: __m512i,
        slots: &mut Slots,
        irregular: &mut u32,
    ) {
        let reach_word = _mm512_set1_epi16(reach as i16);
        let column = narrow([_mm512_cvttps_epi32(expected[0]), _mm512_cvttps_epi32(expected[1])]);
        let begin = _mm512_sub_epi16(column, reach_word);
        // Columns that the image does not have are left to the scalar search.
        let last_begin = self.image.width as i32 - 2 * (reach + 1);
        let outside = _mm512_cmplt_epi16_mask(begin, _mm512_setzero_si512())
            | _mm512_cmpgt_epi16_mask(begin, _mm512_set1_epi16(last_begin.clamp(-1, i32::from(i16::MAX)) as i16));
        *irregular |= outside & active;
        let active = active & !outside;
        if active == 0 {
            return;
        }
        let base = least_word(active, begin);
        let place = _mm512_sub_epi16(begin, _mm512_set1_epi16(base as i16));
        let far = _mm512_cmpgt_epi16_mask(place, _mm512_set1_epi16((COLUMNS - 2 * (reach + 1)) as i16));
        *irregular |= far & active;
        let active = active & !far;
        let tables = rows.tables(self.image, base as usize);
        let mut before = Differences::NONE;
        let mut crossing = Crossing::none();
        let mut several = 0;
        let one = _mm512_set1_epi16(1);
        let mut at = place;
        for k in 0..2 * (reach + 1) {
            let here = rows.difference(&tables, at, phases);
            if k > 0 {
                let hit = crosses(before, here) & active;
                several |= hit & crossing.hit;
                crossing.take(hit & !crossing.hit, before.value, here.value, at);
            }
            before = here;
            at = _mm512_add_epi16(at, one);
        }
        *irregular |= several;
        let column = _mm512_add_epi16(crossing.after_at, _mm512_set1_epi16(base as i16 - 1));
        slots.take(crossing.hit, crossing.before, crossing.after, column);
    }

    /// The crossings of a slot: their columns, orders and δ, as the scalar search computes them.
    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
    fn back_project(
        &self,
        halves: &[Half; 2],
        phases: __m512i,
        slots: &Slots,
        slot: usize,
        used: u32,
        found: &mut Found,
    ) {
        let (before, after, columns) = (slots.before[slot], slots.after[slot], slots.column[slot]);
        let mut passing = [0_u16; 2];
        for h in 0..2 {
            let half = &halves[h];
            let [before, after, column, phase] =
                [signed_half(before, h), signed_half(after, h), signed_half(columns, h), unsigned_half(phases, h)];
            let slope = _mm512_sub_epi32(after, before);
            let offset = _mm512_div_ps(
                _mm512_cvtepi32_ps(before),
                _mm512_cvtepi32_ps(_mm512_sub_epi32(_mm512_setzero_si512(), slope)),
            );
            let column_px = _mm512_add_ps(_mm512_cvtepi32_ps(column), offset);
            let inside = _mm512_cmp_ps_mask::<_CMP_GE_OQ>(column_px, half.begin)
                & _mm512_cmp_ps_mask::<_CMP_LE_OQ>(column_px, half.end);
            // Single multiplications and additions, as in the scalar search.
            let s = _mm512_sub_ps(column_px, half.reference);
            let one = _mm512_set1_ps(1.0);
            let above = _mm512_add_ps(half.a, _mm512_mul_ps(half.b, s));
            let below = _mm512_add_ps(one, _mm512_mul_ps(half.d, s));
            let phase_turns = _mm512_mul_ps(_mm512_cvtepi32_ps(phase), _mm512_set1_ps(1.0 / 65536.0));
            let turns = _mm512_sub_ps(_mm512_div_ps(above, below), phase_turns);
            let order = nearest_whole(turns);
            let rest = _mm512_mul_ps(_mm512_sub_ps(turns, _mm512_cvtepi32_ps(order)), _mm512_set1_ps(65536.0));
            let delta = nearest_whole(rest);
            let delta = _mm512_max_epi32(_mm512_min_epi32(delta, _mm512_set1_epi32(32767)), _mm512_set1_epi32(-32768));
            let delta_turns = _mm512_mul_ps(_mm512_cvtepi32_ps(delta), _mm512_set1_ps(1.0 / 65536.0));
            let off = _mm512_abs_ps(_mm512_sub_ps(delta_turns, _mm512_set1_ps(self.gate.mean_turns)));
            let passes = _mm512_cmp_ps_mask::<_CMP_LT_OQ>(off, _mm512_set1_ps(self.gate.threshold_turns));
            passing[h] = passes & inside & (used >> (16 * h)) as u16;
            store_floats(column_px, &mut found.column_px[slot][16 * h..]);
            store_narrow(order, &mut found.order[slot][16 * h..]);
            store_narrow(delta, &mut found.delta[slot][16 * h..]);
            store_narrow(slope, &mut found.slope[slot][16 * h..]);
            if slot == 0 {
                let nearest = _mm512_cvttps_epi32(_mm512_add_ps(column_px, _mm512_set1_ps(0.5)));
                store_narrow(nearest, &mut found.column[16 * h..]);
            }
        }
        found.passing[slot] = join(passing);
    }
}

/// The segments of sixteen pixels.
struct Half {
    begin: __m512,
    end: __m512,
    reference: __m512,
    a: __m512,
    b: __m512,
    d: __m512,
    row: __m512,
    /// Phase of the pixel and mean of δ, turns.
    middle: __m512,
    /// Least and greatest Φ.
    least: __m512,
    most: __m512,
    /// Order of the lowest column, and by what orders rise from there.
    from: __m512,
    step: __m512,
    /// Number of orders.
    count: __m512,
    irregular: u16,
    /// Columns on either side of where an order is expected.
    reach: i32,
    orders: i32,
}

impl Half {
    /// Columns at which the j-th order is expected, and the lanes that have it.
    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
    #[inline]
    fn expected(&self, j: i32) -> (__m512, u16) {
        let j = _mm512_set1_ps(j as f32);
        let order = _mm512_fmadd_ps(self.step, j, self.from);
        let turns = _mm512_min_ps(_mm512_max_ps(_mm512_add_ps(order, self.middle), self.least), self.most);
        let offset = _mm512_div_ps(_mm512_sub_ps(turns, self.a), _mm512_fnmadd_ps(self.d, turns, self.b));
        let column = _mm512_add_ps(self.reference, offset);
        let column = _mm512_min_ps(_mm512_max_ps(column, self.begin), self.end);
        (column, _mm512_cmp_ps_mask::<_CMP_LT_OQ>(j, self.count))
    }
}

/// The crossings of each lane, in the order of their columns.
struct Slots {
    used: [u32; SLOTS],
    overflown: u32,
    before: [__m512i; SLOTS],
    after: [__m512i; SLOTS],
    /// Column before each.
    column: [__m512i; SLOTS],
}

impl Slots {
    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
    #[inline]
    fn new() -> Self {
        let zero = [_mm512_setzero_si512(); SLOTS];
        Self { used: [0; SLOTS], overflown: 0, before: zero, after: zero, column: zero }
    }

    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
    #[inline]
    fn take(&mut self, mut lanes: u32, before: __m512i, after: __m512i, column: __m512i) {
        for slot in 0..SLOTS {
            let here = lanes & !self.used[slot];
            self.used[slot] |= here;
            self.before[slot] = _mm512_mask_mov_epi16(self.before[slot], here, before);
            self.after[slot] = _mm512_mask_mov_epi16(self.after[slot], here, after);
            self.column[slot] = _mm512_mask_mov_epi16(self.column[slot], here, column);
            lanes &= !here;
            if lanes == 0 {
                return;
            }
        }
        self.overflown |= lanes;
    }
}

/// Rounded to the nearest whole number, halves away from zero.
#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
#[inline]
fn nearest_whole(value: __m512) -> __m512i {
    let sign = _mm512_and_ps(value, _mm512_set1_ps(-0.0));
    _mm512_cvttps_epi32(_mm512_add_ps(value, _mm512_or_ps(sign, _mm512_set1_ps(0.5))))
}
