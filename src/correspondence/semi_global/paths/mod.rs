//! Semi-global optimization: least costs along straight paths through the image, and for each pixel the order with the
//! least sum of them.
//!
//! ```text
//! for each direction, pixel by pixel p after its predecessor q:
//!     F(p, k) = min( L(q, k − carry), P )      where the wrapped phase runs on from q to p, least of L(q) taken off
//!     F(p, k) = 0                              where it jumps, or there is no q
//!     L(p, k) = E(p, k) + F(p, k)
//! for each pixel:
//!     S(p, k) = 8·E(p, k) + sum of F(p, k) over all directions
//! ```
//!
//! Over most of an image one order fits and the others do not. There paths are *settled*: F is 0 for that order and P
//! for all others, whatever the costs were. A pixel that all paths reach settled on its best order leaves them settled.
//! Its sums follow from its best costs alone, so whole runs of such pixels are skipped.
//!
//! A pixel that was decided before is settled on its order, whatever reaches it, and leaves its paths settled.
//!
//! E(p, k) is the matching cost of order k. carry is the whole turn that the wrapped phase skips between q and p: a
//! continuing order changes by it. S differs from the sum of L by a number that is the same for all orders of a pixel.
//!
//! Four directions run with the rows of the image and four against them, in two passes from opposite ends. They are
//! independent until they meet in the middle. Each pass stores its sums in the first half of its way, and decides in
//! the second half, where the sums of the other pass are stored. Sums of whole numbers do not depend on their order.

mod decision;
mod settled;

use fringeflow_simd::{Kernel, Lanes, Level};

use crate::phase::PhaseMap;

use super::UNITS_PER_NAT;
use super::links::{AXES, Link, Links, MAX_SHIFT, NO_PLACE, RowLinks};
use super::matching_cost::{MISSING, MatchingCosts};
use super::order_ranges::{LANE_STEP, MAX_LANES, OrderRanges};

use decision::{Decide, Leave};
use settled::{AgreedRow, SETTLED, place_of_zero, run_of_ones, settled};

/// Price of a change of order where the wrapped phase continues, nats.
const CHANGE_NATS: f32 = 8.0;
const CHANGE: u16 = (CHANGE_NATS * UNITS_PER_NAT) as u16;
/// Numbers of orders with compiled loops of their own, besides the general loop.
const ONE_STEP: usize = LANE_STEP;
const TWO_STEPS: usize = 2 * LANE_STEP;
const THREE_STEPS: usize = 3 * LANE_STEP;
/// Paths through each pixel.
pub(super) const PATHS: usize = 8;

/// The orders with the least cost.
#[derive(Clone, Debug, Default)]
pub(super) struct Verdicts {
    pub(super) order: Vec<i16>,
    /// Excess of the next best order, summed over all paths. Undefined for pixels without orders.
    pub(super) margin: Vec<u16>,
}

/// Scratch for the links of pixels and the sums of paths.
#[derive(Clone, Debug, Default)]
pub(super) struct PathScratch {
    pub(super) links: Links,
    /// What the first pass to reach a pixel stores: the place on which its paths are settled, else its sums.
    places: Vec<u8>,
    sums: Vec<u16>,
    passes: [PassScratch; 2],
}

/// Decides the order of every pixel with a range.
pub(super) fn least_costs(
    cam1: &PhaseMap,
    ranges: &OrderRanges,
    evidence: &MatchingCosts,
    scratch: &mut PathScratch,
    verdicts: &mut Verdicts,
) {
    least_costs_at(Level::in_use(), cam1, ranges, evidence, scratch, verdicts);
}

