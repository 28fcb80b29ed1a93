//! The two halves of a pass: store the sums, then decide by the sums of both passes.

use fringeflow_simd::{Kernel, Lanes};

use crate::correspondence::semi_global::links::{AXES, NO_PLACE};
use crate::correspondence::semi_global::matching_cost::{BestRow, NO_ORDER};
use crate::correspondence::semi_global::order_ranges::LANE_STEP;

use super::{CHANGE, PATHS, Sweep, Visit};

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
pub(super) struct Leave<'a> {
    pub(super) places: &'a mut [u8],
    pub(super) sums: &'a mut [u16],
}

impl Visit for Leave<'_> {
    #[inline(always)]
    fn begin_row<L: Lanes>(&mut self, _: L, sweep: &mut Sweep<'_, '_>, _: usize, place: usize) {
        self.places[place..place + sweep.width].copy_from_slice(&sweep.scratch.agreed.places);
    }

    #[inline(always)]
    fn prefetch<L: Lanes>(&self, _: L, _: usize) {}

    #[inline(always)]
    fn take_settled<L: Lanes, const ROOM: usize>(&mut self, _: L, _: &Sweep<'_, '_>, _: usize, _: usize, _: u8) {}

    #[inline(always)]
    fn take<L: Lanes, const ROOM: usize>(
        &mut self,
        _: L,
        sweep: &Sweep<'_, '_>,
        _: usize,
        place: usize,
        sum: &[u16; ROOM],
    ) {
        let lanes = sweep.lanes::<ROOM>();
        self.places[place] = NO_PLACE;
        self.sums[place * lanes..][..lanes].copy_from_slice(&sum[..lanes]);
    }
}

/// Decides in rows where the other pass has stored its sums.
pub(super) struct Decide<'a> {
    pub(super) places: &'a [u8],
    pub(super) sums: &'a [u16],
    /// Sums of a pixel.
    pub(super) lanes: usize,
    pub(super) order: &'a mut [i16],
    pub(super) margin: &'a mut [u16],
}

impl Visit for Decide<'_> {
    #[inline(always)]
    fn begin_row<L: Lanes>(&mut self, level: L, sweep: &mut Sweep<'_, '_>, first: usize, place: usize) {
        let (pixels, places) = (first..first + sweep.width, place..place + sweep.width);
        let agreed = &mut sweep.scratch.agreed;
        SettledRow {
            agreed: &agreed.places,
            other: &self.places[places.clone()],
            first: &sweep.ranges.first[pixels.clone()],
            best: sweep.evidence.best.row(pixels),
            order: &mut self.order[places.clone()],
            margin: &mut self.margin[places],
            runs_on: &mut agreed.runs_on,
        }
        .run(level);
    }

    #[inline(always)]
    fn prefetch<L: Lanes>(&self, level: L, place: usize) {
        level.prefetch(&self.sums[place * self.lanes..]);
    }

    #[inline(always)]
    fn take_settled<L: Lanes, const ROOM: usize>(
        &mut self,
        level: L,
        sweep: &Sweep<'_, '_>,
        pixel: usize,
        place: usize,
        agreed: u8,
    ) {
        if self.places[place] != agreed {
            self.take::<L, ROOM>(level, sweep, pixel, place, &settled_sum(agreed));
        }
    }

    #[inline(always)]
    fn take<L: Lanes, const ROOM: usize>(
        &mut self,
        level: L,
        sweep: &Sweep<'_, '_>,
        pixel: usize,
        place: usize,
        sum: &[u16; ROOM],
    ) {
        let lanes = sweep.lanes::<ROOM>();
        let evidence = &sweep.evidence.costs[pixel * lanes..][..lanes];
        let (best, lead) = match self.places[place] {
            NO_PLACE => decide::<L, ROOM>(level, evidence, sum, &self.sums[place * lanes..][..lanes]),
            other => decide::<L, ROOM>(level, evidence, sum, &settled_sum::<ROOM>(other)[..lanes]),
        };
        self.order[place] = sweep.ranges.first[pixel] + best;
        self.margin[place] = lead;
    }
}

/// Decides the pixels of a row as if all paths of both passes came settled on the same place.
struct SettledRow<'a> {
    agreed: &'a [u8],
    /// Places on which the paths of the other pass are settled.
    other: &'a [u8],
    first: &'a [i16],
    best: BestRow<'a>,
    order: &'a mut [i16],
    margin: &'a mut [u16],
    /// Set to 0 where the places differ.
    runs_on: &'a mut [u8],
}

impl Kernel for SettledRow<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let Self { agreed, other, first, best, order, margin, runs_on } = self;
        let width = order.len();
        let (agreed, other, first) = (&agreed[..width], &other[..width], &first[..width]);
        let (least, second) = (&best.least[..width], &best.second[..width]);
        let (margin, runs_on) = (&mut margin[..width], &mut runs_on[..width]);
        for u in 0..width {
            order[u] = first[u].wrapping_add(i16::from(agreed[u]));
            // With a single order, the second least cost is its own.
            let lead = u16::from(second[u].wrapping_sub(least[u]));
            margin[u] = PATHS as u16 * (CHANGE + lead);
            runs_on[u] &= u8::from(agreed[u] == other[u]);
        }
    }
}

/// The place of the order with the least sum, and the excess of the next best.
#[inline(always)]
fn decide<L: Lanes, const ROOM: usize>(level: L, evidence: &[u8], sum: &[u16; ROOM], other: &[u16]) -> (i16, u16) {
    let (mut best, mut place, mut second) = (u16::MAX, 0, u16::MAX);
    let (others, _) = other.as_chunks::<LANE_STEP>();
    let sums = sum.as_chunks::<LANE_STEP>().0;
    for (step, ((evidence, other), sums)) in
        evidence.as_chunks::<LANE_STEP>().0.iter().zip(others).zip(sums).enumerate()
    {
        let first = step * LANE_STEP;
        // A key holds the sum and, in its low bits, the place. All keys differ, and of equal sums the first has the
        // least key.
        let mut keys = [u16::MAX; LANE_STEP];
        for lane in 0..LANE_STEP {
            let own = u16::from(evidence[lane]).wrapping_mul(PATHS as u16);
            let total = own.wrapping_add(sums[lane]).wrapping_add(other[lane]);
            let key = total.wrapping_mul(LANE_STEP as u16).wrapping_add(lane as u16);
            keys[lane] = if evidence[lane] == NO_ORDER { u16::MAX } else { key };
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
