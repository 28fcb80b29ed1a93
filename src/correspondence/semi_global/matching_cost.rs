//! Matching costs: how badly the best candidate of each order fits, in whole numbers.
//!
//! The cost of a candidate by its z stands in [`super::cost_table`]. An order without candidate costs five nats. A
//! candidate outside the volume is less likely and costs slightly more.
//!
//! ```text
//! repeat, with room for more orders, until it suffices for all pixels:
//!     for each band of rows, in parallel; for each row:
//!         load segments, drift and sd; the order range of each pixel
//!         confirm the orders that surfaces give: a confirmed pixel is decided
//!         for each other pixel p, for each order k: E(p, k) = cost of its best candidate
//!         keep place and cost of the best order, and the next best cost, of each pixel
//!         mark the pixels that are explained: a surface gives an order, or some order fits
//! ```

use rayon::prelude::*;

use fringeflow_simd::{Kernel, Lanes, Level};

use crate::correspondence::bands::{self, BAND_ROWS};
use crate::correspondence::kernels::{BLOCK, Ends, block_of_mut};
use crate::correspondence::pixel_search::{PixelSearch, Reach};
use crate::correspondence::surfaces::{self, NO_ORDER as NO_SURFACE_ORDER};

use super::cost_table::{CostTable, DECIDED, MAX_Z, MISSING, NO_ORDER, OUTSIDE, PASSING_Z, STEPS_PER_Z};
use super::kernels::{BestBlock, CostScratch, OrderBlock};
use super::order_ranges::{OrderRangeRow, OrderRanges};
use super::search_row::{DeltaScale, SearchRow};
use super::selection::{SelectedPixels, Selection};
use crate::correspondence::scene::Scene;

/// Inputs of the matching costs.
pub(super) struct CostInput<'a> {
    pub(super) scene: &'a Scene<'a>,
    /// The scene without the places of C2 known to show something outside the volume.
    pub(super) open: &'a Scene<'a>,
    pub(super) scale: &'a DeltaScale,
    pub(super) surfaces: &'a surfaces::Scratch,
    /// Pixels known to see something outside the volume.
    pub(super) outside: &'a [bool],
}

/// The matching costs of all pixels.
#[derive(Clone, Debug, Default)]
pub(super) struct MatchingCosts {
    /// Costs of all orders; those of pixel `i` start at `i · lanes`. Undefined for decided pixels and pixels without
    /// orders.
    pub(super) by_order: Vec<u8>,
    pub(super) best: Best,
    /// 1 if some order fits the pixel, or a surface gives one; else 0.
    pub(super) is_explained: Vec<u8>,
    scratches: Vec<BandScratch>,
}

/// Summary of the costs of each pixel; undefined without orders.
#[derive(Clone, Debug, Default)]
pub(super) struct Best {
    /// Place of the first order with the least cost.
    place: Vec<u8>,
    least: Vec<u8>,
    /// The least cost of the other orders; with a single order, its own.
    second: Vec<u8>,
}

/// The summary of a row.
#[derive(Clone, Copy)]
pub(super) struct BestRow<'a> {
    pub(super) place: &'a [u8],
    pub(super) least: &'a [u8],
    pub(super) second: &'a [u8],
}

impl Best {
    /// Whether a pixel was decided by its surface.
    #[inline(always)]
    pub(super) fn is_decided(&self, pixel: usize) -> bool {
        self.least[pixel] == DECIDED
    }

    /// The summary of the pixels of a row.
    pub(super) fn row(&self, pixels: std::ops::Range<usize>) -> BestRow<'_> {
        BestRow { place: &self.place[pixels.clone()], least: &self.least[pixels.clone()], second: &self.second[pixels] }
    }
}

/// Scratch for a band of rows.
#[derive(Clone, Debug, Default)]
struct BandScratch {
    row: SearchRow,
    /// Orders given by surfaces.
    orders: Vec<i16>,
    /// Number of orders of each pixel; 0 for decided ones.
    open_count: Vec<u8>,
    /// Most orders of a pixel.
    most: usize,
}

impl MatchingCosts {
    /// Confirms the orders given by surfaces, which decides most pixels. Computes the costs of all orders of the
    /// others. Counts the orders of each pixel that pass the back-projection test |δ − drift| < 3·sd.
    pub(super) fn gather(
        &mut self,
        input: &CostInput<'_>,
        ranges: &mut OrderRanges,
        selection: &mut Selection,
        passing: &mut Vec<u8>,
    ) {
        let (pixels, costs) = (input.scene.view.cam1.phase.len(), CostTable::new());
        passing.resize(pixels, 0);
        for array in [&mut self.best.place, &mut self.best.least, &mut self.best.second] {
            array.resize(pixels, 0);
        }
        self.is_explained.resize(pixels, 0);
        selection.resize(pixels);
        // The room for orders grows at most a few times in the life of the scratch memory.
        loop {
            let most = self.gather_into(input, ranges, selection, &costs, passing);
            if most <= ranges.lanes {
                return;
            }
            ranges.grow(most);
        }
    }

