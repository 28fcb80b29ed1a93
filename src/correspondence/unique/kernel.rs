//! Searches 32 pixels of a row for candidates that pass the gate, at every SIMD level.
//!
//! ```text
//! Φ is monotone along a segment, so each order k leaves one interval of columns with |Φ − k − φ| < thr
//! for each j: the j-th order of every pixel, counted along its segment
//!     begin = the first column of the interval; all intervals of the block are taken equally wide
//!     for each pair of rows of C2, for each group of pixels whose intervals lie in one table of 64 columns:
//!         step through the interval, and keep the crossing of the phase; two crossings make the pixel irregular
//!     put the crossing into the first free slot of the pixel; without one the pixel is irregular
//! for each slot: column, order and δ of its crossings as by the scan; which of them pass the gate
//! ```
//!
//! Irregular pixels are left to the scan of the whole segment: those at the border of the image, with orders too close
//! together, with too wide a gate, or with several crossings near one order. For the others the result equals that of
//! the scan.

use fringeflow_simd::{COLUMNS, Lanes};

use crate::correspondence::candidates::{Candidate, DeltaGate};
use crate::correspondence::epipolar_image::EpipolarImage;
use crate::correspondence::kernels::{
    BLOCK, Crossing, Differences, Ends, Rows, Segments, Tables, column_and_slope, crosses,
};
use crate::correspondence::segment::SegmentRow;

/// Turns by which the gate is widened in the search, against rounding.
const PHASE_MARGIN_TURNS: f32 = 1e-3;
/// A projector near C1 lights a whole ray with one phase: up to this rise along a segment the pixel is irregular.
const FLAT_TURNS: f32 = 2e-3;
/// Columns by which an interval is widened, against rounding.
const COLUMN_MARGIN_PX: f32 = 0.02;
/// Crossings kept per pixel.
const SLOTS: usize = 4;
/// Widest gate, columns on either side of the expected place.
const MAX_REACH_PX: f32 = 8.0;
/// Least distance between the gates of neighbouring orders, columns: closer ones would share crossings.
const APART_PX: f32 = 4.0;
/// Columns added to the width of an interval, against rounding.
const WIDTH_MARGIN_PX: f32 = 0.01;
/// Most orders of a block.
const MAX_ORDERS: i16 = 64;
/// Greatest accepted Φ, turns: beyond it Φ is near its pole.
const MAX_TURNS: f32 = 1e4;

/// The candidates of a block.
pub(super) struct Found {
    /// Pixels with a phase and a segment.
    pub(super) searched: u32,
    /// Those of them left to the scan.
    pub(super) irregular: u32,
    /// For each slot the pixels whose crossing passes the gate.
    pub(super) passing: [u32; SLOTS],
    column_px: [[f32; BLOCK]; SLOTS],
    order: [[i16; BLOCK]; SLOTS],
    delta: [[i16; BLOCK]; SLOTS],
    /// Scratch for columns at the end of the image.
    ends: Ends,
}

impl Found {
    pub(super) fn new() -> Self {
        Self {
            searched: 0,
            irregular: 0,
            passing: [0; SLOTS],
            column_px: [[0.0; BLOCK]; SLOTS],
            order: [[0; BLOCK]; SLOTS],
            delta: [[0; BLOCK]; SLOTS],
            ends: [[0; COLUMNS]; 3],
        }
    }

    /// Orders and δ of the first slot.
    #[inline(always)]
    pub(super) fn of_first_slot(&self) -> (&[i16; BLOCK], &[i16; BLOCK]) {
        (&self.order[0], &self.delta[0])
    }

    /// The candidate of a pixel in a slot, without its slope.
    #[inline]
    pub(super) fn candidate(&self, slot: usize, pixel: usize) -> Candidate {
        let (order, delta) = (self.order[slot][pixel], self.delta[slot][pixel]);
        Candidate { column_px: self.column_px[slot][pixel], order, delta, slope: 0 }
    }
}

/// Inputs of the search of a row.
pub(super) struct Search<'a> {
    pub(super) image: &'a EpipolarImage,
    pub(super) segments: &'a SegmentRow,
    pub(super) gate: &'a DeltaGate,
}