/// As [`least_costs`], at a SIMD level.
fn least_costs_at(
    level: Level,
    cam1: &PhaseMap,
    ranges: &OrderRanges,
    evidence: &MatchingCosts,
    PathScratch { links, places, sums, passes }: &mut PathScratch,
    verdicts: &mut Verdicts,
) {
    let (width, height, lanes) = (cam1.width.max(1), cam1.height, ranges.lanes);
    links.find(cam1, ranges);
    places.resize(width * height, NO_PLACE);
    sums.resize(width * height * lanes, 0);
    verdicts.order.resize(width * height, 0);
    verdicts.margin.resize(width * height, 0);
    // Each pass stores sums for its first half of the image and decides in its second half.
    let middle = height / 2;
    let (upper_places, lower_places) = places.split_at_mut(middle * width);
    let (upper_sums, lower_sums) = sums.split_at_mut(middle * width * lanes);
    let (upper_order, lower_order) = verdicts.order.split_at_mut(middle * width);
    let (upper_margin, lower_margin) = verdicts.margin.split_at_mut(middle * width);
    let [down, up] = passes;
    [&mut *down, &mut *up].into_iter().for_each(|scratch| scratch.clear(width, lanes));
    let mut down = Sweep { width, ranges, links, evidence, pass: Pass::Down, scratch: down };
    let mut up = Sweep { width, ranges, links, evidence, pass: Pass::Up, scratch: up };
    let (above, below) = (0..middle, middle..height);
    rayon::join(
        || {
            let visit = Leave { places: &mut *upper_places, sums: &mut *upper_sums };
            fringeflow_simd::run(level, PassRows { sweep: &mut down, rows: above.clone(), visit });
        },
        || {
            let visit = Leave { places: &mut *lower_places, sums: &mut *lower_sums };
            fringeflow_simd::run(level, PassRows { sweep: &mut up, rows: below.clone(), visit });
        },
    );
    rayon::join(
        || {
            let (places, sums) = (&*lower_places, &*lower_sums);
            let visit = Decide { places, sums, lanes, order: lower_order, margin: lower_margin };
            fringeflow_simd::run(level, PassRows { sweep: &mut down, rows: below.clone(), visit });
        },
        || {
            let (places, sums) = (&*upper_places, &*upper_sums);
            let visit = Decide { places, sums, lanes, order: upper_order, margin: upper_margin };
            fringeflow_simd::run(level, PassRows { sweep: &mut up, rows: above.clone(), visit });
        },
    );
}

/// Direction of a pass.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Pass {
    /// Rows from the first, columns from the left.
    Down,
    /// Rows from the last, columns from the right.
    Up,
}

/// One pass with its four directions.
struct Sweep<'a, 'b> {
    width: usize,
    ranges: &'a OrderRanges,
    links: &'a Links,
    evidence: &'a MatchingCosts,
    pass: Pass,
    scratch: &'b mut PassScratch,
}

/// Scratch for a pass.
#[derive(Clone, Debug, Default)]
struct PassScratch {
    /// Costs along the row, straight down, and along both diagonals: of the row before and of this one.
    before: [PathRow; AXES.len()],
    here: [PathRow; AXES.len()],
    agreed: AgreedRow,
}

impl PassScratch {
    /// Resets to no row passed.
    fn clear(&mut self, width: usize, lanes: usize) {
        for row in self.before.iter_mut().chain(&mut self.here) {
            row.clear(width, lanes);
        }
        self.agreed.resize(width);
    }
}

/// Path costs of a row of pixels in one direction, the least of each pixel subtracted, none above the price of a
/// change.
#[derive(Clone, Debug, Default)]
struct PathRow {
    /// Places of the orders on which pixels are settled; [`NO_PLACE`] for pixels with costs.
    places: Vec<u8>,
    /// With a margin on either side for shifted ranges of neighbours.
    costs: Vec<u8>,
}

impl PathRow {
    /// Resets to no costs.
    fn clear(&mut self, width: usize, lanes: usize) {
        self.places.clear();
        self.places.resize(width, NO_PLACE);
        self.costs.clear();
        self.costs.resize(width * (lanes + 2 * MAX_SHIFT), CHANGE as u8);
        // Behind them the costs of a settled pixel and those without link, so that one index finds any of the three.
        self.costs.extend_from_slice(&SETTLED);
        self.costs.extend_from_slice(&[0; MAX_LANES]);
    }

