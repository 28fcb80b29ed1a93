//! Selects the candidate of the decided order.
//!
//! The order is decided by many pixels together, so its candidate may err by more than the threshold: by noise beyond
//! 3·sd, in a pixel that mixes two surfaces, or at a rim between two columns. Verification decides whether it stays.
//!
//! The selected candidates are stored array by array. Their parts have types of their own:
//!
//! | type | pixels | access |
//! |---|---|---|
//! | [`Selection`] | the image | owner |
//! | [`SelectedBand`] | a band of rows, with their places in C2 | written in parallel |
//! | [`SelectedPixels`] | consecutive pixels: of a band, or of one row | written |
//! | [`SelectedBlock`] | 32 pixels of a row, for the kernels | written |
//! | [`BlockScratch`] | 32 pixels | scratch, from which some pixels are copied |
//! | [`CandidateRow`] | a row | read |

use rayon::prelude::*;

use super::kernels::{self, REACH_SD, REACH_TURNS, RIM_COLUMNS, SelectedBlock, SelectionScratch};
use super::order_ranges::OrderRanges;
use super::search_row::{DeltaScale, SearchRow, ranked};
use crate::correspondence::bands::{self, BAND_ROWS};
use crate::correspondence::candidates::Candidate;
use crate::correspondence::kernels::{BLOCK, block_of_mut};
use crate::correspondence::neighbourhood::{ABSENT, TURN};
use crate::correspondence::pixel_search::{PixelSearch, Reach};
use crate::correspondence::places::{PlaceRow, Places};
use crate::correspondence::scene::Scene;
use crate::correspondence::surfaces::NO_ORDER;
use fringeflow_simd::{Kernel, Lanes, Level};

/// The selected candidates of all pixels, and how well they fit.
#[derive(Clone, Debug, Default)]
pub(super) struct Selection {
    /// Absolute phase of each pixel, turns · 65536; [`ABSENT`] where no candidate is selected.
    pub(super) absolute: Vec<i32>,
    pub(super) column_px: Vec<f32>,
    /// (δ − drift)/sd, scaled to the sd of the true candidates of these images.
    pub(super) z: Vec<f32>,
    pub(super) delta: Vec<i16>,
    pub(super) slope: Vec<i16>,
    /// Whether the candidate lies in the measurement volume.
    pub(super) in_volume: Vec<bool>,
    /// Whether the pixel was decided: the order of its surface was confirmed.
    pub(super) is_decided: Vec<bool>,
    /// Places of the candidates in C2.
    pub(super) places: Places,
    scratches: Vec<RowScratch>,
    /// Scratch for the median of z.
    counts: Vec<u32>,
    near: Vec<f32>,
}

/// Scratch for a band of rows.
#[derive(Clone, Debug, Default)]
struct RowScratch {
    row: SearchRow,
    /// Number of orders of each pixel; 0 for decided ones.
    open_count: Vec<u8>,
}

impl Selection {
    /// Resizes to `pixels`.
    pub(super) fn resize(&mut self, pixels: usize) {
        self.absolute.resize(pixels, ABSENT);
        self.column_px.resize(pixels, 0.0);
        self.z.resize(pixels, 0.0);
        self.delta.resize(pixels, 0);
        self.slope.resize(pixels, 0);
        self.in_volume.resize(pixels, false);
        self.is_decided.resize(pixels, false);
        self.places.resize(pixels);
    }

    /// Selects the candidate of each undecided pixel that has one of the order given by the paths.
    pub(super) fn select(&mut self, scene: &Scene<'_>, ranges: &OrderRanges, scale: &DeltaScale, order: &[i16]) {
        let width = scene.view.cam1.width.max(1);
        let mut scratches = std::mem::take(&mut self.scratches);
        bands::resize(&mut scratches, scene.view.cam1.height);
        let bands = self.bands(BAND_ROWS * width).zip(&mut scratches).enumerate();
        bands.for_each(|(band, (mut selected, RowScratch { row, open_count }))| {
            for i in 0..selected.pixels.absolute.len() / width {
                let v = band * BAND_ROWS + i;
                row.load_row(scene, scale, v);
                let pixels = v * width..(v + 1) * width;
                let (order, count) = (&order[pixels.clone()], &ranges.count[pixels.clone()]);
                let (mut out, places) = selected.row(i, width);
                out.fill_open(count, open_count);
                let (out, phase) = (&mut out, &scene.view.cam1.phase[pixels]);
                let selection = SelectionRow { scene, reach: ranges.reach, row, phase, count: open_count, order, out };
                fringeflow_simd::run(Level::in_use(), selection);
                places.find(scene.view.table, &row.segments, out.column_px);
            }
        });
        self.scratches = scratches;
        self.normalize(width);
    }