    /// As [`Self::gather`], with room for `lanes` orders per pixel. Returns the most orders of a pixel; if that exceeds
    /// the room, the costs are incomplete.
    fn gather_into(
        &mut self,
        &CostInput { scene, open, scale, surfaces, outside }: &CostInput<'_>,
        ranges: &mut OrderRanges,
        selection: &mut Selection,
        costs: &CostTable,
        passing: &mut [u8],
    ) -> usize {
        let (lanes, reach, width) = (ranges.lanes, ranges.reach, scene.view.cam1.width.max(1));
        self.by_order.resize(scene.view.cam1.phase.len() * lanes, NO_ORDER);
        bands::resize(&mut self.scratches, scene.view.cam1.height);
        let band_px = BAND_ROWS * width;
        let bands = (
            self.by_order.par_chunks_mut(band_px * lanes),
            passing.par_chunks_mut(band_px),
            self.best.place.par_chunks_mut(band_px),
            self.best.least.par_chunks_mut(band_px),
            self.best.second.par_chunks_mut(band_px),
            ranges.first.par_chunks_mut(band_px),
            ranges.count.par_chunks_mut(band_px),
            selection.bands(band_px),
            self.is_explained.par_chunks_mut(band_px),
            &mut self.scratches,
        );
        bands.into_par_iter().enumerate().for_each(|(band, arrays)| {
            let (tile, passing, place, least, second, first, count, mut selected, is_explained, scratch) = arrays;
            scratch.most = 0;
            for (i, pixels) in (0..count.len()).step_by(width).map(|begin| begin..begin + width).enumerate() {
                let v = band * BAND_ROWS + i;
                let BandScratch { row, orders, open_count, most } = &mut *scratch;
                row.load_row(scene, scale, v);
                let (first, count) = (&mut first[pixels.clone()], &mut count[pixels.clone()]);
                let own = v * width..(v + 1) * width;
                let (phase, valid) = (&scene.view.cam1.phase[own.clone()], &scene.view.cam1.valid[own.clone()]);
                let outside = &outside[own];
                OrderRangeRow { reach, segments: &row.segments, phase, valid, outside, first, count }.fill();
                *most = count.iter().fold(*most, |most, &count| most.max(usize::from(count)));
                // Too little room: the whole pass is repeated with more, so only the ranges are still needed.
                if *most > lanes {
                    continue;
                }
                surfaces.fill_orders((v, width), orders);
                orders
                    .iter_mut()
                    .zip(&*count)
                    .for_each(|(k, &count)| *k = if count == 0 { NO_SURFACE_ORDER } else { *k });
                let (mut selected, _) = selected.row(i, width);
                selected.confirm(row.block_row(scene, reach), orders);
                // A few confirmed pixels amid many refused ones are accidents.
                surfaces.clear_minorities((v, width), selected.is_decided);
                keep_within_ranges(first, count, &mut selected);
                selected.fill_open(count, open_count);
                let cost_row = CostRow {
                    scene: open,
                    reach,
                    row,
                    first,
                    count: open_count,
                    costs,
                    lanes,
                    tile: &mut tile[pixels.start * lanes..pixels.end * lanes],
                    passing: &mut passing[pixels.clone()],
                    place: &mut place[pixels.clone()],
                    least: &mut least[pixels.clone()],
                    second: &mut second[pixels.clone()],
                };
                fringeflow_simd::run(Level::in_use(), cost_row);
                mark_explained(open_count, orders, &least[pixels.clone()], &mut is_explained[pixels.clone()]);
                let best = [&mut passing[pixels.clone()], &mut place[pixels.clone()], &mut least[pixels.clone()]];
                store_decided(first, &selected, best, &mut second[pixels]);
            }
        });
        self.scratches.iter().map(|scratch| scratch.most).max().unwrap_or(0)
    }
}

/// Keeps only those pixels decided whose order is in their range.
fn keep_within_ranges(first: &[i16], count: &[u8], selected: &mut SelectedPixels<'_>) {
    let width = count.len();
    let (absolute, first) = (&selected.absolute[..width], &first[..width]);
    let is_decided = &mut selected.is_decided[..width];
    for u in 0..width {
        let place = (absolute[u] >> 16).wrapping_sub(i32::from(first[u]));
        is_decided[u] &= (place >= 0) & (place < i32::from(count[u]));
    }
}