    /// The costs that a path brings along a link.
    #[inline(always)]
    fn towards(&self, Link { is_link, column, shift }: Link, lanes: usize) -> &[u8] {
        let (place, of_settled) = (self.places[column], self.costs.len() - MAX_LANES - SETTLED.len());
        let own = column * (lanes + 2 * MAX_SHIFT) + shift;
        let begin = if place == NO_PLACE { own } else { of_settled + MAX_LANES + shift - usize::from(place) };
        let begin = if is_link { begin } else { of_settled + SETTLED.len() };
        &self.costs[begin..][..lanes]
    }

    /// Stores the costs of a pixel; the least is zero. Free of branches: whether they are settled is unpredictable.
    #[inline(always)]
    fn set<L: Lanes>(&mut self, level: L, u: usize, costs: &[u16]) {
        let lanes = costs.len();
        let own = &mut self.costs[u * (lanes + 2 * MAX_SHIFT) + MAX_SHIFT..][..lanes];
        let mut place = 0;
        let steps = own.as_chunks_mut::<LANE_STEP>().0.iter_mut().zip(costs.as_chunks::<LANE_STEP>().0);
        for (step, (own, costs)) in steps.enumerate().rev() {
            let bytes = level.bytes_of(costs);
            *own = bytes.to_le_bytes();
            let of_step = place_of_zero(bytes);
            place = if of_step < LANE_STEP { step * LANE_STEP + of_step } else { place };
        }
        let differs = *own != *settled(place, MAX_SHIFT, lanes);
        // All bits set are [`NO_PLACE`].
        self.places[u] = place as u8 | u8::from(differs).wrapping_neg();
    }
}

const _: () = assert!(NO_PLACE == u8::MAX);

/// Passes through some rows.
struct PassRows<'a, 'b, 'c, V> {
    sweep: &'a mut Sweep<'b, 'c>,
    rows: std::ops::Range<usize>,
    visit: V,
}

/// What is done with the sums of pixels. `place` is the index of a row or pixel among those of the rows.
trait Visit {
    /// Begins a row, where `agreed` holds the places on which all paths come settled; `first` is the number of its
    /// first pixel.
    fn begin_row<L: Lanes>(&mut self, level: L, sweep: &mut Sweep<'_, '_>, first: usize, place: usize);

    /// Prefetches what a pixel that is not settled will read.
    fn prefetch<L: Lanes>(&self, level: L, place: usize);

    /// Takes a settled pixel that `begin_row` did not finish.
    fn take_settled<L: Lanes, const ROOM: usize>(
        &mut self,
        level: L,
        sweep: &Sweep<'_, '_>,
        pixel: usize,
        place: usize,
        agreed: u8,
    );

    /// Takes the sums that the paths of a pass bring to any other pixel.
    fn take<L: Lanes, const ROOM: usize>(
        &mut self,
        level: L,
        sweep: &Sweep<'_, '_>,
        pixel: usize,
        place: usize,
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
            let (first, first_place) = (v * sweep.width, (v - rows.start) * sweep.width);
            let links = sweep.begin_row(level, v);
            visit.begin_row(level, sweep, first, first_place);
            sweep.prefetch_unsettled::<L, ROOM>(level, first, |place| visit.prefetch(level, first_place + place));
            let mut j = 0;
            while j < sweep.width {
                let u = sweep.column(j);
                j += 1;
                let (pixel, place) = (first + u, first_place + u);
                if sweep.ranges.count[pixel] == 0 {
                    continue;
                }
                let agreed = sweep.scratch.agreed.places[u];
                if sweep.evidence.best.is_decided(pixel)
                    || (agreed != NO_PLACE && sweep.place_along(&links[0], u) == agreed)
                {
                    visit.take_settled::<L, ROOM>(level, sweep, pixel, place, agreed);
                    if j < sweep.width {
                        j += run_of_ones(&sweep.scratch.agreed.runs_on, sweep.column(j), sweep.pass == Pass::Down);
                    }
                } else {
                    let sum = sweep.pixel::<L, ROOM>(level, &links, [u, pixel]);
                    visit.take::<L, ROOM>(level, sweep, pixel, place, &sum);
                }
            }
            // This row is the one before the next.
            std::mem::swap(&mut sweep.scratch.before, &mut sweep.scratch.here);
        }
    }
}