impl Search<'_> {
    /// Searches the pixels from `first` on; `valid` is not 0 for pixels with a phase.
    #[inline(always)]
    pub(super) fn block<L: Lanes>(
        &self,
        lanes: L,
        first: usize,
        phase: &[u16; BLOCK],
        valid: &[u8; BLOCK],
        found: &mut Found,
    ) {
        let segments = Segments::new(lanes, self.segments, first);
        let has_phase = lanes.is_greater(lanes.words_of_bytes(valid), lanes.word(0));
        let wanted = lanes.and(has_phase, lanes.mask_of(lanes.reaches(segments.end, segments.begin)));
        (found.searched, found.irregular, found.passing) = (lanes.bits(wanted), 0, [0; SLOTS]);
        if found.searched == 0 {
            return;
        }
        let phases = lanes.load(phase);
        let pixels = Pixels::new(lanes, segments, phases, self.gate);
        let regular = lanes.and(wanted, pixels.regular);
        let (rows, in_rows) = Rows::new(lanes, self.image, pixels.segments.row, regular);
        let regular = lanes.and(regular, in_rows);
        let orders = lanes.narrow_signed(lanes.longs(pixels.count));
        let orders = lanes.select(lanes.is_greater(orders, lanes.word(0)), orders, lanes.word(0));
        let orders = most_of(lanes, regular, orders);
        if !lanes.any(regular) || orders > MAX_ORDERS {
            found.irregular = found.searched;
            return;
        }
        // One width for all: the loop over columns has no branches for single pixels.
        let width = most_of(lanes, regular, pixels.width);
        let mut slots = Slots::new(lanes);
        for j in 0..orders {
            let j = lanes.float(f32::from(j));
            let active = lanes.and(regular, lanes.mask_of(lanes.exceeds(pixels.count, j)));
            if lanes.any(active) {
                let begin = pixels.first_column(j);
                self.find_crossings(lanes, &rows, begin, width, active, phases, &mut slots, &mut found.ends);
            }
        }
        let irregular = lanes.or(lanes.and_not(wanted, regular), slots.irregular);
        found.irregular = lanes.bits(lanes.and(irregular, wanted));
        for slot in 0..SLOTS {
            slots.crossings[slot].hit = lanes.and_not(slots.crossings[slot].hit, irregular);
            if !lanes.any(slots.crossings[slot].hit) {
                break;
            }
            self.back_project(lanes, &pixels, &slots, slot, found);
        }
    }

    /// Finds the crossings of one order in `width` columns from `begin` on.
    #[inline(always)]
    fn find_crossings<L: Lanes>(
        &self,
        lanes: L,
        rows: &Rows<L>,
        begin: L::Words,
        width: i16,
        active: L::Mask,
        phases: L::Words,
        slots: &mut Slots<L>,
        ends: &mut Ends,
    ) {
        // An interval that reaches beyond the image is left to the scan.
        let last_begin = self.image.width as i32 - i32::from(width);
        let outside = lanes.is_greater(begin, lanes.word(last_begin.clamp(-1, i32::from(i16::MAX)) as i16));
        slots.irregular = lanes.or(slots.irregular, lanes.and(active, outside));
        let (active, one) = (lanes.and_not(active, outside), lanes.word(1));
        for pair in rows.pairs() {
            let mut todo = lanes.and(active, pair.pixels);
            while lanes.any(todo) {
                let base = lanes.least_of(todo, begin);
                let bases = lanes.word(base);
                let mut at = lanes.sub(begin, bases);
                // Pixels whose interval lies within 64 columns of the first share one table.
                let here = lanes.and(todo, lanes.is_greater(lanes.word(COLUMNS as i16 - width + 1), at));
                todo = lanes.and_not(todo, here);
                let tables = Tables::new(lanes, self.image, rows, *pair, base, phases, ends);
                let mut before: Differences<L> = tables.difference(at);
                let mut crossing = Crossing::none(lanes);
                for _ in 1..width {
                    at = lanes.add(at, one);
                    let after = tables.difference(at);
                    let hit = lanes.and(crosses(lanes, before, after), here);
                    slots.irregular = lanes.or(slots.irregular, lanes.and(hit, crossing.hit));
                    crossing.set(lanes, hit, before.value, after.value, at);
                    before = after;
                }
                crossing.after_at = lanes.add(crossing.after_at, bases);
                slots.add(lanes, &crossing);
            }
        }
    }

    /// Computes column, order and δ of the crossings of a slot, as the scan does.
    #[inline(always)]
    fn back_project<L: Lanes>(&self, lanes: L, pixels: &Pixels<L>, slots: &Slots<L>, slot: usize, found: &mut Found) {
        let crossing = &slots.crossings[slot];
        let (column_px, _) = column_and_slope(lanes, crossing);
        let turns = lanes.sub_float(pixels.segments.phase_turns(column_px), pixels.phase_turns);
        let order = nearest_whole(lanes, turns);
        let rest = lanes.times_float(lanes.sub_float(turns, lanes.floats(order)), lanes.float(65536.0));
        let delta = lanes.narrow_signed(nearest_whole(lanes, rest));
        let delta_turns = lanes.times_float(lanes.floats(lanes.widen(delta)), lanes.float(1.0 / 65536.0));
        let off = lanes.abs_float(lanes.sub_float(delta_turns, lanes.float(self.gate.mean_turns)));
        let passes = lanes.exceeds(lanes.float(self.gate.threshold_turns), off);
        let passes = lanes.mask_of(lanes.both(passes, pixels.segments.have(column_px)));
        found.passing[slot] = lanes.bits(lanes.and(crossing.hit, passes));
        lanes.store_floats(column_px, &mut found.column_px[slot]);
        lanes.store_signed(lanes.narrow_signed(order), &mut found.order[slot]);
        lanes.store_signed(delta, &mut found.delta[slot]);
    }
}