/// Marks the pixels of a row that are explained: a surface gives their order, or some order fits.
fn mark_explained(open_count: &[u8], orders: &[i16], least: &[u8], is_explained: &mut [u8]) {
    let width = open_count.len();
    let (orders, least, is_explained) = (&orders[..width], &least[..width], &mut is_explained[..width]);
    for u in 0..width {
        let fits = (open_count[u] > 0) & (least[u] != MISSING);
        is_explained[u] = u8::from((orders[u] != NO_SURFACE_ORDER) | fits);
    }
}

/// Writes the decided pixels of a row into the summary of costs.
fn store_decided(
    first: &[i16],
    selected: &SelectedPixels<'_>,
    [passing, place, least]: [&mut [u8]; 3],
    second: &mut [u8],
) {
    let width = first.len();
    let (is_decided, absolute) = (&selected.is_decided[..width], &selected.absolute[..width]);
    let (first, z) = (&first[..width], &selected.z[..width]);
    let (passing, place, least, second) =
        (&mut passing[..width], &mut place[..width], &mut least[..width], &mut second[..width]);
    for u in 0..width {
        let own = (absolute[u] >> 16).wrapping_sub(i32::from(first[u])) as u8;
        let passes = u8::from(z[u].abs() < PASSING_Z);
        passing[u] = if is_decided[u] { passes } else { passing[u] };
        place[u] = if is_decided[u] { own } else { place[u] };
        least[u] = if is_decided[u] { DECIDED } else { least[u] };
        second[u] = if is_decided[u] { NO_ORDER } else { second[u] };
    }
}

/// Computes the costs of a row.
struct CostRow<'a> {
    scene: &'a Scene<'a>,
    reach: Reach,
    row: &'a SearchRow,
    first: &'a [i16],
    count: &'a [u8],
    costs: &'a CostTable,
    /// Orders per pixel in memory.
    lanes: usize,
    tile: &'a mut [u8],
    passing: &'a mut [u8],
    place: &'a mut [u8],
    least: &'a mut [u8],
    second: &'a mut [u8],
}

impl Kernel for CostRow<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(mut self, level: L) {
        let row = self.row.block_row(self.scene, self.reach);
        let (firsts, counts) = (self.first.as_chunks().0, self.count.as_chunks().0);
        let (mut scratch, mut ends): (_, Ends) = (CostScratch::new(level), [[0; _]; 3]);
        for (block, (first, count)) in firsts.iter().zip(counts).enumerate() {
            let begin = block * BLOCK;
            let Some(mut of_block) = row.block(level, begin, count) else {
                self.passing[begin..][..BLOCK].fill(0);
                continue;
            };
            let most = usize::from(count.iter().fold(0, |most: u8, &count| most.max(count)));
            let tile = &mut self.tile[begin * self.lanes..][..BLOCK * self.lanes];
            let orders = OrderBlock { first, count, most };
            let best = of_block.matching_costs(&orders, self.costs, &mut scratch, &mut ends, tile, self.lanes);
            let BestBlock { passing, place, least, second } = best;
            let out = [&mut *self.passing, &mut *self.place, &mut *self.least, &mut *self.second];
            for (words, out) in [passing, place, least, second].into_iter().zip(out) {
                level.store_bytes(words, block_of_mut(out, begin));
            }
            self.gather_pixels(begin, of_block.irregular());
        }
        (counts.len() * BLOCK..self.count.len()).for_each(|u| self.gather_pixel(u));
    }
}

impl CostRow<'_> {
    /// Computes the costs of some of the 32 pixels from `begin` on, a bit each, one by one.
    fn gather_pixels(&mut self, begin: usize, mut pixels: u32) {
        while pixels != 0 {
            self.gather_pixel(begin + pixels.trailing_zeros() as usize);
            pixels &= pixels - 1;
        }
    }

    /// Computes the costs of a pixel: the scalar form.
    fn gather_pixel(&mut self, u: usize) {
        let count = usize::from(self.count[u]);
        self.passing[u] = 0;
        if count == 0 {
            return;
        }
        let search = self.row.search(self.scene, self.reach, u);
        let orders = &mut self.tile[u * self.lanes..][..self.lanes];
        orders.fill(NO_ORDER);
        let (mut place, mut least, mut second) = (0, NO_ORDER, NO_ORDER);
        for (lane, cost) in orders[..count].iter_mut().enumerate() {
            let order = i32::from(self.first[u]) + lane as i32;
            *cost = best_cost(&search, order, self.row.sd_turns[u], self.costs);
            self.passing[u] += u8::from(*cost < self.costs.limit);
            // The loser of cost and least is a candidate for the second place.
            second = second.min(least.max(*cost));
            if *cost < least {
                (place, least) = (lane as u8, *cost);
            }
        }
        (self.place[u], self.least[u]) = (place, least);
        self.second[u] = if count == 1 { least } else { second };
    }
}