impl<'a> Sweep<'a, '_> {
    /// Number of orders; a constant for few orders.
    #[inline(always)]
    fn lanes<const ROOM: usize>(&self) -> usize {
        if ROOM < MAX_LANES { ROOM } else { self.ranges.lanes }
    }

    #[inline(always)]
    fn column(&self, j: usize) -> usize {
        if self.pass == Pass::Down { j } else { self.width - 1 - j }
    }

    /// Finds the pixels of a row that all paths reach settled, provided that the paths along the row do. Returns the
    /// links of the row.
    #[inline(always)]
    fn begin_row<L: Lanes>(&mut self, level: L, v: usize) -> [RowLinks<'a>; AXES.len()] {
        let (links, forward) = (self.links, self.pass == Pass::Down);
        let links = [0, 1, 2, 3].map(|axis| links.row(axis, v, forward));
        let PassScratch { before, here, agreed } = &mut *self.scratch;
        let pixels = v * self.width..(v + 1) * self.width;
        agreed.find(level, &links, before, &self.ranges.count[pixels.clone()], self.evidence.best.row(pixels));
        here.iter_mut().for_each(|row| row.places.copy_from_slice(&agreed.places));
        links
    }

    /// Prefetches for the pixels of a row that are not settled: the hardware cannot foresee where they lie.
    #[inline(always)]
    fn prefetch_unsettled<L: Lanes, const ROOM: usize>(&self, level: L, first: usize, expect: impl Fn(usize)) {
        let (lanes, runs_on) = (self.lanes::<ROOM>(), &self.scratch.agreed.runs_on);
        let count = &self.ranges.count[first..first + runs_on.len()];
        for (i, (runs_on, count)) in runs_on.as_chunks::<8>().0.iter().zip(count.as_chunks::<8>().0).enumerate() {
            // Eight pixels that are skipped or have no orders read nothing.
            if *runs_on == [1; 8] || *count == [0; 8] {
                continue;
            }
            for u in 8 * i..8 * i + 8 {
                level.prefetch(&self.evidence.costs[(first + u) * lanes..]);
                expect(u);
            }
        }
    }

    /// The place on which the path along the row comes settled to a pixel.
    #[inline(always)]
    fn place_along(&self, links: &RowLinks<'_>, u: usize) -> u8 {
        let Link { is_link, column, shift } = links.link(u);
        match self.scratch.here[0].places[column] {
            place if is_link && place != NO_PLACE => place.wrapping_add(MAX_SHIFT as u8).wrapping_sub(shift as u8),
            _ => NO_PLACE,
        }
    }

    /// Advances all four directions by a pixel in column `u`. Returns the sums that they bring.
    #[inline(always)]
    fn pixel<L: Lanes, const ROOM: usize>(
        &mut self,
        level: L,
        links: &[RowLinks<'_>; AXES.len()],
        [u, pixel]: [usize; 2],
    ) -> [u16; ROOM] {
        let lanes = self.lanes::<ROOM>();
        let evidence = &self.evidence.costs[pixel * lanes..][..lanes];
        let PassScratch { before, here, .. } = &mut *self.scratch;
        let mut sum = [0_u16; ROOM];
        for axis in 0..AXES.len() {
            // Along the row the predecessor is in this row, else in the row before.
            let row = if AXES[axis][1] == 0 { &here[axis] } else { &before[axis] };
            let brought = row.towards(links[axis].link(u), lanes);
            let mut from = [0; ROOM];
            for lane in 0..lanes {
                from[lane] = u16::from(brought[lane]);
            }
            let costs = add::<L, ROOM>(level, evidence, &from, lanes);
            for lane in 0..lanes {
                sum[lane] = sum[lane].wrapping_add(from[lane]);
            }
            here[axis].set(level, u, &costs[..lanes]);
        }
        sum
    }
}

