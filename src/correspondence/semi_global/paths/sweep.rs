//! A pass through the image with its four directions, row by row and pixel by pixel.

use fringeflow_simd::{Kernel, Lanes};

use crate::correspondence::semi_global::cost_table::MISSING;
use crate::correspondence::semi_global::links::{AXES, Link, Links, MAX_SHIFT, NO_PLACE, RowLinks};
use crate::correspondence::semi_global::matching_cost::MatchingCosts;
use crate::correspondence::semi_global::order_ranges::{LANE_STEP, MAX_LANES, OrderRanges};

use super::agreed::{AgreedRow, run_of_ones};
use super::path_row::PathRow;
use super::settled::CHANGE;

/// Numbers of orders with compiled loops of their own, besides the general loop.
const ONE_STEP: usize = LANE_STEP;
const TWO_STEPS: usize = 2 * LANE_STEP;
const THREE_STEPS: usize = 3 * LANE_STEP;
/// Paths through each pixel.
pub(in crate::correspondence::semi_global) const PATHS: usize = 8;

const _: () = assert!(PATHS * (CHANGE as usize + MISSING as usize) * LANE_STEP < u16::MAX as usize - LANE_STEP);

/// Direction of a pass.
#[derive(Clone, Copy, PartialEq, Eq)]
pub(super) enum Pass {
    /// Rows from the first, columns from the left.
    Down,
    /// Rows from the last, columns from the right.
    Up,
}

/// One pass with its four directions.
pub(super) struct Sweep<'a, 'b> {
    pub(super) width: usize,
    pub(super) ranges: &'a OrderRanges,
    pub(super) links: &'a Links,
    pub(super) matching_costs: &'a MatchingCosts,
    pub(super) pass: Pass,
    pub(super) scratch: &'b mut PassScratch,
}

/// Scratch for a pass.
#[derive(Clone, Debug, Default)]
pub(super) struct PassScratch {
    /// Costs along the row, straight down, and along both diagonals: in the row before and in this one.
    pub(super) before: [PathRow; AXES.len()],
    pub(super) here: [PathRow; AXES.len()],
    pub(super) agreed: AgreedRow,
}

impl PassScratch {
    /// Resets to the state before the first row.
    pub(super) fn clear(&mut self, width: usize, lanes: usize) {
        for row in self.before.iter_mut().chain(&mut self.here) {
            row.clear(width, lanes);
        }
        self.agreed.resize(width);
    }
}

/// Passes through some rows.
pub(super) struct PassRows<'a, 'b, 'c, V> {
    pub(super) sweep: &'a mut Sweep<'b, 'c>,
    pub(super) rows: std::ops::Range<usize>,
    pub(super) visit: V,
}

/// Use of the sums that a pass computes: stored in its first half, decided upon in its second half. `pixel` is the
/// number of a pixel in the image, `index` its number among the pixels of the half.
pub(super) trait Visit {
    /// Begins the row whose first pixel is number `first` of the image and `index` of the half. `sweep.scratch.agreed`
    /// holds the places on which all paths arrive settled.
    fn begin_row<L: Lanes>(&mut self, level: L, sweep: &mut Sweep<'_, '_>, first: usize, index: usize);

    /// Prefetches the data of a pixel that is not settled.
    fn prefetch<L: Lanes>(&self, level: L, index: usize);

    /// Visits a settled pixel that `begin_row` did not finish.
    fn visit_settled<L: Lanes, const ROOM: usize>(
        &mut self,
        level: L,
        sweep: &Sweep<'_, '_>,
        pixel: usize,
        index: usize,
        agreed: u8,
    );

    /// Visits any other pixel, to which the paths of the pass bring the sums `sum`.
    fn visit<L: Lanes, const ROOM: usize>(
        &mut self,
        level: L,
        sweep: &Sweep<'_, '_>,
        pixel: usize,
        index: usize,
        sum: &[u16; ROOM],
    );
}

impl<V: Visit> Kernel for PassRows<'_, '_, '_, V> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        // Most rigs have few orders; loops of known length stay in registers.
        match self.sweep.ranges.lanes {
            ONE_STEP => self.run_with::<L, ONE_STEP>(lanes),
            TWO_STEPS => self.run_with::<L, TWO_STEPS>(lanes),
            THREE_STEPS => self.run_with::<L, THREE_STEPS>(lanes),
            _ => self.run_with::<L, MAX_LANES>(lanes),
        }
    }
}

impl<V: Visit> PassRows<'_, '_, '_, V> {
    #[inline(always)]
    fn run_with<L: Lanes, const ROOM: usize>(self, level: L) {
        let Self { sweep, rows, mut visit } = self;
        for i in 0..rows.len() {
            let v = if sweep.pass == Pass::Down { rows.start + i } else { rows.end - 1 - i };
            let (first, first_index) = (v * sweep.width, (v - rows.start) * sweep.width);
            let links = sweep.begin_row(level, v);
            visit.begin_row(level, sweep, first, first_index);
            sweep.prefetch_unsettled::<L, ROOM>(level, first, |u| visit.prefetch(level, first_index + u));
            let mut j = 0;
            while j < sweep.width {
                let u = sweep.column(j);
                j += 1;
                let (pixel, index) = (first + u, first_index + u);
                if sweep.ranges.count[pixel] == 0 {
                    continue;
                }
                let agreed = sweep.scratch.agreed.places[u];
                if sweep.matching_costs.best.is_decided(pixel)
                    || (agreed != NO_PLACE && sweep.place_along(&links[0], u) == agreed)
                {
                    visit.visit_settled::<L, ROOM>(level, sweep, pixel, index, agreed);
                    if j < sweep.width {
                        j += run_of_ones(&sweep.scratch.agreed.is_skippable, sweep.column(j), sweep.pass == Pass::Down);
                    }
                } else {
                    let sum = sweep.advance::<L, ROOM>(level, &links, [u, pixel]);
                    visit.visit::<L, ROOM>(level, sweep, pixel, index, &sum);
                }
            }
            // This row is the one before the next.
            std::mem::swap(&mut sweep.scratch.before, &mut sweep.scratch.here);
        }
    }
}