/// Matching cost of the best candidate of an order.
fn best_cost(search: &PixelSearch<'_>, order: i32, sd_turns: f32, costs: &CostTable) -> u8 {
    let mut best = MISSING;
    let Some(interval_px) = search.columns_of(order, MAX_Z * sd_turns) else { return best };
    search.crossings(interval_px, |column_px, _| {
        let (found, rest) = search.order_and_residual(column_px);
        if found == order {
            // The table makes kernels and scalar form agree to the bit.
            let step = (rest.abs() / sd_turns * STEPS_PER_Z) as usize;
            let outside = if search.is_in_volume(column_px) { 0 } else { OUTSIDE };
            best = best.min(costs.of_step[step.min(CostTable::STEPS)] as u8 + outside);
        }
    });
    best
}

#[cfg(test)]
impl Best {
    /// Decides a pixel for the order in a place.
    pub(super) fn decide(&mut self, pixel: usize, place: u8) {
        (self.place[pixel], self.least[pixel], self.second[pixel]) = (place, DECIDED, NO_ORDER);
    }
}

#[cfg(test)]
impl MatchingCosts {
    /// From given costs.
    pub(super) fn new(costs: Vec<u8>, ranges: &OrderRanges) -> Self {
        let mut best = Best::default();
        for (costs, &count) in costs.chunks(ranges.lanes).zip(&ranges.count) {
            let mut own = costs[..usize::from(count)].to_vec();
            let place = (0..own.len()).min_by_key(|&lane| own[lane]).unwrap_or(0);
            own.sort_unstable();
            best.place.push(place as u8);
            best.least.push(own.first().copied().unwrap_or(0));
            best.second.push(own.get(1).or(own.first()).copied().unwrap_or(0));
        }
        Self { by_order: costs, best, ..Self::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::correspondence::semi_global::test_scene::TestScene;

    #[test]
    fn matching_costs_of_many_pixels_are_those_of_each_at_every_level() {
        let test_scene = TestScene::new();
        let scene = test_scene.scene();
        let (scale, costs, width) = (DeltaScale::from_scene(&scene), CostTable::new(), scene.view.cam1.width);
        let (mut ranges, mut row, mut known) = (OrderRanges::default(), SearchRow::default(), 0);
        ranges.prepare(&scene, false);
        let reach = ranges.reach;
        for lanes in [ranges.lanes + 8, ranges.lanes + 16] {
            for v in 0..scene.view.cam1.height {
                row.load_row(&scene, &scale, v);
                let (mut first, mut count) = (vec![0; width], vec![0; width]);
                let own = v * width..(v + 1) * width;
                let (phase, valid) = (&scene.view.cam1.phase[own.clone()], &scene.view.cam1.valid[own]);
                let (segments, outside) = (&row.segments, &vec![false; width]);
                let (own_first, own_count) = (&mut first, &mut count);
                let range =
                    OrderRangeRow { reach, segments, phase, valid, outside, first: own_first, count: own_count };
                range.fill();
                let of = |fill: &dyn Fn(CostRow<'_>)| {
                    let (mut tile, mut out) = (vec![NO_ORDER; width * lanes], [const { Vec::new() }; 4]);
                    out.iter_mut().for_each(|out| out.resize(width, 0));
                    let [passing, place, least, second] = &mut out;
                    fill(CostRow {
                        scene: &scene,
                        reach,
                        row: &row,
                        first: &first,
                        count: &count,
                        costs: &costs,
                        lanes,
                        tile: &mut tile,
                        passing,
                        place,
                        least,
                        second,
                    });
                    // Pixels without orders are undefined.
                    for u in (0..width).filter(|&u| count[u] == 0) {
                        tile[u * lanes..(u + 1) * lanes].fill(0);
                        out.iter_mut().for_each(|out| out[u] = 0);
                    }
                    (tile, out)
                };
                let wanted = of(&|mut row| (0..width).for_each(|u| row.gather_pixel(u)));
                known += wanted.0.iter().filter(|&&cost| cost < MISSING).count();
                for level in Level::ALL {
                    assert!(of(&|row| fringeflow_simd::run(level, row)) == wanted, "{level:?} {v} {lanes}");
                }
            }
        }
        assert!(known > 20_000, "{known}");
    }

    #[test]
    fn costs_rise_from_none_to_that_of_a_missing_candidate() {
        let CostTable { of_step: costs, limit } = CostTable::new();
        assert!(costs[0] == 0 && costs.is_sorted());
        assert!(costs.iter().all(|&cost| cost <= i32::from(MISSING)) && costs[CostTable::STEPS - 1] >= 99);
        // One sd costs half a nat.
        assert_eq!(costs[64], 10);
        assert!((80..90).contains(&limit), "{limit}");
    }
}