/// Path costs of a pixel in one direction: what the path brings plus the pixel's own, less the least of the sums. They
/// are capped at the price of a change, which is the most that a successor pays.
#[inline(always)]
fn add<L: Lanes, const ROOM: usize>(level: L, evidence: &[u8], from: &[u16; ROOM], lanes: usize) -> [u16; ROOM] {
    let mut costs = *from;
    let mut least = [u16::MAX; LANE_STEP];
    for (costs, evidence) in costs.as_chunks_mut::<LANE_STEP>().0.iter_mut().zip(evidence.as_chunks::<LANE_STEP>().0) {
        for lane in 0..LANE_STEP {
            costs[lane] = costs[lane].wrapping_add(u16::from(evidence[lane]));
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

const _: () = assert!(CHANGE < u8::MAX as u16);
const _: () = assert!(PATHS * (CHANGE as usize + MISSING as usize) * LANE_STEP < u16::MAX as usize - LANE_STEP);

#[cfg(test)]
mod tests {
    use super::*;
    use crate::correspondence::semi_global::matching_cost::{DECIDED_LEAD, NO_ORDER};
    use crate::correspondence::test_random::random;

    /// Pieces of surfaces with holes. Most pixels have one order that fits, some have others that fit as well, or none.
    fn scene(width: usize, height: usize, lanes: usize) -> (PhaseMap, OrderRanges, MatchingCosts) {
        let mut random = random(7);
        let pieces: Vec<[i32; 3]> = (0..64)
            .map(|_| [random(9000) as i32 - 4500, random(3000) as i32 - 1500, random(400_000) as i32 - 200_000])
            .collect();
        let mut ranges = OrderRanges::default();
        ranges.grow(lanes);
        let (mut phase, mut valid, mut costs) = (Vec::new(), Vec::new(), Vec::new());
        for i in 0..width * height {
            let (u, v) = (i % width, i / width);
            let [along, across, base] = pieces[u / 19 % 8 + v / 13 % 8 * 8];
            let absolute = base + along * u as i32 + across * v as i32 + random(300) as i32;
            let is_valid = random(200) > 0;
            let count = if is_valid { lanes - random(3) as usize } else { 0 };
            let first = (absolute >> 16) as i16 - random(lanes as u64) as i16 / 2 + random(30) as i16 / 29;
            let mut own = vec![NO_ORDER; lanes];
            own[..count].fill(MISSING);
            if let Some(own) =
                usize::try_from((absolute >> 16) as i16 - first).ok().and_then(|k| own[..count].get_mut(k))
                && random(60) > 0
            {
                *own = random(60) as u8;
            }
            if count > 0 && random(25) == 0 {
                own[random(count as u64) as usize] = random(100) as u8;
            }
            phase.push(absolute as u16);
            valid.push(is_valid);
            ranges.first.push(first);
            ranges.count.push(count as u8);
            costs.extend(own);
        }
        let mut evidence = MatchingCosts::new(costs, &ranges);
        // Most of some pieces are decided, some of them wrongly.
        for pixel in 0..width * height {
            let (u, v) = (pixel % width, pixel / width);
            if ranges.count[pixel] > 0 && (u / 19 + v / 13) % 3 == 0 && random(12) > 0 {
                let any = random(ranges.count[pixel].into()) as u8;
                let place = if random(40) == 0 { any } else { evidence.best.row(pixel..pixel + 1).place[0] };
                evidence.best.decide(pixel, place);
            }
        }
        (PhaseMap { width, height, phase, valid, ..PhaseMap::default() }, ranges, evidence)
    }

    /// Every path order by order, as it is written above: the oracle.
    fn plain(cam1: &PhaseMap, ranges: &OrderRanges, evidence: &MatchingCosts) -> Vec<Option<(i16, u16)>> {
        let (width, lanes, pixels) = (cam1.width, ranges.lanes, cam1.phase.len());
        let decided = |pixel: usize| {
            let place = evidence.best.row(pixel..pixel + 1).place[0];
            evidence.best.is_decided(pixel).then_some(usize::from(place))
        };
        let mut links = Links::default();
        links.find(cam1, ranges);
        let mut sums: Vec<u32> = evidence.costs.iter().map(|&cost| 8 * u32::from(cost)).collect();
        for (axis, forward) in (0..AXES.len()).flat_map(|axis| [(axis, true), (axis, false)]) {
            let mut paths = vec![u32::from(CHANGE); pixels * lanes];
            for i in 0..pixels {
                let pixel = if forward { i } else { pixels - 1 - i };
                let (u, v) = (pixel % width, pixel / width);
                let count = usize::from(ranges.count[pixel]);
                if count == 0 {
                    continue;
                }
                let link = links.row(axis, v, forward).link(u);
                let before = if AXES[axis][1] == 0 {
                    v
                } else if forward {
                    v.wrapping_sub(1)
                } else {
                    v + 1
                };
                let from = |lane: usize| {
                    let lane = (lane + link.shift).wrapping_sub(MAX_SHIFT);
                    let q = before.wrapping_mul(width).wrapping_add(link.column);
                    if !link.is_link {
                        0
                    } else if lane < lanes {
                        paths[q * lanes + lane]
                    } else {
                        u32::from(CHANGE)
                    }
                };
                let from: Vec<u32> = (0..lanes).map(from).collect();
                if let Some(place) = decided(pixel) {
                    paths[pixel * lanes + place] = 0;
                    continue;
                }
                let cost = |lane: usize| from[lane] + u32::from(evidence.costs[pixel * lanes + lane]);
                let least = (0..lanes).map(cost).min().unwrap();
                for lane in 0..lanes {
                    paths[pixel * lanes + lane] = (cost(lane) - least).min(u32::from(CHANGE));
                    sums[pixel * lanes + lane] += from[lane];
                }
            }
        }
        let verdict = |pixel: usize| {
            if let Some(place) = decided(pixel) {
                return Some((ranges.first[pixel] + place as i16, PATHS as u16 * (CHANGE + u16::from(DECIDED_LEAD))));
            }
            let own = &sums[pixel * lanes..][..usize::from(ranges.count[pixel])];
            let best = (0..own.len()).min_by_key(|&lane| own[lane])?;
            let second = (0..own.len()).filter(|&lane| lane != best).map(|lane| own[lane]).min();
            let lead = second.map_or(PATHS as u32 * u32::from(CHANGE), |second| second - own[best]);
            Some((ranges.first[pixel] + best as i16, lead as u16))
        };
        (0..pixels).map(verdict).collect()
    }

    #[test]
    fn the_least_costs_are_those_of_plain_paths_at_every_level() {
        // The same scratch memory for all: what it held before makes no difference.
        let (mut scratch, mut verdicts, mut settled) = (PathScratch::default(), Verdicts::default(), 0);
        for (width, height, lanes) in [(1, 1, 8), (97, 60, 8), (64, 41, 16), (50, 30, 24), (33, 20, 40)] {
            let (cam1, ranges, evidence) = scene(width, height, lanes);
            let wanted = plain(&cam1, &ranges, &evidence);
            for level in Level::ALL {
                least_costs_at(level, &cam1, &ranges, &evidence, &mut scratch, &mut verdicts);
                for (pixel, wanted) in wanted.iter().enumerate().filter_map(|(pixel, w)| Some((pixel, (*w)?))) {
                    let found = (verdicts.order[pixel], verdicts.margin[pixel]);
                    assert_eq!(found, wanted, "{level:?} {width} {height} {lanes} {pixel}");
                }
            }
            settled += scratch.places.iter().filter(|&&place| place != NO_PLACE).count();
        }
        assert!(settled > 1000, "{settled}");
    }
}
