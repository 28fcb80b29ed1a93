//! The best candidate of one order of each of 32 pixels.
//!
//! ```text
//! columns = where candidates of the order within reach of the drift can lie, and one more on either side for rims
//! walk along the columns in the two rows of C2:
//!     where the phase of the pixel is crossed:                          consider the crossing
//!     where a surface ends and would have the phase within a pixel:     remember that there are rims
//! if there are rims: go through the same columns again and consider each
//! consider(x): take x if its order is right and |δ − drift| is less than that of the best so far
//! ```

use fringeflow_simd::{COLUMNS, Lanes};

use crate::correspondence::kernels::{BLOCK, Crossing, Differences, Ends, RowPair, Tables, column_and_slope, crosses};
use crate::correspondence::neighbourhood::ABSENT;
use crate::correspondence::row_view::{MAX_RIM_BEND, RIM_SLOPES};

use super::Block;
use super::pixels::{MAX_WIDTH, Pixels};

/// Largest |δ − drift| of a selected candidate: turns (18°), or this many sd if that is more.
pub(in crate::correspondence::semi_global) const REACH_TURNS: f32 = 0.05;
pub(in crate::correspondence::semi_global) const REACH_SD: f32 = 6.0;
/// Columns beside an interval in which a surface may have its rim.
pub(in crate::correspondence::semi_global) const RIM_COLUMNS: usize = 1;
/// Columns on either side of an interval that are searched for rims: the columns of the rims, and one more.
const BESIDE: i32 = RIM_COLUMNS as i32 + 1;
/// Most columns kept of an interval.
const MAX_DIFFERENCES: usize = (MAX_WIDTH + 2 * BESIDE + 2) as usize;

/// The selected candidates of a block, to be written.
pub(in crate::correspondence::semi_global) struct SelectedBlock<'a> {
    pub(in crate::correspondence::semi_global) absolute: &'a mut [i32; BLOCK],
    pub(in crate::correspondence::semi_global) column_px: &'a mut [f32; BLOCK],
    pub(in crate::correspondence::semi_global) z: &'a mut [f32; BLOCK],
    pub(in crate::correspondence::semi_global) delta: &'a mut [i16; BLOCK],
    pub(in crate::correspondence::semi_global) slope: &'a mut [i16; BLOCK],
    pub(in crate::correspondence::semi_global) in_volume: &'a mut [bool; BLOCK],
}

/// Scratch for the differences of an interval, and for columns at the end of the image.
pub(in crate::correspondence::semi_global) struct SelectionScratch<L: Lanes> {
    differences: [Differences<L>; MAX_DIFFERENCES],
    ends: Ends,
}

impl<L: Lanes> SelectionScratch<L> {
    #[inline(always)]
    pub(in crate::correspondence::semi_global) fn new(lanes: L) -> Self {
        Self { differences: [Differences::none(lanes); MAX_DIFFERENCES], ends: [[0; COLUMNS]; 3] }
    }
}

/// The columns searched for 32 pixels.
struct Search<L: Lanes> {
    begin: L::Words,
    /// Last column of a crossing.
    ceil: L::Words,
    /// First column searched, and the column behind the last rim.
    start: L::Words,
    stop: L::Words,
}