    /// Splits into bands of this many pixels.
    pub(super) fn bands(&mut self, pixels: usize) -> impl IndexedParallelIterator<Item = SelectedBand<'_>> {
        let Self { absolute, column_px, z, delta, slope, in_volume, is_decided, places, .. } = self;
        let arrays = (
            absolute.par_chunks_mut(pixels),
            column_px.par_chunks_mut(pixels),
            z.par_chunks_mut(pixels),
            delta.par_chunks_mut(pixels),
            slope.par_chunks_mut(pixels),
            in_volume.par_chunks_mut(pixels),
            is_decided.par_chunks_mut(pixels),
            places.of_pixels.par_chunks_mut(pixels),
            places.nearness.par_chunks_mut(pixels),
        );
        let bands = arrays.into_par_iter();
        bands.map(|(absolute, column_px, z, delta, slope, in_volume, is_decided, of_pixels, nearness)| SelectedBand {
            pixels: SelectedPixels { absolute, column_px, z, delta, slope, in_volume, is_decided },
            places: PlaceRow { of_pixels, nearness },
        })
    }

    /// The candidates of a row of pixels.
    pub(super) fn row(&self, pixels: std::ops::Range<usize>) -> CandidateRow<'_> {
        CandidateRow {
            absolute: &self.absolute[pixels.clone()],
            column_px: &self.column_px[pixels.clone()],
            z: &self.z[pixels.clone()],
            delta: &self.delta[pixels.clone()],
            slope: &self.slope[pixels.clone()],
            in_volume: &self.in_volume[pixels],
        }
    }

    /// Scales z to that of a normal error: the estimated sd also covers errors that no true candidate has. Candidates
    /// outside the volume are left out, since the drift is not known there.
    fn normalize(&mut self, width: usize) {
        const MEDIAN_OF_UNIT_NORMAL: f32 = 0.6745;
        /// Least accepted scale.
        const MIN_SCALE: f32 = 0.2;
        /// Largest accepted scale: beyond it most of the selected candidates are wrong.
        const MAX_SCALE: f32 = 1.5;
        let Some(median) = self.median_magnitude_of_z(width) else { return };
        // The median is robust against the wrong candidates.
        let scale = (median / MEDIAN_OF_UNIT_NORMAL).clamp(MIN_SCALE, MAX_SCALE);
        self.z.par_iter_mut().for_each(|z| *z /= scale);
    }

    /// Median of |z| of selected candidates in the volume.
    fn median_magnitude_of_z(&mut self, width: usize) -> Option<f32> {
        // The bits of positive floats ascend with their values: first the upper half of the bits of the median is
        // found, then the rest.
        let upper = |z: f32| usize::from((z.abs().to_bits() >> 16) as u16);
        /// Distance of the sampled rows.
        const PITCH: usize = 4;
        let Self { z, absolute, in_volume, counts, near, .. } = self;
        let rows = || z.chunks(width).zip(absolute.chunks(width)).zip(in_volume.chunks(width)).step_by(PITCH);
        let all = || rows().flat_map(|((z, absolute), in_volume)| z.iter().zip(absolute).zip(in_volume));
        let selected =
            || all().filter(|((_, absolute), in_volume)| **absolute != ABSENT && **in_volume).map(|((z, _), _)| *z);
        counts.clear();
        counts.resize(1 << 15, 0);
        selected().for_each(|z| counts[upper(z) % (1 << 15)] += 1);
        let middle = counts.iter().sum::<u32>() / 2;
        let (of_median, rank) = ranked(counts, middle)?;
        near.clear();
        near.extend(selected().map(f32::abs).filter(|&z| upper(z) == of_median));
        let (_, &mut median, _) = near.select_nth_unstable_by(rank as usize, f32::total_cmp);
        Some(median)
    }
}

/// The selected candidates of a row, to be read.
pub(super) struct CandidateRow<'a> {
    pub(super) absolute: &'a [i32],
    column_px: &'a [f32],
    pub(super) z: &'a [f32],
    delta: &'a [i16],
    slope: &'a [i16],
    pub(super) in_volume: &'a [bool],
}

impl CandidateRow<'_> {
    /// The candidate of a pixel, of its decided order.
    #[inline(always)]
    pub(super) fn candidate(&self, u: usize, order: i16) -> Option<Candidate> {
        let candidate = Candidate { column_px: self.column_px[u], order, delta: self.delta[u], slope: self.slope[u] };
        (self.absolute[u] != ABSENT).then_some(candidate)
    }
}

