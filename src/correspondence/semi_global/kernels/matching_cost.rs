//! Matching costs of all orders of 32 pixels.
//!
//! ```text
//! for each eight orders k of the pixels:
//!     for each k: columns(k) = where candidates with |δ − drift| <= MAX_Z·sd can lie
//!     for each k: walk along columns(k) in the two rows of C2, and keep where the phase of the pixel is crossed
//!     for each kept crossing: z = (δ − drift)/sd, best(k) = min( best(k), table(z) ), more outside the volume
//!     for each k: cost(k) = best(k), or MISSING; update the least and the second least cost of the pixel
//! transpose the costs from order by order to pixel by pixel
//! ```
//!
//! The walks of pixels in neighbouring columns share a table of 64 columns; the others take a walk of their own.

use fringeflow_simd::{COLUMNS, Lanes};

use crate::correspondence::kernels::{BLOCK, Crossing, Differences, Ends, Tables, column_and_slope, crosses};
use crate::correspondence::semi_global::cost_table::{CostTable, MAX_Z, MISSING, NO_ORDER, OUTSIDE, STEPS_PER_Z};
use crate::correspondence::semi_global::order_ranges::LANE_STEP;

use super::Block;

/// Crossings kept before their costs are computed.
const MAX_CROSSINGS: usize = 2 * LANE_STEP;

/// The order ranges of 32 pixels.
pub(in crate::correspondence::semi_global) struct OrderBlock<'a> {
    /// First order of each pixel, and number of orders.
    pub(in crate::correspondence::semi_global) first: &'a [i16; BLOCK],
    pub(in crate::correspondence::semi_global) count: &'a [u8; BLOCK],
    /// The largest of these numbers.
    pub(in crate::correspondence::semi_global) most: usize,
}

/// Summary of the costs of 32 pixels, as words.
pub(in crate::correspondence::semi_global) struct BestBlock<L: Lanes> {
    /// Orders that pass the back-projection test.
    pub(in crate::correspondence::semi_global) passing: L::Words,
    /// Place of the first order with the least cost, that cost, and the least cost of the others.
    pub(in crate::correspondence::semi_global) place: L::Words,
    pub(in crate::correspondence::semi_global) least: L::Words,
    pub(in crate::correspondence::semi_global) second: L::Words,
}

/// Scratch memory, kept from block to block.
pub(in crate::correspondence::semi_global) struct CostScratch<L: Lanes> {
    columns: [Columns<L>; LANE_STEP],
    crossings: [(Crossing<L>, usize); MAX_CROSSINGS],
    count: usize,
    best: [L::Words; LANE_STEP],
    by_order: [[u8; BLOCK]; LANE_STEP],
}

/// Columns in which candidates of an order can lie.
#[derive(Clone, Copy)]
struct Columns<L: Lanes> {
    /// Pixels that have the order, and those of them whose columns are not empty.
    own: L::Mask,
    some: L::Mask,
    /// The first column and the last.
    begin: L::Words,
    end: L::Words,
}

impl<L: Lanes> CostScratch<L> {
    #[inline(always)]
    pub(in crate::correspondence::semi_global) fn new(lanes: L) -> Self {
        let (none, zero) = (lanes.mask(0), lanes.word(0));
        Self {
            columns: [Columns { own: none, some: none, begin: zero, end: zero }; LANE_STEP],
            crossings: [(Crossing::none(lanes), 0); MAX_CROSSINGS],
            count: 0,
            best: [zero; LANE_STEP],
            by_order: [[0; BLOCK]; LANE_STEP],
        }
    }
}