/// 32 pixels and their orders.
struct Pixels<L: Lanes> {
    lanes: L,
    segments: Segments<L>,
    phase_turns: L::Floats,
    /// Phase of the pixel plus mean of δ, turns.
    middle: L::Floats,
    /// Least and greatest Φ.
    least: L::Floats,
    most: L::Floats,
    /// Order at the first column, step to the next order along the segment, and number of orders.
    from: L::Floats,
    step: L::Floats,
    count: L::Floats,
    /// Columns on either side of the expected place, pixels, and columns of an interval.
    half_px: L::Floats,
    width: L::Words,
    /// Pixels that are not left to the scan.
    regular: L::Mask,
}

impl<L: Lanes> Pixels<L> {
    #[inline(always)]
    fn new(lanes: L, segments: Segments<L>, phases: L::Words, gate: &DeltaGate) -> Self {
        let phase_turns = lanes.times_float(lanes.floats(lanes.widen_unsigned(phases)), lanes.float(1.0 / 65536.0));
        let (at_begin, at_end) = (segments.phase_turns(segments.begin), segments.phase_turns(segments.end));
        let (least, most) = (lanes.min_float(at_begin, at_end), lanes.max_float(at_begin, at_end));
        let reach = lanes.float(gate.threshold_turns + PHASE_MARGIN_TURNS);
        let middle = lanes.add_float(phase_turns, lanes.float(gate.mean_turns));
        let one = lanes.float(1.0);
        let lowest = lanes.sub_float(lanes.sub_float(least, middle), reach);
        let highest = lanes.add_float(lanes.sub_float(most, middle), reach);
        // The lowest order is rounded up, the highest down.
        let (whole_lowest, whole_highest) = (whole(lanes, lowest), whole(lanes, highest));
        let is_above = lanes.exceeds(lowest, whole_lowest);
        let lowest = lanes.select_float(is_above, lanes.add_float(whole_lowest, one), whole_lowest);
        let is_below = lanes.exceeds(whole_highest, highest);
        let highest = lanes.select_float(is_below, lanes.sub_float(whole_highest, one), whole_highest);
        let rises = lanes.reaches(at_end, at_begin);
        let per_column = |turns: L::Floats| {
            let inverse = lanes.sub_float(segments.b, lanes.times_float(segments.d, turns));
            lanes.times_float(inverse, inverse)
        };
        // Columns per turn are monotone along a segment, so the ends give the extremes.
        let (x, y) = (per_column(at_begin), per_column(at_end));
        let rise = lanes.abs_float(lanes.sub_float(segments.b, lanes.times_float(segments.a, segments.d)));
        let most_per_turn = lanes.over(rise, lanes.min_float(x, y));
        let least_per_turn = lanes.over(rise, lanes.max_float(x, y));
        let half_px = lanes.add_float(lanes.times_float(reach, most_per_turn), lanes.float(COLUMN_MARGIN_PX));
        let width_px = lanes.add_float(half_px, half_px);
        let small = |turns: L::Floats| lanes.exceeds(lanes.float(MAX_TURNS), lanes.abs_float(turns));
        let changes = lanes.exceeds(lanes.sub_float(most, least), lanes.float(FLAT_TURNS));
        let narrow = lanes.reaches(lanes.float(MAX_REACH_PX), half_px);
        let apart = lanes.reaches(least_per_turn, lanes.add_float(width_px, lanes.float(APART_PX)));
        let regular = lanes.both(lanes.both(small(at_begin), small(at_end)), lanes.both(changes, narrow));
        // From the whole column before its begin to the one behind its end.
        let columns = lanes.longs(lanes.add_float(width_px, lanes.float(WIDTH_MARGIN_PX)));
        Self {
            lanes,
            phase_turns,
            middle,
            least,
            most,
            from: lanes.select_float(rises, lowest, highest),
            step: lanes.select_float(rises, one, lanes.float(-1.0)),
            count: lanes.add_float(lanes.sub_float(highest, lowest), one),
            half_px,
            width: lanes.narrow(lanes.add_long(columns, lanes.long(3))),
            regular: lanes.mask_of(lanes.both(regular, apart)),
            segments,
        }
    }

