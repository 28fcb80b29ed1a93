//! Evidence and selection of 32 pixels of a row at once, by AVX-512: what [`super::outlook`] says of each, bit for bit.
//!
//! As in the projector-side search, neighbouring pixels look for one order in neighbouring columns of the same rows of C2,
//! which registers hold. Every operation is that of the scalar form, single and in its order. Pixels of which more cannot be
//! said are *irregular*, and left to it: Φ that hardly changes or runs into its pole, intervals of many columns or at the
//! border of the image, rows of C2 that lie apart.
#![allow(unsafe_code, reason = "instructions of the level")]

use std::arch::x86_64::*;

use crate::simd::Avx512;

use super::super::drift::DepthRow;
use super::super::epipolar_image::EpipolarImage;
pub(super) use super::super::registers::BLOCK;
use super::super::registers::{
    COLUMNS, Crossing, Differences, Rows, crosses, join, least_word, load_floats, load_words, narrow, signed_half,
    store_floats, store_narrow, unsigned_half, widen,
};
use super::super::row_view::{MAX_RIM_BEND, RIM_SLOPES};
use super::super::segment::SegmentRow;
use super::evidence::{Energies, MAX_Z, MISSING, NO_ORDER, OUTSIDE, STEPS_PER_Z};
use super::outlook::{COLUMN_MARGIN_PX, FLAT_TURNS};
use super::selection::{ABSENT, REACH_SD, REACH_TURNS, RIM_COLUMNS};
use super::windows::{LANE_STEP, Windows};

/// Most columns of an interval.
const MAX_WIDTH: i32 = 24;
/// Columns beside an interval that are looked at for rims: those of the rims, and their neighbours.
const BESIDE: i32 = RIM_COLUMNS as i32 + 1;
/// Differences that are kept of an interval.
const MAX_DIFFERENCES: usize = (MAX_WIDTH + 2 * BESIDE + 2) as usize;
/// Greatest Φ that is believed, turns: what lies beyond has met its pole.
const MAX_TURNS: f32 = 1e4;

/// A row of pixels and what it is searched in.
pub(super) struct Row<'a> {
    pub(super) image: &'a EpipolarImage,
    pub(super) segments: &'a SegmentRow,
    pub(super) drift: &'a DepthRow,
    pub(super) windows: &'a Windows,
    pub(super) phase: &'a [u16],
    /// sd of δ of each pixel, turns.
    pub(super) sd_turns: &'a [f32],
}

/// Room for what is found on the way, to be used from block to block.
pub(super) struct Room {
    columns: [Columns; LANE_STEP],
    crossings: Crossings,
    differences: [Differences; MAX_DIFFERENCES],
}

impl Room {
    pub(super) fn new() -> Self {
        let differences = [Differences::NONE; MAX_DIFFERENCES];
        Self { columns: [Columns::NONE; LANE_STEP], crossings: Crossings::NONE, differences }
    }
}

/// The selected candidates of 32 pixels.
pub(super) struct Found {
    /// Pixels left to the scalar form.
    pub(super) irregular: u32,
    /// Absolute phases of those that have one.
    pub(super) absolute: [i32; BLOCK],
    /// Whether it lies in the volume.
    pub(super) in_volume: [bool; BLOCK],
    pub(super) column_px: [f32; BLOCK],
    pub(super) z: [f32; BLOCK],
    pub(super) delta: [i16; BLOCK],
    pub(super) slope: [i16; BLOCK],
}

impl Found {
    pub(super) const NONE: Self = Self {
        irregular: 0,
        absolute: [ABSENT; BLOCK],
        in_volume: [false; BLOCK],
        column_px: [0.0; BLOCK],
        z: [0.0; BLOCK],
        delta: [0; BLOCK],
        slope: [0; BLOCK],
    };
}

/// Pixels of a row from a column on, made ready to be asked about their orders.
pub(super) struct Block<'a> {
    image: &'a EpipolarImage,
    halves: [Half; 2],
    rows: Rows,
    phases: __m512i,
    /// Pixels that are asked about.
    pub(super) regular: u32,
    /// Pixels left to the scalar form.
    pub(super) irregular: u32,
}

