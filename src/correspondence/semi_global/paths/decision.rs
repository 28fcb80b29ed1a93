//! The two halves of a pass: it stores its sums, then decides by the sums of both passes.
//!
//! ```text
//! first half, for each row:    store the places on which all paths arrive settled
//!     for each other pixel:    store its sums, and no place
//! second half, for each row:   decide all pixels as if both passes were settled on the same place
//!     for each pixel for which this is not so:
//!         S(k) = 8·E(k) + sum of this pass (k) + sum of the other pass (k)
//!         order = the k of the least S, margin = excess of the next best S
//! ```

use fringeflow_simd::{Kernel, Lanes};

use crate::correspondence::semi_global::cost_table::NO_ORDER;
use crate::correspondence::semi_global::links::{AXES, NO_PLACE};
use crate::correspondence::semi_global::matching_cost::BestRow;
use crate::correspondence::semi_global::order_ranges::LANE_STEP;

use super::settled::CHANGE;
use super::sweep::{PATHS, Sweep, Visit};

/// Sum that the settled paths of a pass bring to all other orders.
const SETTLED_SUM: u16 = AXES.len() as u16 * CHANGE;

/// Sums of a pass whose paths are settled on a place.
#[inline(always)]
fn settled_sum<const ROOM: usize>(place: u8) -> [u16; ROOM] {
    let mut sum = [SETTLED_SUM; ROOM];
    sum[usize::from(place)] = 0;
    sum
}

/// Stores the sums of rows that the other pass has not reached.
pub(super) struct StoreSums<'a> {
    pub(super) places: &'a mut [u8],
    pub(super) sums: &'a mut [u16],
}

impl Visit for StoreSums<'_> {
    #[inline(always)]
    fn begin_row<L: Lanes>(&mut self, _: L, sweep: &mut Sweep<'_, '_>, _: usize, index: usize) {
        self.places[index..index + sweep.width].copy_from_slice(&sweep.scratch.agreed.places);
    }

    #[inline(always)]
    fn prefetch<L: Lanes>(&self, _: L, _: usize) {}

    #[inline(always)]
    fn visit_settled<L: Lanes, const ROOM: usize>(&mut self, _: L, _: &Sweep<'_, '_>, _: usize, _: usize, _: u8) {}

    #[inline(always)]
    fn visit<L: Lanes, const ROOM: usize>(
        &mut self,
        _: L,
        sweep: &Sweep<'_, '_>,
        _: usize,
        index: usize,
        sum: &[u16; ROOM],
    ) {
        let lanes = sweep.lanes::<ROOM>();
        self.places[index] = NO_PLACE;
        self.sums[index * lanes..][..lanes].copy_from_slice(&sum[..lanes]);
    }
}

/// Decides in rows where the other pass has stored its sums.
pub(super) struct DecideOrders<'a> {
    pub(super) places: &'a [u8],
    pub(super) sums: &'a [u16],
    /// Number of sums per pixel.
    pub(super) lanes: usize,
    pub(super) order: &'a mut [i16],
    pub(super) margin: &'a mut [u16],
}

impl Visit for DecideOrders<'_> {
    #[inline(always)]
    fn begin_row<L: Lanes>(&mut self, level: L, sweep: &mut Sweep<'_, '_>, first: usize, index: usize) {
        let (pixels, indices) = (first..first + sweep.width, index..index + sweep.width);
        let agreed = &mut sweep.scratch.agreed;
        SettledRow {
            agreed: &agreed.places,
            other: &self.places[indices.clone()],
            first: &sweep.ranges.first[pixels.clone()],
            best: sweep.matching_costs.best.row(pixels),
            order: &mut self.order[indices.clone()],
            margin: &mut self.margin[indices],
            is_skippable: &mut agreed.is_skippable,
        }
        .run(level);
    }

    #[inline(always)]
    fn prefetch<L: Lanes>(&self, level: L, index: usize) {
        level.prefetch(&self.sums[index * self.lanes..]);
    }

    #[inline(always)]
    fn visit_settled<L: Lanes, const ROOM: usize>(
        &mut self,
        level: L,
        sweep: &Sweep<'_, '_>,
        pixel: usize,
        index: usize,
        agreed: u8,
    ) {
        if self.places[index] != agreed {
            self.visit::<L, ROOM>(level, sweep, pixel, index, &settled_sum(agreed));
        }
    }

    #[inline(always)]
    fn visit<L: Lanes, const ROOM: usize>(
        &mut self,
        level: L,
        sweep: &Sweep<'_, '_>,
        pixel: usize,
        index: usize,
        sum: &[u16; ROOM],
    ) {
        let lanes = sweep.lanes::<ROOM>();
        let own_costs = &sweep.matching_costs.by_order[pixel * lanes..][..lanes];
        let (best, lead) = match self.places[index] {
            NO_PLACE => decide::<L, ROOM>(level, own_costs, sum, &self.sums[index * lanes..][..lanes]),
            other => decide::<L, ROOM>(level, own_costs, sum, &settled_sum::<ROOM>(other)[..lanes]),
        };
        self.order[index] = sweep.ranges.first[pixel] + best;
        self.margin[index] = lead;
    }
}

