//! Matching costs: how badly the best candidate of each order fits, in whole numbers.
//!
//! A candidate with z = (δ − drift)/sd costs −ln(e⁻⁵ + e^(−z²/2)): that of a normal error, but at most five nats, since
//! the true candidate may be missing or spoilt. An order without candidate costs five nats. A candidate outside the
//! volume is less likely and costs slightly more.

use rayon::prelude::*;

use fringeflow_simd::{Kernel, Lanes, Level};

use crate::correspondence::drift::DepthRow;
use crate::correspondence::kernels::{BLOCK, Ends, block_of_mut};
use crate::correspondence::pixel_search::PixelSearch;
use crate::correspondence::segment::SegmentRow;
use crate::correspondence::surfaces::{self, NO_ORDER as NO_SURFACE_ORDER};
use crate::phase::Modulation;

use super::bands::{self, BAND_ROWS};
use super::kernels::{self, BestBlock, CostScratch, OrderBlock};
use super::order_ranges::{OrderRangeRow, OrderRanges, Reach};
use super::selection::{SelectedRow, Selection};
use super::{Scene, UNITS_PER_NAT};

/// Matching cost of an order without candidate, nats.
const MISSING_NATS: f32 = 5.0;
/// The same in whole numbers.
pub(super) const MISSING: u8 = (MISSING_NATS * UNITS_PER_NAT) as u8;
/// Stands for an order that a pixel does not have.
pub(super) const NO_ORDER: u8 = u8::MAX;
/// Additional cost of a candidate outside the measurement volume, nats.
const OUTSIDE_NATS: f32 = 0.2;
pub(super) const OUTSIDE: u8 = (OUTSIDE_NATS * UNITS_PER_NAT) as u8;
/// Stands for the least cost of a decided pixel, and the excess of all its other orders.
pub(super) const DECIDED: u8 = NO_ORDER - DECIDED_LEAD;
pub(super) const DECIDED_LEAD: u8 = MISSING;
/// Largest z with a cost of its own; beyond it the candidate counts as missing.
pub(super) const MAX_Z: f32 = 5.0;
/// Steps of the cost table per unit of z.
pub(super) const STEPS_PER_Z: f32 = 64.0;
/// z of the back-projection test (paper, section 2.1).
pub(super) const PASSING_Z: f32 = 3.0;
/// Share of the variance of δ that grows with (noise / modulation)²; the rest is equal for all pixels.
const NOISE_SHARE: f32 = 0.5;
/// Largest sd of a pixel, relative to one of median modulation.
const MAX_SD_RATIO: f32 = 4.0;

/// Predicted sd of δ of a true candidate about the drift.
pub(super) struct DeltaScale {
    /// At median modulation, turns.
    sd_turns: f32,
    /// Median modulation, grey levels.
    median_grey: f32,
}

impl DeltaScale {
    pub(super) fn from_scene(scene: &Scene<'_>) -> Self {
        let cam1 = scene.cam1;
        let median_grey = median_modulation(&cam1.modulation, &cam1.valid, cam1.width).map_or(1.0, Modulation::grey);
        let sd_turns = (scene.drift.residual_sd_rad / std::f64::consts::TAU) as f32;
        Self { sd_turns, median_grey }
    }

    /// At a modulation, turns.
    #[inline(always)]
    fn sd_turns(&self, modulation_grey: f32) -> f32 {
        let ratio = self.median_grey / modulation_grey.max(f32::MIN_POSITIVE);
        let variance = 1.0 - NOISE_SHARE + NOISE_SHARE * ratio * ratio;
        self.sd_turns * variance.sqrt().min(MAX_SD_RATIO)
    }
}

/// Median modulation of the valid pixels, from a sample of the rows.
fn median_modulation(modulation: &[Modulation], valid: &[bool], width: usize) -> Option<Modulation> {
    /// Distance of the sampled rows.
    const PITCH: usize = 16;
    // First the upper byte of the median, then the lower one. Neighbouring pixels are alike, so each adds to a
    // histogram of its own: no addition waits for the one before.
    const WAYS: usize = 4;
    let rows = || modulation.chunks(width).zip(valid.chunks(width)).step_by(PITCH);
    let mut upper = [[0_u32; 256]; WAYS];
    for (modulation, valid) in rows().flat_map(|(modulation, valid)| modulation.chunks(WAYS).zip(valid.chunks(WAYS))) {
        for ((counts, modulation), &valid) in upper.iter_mut().zip(modulation).zip(valid) {
            counts[usize::from(modulation.steps() >> 8)] += u32::from(valid);
        }
    }
    let upper: [u32; 256] = std::array::from_fn(|byte| upper.iter().map(|counts| counts[byte]).sum());
    let (byte, rank) = ranked(&upper, upper.iter().sum::<u32>() / 2)?;
    let mut lower = [0_u32; 256];
    for (modulation, &valid) in rows().flat_map(|(modulation, valid)| modulation.iter().zip(valid)) {
        let is_near = valid && usize::from(modulation.steps() >> 8) == byte;
        lower[usize::from(modulation.steps() & 0xff)] += u32::from(is_near);
    }
    ranked(&lower, rank).map(|(lower, _)| Modulation::from_steps((byte << 8 | lower) as u16))
}