impl<L: Lanes> Block<'_, L> {
    /// Writes the costs of all orders to `tile`, `lanes_of_pixel` per pixel, and returns their summary.
    #[inline(always)]
    pub(in crate::correspondence::semi_global) fn matching_costs(
        &mut self,
        orders: &OrderBlock<'_>,
        costs: &CostTable,
        scratch: &mut CostScratch<L>,
        ends: &mut Ends,
        tile: &mut [u8],
        lanes_of_pixel: usize,
    ) -> BestBlock<L> {
        let lanes = self.lanes;
        let none = lanes.word(i16::from(NO_ORDER));
        let mut best = BestBlock { passing: lanes.word(0), place: lanes.word(0), least: none, second: none };
        for skipped in (0..lanes_of_pixel).step_by(LANE_STEP) {
            let count = orders.most.saturating_sub(skipped).min(LANE_STEP);
            self.step(orders, [skipped, count], costs, scratch, ends, &mut best);
            scratch.by_order[count..].fill([NO_ORDER; BLOCK]);
            transpose(&scratch.by_order, &mut tile[skipped..], lanes_of_pixel);
        }
        // With a single order, the second least cost is its own.
        best.second = lanes.select(lanes.is_equal(best.second, none), best.least, best.second);
        best
    }

    /// Handles `count` orders, from the first order plus `skipped` on.
    #[inline(always)]
    fn step(
        &mut self,
        orders: &OrderBlock<'_>,
        [skipped, count]: [usize; 2],
        costs: &CostTable,
        scratch: &mut CostScratch<L>,
        ends: &mut Ends,
        all: &mut BestBlock<L>,
    ) {
        let lanes = self.lanes;
        let first = lanes.widen(lanes.load_signed(orders.first));
        let first = lanes.add_long(first, lanes.long(skipped as i32));
        let counts = lanes.words_of_bytes(orders.count);
        let reach = lanes.times_float(lanes.float(MAX_Z), self.pixels.sd_turns);
        // Each stage runs over all orders: their instructions are independent and fill the pipeline.
        let mut wide = lanes.mask(0);
        for lane in 0..count {
            let own = lanes.is_greater(counts, lanes.word((skipped + lane) as i16));
            let own = lanes.and(own, self.regular);
            let interval = self.pixels.columns_of(lanes.add_long(first, lanes.long(lane as i32)), reach);
            let some = lanes.and(own, interval.some);
            wide = lanes.or(wide, lanes.and_not(some, interval.narrow));
            scratch.columns[lane] = Columns { own, some, begin: interval.begin, end: interval.end_ceil };
        }
        if lanes.any(wide) {
            self.leave_to_scalar(wide);
        }
        scratch.best = [lanes.word(i16::from(MISSING)); LANE_STEP];
        for lane in 0..count {
            self.cross(lane, first, costs, scratch, ends);
        }
        self.add_costs(first, costs, scratch);
        let limit = lanes.word(i16::from(costs.limit));
        for lane in 0..count {
            let own = lanes.and(scratch.columns[lane].own, self.regular);
            let cost = lanes.select(own, scratch.best[lane], lanes.word(i16::from(NO_ORDER)));
            lanes.store_bytes(cost, &mut scratch.by_order[lane]);
            let better = lanes.is_greater(all.least, cost);
            all.place = lanes.select(better, lanes.word((skipped + lane) as i16), all.place);
            all.second = lanes.min_unsigned(all.second, lanes.max_unsigned(all.least, cost));
            all.least = lanes.min_unsigned(all.least, cost);
            let passes = lanes.select(lanes.is_greater(limit, cost), lanes.word(1), lanes.word(0));
            all.passing = lanes.add(all.passing, passes);
        }
    }

    /// Finds the crossings in the columns of an order.
    #[inline(always)]
    fn cross(&self, lane: usize, first: L::Longs, costs: &CostTable, scratch: &mut CostScratch<L>, ends: &mut Ends) {
        let lanes = self.lanes;
        let columns = scratch.columns[lane];
        let last_column = lanes.word((self.image.width - 1) as i16);
        let (begin, end) = (columns.begin, lanes.min_unsigned(columns.end, last_column));
        let (one, some) = (lanes.word(1), lanes.and(columns.some, self.regular));
        for pair in self.rows.pairs() {
            let mut todo = lanes.and(some, pair.pixels);
            while lanes.any(todo) {
                let base = lanes.least_of(todo, begin);
                let bases = lanes.word(base);
                let (place, last) = (lanes.sub(begin, bases), lanes.sub(end, bases));
                // Pixels whose columns lie within 64 of the first share one table.
                let here = lanes.and(todo, lanes.is_greater(lanes.word(COLUMNS as i16), last));
                todo = lanes.and_not(todo, here);
                let tables = Tables::new(lanes, self.image, &self.rows, *pair, base, self.phases, ends);
                let mut before: Differences<L> = tables.difference(place);
                let mut at = lanes.add(place, one);
                let mut within = lanes.and_not(here, lanes.is_greater(at, last));
                let mut crossing = Crossing::none(lanes);
                while lanes.any(within) {
                    let after = tables.difference(at);
                    let hit = lanes.and(crosses(lanes, before, after), within);
                    // A second crossing of a pixel would overwrite the first.
                    if lanes.any(lanes.and(hit, crossing.hit)) {
                        self.keep(lane, crossing, bases, first, costs, scratch);
                        crossing = Crossing::none(lanes);
                    }
                    crossing.set(lanes, hit, before.value, after.value, at);
                    before = after;
                    at = lanes.add(at, one);
                    within = lanes.and_not(within, lanes.is_greater(at, last));
                }
                self.keep(lane, crossing, bases, first, costs, scratch);
            }
        }
    }

    /// Keeps crossings, whose columns count from `bases`, until their costs are computed.
    #[inline(always)]
    fn keep(
        &self,
        lane: usize,
        mut crossing: Crossing<L>,
        bases: L::Words,
        first: L::Longs,
        costs: &CostTable,
        scratch: &mut CostScratch<L>,
    ) {
        if !self.lanes.any(crossing.hit) {
            return;
        }
        if scratch.count == MAX_CROSSINGS {
            self.add_costs(first, costs, scratch);
        }
        crossing.after_at = self.lanes.add(crossing.after_at, bases);
        scratch.crossings[scratch.count] = (crossing, lane);
        scratch.count += 1;
    }

    /// Adds the costs of the kept crossings to the best costs, and clears them.
    #[inline(always)]
    fn add_costs(&self, first: L::Longs, costs: &CostTable, scratch: &mut CostScratch<L>) {
        let (lanes, pixels) = (self.lanes, &self.pixels);
        for &(crossing, lane) in &scratch.crossings[..scratch.count] {
            let order = lanes.add_long(first, lanes.long(lane as i32));
            let (column_px, _) = column_and_slope(lanes, &crossing);
            let (found, rest) = pixels.order_and_residual(column_px);
            let fits = lanes.both(pixels.is_within_limits(column_px), lanes.is_same(found, order));
            let fits = lanes.and(crossing.hit, lanes.mask_of(fits));
            let z = lanes.over(lanes.abs_float(rest), pixels.sd_turns);
            let step = lanes.times_float(z, lanes.float(STEPS_PER_Z));
            let step = lanes.longs(lanes.min_float(step, lanes.float(CostTable::STEPS as f32)));
            let cost = lanes.numbers(&costs.of_step, step);
            let within = pixels.segments.have(column_px);
            let outside = lanes.select_long(within, lanes.long(0), lanes.long(i32::from(OUTSIDE)));
            let cost = lanes.narrow(lanes.add_long(cost, outside));
            let best = scratch.best[lane];
            scratch.best[lane] = lanes.select(fits, lanes.min_unsigned(best, cost), best);
        }
        scratch.count = 0;
    }
}

