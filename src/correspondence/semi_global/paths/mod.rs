//! Semi-global optimization: least costs along straight paths through the image, and for each pixel the order with the
//! least sum of them.
//!
//! ```text
//! for each direction, pixel by pixel p after its predecessor q:
//!     F(p, k) = min( L(q, k − carry) − min L(q), P )      where the wrapped phase continues from q to p
//!     F(p, k) = 0                                         where it jumps, or there is no q
//!     L(p, k) = E(p, k) + F(p, k)
//! for each pixel:
//!     S(p, k) = 8·E(p, k) + sum of F(p, k) over all directions
//! ```
//!
//! Over most of an image one order fits and the others do not. There paths are *settled*: F is 0 for that order and P
//! for all others; the exact costs no longer matter. If all paths arrive at a pixel settled on its best order, they
//! leave it settled. The sums of such a pixel follow from its best costs alone, so whole runs of them are skipped.
//!
//! A pixel that its surface decided settles all its paths on its order.
//!
//! E(p, k) is the matching cost of order k. carry is the whole turn that the wrapped phase skips between q and p: a
//! continuing order changes by it. S differs from the sum of L by a number that is the same for all orders of a pixel.
//!
//! Four directions run with the rows of the image and four against them, in two passes from opposite ends. They are
//! independent until they meet in the middle. Each pass stores its sums in the first half of its way, and decides in
//! the second half, where the sums of the other pass are stored. Sums of whole numbers do not depend on their order.

mod agreed;
mod decision;
mod path_row;
mod settled;
mod sweep;

use fringeflow_simd::Level;

use crate::phase::PhaseMap;

use super::links::{Links, NO_PLACE};
use super::matching_cost::MatchingCosts;
use super::order_ranges::OrderRanges;

use decision::{DecideOrders, StoreSums};
pub(super) use sweep::PATHS;
use sweep::{Pass, PassRows, PassScratch, Sweep};

/// The order of each pixel with the least sum of costs.
#[derive(Clone, Debug, Default)]
pub(super) struct PathOrders {
    pub(super) order: Vec<i16>,
    /// Excess of the next best order, summed over all paths. Undefined for pixels without orders.
    pub(super) margin: Vec<u16>,
}

/// Scratch for the links of pixels and the sums of paths.
#[derive(Clone, Debug, Default)]
pub(super) struct PathScratch {
    pub(super) links: Links,
    /// Stored by the pass that reaches a pixel first: the place on which its paths are settled, or [`NO_PLACE`].
    places: Vec<u8>,
    /// Stored by the same pass: the sums of pixels that are not settled.
    sums: Vec<u16>,
    passes: [PassScratch; 2],
}

/// Decides the order of every pixel with a range.
pub(super) fn least_costs(
    cam1: &PhaseMap,
    ranges: &OrderRanges,
    matching_costs: &MatchingCosts,
    scratch: &mut PathScratch,
    path_orders: &mut PathOrders,
) {
    least_costs_at(Level::in_use(), cam1, ranges, matching_costs, scratch, path_orders);
}