/// The selected candidates of a band of rows and their places in C2, to be written.
pub(super) struct SelectedBand<'a> {
    pixels: SelectedPixels<'a>,
    places: PlaceRow<'a>,
}

impl SelectedBand<'_> {
    /// A row of the band.
    pub(super) fn row(&mut self, row: usize, width: usize) -> (SelectedPixels<'_>, PlaceRow<'_>) {
        let here = row * width..(row + 1) * width;
        let band = &mut self.pixels;
        let selected = SelectedPixels {
            absolute: &mut band.absolute[here.clone()],
            column_px: &mut band.column_px[here.clone()],
            z: &mut band.z[here.clone()],
            delta: &mut band.delta[here.clone()],
            slope: &mut band.slope[here.clone()],
            in_volume: &mut band.in_volume[here.clone()],
            is_decided: &mut band.is_decided[here.clone()],
        };
        let PlaceRow { of_pixels, nearness } = &mut self.places;
        (selected, PlaceRow { of_pixels: &mut of_pixels[here.clone()], nearness: &mut nearness[here] })
    }
}

/// The selected candidates of consecutive pixels, to be written.
pub(super) struct SelectedPixels<'a> {
    pub(super) absolute: &'a mut [i32],
    column_px: &'a mut [f32],
    pub(super) z: &'a mut [f32],
    delta: &'a mut [i16],
    slope: &'a mut [i16],
    in_volume: &'a mut [bool],
    pub(super) is_decided: &'a mut [bool],
}

/// The selected candidates of a block of which only some pixels are copied.
#[derive(Default)]
struct BlockScratch {
    absolute: [i32; BLOCK],
    column_px: [f32; BLOCK],
    z: [f32; BLOCK],
    delta: [i16; BLOCK],
    slope: [i16; BLOCK],
    in_volume: [bool; BLOCK],
}

impl BlockScratch {
    #[inline(always)]
    fn as_block(&mut self) -> SelectedBlock<'_> {
        let Self { absolute, column_px, z, delta, slope, in_volume } = self;
        SelectedBlock { absolute, column_px, z, delta, slope, in_volume }
    }
}

impl SelectedPixels<'_> {
    /// Confirms the order of each pixel, [`NO_ORDER`] standing for none. A pixel is decided if its candidate fits.
    pub(super) fn confirm(&mut self, row: kernels::Row<'_>, orders: &[i16]) {
        self.absolute.fill(ABSENT);
        self.is_decided.fill(false);
        fringeflow_simd::run(Level::in_use(), ConfirmRow { row, orders, out: self });
    }

    /// Copies the number of orders of each pixel, with 0 for decided pixels.
    pub(super) fn fill_open(&self, count: &[u8], open: &mut Vec<u8>) {
        open.clear();
        open.extend(count.iter().zip(&*self.is_decided).map(|(&count, &decided)| if decided { 0 } else { count }));
    }

    #[inline(always)]
    fn block(&mut self, begin: usize) -> SelectedBlock<'_> {
        SelectedBlock {
            absolute: block_of_mut(self.absolute, begin),
            column_px: block_of_mut(self.column_px, begin),
            z: block_of_mut(self.z, begin),
            delta: block_of_mut(self.delta, begin),
            slope: block_of_mut(self.slope, begin),
            in_volume: block_of_mut(self.in_volume, begin),
        }
    }
}

/// Confirms the orders of a row.
struct ConfirmRow<'a, 'b, 'c> {
    row: kernels::Row<'a>,
    /// Orders of the pixels, padded to whole blocks.
    orders: &'a [i16],
    out: &'b mut SelectedPixels<'c>,
}

impl Kernel for ConfirmRow<'_, '_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, level: L) {
        let Self { row, orders, out } = self;
        // The rest of the row, less than a block, stays open.
        let blocks = out.absolute.len() / BLOCK;
        for (block, orders) in orders.as_chunks().0.iter().take(blocks).enumerate() {
            if *orders == [NO_ORDER; BLOCK] {
                continue;
            }
            let begin = block * BLOCK;
            let decided = row.confirm(level, begin, orders, &mut out.block(begin));
            level.store_mask(level.mask(decided), block_of_mut(out.is_decided, begin));
        }
    }
}

/// Selects the candidates of a row.
struct SelectionRow<'a, 'b> {
    scene: &'a Scene<'a>,
    reach: Reach,
    row: &'a SearchRow,
    phase: &'a [u16],
    count: &'a [u8],
    order: &'a [i16],
    out: &'a mut SelectedPixels<'b>,
}