impl<'a> Row<'a> {
    /// A block without pixels.
    pub(super) fn no_block(&self) -> Block<'a> {
        let halves = [Half::NONE; 2];
        Block { image: self.image, halves, rows: Rows::NONE, phases: Differences::NONE.value, regular: 0, irregular: 0 }
    }

    /// Turns a block to the pixels from `first` on, which have so many orders each; yields whether any has one.
    #[inline]
    pub(super) fn turn(&self, _: Avx512, block: &mut Block<'_>, first: usize, count: &[u8; BLOCK]) -> bool {
        // SAFETY: the lanes prove that the machine has the instructions.
        unsafe { self.turn_of_level(block, first, count) }
    }

    #[target_feature(
        enable = "avx512f,avx512bw,avx512dq,avx512vl,avx512cd,avx512vbmi,avx512vnni,bmi1,bmi2,lzcnt,popcnt"
    )]
    fn turn_of_level(&self, block: &mut Block<'_>, first: usize, count: &[u8; BLOCK]) -> bool {
        let counts = load_bytes(count);
        let wanted = _mm256_test_epi8_mask(counts, counts);
        if wanted == 0 {
            return false;
        }
        let [low, high] = &mut block.halves;
        let regular = join([self.turn_half(low, first), self.turn_half(high, first + 16)]);
        let regular = if self.image.width > i16::MAX as usize { 0 } else { regular & wanted };
        let mut irregular = wanted & !regular;
        block.rows = Rows::of(self.image, [block.halves[0].row, block.halves[1].row], regular, &mut irregular);
        let mut phase = [0; BLOCK];
        phase.copy_from_slice(&self.phase[first..first + BLOCK]);
        block.phases = load_words(&phase);
        (block.regular, block.irregular) = (wanted & !irregular, irregular);
        true
    }

    /// Turns half a block to the pixels from `first` on; yields those that are regular.
    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
    fn turn_half(&self, half: &mut Half, first: usize) -> u16 {
        let (s, drift) = (self.segments, self.drift);
        let load = |from: &[f32]| load_floats(&from[first..first + 16]);
        (half.begin, half.end) = (load(&s.begin_px), load(&s.end_px));
        let beyond = _mm512_set1_ps(self.windows.reach.beyond_px);
        half.first_px = _mm512_max_ps(_mm512_sub_ps(half.begin, beyond), _mm512_setzero_ps());
        let last_column_px = _mm512_set1_ps(self.windows.reach.last_column_px);
        half.last_px = _mm512_min_ps(_mm512_add_ps(half.end, beyond), last_column_px);
        let mut words = [0; 16];
        words.copy_from_slice(&self.phase[first..first + 16]);
        half.phase_turns = _mm512_mul_ps(_mm512_cvtepi32_ps(widen(words)), _mm512_set1_ps(1.0 / 65536.0));
        (half.reference, half.row) = (load(&s.reference_px), load(&s.row_px));
        (half.a, half.b, half.d) = (load(&s.a), load(&s.b), load(&s.d));
        half.rise = _mm512_sub_ps(half.b, _mm512_mul_ps(half.a, half.d));
        let c = &drift.coefficients;
        half.drift = [load(&c[0]), load(&c[1]), load(&c[2]), load(&c[3]), load(&c[4]), load(&c[5])];
        (half.middle_px, half.per_px) = (load(&drift.middle_px), _mm512_set1_ps(drift.per_px));
        half.sd_turns = load(self.sd_turns);
        let (at_first, at_last) = (half.phase_turns_at(half.first_px), half.phase_turns_at(half.last_px));
        half.least = _mm512_min_ps(at_first, at_last);
        half.most = _mm512_max_ps(at_first, at_last);
        let is_small =
            |turns: __m512| _mm512_cmp_ps_mask::<_CMP_LT_OQ>(_mm512_abs_ps(turns), _mm512_set1_ps(MAX_TURNS));
        let rises = _mm512_sub_ps(half.most, half.least);
        is_small(at_first)
            & is_small(at_last)
            & _mm512_cmp_ps_mask::<_CMP_GT_OQ>(rises, _mm512_set1_ps(FLAT_TURNS))
            & _mm512_cmp_ps_mask::<_CMP_GT_OQ>(half.sd_turns, _mm512_setzero_ps())
    }
}