/// As [`least_costs`], at a SIMD level.
fn least_costs_at(
    level: Level,
    cam1: &PhaseMap,
    ranges: &OrderRanges,
    matching_costs: &MatchingCosts,
    PathScratch { links, places, sums, passes }: &mut PathScratch,
    path_orders: &mut PathOrders,
) {
    let (width, height, lanes) = (cam1.width.max(1), cam1.height, ranges.lanes);
    links.find(cam1, ranges);
    places.resize(width * height, NO_PLACE);
    sums.resize(width * height * lanes, 0);
    path_orders.order.resize(width * height, 0);
    path_orders.margin.resize(width * height, 0);
    // Each pass stores sums for its first half of the image and decides in its second half.
    let middle = height / 2;
    let (upper_places, lower_places) = places.split_at_mut(middle * width);
    let (upper_sums, lower_sums) = sums.split_at_mut(middle * width * lanes);
    let (upper_order, lower_order) = path_orders.order.split_at_mut(middle * width);
    let (upper_margin, lower_margin) = path_orders.margin.split_at_mut(middle * width);
    let [down, up] = passes;
    [&mut *down, &mut *up].into_iter().for_each(|scratch| scratch.clear(width, lanes));
    let mut down = Sweep { width, ranges, links, matching_costs, pass: Pass::Down, scratch: down };
    let mut up = Sweep { width, ranges, links, matching_costs, pass: Pass::Up, scratch: up };
    let (above, below) = (0..middle, middle..height);
    rayon::join(
        || {
            let visit = StoreSums { places: &mut *upper_places, sums: &mut *upper_sums };
            fringeflow_simd::run(level, PassRows { sweep: &mut down, rows: above.clone(), visit });
        },
        || {
            let visit = StoreSums { places: &mut *lower_places, sums: &mut *lower_sums };
            fringeflow_simd::run(level, PassRows { sweep: &mut up, rows: below.clone(), visit });
        },
    );
    rayon::join(
        || {
            let (places, sums) = (&*lower_places, &*lower_sums);
            let visit = DecideOrders { places, sums, lanes, order: lower_order, margin: lower_margin };
            fringeflow_simd::run(level, PassRows { sweep: &mut down, rows: below.clone(), visit });
        },
        || {
            let (places, sums) = (&*upper_places, &*upper_sums);
            let visit = DecideOrders { places, sums, lanes, order: upper_order, margin: upper_margin };
            fringeflow_simd::run(level, PassRows { sweep: &mut up, rows: above.clone(), visit });
        },
    );
}

#[cfg(test)]
mod tests {
    use super::settled::CHANGE;
    use super::*;
    use crate::correspondence::semi_global::cost_table::{DECIDED_LEAD, MISSING, NO_ORDER};
    use crate::correspondence::semi_global::links::{AXES, MAX_SHIFT};
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
        let mut matching_costs = MatchingCosts::new(costs, &ranges);
        // Most of some pieces are decided, some of them wrongly.
        for pixel in 0..width * height {
            let (u, v) = (pixel % width, pixel / width);
            if ranges.count[pixel] > 0 && (u / 19 + v / 13) % 3 == 0 && random(12) > 0 {
                let any = random(ranges.count[pixel].into()) as u8;
                let place = if random(40) == 0 { any } else { matching_costs.best.row(pixel..pixel + 1).place[0] };
                matching_costs.best.decide(pixel, place);
            }
        }
        (PhaseMap { width, height, phase, valid, ..PhaseMap::default() }, ranges, matching_costs)
    }

    /// Every path order by order, as in the pseudocode of the module: the oracle.
    fn plain(cam1: &PhaseMap, ranges: &OrderRanges, matching_costs: &MatchingCosts) -> Vec<Option<(i16, u16)>> {
        let (width, lanes, pixels) = (cam1.width, ranges.lanes, cam1.phase.len());
        let decided = |pixel: usize| {
            let place = matching_costs.best.row(pixel..pixel + 1).place[0];
            matching_costs.best.is_decided(pixel).then_some(usize::from(place))
        };
        let mut links = Links::default();
        links.find(cam1, ranges);
        let mut sums: Vec<u32> = matching_costs.by_order.iter().map(|&cost| 8 * u32::from(cost)).collect();
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
                let cost = |lane: usize| from[lane] + u32::from(matching_costs.by_order[pixel * lanes + lane]);
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
        // The same scratch memory for all: its old content must not matter.
        let (mut scratch, mut path_orders, mut settled) = (PathScratch::default(), PathOrders::default(), 0);
        for (width, height, lanes) in [(1, 1, 8), (97, 60, 8), (64, 41, 16), (50, 30, 24), (33, 20, 40)] {
            let (cam1, ranges, matching_costs) = scene(width, height, lanes);
            let wanted = plain(&cam1, &ranges, &matching_costs);
            for level in Level::ALL {
                least_costs_at(level, &cam1, &ranges, &matching_costs, &mut scratch, &mut path_orders);
                for (pixel, wanted) in wanted.iter().enumerate().filter_map(|(pixel, w)| Some((pixel, (*w)?))) {
                    let found = (path_orders.order[pixel], path_orders.margin[pixel]);
                    assert_eq!(found, wanted, "{level:?} {width} {height} {lanes} {pixel}");
                }
            }
            settled += scratch.places.iter().filter(|&&place| place != NO_PLACE).count();
        }
        assert!(settled > 1000, "{settled}");
    }
}