/// Groups of pixels transposed side by side.
const GROUPS: usize = BLOCK / LANE_STEP;

/// Transposes eight rows of 32 bytes into 32 rows of eight, `stride` apart.
#[inline(always)]
fn transpose(rows: &[[u8; BLOCK]; LANE_STEP], tile: &mut [u8], stride: usize) {
    let mut words = [[0_u64; GROUPS]; LANE_STEP];
    for (words, row) in words.iter_mut().zip(rows) {
        for (word, bytes) in words.iter_mut().zip(row.as_chunks().0) {
            *word = u64::from_le_bytes(*bytes);
        }
    }
    // Squares of one byte, then of two and of four, are swapped across the diagonal.
    exchange::<1>(&mut words, 0x00ff_00ff_00ff_00ff);
    exchange::<2>(&mut words, 0x0000_ffff_0000_ffff);
    exchange::<4>(&mut words, 0x0000_0000_ffff_ffff);
    for (i, words) in words.iter().enumerate() {
        for (group, word) in words.iter().enumerate() {
            tile[(group * LANE_STEP + i) * stride..][..LANE_STEP].copy_from_slice(&word.to_le_bytes());
        }
    }
}

/// Swaps the upper parts of rows with the lower parts of the rows `BY` further.
#[inline(always)]
fn exchange<const BY: usize>(words: &mut [[u64; GROUPS]; LANE_STEP], lower: u64) {
    for i in (0..LANE_STEP).filter(|i| i & BY == 0) {
        for group in 0..GROUPS {
            let (a, b) = (words[i][group], words[i + BY][group]);
            let change = (a >> (8 * BY) ^ b) & lower;
            words[i][group] = a ^ change << (8 * BY);
            words[i + BY][group] = b ^ change;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_become_columns() {
        let rows: [[u8; BLOCK]; LANE_STEP] = std::array::from_fn(|i| std::array::from_fn(|k| (i * BLOCK + k) as u8));
        for stride in [8, 24] {
            let mut tile = vec![0; BLOCK * stride];
            transpose(&rows, &mut tile, stride);
            for k in 0..BLOCK {
                let expected: [u8; LANE_STEP] = std::array::from_fn(|i| rows[i][k]);
                assert_eq!(tile[k * stride..][..LANE_STEP], expected);
            }
        }
    }
}