impl<L: Lanes> Block<'_, L> {
    /// Selects the candidate of an order with the least |δ − drift|.
    #[inline(always)]
    pub(in crate::correspondence::semi_global) fn select(
        &mut self,
        order: &[i16; BLOCK],
        scratch: &mut SelectionScratch<L>,
        out: &mut SelectedBlock<'_>,
    ) {
        let lanes = self.lanes;
        let order = lanes.load_signed(order);
        let of_sd = lanes.times_float(lanes.float(REACH_SD), self.pixels.sd_turns);
        let reach = lanes.max_float(lanes.float(REACH_TURNS), of_sd);
        let interval = self.pixels.columns_of(lanes.widen(order), reach);
        let has = lanes.and(self.regular, interval.some);
        // Keeps every column searched inside the image.
        let last_floor = (self.image.width as i32 - 2 - BESIDE).max(0) as i16;
        let outer = lanes.or(
            lanes.is_greater(lanes.word(BESIDE as i16), interval.begin),
            lanes.is_greater(interval.end_floor, lanes.word(last_floor)),
        );
        let odd = lanes.and_not(has, lanes.and_not(interval.narrow, outer));
        self.leave_to_scalar(odd);
        let beside = lanes.word(BESIDE as i16);
        let search = Search {
            begin: interval.begin,
            ceil: interval.end_ceil,
            start: lanes.sub(interval.begin, beside),
            stop: lanes.add(interval.end_floor, lanes.word(1 + BESIDE as i16)),
        };
        let mut best = Best::none(lanes, order, reach);
        let sought = lanes.and_not(has, odd);
        for pair in self.rows.pairs() {
            let mut todo = lanes.and(sought, pair.pixels);
            while lanes.any(todo) {
                let base = lanes.least_of(todo, search.start);
                let last = lanes.sub(search.stop, lanes.word(base));
                let here = lanes.and(todo, lanes.is_greater(lanes.word(COLUMNS as i16), last));
                todo = lanes.and_not(todo, here);
                self.consider_all(*pair, base, &search, here, scratch, &mut best);
            }
        }
        let Best { order, present, rest, column_px, slope, .. } = best;
        let (pixels, present) = (&self.pixels, lanes.and(present, self.regular));
        let in_volume = lanes.and(present, lanes.mask_of(pixels.segments.have(column_px)));
        let drift = pixels.drift_at(column_px);
        let found = Found { order, phases: self.phases, present, in_volume, rest, drift, column_px, slope };
        found.store(lanes, pixels.sd_turns, out);
    }

    /// Considers the crossings and rims of pixels `here`, whose columns lie within 64 from `base` on.
    #[inline(always)]
    fn consider_all(
        &self,
        pair: RowPair<L>,
        base: i16,
        search: &Search<L>,
        here: L::Mask,
        SelectionScratch { differences, ends }: &mut SelectionScratch<L>,
        best: &mut Best<L>,
    ) {
        let lanes = self.lanes;
        let tables = Tables::new(lanes, self.image, &self.rows, pair, base, self.phases, ends);
        let (one, bases) = (lanes.word(1), lanes.word(base));
        let mut column = search.start;
        let mut crossing = Crossing::none(lanes);
        let (mut count, mut within, mut rims) = (0, here, lanes.mask(0));
        while lanes.any(within) && count < MAX_DIFFERENCES {
            let after = tables.difference(lanes.sub(column, bases));
            differences[count] = after;
            if count >= 1 {
                let before = differences[count - 1];
                let is_pair =
                    lanes.and_not(lanes.is_greater(column, search.begin), lanes.is_greater(column, search.ceil));
                let hit = lanes.and(lanes.and(crosses(lanes, before, after), within), is_pair);
                if lanes.any(lanes.and(hit, crossing.hit)) {
                    self.consider_crossing(&crossing, best);
                    crossing = Crossing::none(lanes);
                }
                crossing.set(lanes, hit, before.value, after.value, column);
                if count >= 2 {
                    let inner = differences[count - 2];
                    let rim =
                        lanes.or(beyond_rim(lanes, inner, before, after), beyond_rim(lanes, after, before, inner));
                    rims = lanes.or(rims, lanes.and(within, rim));
                }
            }
            count += 1;
            column = lanes.add(column, one);
            within = lanes.and_not(within, lanes.is_greater(column, search.stop));
        }
        if lanes.any(crossing.hit) {
            self.consider_crossing(&crossing, best);
        }
        if !lanes.any(rims) {
            return;
        }
        let mut column = lanes.add(search.start, one);
        let mut within = lanes.and(here, rims);
        for k in 2..count {
            let [left, middle, right] = [differences[k - 2], differences[k - 1], differences[k]];
            within = lanes.and(within, lanes.is_greater(search.stop, column));
            let at_left = lanes.and(within, beyond_rim(lanes, left, middle, right));
            if lanes.any(at_left) {
                self.consider_rim(middle, right, column, at_left, -1.0, best);
            }
            let at_right = lanes.and(within, beyond_rim(lanes, right, middle, left));
            if lanes.any(at_right) {
                self.consider_rim(middle, left, column, at_right, 1.0, best);
            }
            column = lanes.add(column, one);
        }
    }

    /// Considers crossings.
    #[inline(always)]
    fn consider_crossing(&self, crossing: &Crossing<L>, best: &mut Best<L>) {
        let (column_px, slope) = column_and_slope(self.lanes, crossing);
        best.consider(self.lanes, &self.pixels, column_px, slope, crossing.hit);
    }

    /// Considers where surfaces that end at a column would have the phase beyond it.
    #[inline(always)]
    fn consider_rim(
        &self,
        middle: Differences<L>,
        inner: Differences<L>,
        column: L::Words,
        rims: L::Mask,
        sense: f32,
        best: &mut Best<L>,
    ) {
        let lanes = self.lanes;
        let outwards = lanes.floats(lanes.widen(lanes.sub(middle.value, inner.value)));
        let middle = lanes.floats(lanes.widen(middle.value));
        let distance_px = lanes.over(lanes.sub_float(lanes.float(0.0), middle), outwards);
        let sense = lanes.float(sense);
        let column_px = lanes.add_float(lanes.floats(lanes.widen(column)), lanes.times_float(sense, distance_px));
        let slope = lanes.longs(lanes.times_float(sense, outwards));
        best.consider(lanes, &self.pixels, column_px, slope, rims);
    }
}

/// The candidates of 32 pixels.
pub(super) struct Found<L: Lanes> {
    pub(super) order: L::Words,
    /// Wrapped phases of the pixels.
    pub(super) phases: L::Words,
    /// Pixels with a candidate.
    pub(super) present: L::Mask,
    pub(super) in_volume: L::Mask,
    /// δ − drift, and the drift, turns.
    pub(super) rest: L::Floats,
    pub(super) drift: L::Floats,
    pub(super) column_px: L::Floats,
    pub(super) slope: L::Longs,
}