/// The bin that holds the number of a rank, and its rank in the bin.
pub(super) fn ranked(counts: &[u32], rank: u32) -> Option<(usize, u32)> {
    let mut below = 0;
    let place = counts.iter().position(|count| {
        below += count;
        below > rank
    })?;
    Some((place, rank + counts[place] - below))
}

/// Computes the sd of the pixels of a row.
struct ScaleRow<'a> {
    scale: &'a DeltaScale,
    modulation: &'a [Modulation],
    sd_turns: &'a mut [f32],
}

impl Kernel for ScaleRow<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        for (sd_turns, modulation) in self.sd_turns.iter_mut().zip(self.modulation) {
            *sd_turns = self.scale.sd_turns(modulation.grey());
        }
    }
}

/// What the pixels of a row of C1 are searched with.
#[derive(Clone, Debug, Default)]
pub(super) struct SearchRow {
    pub(super) segments: SegmentRow,
    drift: DepthRow,
    /// sd of δ of each pixel, turns.
    pub(super) sd_turns: Vec<f32>,
    v: usize,
}

impl SearchRow {
    /// Loads row `v`.
    pub(super) fn load_row(&mut self, scene: &Scene<'_>, scale: &DeltaScale, v: usize) {
        let width = scene.cam1.width;
        self.v = v;
        scene.table.row(v, &mut self.segments);
        scene.drift.along_row(v, width, &mut self.drift);
        self.sd_turns.resize(width, 0.0);
        let modulation = &scene.cam1.modulation[v * width..(v + 1) * width];
        fringeflow_simd::run(Level::in_use(), ScaleRow { scale, modulation, sd_turns: &mut self.sd_turns });
    }

    /// The search of a pixel of the row.
    pub(super) fn search<'a>(&self, scene: &Scene<'a>, reach: Reach, u: usize) -> PixelSearch<'a> {
        PixelSearch::new(scene, reach, &self.segments, &self.drift, [u, self.v])
    }

    /// The row for the kernels over 32 pixels.
    pub(super) fn block_row<'a>(&'a self, scene: &Scene<'a>, reach: Reach) -> kernels::Row<'a> {
        let width = scene.cam1.width;
        kernels::Row {
            image: scene.cam2,
            segments: &self.segments,
            drift: &self.drift,
            reach,
            phase: &scene.cam1.phase[self.v * width..(self.v + 1) * width],
            sd_turns: &self.sd_turns,
        }
    }
}

/// What the matching costs are computed from.
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
    /// Costs of all orders; those of pixel `i` start at `i · lanes`. Undefined for pixels without orders.
    pub(super) costs: Vec<u8>,
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
        let (pixels, costs) = (input.scene.cam1.phase.len(), CostTable::new());
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
        let (lanes, reach, width) = (ranges.lanes, ranges.reach, scene.cam1.width.max(1));
        self.costs.resize(scene.cam1.phase.len() * lanes, NO_ORDER);
        bands::resize(&mut self.scratches, scene.cam1.height);
        let of_band = BAND_ROWS * width;
        let Best { place, least, second } = &mut self.best;
        let best = place.par_chunks_mut(of_band).zip(least.par_chunks_mut(of_band)).zip(second.par_chunks_mut(of_band));
        let ranges = ranges.first.par_chunks_mut(of_band).zip(ranges.count.par_chunks_mut(of_band));
        let out = self.costs.par_chunks_mut(of_band * lanes).zip(passing.par_chunks_mut(of_band));
        let scratches = self.is_explained.par_chunks_mut(of_band).zip(&mut self.scratches);
        let bands = out.zip(best).zip(ranges).zip(selection.bands(of_band)).zip(scratches).enumerate();
        bands.for_each(|(band, (((out, (first, count)), mut selected), (is_explained, scratch)))| {
            let ((tile, passing), ((place, least), second)) = out;
            scratch.most = 0;
            for (i, pixels) in (0..count.len()).step_by(width).map(|begin| begin..begin + width).enumerate() {
                let v = band * BAND_ROWS + i;
                let BandScratch { row, orders, open_count, most } = &mut *scratch;
                row.load_row(scene, scale, v);
                let (first, count) = (&mut first[pixels.clone()], &mut count[pixels.clone()]);
                let own = v * width..(v + 1) * width;
                let (phase, valid) = (&scene.cam1.phase[own.clone()], &scene.cam1.valid[own.clone()]);
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
                let evidence = CostRow {
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
                fringeflow_simd::run(Level::in_use(), evidence);
                mark_explained(open_count, orders, &least[pixels.clone()], &mut is_explained[pixels.clone()]);
                let best = [&mut passing[pixels.clone()], &mut place[pixels.clone()], &mut least[pixels.clone()]];
                enter_decided(first, &selected, best, &mut second[pixels]);
            }
        });
        self.scratches.iter().map(|scratch| scratch.most).max().unwrap_or(0)
    }
}