impl Kernel for SelectionRow<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(mut self, level: L) {
        let row = self.row.block_row(self.scene, self.reach);
        let (orders, counts) = (self.order.as_chunks().0, self.count.as_chunks().0);
        let (mut scratch, mut found) = (SelectionScratch::new(level), BlockScratch::default());
        for (block, (order, count)) in orders.iter().zip(counts).enumerate() {
            let begin = block * BLOCK;
            // The kernel selects for all 32 pixels. Those that are decided already, or irregular, are not copied.
            let Some(mut of_block) = row.block(level, begin, count) else { continue };
            of_block.select(order, &mut scratch, &mut found.as_block());
            self.copy_pixels(begin, of_block.regular(), &found);
            self.select_pixels(begin, of_block.irregular());
        }
        (counts.len() * BLOCK..self.count.len()).for_each(|u| self.select_pixel(u));
    }
}

impl SelectionRow<'_, '_> {
    /// Copies some of the 32 pixels from `begin` on, a bit each.
    fn copy_pixels(&mut self, begin: usize, mut pixels: u32, found: &BlockScratch) {
        let out = &mut *self.out;
        while pixels != 0 {
            let k = pixels.trailing_zeros() as usize;
            out.absolute[begin + k] = found.absolute[k];
            out.column_px[begin + k] = found.column_px[k];
            out.z[begin + k] = found.z[k];
            out.delta[begin + k] = found.delta[k];
            out.slope[begin + k] = found.slope[k];
            out.in_volume[begin + k] = found.in_volume[k];
            pixels &= pixels - 1;
        }
    }

    /// Selects for some of the 32 pixels from `begin` on, a bit each, one by one.
    fn select_pixels(&mut self, begin: usize, mut pixels: u32) {
        while pixels != 0 {
            self.select_pixel(begin + pixels.trailing_zeros() as usize);
            pixels &= pixels - 1;
        }
    }

    /// Selects for a pixel: the scalar form.
    fn select_pixel(&mut self, u: usize) {
        if self.count[u] == 0 {
            return;
        }
        self.out.absolute[u] = ABSENT;
        let search = self.row.search(self.scene, self.reach, u);
        let sd_turns = self.row.sd_turns[u];
        let Some((rest, column_px, slope)) = best_of_order(&search, self.order[u], sd_turns) else { return };
        let delta_turns = rest + search.drift.at(column_px);
        let out = &mut self.out;
        out.absolute[u] = absolute(self.order[u], self.phase[u]);
        out.column_px[u] = column_px;
        out.z[u] = rest / sd_turns;
        out.delta[u] = (delta_turns * 65536.0).round().clamp(-32768.0, 32767.0) as i16;
        out.slope[u] = slope.clamp(-32768, 32767) as i16;
        out.in_volume[u] = search.is_in_volume(column_px);
    }
}

/// Absolute phase, turns · 65536.
#[inline(always)]
fn absolute(order: i16, phase: u16) -> i32 {
    i32::from(order) * TURN + i32::from(phase)
}