/// Decides the pixels of a row as if all paths of both passes arrived settled on the same place.
struct SettledRow<'a> {
    agreed: &'a [u8],
    /// Places on which the paths of the other pass are settled.
    other: &'a [u8],
    first: &'a [i16],
    best: BestRow<'a>,
    order: &'a mut [i16],
    margin: &'a mut [u16],
    /// Set to 0 where the places of the passes differ.
    is_skippable: &'a mut [u8],
}

impl Kernel for SettledRow<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let Self { agreed, other, first, best, order, margin, is_skippable } = self;
        let width = order.len();
        let (agreed, other, first) = (&agreed[..width], &other[..width], &first[..width]);
        let (least, second) = (&best.least[..width], &best.second[..width]);
        let (margin, is_skippable) = (&mut margin[..width], &mut is_skippable[..width]);
        for u in 0..width {
            order[u] = first[u].wrapping_add(i16::from(agreed[u]));
            // With a single order, the second least cost is its own.
            let lead = u16::from(second[u].wrapping_sub(least[u]));
            margin[u] = PATHS as u16 * (CHANGE + lead);
            is_skippable[u] &= u8::from(agreed[u] == other[u]);
        }
    }
}

/// The place of the order with the least sum, and the excess of the next best. `sum` comes from the paths of this pass,
/// `other` from those of the other pass.
#[inline(always)]
fn decide<L: Lanes, const ROOM: usize>(level: L, own_costs: &[u8], sum: &[u16; ROOM], other: &[u16]) -> (i16, u16) {
    let (mut best, mut place, mut second) = (u16::MAX, 0, u16::MAX);
    let (others, _) = other.as_chunks::<LANE_STEP>();
    let sums = sum.as_chunks::<LANE_STEP>().0;
    let steps = own_costs.as_chunks::<LANE_STEP>().0.iter().zip(others).zip(sums);
    for (step, ((own_costs, other), sums)) in steps.enumerate() {
        let first = step * LANE_STEP;
        // A key holds the sum and, in its low bits, the place. All keys differ, and of equal sums the first has the
        // least key.
        let mut keys = [u16::MAX; LANE_STEP];
        for lane in 0..LANE_STEP {
            let own = u16::from(own_costs[lane]).wrapping_mul(PATHS as u16);
            let total = own.wrapping_add(sums[lane]).wrapping_add(other[lane]);
            let key = total.wrapping_mul(LANE_STEP as u16).wrapping_add(lane as u16);
            keys[lane] = if own_costs[lane] == NO_ORDER { u16::MAX } else { key };
        }
        let leasts = level.least(&keys);
        let least = leasts[0];
        for lane in 0..LANE_STEP {
            keys[lane] = if keys[lane] == leasts[lane] { u16::MAX } else { keys[lane] };
        }
        // Without the least key, the least is the second of this step.
        let next = level.least(&keys)[0];
        if least < u16::MAX {
            let total = least / LANE_STEP as u16;
            if total < best {
                second = second.min(best);
                (best, place) = (total, first as u16 + least % LANE_STEP as u16);
            } else {
                second = second.min(total);
            }
            second = second.min(if next < u16::MAX { next / LANE_STEP as u16 } else { u16::MAX });
        }
    }
    // With a single order, the cost of a missing candidate on all paths stands for the excess.
    let lead = if second == u16::MAX { PATHS as u16 * CHANGE } else { second - best };
    (place as i16, lead)
}