/// Keeps only those pixels decided whose order is in their range.
fn keep_within_ranges(first: &[i16], count: &[u8], selected: &mut SelectedRow<'_>) {
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

/// Enters the decided pixels of a row in the summary of costs.
fn enter_decided(
    first: &[i16],
    selected: &SelectedRow<'_>,
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
    /// Some of the 32 pixels from `begin` on, a bit each, one by one.
    fn gather_pixels(&mut self, begin: usize, mut pixels: u32) {
        while pixels != 0 {
            self.gather_pixel(begin + pixels.trailing_zeros() as usize);
            pixels &= pixels - 1;
        }
    }

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

/// Table of the matching cost by z.
pub(super) struct CostTable {
    /// The last is that of a missing candidate.
    pub(super) of_step: [i32; Self::STEPS + 1],
    /// An order whose cost is below this passes the back-projection test.
    pub(super) limit: u8,
}

impl CostTable {
    /// Number of steps with a cost of their own.
    pub(super) const STEPS: usize = (MAX_Z * STEPS_PER_Z) as usize;

    fn new() -> Self {
        let of_step = std::array::from_fn(|step| {
            let z = (step as f64 + 0.5) / f64::from(STEPS_PER_Z);
            let nats = -((-f64::from(MISSING_NATS)).exp() + (-0.5 * z * z).exp()).ln();
            let cost = (nats.max(0.0) * f64::from(UNITS_PER_NAT)).round() as i32;
            if step < Self::STEPS { cost } else { i32::from(MISSING) }
        });
        Self { of_step, limit: of_step[(PASSING_Z * STEPS_PER_Z) as usize] as u8 }
    }
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
        Self { costs, best, ..Self::default() }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::correspondence::semi_global::test_scene::TestScene;

    #[test]
    fn evidence_of_many_pixels_is_that_of_each_at_every_level() {
        let test_scene = TestScene::new();
        let scene = test_scene.scene();
        let (scale, costs, width) = (DeltaScale::from_scene(&scene), CostTable::new(), scene.cam1.width);
        let (mut ranges, mut row, mut known) = (OrderRanges::default(), SearchRow::default(), 0);
        ranges.prepare(&scene, false);
        let reach = ranges.reach;
        for lanes in [ranges.lanes + 8, ranges.lanes + 16] {
            for v in 0..scene.cam1.height {
                row.load_row(&scene, &scale, v);
                let (mut first, mut count) = (vec![0; width], vec![0; width]);
                let own = v * width..(v + 1) * width;
                let (phase, valid) = (&scene.cam1.phase[own.clone()], &scene.cam1.valid[own]);
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
    fn the_median_modulation_is_that_of_sorting() {
        for count in [0, 1, 2, 7, 1000, 1001] {
            let modulation: Vec<Modulation> =
                (0..count).map(|i: u32| Modulation::from_steps((i * 40_503 % 5003) as u16)).collect();
            let valid: Vec<bool> = (0..count).map(|i| i % 3 != 1).collect();
            let mut lit: Vec<Modulation> =
                modulation.iter().zip(&valid).filter(|(_, valid)| **valid).map(|(m, _)| *m).collect();
            lit.sort();
            assert_eq!(median_modulation(&modulation, &valid, 1001), lit.get(lit.len() / 2).copied());
        }
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