impl<L: Lanes> Found<L> {
    /// Stores the candidates. Pixels without one become absent; their other numbers are undefined.
    #[inline(always)]
    pub(super) fn store(self, lanes: L, sd_turns: L::Floats, out: &mut SelectedBlock<'_>) {
        let Self { order, phases, present, in_volume, rest, drift, column_px, slope } = self;
        let present = lanes.truths(present);
        let absolute = lanes.join(order, phases);
        lanes.store_longs(lanes.select_long(present, absolute, lanes.long(ABSENT)), out.absolute);
        lanes.store_mask(in_volume, out.in_volume);
        let delta_turns = lanes.add_float(rest, drift);
        let delta = nearest_whole(lanes, lanes.times_float(delta_turns, lanes.float(65536.0)));
        lanes.store_floats(column_px, out.column_px);
        lanes.store_floats(lanes.over(rest, sd_turns), out.z);
        lanes.store_signed(lanes.narrow_signed(delta), out.delta);
        lanes.store_signed(lanes.narrow_signed(slope), out.slope);
    }
}

/// The best candidates of 32 pixels so far.
struct Best<L: Lanes> {
    order: L::Words,
    reach: L::Floats,
    present: L::Mask,
    rest: L::Floats,
    column_px: L::Floats,
    slope: L::Longs,
}

impl<L: Lanes> Best<L> {
    #[inline(always)]
    fn none(lanes: L, order: L::Words, reach: L::Floats) -> Self {
        let zero = lanes.float(0.0);
        Self { order, reach, present: lanes.mask(0), rest: zero, column_px: zero, slope: lanes.long(0) }
    }

    #[inline(always)]
    fn consider(&mut self, lanes: L, pixels: &Pixels<L>, column_px: L::Floats, slope: L::Longs, candidates: L::Mask) {
        let (found, rest) = pixels.order_and_residual(column_px);
        let off = lanes.abs_float(rest);
        let fits = lanes.both(pixels.is_within_limits(column_px), lanes.is_same(found, lanes.widen(self.order)));
        let fits = lanes.both(lanes.both(fits, lanes.truths(candidates)), lanes.reaches(self.reach, off));
        // Without a candidate so far, any is better.
        let own = lanes.select_float(lanes.truths(self.present), lanes.abs_float(self.rest), lanes.float(f32::MAX));
        let better = lanes.both(fits, lanes.exceeds(own, off));
        self.present = lanes.or(self.present, lanes.mask_of(better));
        self.rest = lanes.select_float(better, rest, self.rest);
        self.column_px = lanes.select_float(better, column_px, self.column_px);
        self.slope = lanes.select_long(better, slope, self.slope);
    }
}

/// Pixels for which a surface ends at a column and would have the phase within a pixel beyond it, see
/// [`crate::correspondence::row_view`]. `outer` does not continue what `inner` and the column show.
#[inline(always)]
fn beyond_rim<L: Lanes>(lanes: L, outer: Differences<L>, here: Differences<L>, inner: Differences<L>) -> L::Mask {
    let zero = lanes.word(0);
    let outwards = lanes.sub(here.value, inner.value);
    let bend = lanes.abs(lanes.sub_saturating(lanes.sub(outer.value, here.value), outwards));
    // As unsigned words, |−32768| is 32768.
    let continued = lanes.and(outer.known, lanes.is_at_least(lanes.word(MAX_RIM_BEND as i16), bend));
    let steepness = lanes.abs(outwards);
    let steep = lanes.and(
        lanes.is_at_least(steepness, lanes.word(*RIM_SLOPES.start() as i16)),
        lanes.is_at_least(lanes.word(*RIM_SLOPES.end() as i16), steepness),
    );
    // −here/outwards lies between 0 and 1.
    let (below, falls) = (lanes.is_greater(zero, here.value), lanes.is_greater(zero, outwards));
    let opposite = lanes.or(lanes.and_not(below, falls), lanes.and_not(falls, below));
    let near = lanes.and_not(lanes.is_at_least(steepness, lanes.abs(here.value)), lanes.is_equal(here.value, zero));
    let surface = lanes.and_not(lanes.and(here.known, inner.known), continued);
    lanes.and(lanes.and(surface, steep), lanes.and(opposite, near))
}

/// Rounds to the nearest whole number, halves away from zero, as `f32::round` does. Far values become some number
/// beyond all words.
#[inline(always)]
fn nearest_whole<L: Lanes>(lanes: L, value: L::Floats) -> L::Longs {
    const BEYOND: f32 = 100_000.0;
    let value = lanes.min_float(lanes.max_float(value, lanes.float(-BEYOND)), lanes.float(BEYOND));
    let whole = lanes.longs(value);
    let rest = lanes.sub_float(value, lanes.floats(whole));
    let (up, down) = (lanes.reaches(rest, lanes.float(0.5)), lanes.reaches(lanes.float(-0.5), rest));
    let whole_up = lanes.select_long(up, lanes.add_long(whole, lanes.long(1)), whole);
    lanes.select_long(down, lanes.sub_long(whole, lanes.long(1)), whole_up)
}