impl Block<'_> {
    /// Energies of sixteen orders of each pixel, from so many after order `first` on, of all `count` that it has, into `tile`,
    /// where those of each pixel begin `lanes` after those of the one before; and how many of them pass, added to `passing`.
    #[inline]
    pub(super) fn evidence(
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

    /// Leaves pixels to the scalar form.
    #[inline(always)]
    fn give_up(&mut self, pixels: u32) {
        self.irregular |= pixels;
        self.regular &= !pixels;
    }

    /// The candidate of an order of each pixel with the least |δ − drift|.
    #[inline]
    pub(super) fn select(&mut self, _: Avx512, order: &[i16; BLOCK], room: &mut Room, found: &mut Found) {
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

/// Sixteen pixels.
#[derive(Clone, Copy)]
struct Half {
    begin: __m512,
    end: __m512,
    first_px: __m512,
    last_px: __m512,
    reference: __m512,
    a: __m512,
    b: __m512,
    d: __m512,
    row: __m512,
    /// b − a·d.
    rise: __m512,
    /// Least and greatest Φ within the limits.
    least: __m512,
    most: __m512,
    phase_turns: __m512,
    drift: [__m512; 6],
    middle_px: __m512,
    per_px: __m512,
    sd_turns: __m512,
}

/// Columns in which candidates can lie.
struct Interval {
    begin: __m512i,
    /// The last column, rounded down and up.
    end_floor: __m512i,
    end_ceil: __m512i,
    /// Pixels that have such columns, and those for which they are few.
    some: u16,
    narrow: u16,
}

impl Half {
    // SAFETY: all bits zero is a value of these.
    const NONE: Self = unsafe { std::mem::zeroed() };

    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
    #[inline]
    fn phase_turns_at(&self, column_px: __m512) -> __m512 {
        let s = _mm512_sub_ps(column_px, self.reference);
        let above = _mm512_add_ps(self.a, _mm512_mul_ps(self.b, s));
        let below = _mm512_add_ps(_mm512_set1_ps(1.0), _mm512_mul_ps(self.d, s));
        _mm512_div_ps(above, below)
    }

    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
    #[inline]
    fn drift_at(&self, column_px: __m512) -> __m512 {
        let d = _mm512_mul_ps(_mm512_sub_ps(column_px, self.middle_px), self.per_px);
        let [c0, c1, c2, c3, c4, c5] = self.drift;
        let then = |sum: __m512, c: __m512| _mm512_add_ps(_mm512_mul_ps(sum, d), c);
        then(then(then(then(then(c5, c4), c3), c2), c1), c0)
    }

    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
    #[inline]
    fn order_and_rest(&self, column_px: __m512) -> (__m512i, __m512) {
        let turns = _mm512_sub_ps(self.phase_turns_at(column_px), self.drift_at(column_px));
        let turns = _mm512_sub_ps(turns, self.phase_turns);
        let half = _mm512_or_ps(_mm512_and_ps(turns, _mm512_set1_ps(-0.0)), _mm512_set1_ps(0.5));
        let order = _mm512_cvttps_epi32(_mm512_add_ps(turns, half));
        (order, _mm512_sub_ps(turns, _mm512_cvtepi32_ps(order)))
    }

    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
    #[inline]
    fn is_in_volume(&self, column_px: __m512) -> u16 {
        _mm512_cmp_ps_mask::<_CMP_GE_OQ>(column_px, self.begin) & _mm512_cmp_ps_mask::<_CMP_LE_OQ>(column_px, self.end)
    }

    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
    #[inline]
    fn is_within_limits(&self, column_px: __m512) -> u16 {
        _mm512_cmp_ps_mask::<_CMP_GE_OQ>(column_px, self.first_px)
            & _mm512_cmp_ps_mask::<_CMP_LE_OQ>(column_px, self.last_px)
    }

    /// Column at which Φ has a value, clamped to the limits, and the inverse of how it changes there.
    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
    #[inline]
    fn column_at(&self, turns: __m512) -> (__m512, __m512) {
        let inverse = _mm512_div_ps(_mm512_set1_ps(1.0), _mm512_sub_ps(self.b, _mm512_mul_ps(self.d, turns)));
        let offset = _mm512_mul_ps(_mm512_sub_ps(turns, self.a), inverse);
        let column_px = _mm512_add_ps(self.reference, offset);
        (_mm512_min_ps(_mm512_max_ps(column_px, self.first_px), self.last_px), inverse)
    }

    #[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
    #[inline]
    fn columns_of(&self, order: __m512i, reach: __m512) -> Interval {
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

/// Where the candidates of an order can lie.
#[derive(Clone, Copy)]
struct Columns {
    /// Pixels that have the order, and those of them that have such columns.
    own: u32,
    some: u32,
    /// The first column and the last.
    begin: __m512i,
    end: __m512i,
}

impl Columns {
    // SAFETY: all bits zero is a value of these.
    const NONE: Self = unsafe { std::mem::zeroed() };
}

/// Crossings of several orders, of which the columns after are told.
struct Crossings {
    all: [Crossing; 2 * LANE_STEP],
    /// Places of their orders.
    lanes: [u8; 2 * LANE_STEP],
    count: usize,
    /// Pixels of crossings that found no room.
    lost: u32,
}

impl Crossings {
    // SAFETY: all bits zero is a value of these.
    const NONE: Self = unsafe { std::mem::zeroed() };

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

/// Column and slope of crossings.
#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
#[inline]
fn crossing_of(crossing: &Crossing, half: usize) -> (__m512, __m512i) {
    let (before, after) = (signed_half(crossing.before, half), signed_half(crossing.after, half));
    let slope = _mm512_sub_epi32(after, before);
    let down = _mm512_cvtepi32_ps(_mm512_sub_epi32(_mm512_setzero_si512(), slope));
    let offset = _mm512_div_ps(_mm512_cvtepi32_ps(before), down);
    let column = _mm512_sub_epi32(unsigned_half(crossing.after_at, half), _mm512_set1_epi32(1));
    (_mm512_add_ps(_mm512_cvtepi32_ps(column), offset), slope)
}

/// Where a surface ends at a column and would have the phase within a pixel beyond it, see
/// [`super::super::row_view`]: `outer` does not continue what `inner` and the column show.
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

/// Rounded to the nearest whole number, halves away from zero, as `f32::round` does.
#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
#[inline]
fn nearest_whole(value: __m512) -> __m512i {
    let whole = _mm512_cvttps_epi32(value);
    let rest = _mm512_sub_ps(value, _mm512_cvtepi32_ps(whole));
    let one = _mm512_set1_epi32(1);
    let up = _mm512_cmp_ps_mask::<_CMP_GE_OQ>(rest, _mm512_set1_ps(0.5));
    let down = _mm512_cmp_ps_mask::<_CMP_LE_OQ>(rest, _mm512_set1_ps(-0.5));
    _mm512_mask_sub_epi32(_mm512_mask_add_epi32(whole, up, whole, one), down, whole, one)
}

#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
#[inline]
fn load_signed(words: &[i16; BLOCK]) -> [__m512i; 2] {
    // SAFETY: twice sixteen words are read.
    [0, 16].map(|from| _mm512_cvtepi16_epi32(unsafe { _mm256_loadu_si256(words[from..].as_ptr().cast()) }))
}

#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
#[inline]
fn load_bytes(bytes: &[u8; BLOCK]) -> __m256i {
    // SAFETY: 32 bytes are read.
    unsafe { _mm256_loadu_si256(bytes.as_ptr().cast()) }
}

#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
#[inline]
fn store_bytes(bytes: __m128i, to: &mut [u8]) {
    let to = &mut to[..16];
    // SAFETY: sixteen bytes are written.
    unsafe { _mm_storeu_si128(to.as_mut_ptr().cast(), bytes) };
}

#[target_feature(enable = "avx512f,avx512bw,avx512dq,avx512vl")]
#[inline]
fn greatest_byte(bytes: __m256i) -> u8 {
    let half = _mm_max_epu8(_mm256_castsi256_si128(bytes), _mm256_extracti128_si256::<1>(bytes));
    let quarter = _mm_max_epu8(half, _mm_srli_si128::<8>(half));
    // The greatest is the complement of the least of the complements, which are widened.
    let least = _mm_minpos_epu16(_mm_sub_epi16(_mm_set1_epi16(255), _mm_cvtepu8_epi16(quarter)));
    255 - _mm_cvtsi128_si32(least) as u8
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