    /// The first column of the interval of the j-th order.
    #[inline(always)]
    fn first_column(&self, j: L::Floats) -> L::Words {
        let (lanes, segments) = (self.lanes, &self.segments);
        let order = lanes.add_float(self.from, lanes.times_float(self.step, j));
        let turns = lanes.add_float(order, self.middle);
        let turns = lanes.min_float(lanes.max_float(turns, self.least), self.most);
        let down = lanes.sub_float(segments.b, lanes.times_float(segments.d, turns));
        let offset = lanes.over(lanes.sub_float(turns, segments.a), down);
        let begin = lanes.sub_float(lanes.add_float(segments.reference, offset), self.half_px);
        let begin = lanes.min_float(lanes.max_float(begin, segments.begin), segments.end);
        lanes.narrow(lanes.longs(begin))
    }
}

/// The crossings of each pixel, by ascending column.
struct Slots<L: Lanes> {
    crossings: [Crossing<L>; SLOTS],
    /// Pixels with more crossings than slots.
    irregular: L::Mask,
}

impl<L: Lanes> Slots<L> {
    #[inline(always)]
    fn new(lanes: L) -> Self {
        Self { crossings: [Crossing::none(lanes); SLOTS], irregular: lanes.mask(0) }
    }

    /// Puts the crossings into the first free slots of their pixels.
    #[inline(always)]
    fn add(&mut self, lanes: L, crossing: &Crossing<L>) {
        let mut rest = crossing.hit;
        let mut slot = 0;
        while slot < SLOTS && lanes.any(rest) {
            let here = lanes.and_not(rest, self.crossings[slot].hit);
            self.crossings[slot].set(lanes, here, crossing.before, crossing.after, crossing.after_at);
            rest = lanes.and_not(rest, here);
            slot += 1;
        }
        self.irregular = lanes.or(self.irregular, rest);
    }
}

/// Rounds to the nearest whole number, halves away from zero.
#[inline(always)]
fn nearest_whole<L: Lanes>(lanes: L, value: L::Floats) -> L::Longs {
    lanes.longs(lanes.add_float(value, lanes.with_sign(lanes.float(0.5), value)))
}

/// Rounds towards zero.
#[inline(always)]
fn whole<L: Lanes>(lanes: L, value: L::Floats) -> L::Floats {
    lanes.floats(lanes.longs(value))
}

/// The greatest of the words of some pixels, none of them negative; 0 without pixels.
#[inline(always)]
fn most_of<L: Lanes>(lanes: L, some: L::Mask, words: L::Words) -> i16 {
    if !lanes.any(some) {
        return 0;
    }
    i16::MAX - lanes.least_of(some, lanes.sub(lanes.word(i16::MAX), words))
}