impl<'a> Sweep<'a, '_> {
    /// Orders per pixel in memory; a constant for few orders.
    #[inline(always)]
    pub(super) fn lanes<const ROOM: usize>(&self) -> usize {
        if ROOM < MAX_LANES { ROOM } else { self.ranges.lanes }
    }

    #[inline(always)]
    fn column(&self, j: usize) -> usize {
        if self.pass == Pass::Down { j } else { self.width - 1 - j }
    }

    /// Finds the pixels of a row at which all paths arrive settled, assuming that the paths along the row do. Returns
    /// the links of the row.
    #[inline(always)]
    fn begin_row<L: Lanes>(&mut self, level: L, v: usize) -> [RowLinks<'a>; AXES.len()] {
        let (links, forward) = (self.links, self.pass == Pass::Down);
        let links = [0, 1, 2, 3].map(|axis| links.row(axis, v, forward));
        let PassScratch { before, here, agreed } = &mut *self.scratch;
        let pixels = v * self.width..(v + 1) * self.width;
        agreed.find(level, &links, before, &self.ranges.count[pixels.clone()], self.matching_costs.best.row(pixels));
        here.iter_mut().for_each(|row| row.places.copy_from_slice(&agreed.places));
        links
    }

    /// Prefetches the costs of the pixels of a row that are not settled, because the hardware cannot predict where they
    /// lie. Calls `prefetch_visit` with their columns.
    #[inline(always)]
    fn prefetch_unsettled<L: Lanes, const ROOM: usize>(&self, level: L, first: usize, prefetch_visit: impl Fn(usize)) {
        let (lanes, is_skippable) = (self.lanes::<ROOM>(), &self.scratch.agreed.is_skippable);
        let count = &self.ranges.count[first..first + is_skippable.len()];
        let eights = is_skippable.as_chunks::<8>().0.iter().zip(count.as_chunks::<8>().0);
        for (i, (is_skippable, count)) in eights.enumerate() {
            // Eight pixels that are skipped or have no orders read no costs.
            if *is_skippable == [1; 8] || *count == [0; 8] {
                continue;
            }
            for u in 8 * i..8 * i + 8 {
                level.prefetch(&self.matching_costs.by_order[(first + u) * lanes..]);
                prefetch_visit(u);
            }
        }
    }

    /// The place on which the path along the row arrives settled at a pixel.
    #[inline(always)]
    fn place_along(&self, links: &RowLinks<'_>, u: usize) -> u8 {
        let Link { is_link, column, shift } = links.link(u);
        match self.scratch.here[0].places[column] {
            place if is_link && place != NO_PLACE => place.wrapping_add(MAX_SHIFT as u8).wrapping_sub(shift as u8),
            _ => NO_PLACE,
        }
    }

    /// Advances all four directions to pixel number `pixel`, in column `u`. Returns the sum of the costs that they
    /// bring.
    #[inline(always)]
    fn advance<L: Lanes, const ROOM: usize>(
        &mut self,
        level: L,
        links: &[RowLinks<'_>; AXES.len()],
        [u, pixel]: [usize; 2],
    ) -> [u16; ROOM] {
        let lanes = self.lanes::<ROOM>();
        let own_costs = &self.matching_costs.by_order[pixel * lanes..][..lanes];
        let PassScratch { before, here, .. } = &mut *self.scratch;
        let mut sum = [0_u16; ROOM];
        for axis in 0..AXES.len() {
            // Along the row the predecessor is in this row, else in the row before.
            let row = if AXES[axis][1] == 0 { &here[axis] } else { &before[axis] };
            let bytes = row.costs_along(links[axis].link(u), lanes);
            let mut brought = [0; ROOM];
            for lane in 0..lanes {
                brought[lane] = u16::from(bytes[lane]);
            }
            let costs = add::<L, ROOM>(level, own_costs, &brought, lanes);
            for lane in 0..lanes {
                sum[lane] = sum[lane].wrapping_add(brought[lane]);
            }
            here[axis].set(level, u, &costs[..lanes]);
        }
        sum
    }
}

/// Path costs of a pixel in one direction: the costs that the path brings plus the pixel's own, minus the least of
/// these sums. They are capped at the price of a change, which is the most that a successor pays.
#[inline(always)]
fn add<L: Lanes, const ROOM: usize>(level: L, own_costs: &[u8], brought: &[u16; ROOM], lanes: usize) -> [u16; ROOM] {
    let mut costs = *brought;
    let mut least = [u16::MAX; LANE_STEP];
    for (costs, own) in costs.as_chunks_mut::<LANE_STEP>().0.iter_mut().zip(own_costs.as_chunks::<LANE_STEP>().0) {
        for lane in 0..LANE_STEP {
            costs[lane] = costs[lane].wrapping_add(u16::from(own[lane]));
            least[lane] = least[lane].min(costs[lane]);
        }
    }
    let least = level.least(&least);
    for costs in costs[..lanes].as_chunks_mut::<LANE_STEP>().0 {
        for lane in 0..LANE_STEP {
            costs[lane] = costs[lane].wrapping_sub(least[lane]).min(CHANGE);
        }
    }
    costs
}