/// The candidate of an order with the least |δ − drift| within reach: δ − drift, column and slope.
fn best_of_order(search: &PixelSearch<'_>, order: i16, sd_turns: f32) -> Option<(f32, f32, i32)> {
    let reach_turns = REACH_TURNS.max(REACH_SD * sd_turns);
    let interval_px = search.columns_of(i32::from(order), reach_turns)?;
    let mut best: Option<(f32, f32, i32)> = None;
    let mut consider = |column_px: f32, slope: i32| {
        let (found, rest) = search.order_and_residual(column_px);
        let fits = found == i32::from(order) && rest.abs() <= reach_turns;
        if fits && best.is_none_or(|(least, ..)| rest.abs() < f32::abs(least)) {
            best = Some((rest, column_px, slope));
        }
    };
    search.crossings(interval_px, &mut consider);
    let [begin, end] = interval_px.map(|px| px.max(0.0) as usize);
    let [first_px, last_px] = search.limits_px;
    search.row.rims(search.phase, begin.saturating_sub(RIM_COLUMNS)..=end + 1 + RIM_COLUMNS, |column_px, slope| {
        if column_px >= first_px && column_px <= last_px {
            consider(column_px, slope);
        }
    });
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::correspondence::semi_global::matching_cost::{CostInput, MatchingCosts};
    use crate::correspondence::semi_global::test_scene::TestScene;

    /// The selected candidate of a pixel, as bits.
    type Selected = Option<(i32, [u32; 2], [i16; 2], bool)>;

    /// The selected candidates of the pixels of a row.
    fn selected(width: usize, select: impl Fn(&mut SelectedPixels<'_>)) -> Vec<Selected> {
        let (mut absolute, mut in_volume) = (vec![0; width], vec![false; width]);
        let ([mut column_px, mut z], [mut delta, mut slope]) =
            ([vec![0.0; width], vec![0.0; width]], [vec![0; width], vec![0; width]]);
        select(&mut SelectedPixels {
            absolute: &mut absolute,
            column_px: &mut column_px,
            z: &mut z,
            delta: &mut delta,
            slope: &mut slope,
            in_volume: &mut in_volume,
            is_decided: &mut vec![false; width],
        });
        let of_pixel = |u: usize| {
            let fit = (absolute[u], [column_px[u].to_bits(), z[u].to_bits()], [delta[u], slope[u]], in_volume[u]);
            (absolute[u] != ABSENT).then_some(fit)
        };
        (0..width).map(of_pixel).collect()
    }

    #[test]
    fn candidates_of_many_pixels_are_those_of_each_at_every_level() {
        let test_scene = TestScene::new();
        let scene = test_scene.scene();
        let (scale, width) = (DeltaScale::from_scene(&scene), scene.view.cam1.width);
        let (mut ranges, mut matching_costs, mut row) =
            (OrderRanges::default(), MatchingCosts::default(), SearchRow::default());
        let outside = vec![false; scene.view.cam1.phase.len()];
        ranges.prepare(&scene, false);
        let surfaces = &test_scene.surfaces();
        let input = CostInput { scene: &scene, open: &scene, scale: &scale, surfaces, outside: &outside };
        matching_costs.gather(&input, &mut ranges, &mut Selection::default(), &mut Vec::new());
        let (reach, mut found) = (ranges.reach, 0);
        for v in 0..scene.view.cam1.height {
            row.load_row(&scene, &scale, v);
            let pixels = v * width..(v + 1) * width;
            let (count, phase) = (&ranges.count[pixels.clone()], &scene.view.cam1.phase[pixels.clone()]);
            let best = matching_costs.best.row(pixels.clone()).place;
            // The best order of most pixels, the next one of some.
            let order: Vec<i16> = (0..width)
                .map(|u| ranges.first[pixels.start + u] + i16::from(best[u]) + i16::from((u + v) % 7 == 0))
                .collect();
            let of = |select: &dyn Fn(SelectionRow<'_, '_>)| {
                let order = &order;
                selected(width, |out| {
                    select(SelectionRow { scene: &scene, reach, row: &row, phase, count, order, out });
                })
            };
            let wanted = of(&|mut row| (0..width).for_each(|u| row.select_pixel(u)));
            found += wanted.iter().flatten().count();
            for level in Level::ALL {
                assert_eq!(of(&|row| fringeflow_simd::run(level, row)), wanted, "{level:?} {v}");
            }
        }
        assert!(found > 15_000, "{found}");
    }

    #[test]
    fn a_confirmed_pixel_has_the_candidate_of_its_order_at_every_level() {
        let test_scene = TestScene::new();
        let scene = test_scene.scene();
        let (scale, width) = (DeltaScale::from_scene(&scene), scene.view.cam1.width);
        let (mut ranges, mut row, mut orders) = (OrderRanges::default(), SearchRow::default(), Vec::new());
        ranges.prepare(&scene, false);
        let (surfaces, reach) = (test_scene.surfaces(), ranges.reach);
        let (mut decided, mut other) = (0, 0);
        for v in 0..scene.view.cam1.height {
            row.load_row(&scene, &scale, v);
            surfaces.fill_orders((v, width), &mut orders);
            let of = |level: Level| {
                selected(width, |out| {
                    out.absolute.fill(ABSENT);
                    fringeflow_simd::run(level, ConfirmRow { row: row.block_row(&scene, reach), orders: &orders, out });
                })
            };
            let found = of(Level::ALL[0]);
            for level in Level::ALL {
                assert_eq!(of(level), found, "{level:?} {v}");
            }
            for (u, found) in found.iter().enumerate() {
                let Some((_, [column_px, z], ..)) = *found else { continue };
                let sd_turns = row.sd_turns[u];
                let best = best_of_order(&row.search(&scene, reach, u), orders[u], sd_turns);
                let is_same = best.is_some_and(|(rest, best_px, _)| {
                    let off = (rest / sd_turns - f32::from_bits(z)).abs();
                    (best_px - f32::from_bits(column_px)).abs() < 0.01 && off < 0.05
                });
                decided += 1;
                other += usize::from(!is_same);
            }
        }
        assert!(decided > 10_000 && 100 * other < decided, "{other} of {decided}");
    }
}
