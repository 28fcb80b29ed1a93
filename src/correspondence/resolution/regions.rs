//! Regions of pixels whose absolute phases run on from one to the next.

use rayon::prelude::*;

use crate::simd::{self, Kernel, LANES, Lanes, Level};

use super::super::unions::Unions;
use super::continuity::{Along, Continuity};
use super::decisions::Decisions;
use super::grid::{Grid, bits_from, ones, words};

/// A place without region.
const NONE: u32 = u32::MAX;

/// Decided pixels of a row that belong together, one beside the other.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Run {
    /// Place of the first.
    pub(super) place: u32,
    pub(super) length: u32,
    pub(super) region: u32,
}

impl Run {
    /// Its places.
    pub(super) fn places(self) -> std::ops::Range<usize> {
        self.place as usize..(self.place + self.length) as usize
    }

    /// Its blocks, and the bits of its places in each.
    pub(super) fn blocks(self) -> impl Iterator<Item = (usize, u32)> {
        let places = self.places();
        (places.start / LANES..places.end.div_ceil(LANES)).map(move |block| {
            let begin = places.start.max(block * LANES) - block * LANES;
            let end = places.end.min((block + 1) * LANES) - block * LANES;
            (block, (u32::MAX >> (LANES - (end - begin))) << begin)
        })
    }
}

/// Division of the decided pixels into regions.
pub(super) struct Regions {
    /// Row by row, from left to right.
    pub(super) runs: Vec<Run>,
    /// Pixels of each region.
    pub(super) sizes: Vec<u32>,
    label: Vec<u32>,
}

impl Regions {
    /// Regions of an image: neighbours belong together if their absolute phases run on and their δ differ by no more than
    /// `tolerance`, turns · 65536.
    pub(super) fn of(continuity: &Continuity, decisions: &Decisions, tolerance: i32) -> Self {
        let grid = continuity.grid;
        let mut links = vec![Links::default(); grid.all_blocks()];
        let level = Level::in_use();
        let tolerance = tolerance.clamp(0, 0xffff) as u16;
        grid.rows(&mut links).par_chunks_mut(grid.blocks).enumerate().for_each(|(v, links)| {
            simd::run(level, LinksOfRow { continuity, decisions, tolerance, v, links });
        });
        let mut joined = Joined::default();
        (0..grid.height()).for_each(|v| joined.add_row(grid, v, &decisions.decided, &links));
        joined.into_regions(grid)
    }

    /// A bit a place: those of the regions that are wanted.
    pub(super) fn places_where(&self, grid: Grid, is_wanted: impl Fn(usize) -> bool) -> Vec<u32> {
        let mut bits = vec![0; grid.all_blocks()];
        let wanted = self.runs.iter().filter(|run| is_wanted(run.region as usize));
        wanted.flat_map(|run| run.blocks()).for_each(|(block, places)| bits[block] |= places);
        bits
    }

    /// Region of a place, if it is decided.
    #[inline]
    pub(super) fn region_of(&self, place: usize) -> Option<usize> {
        let label = self.label[place];
        (label != NONE).then_some(label as usize)
    }

    /// Whether two places, the first decided, are of one region.
    #[inline]
    pub(super) fn are_one(&self, place: usize, other: usize) -> bool {
        self.label[place] == self.label[other]
    }
}

/// Pixels of a block that belong together with the next of their row and with the one below, a bit each.
#[derive(Clone, Copy, Debug, Default)]
struct Links {
    next: u32,
    below: u32,
}

struct LinksOfRow<'a> {
    continuity: &'a Continuity,
    decisions: &'a Decisions,
    tolerance: u16,
    v: usize,
    links: &'a mut [Links],
}

impl Kernel for LinksOfRow<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let decided = &self.decisions.decided;
        let blocks = self.continuity.grid.blocks;
        let first = self.continuity.grid.blocks_of_row(self.v).start - 1;
        let mut b = 1;
        while b + 1 < blocks {
            let block = first + b;
            if decided[block] != 0 {
                self.links[b] = Links {
                    next: self.links_along(lanes, &self.continuity.row, block),
                    below: self.links_along(lanes, &self.continuity.column, block),
                };
            }
            b += 1;
        }
    }
}

impl LinksOfRow<'_> {
    /// Which pixels of a block belong together with those one stride on.
    #[inline(always)]
    fn links_along<L: Lanes>(&self, lanes: L, along: &Along, block: usize) -> u32 {
        let (here, there) = (block * LANES, block * LANES + along.stride);
        let decided = &self.decisions.decided;
        let both = along.runs_on[block] & decided[block] & bits_from(decided, there);
        if both == 0 {
            return 0;
        }
        let (order, delta) = (&self.decisions.order, &self.decisions.delta);
        let turns = lanes.sub(lanes.load(words(&along.turns, there)), lanes.load(words(&along.turns, here)));
        let expected = lanes.add(lanes.load(words(order, here)), turns);
        let runs_on = lanes.bits(lanes.is_equal(expected, lanes.load(words(order, there))));
        let change = lanes.sub_saturating(lanes.load(words(delta, there)), lanes.load(words(delta, here)));
        let level = lanes.bits(lanes.is_at_least(lanes.word(self.tolerance as i16), lanes.abs(change)));
        both & runs_on & level
    }
}

/// Runs joined to regions.
#[derive(Default)]
struct Joined {
    /// Place and length of each run.
    runs: Vec<(u32, u32)>,
    unions: Unions,
    /// Where the runs of the row above begin.
    above: usize,
}

impl Joined {
    fn add_row(&mut self, grid: Grid, v: usize, decided: &[u32], links: &[Links]) {
        let first = self.runs.len();
        let mut carry = 0;
        let mut begin = 0;
        for block in grid.blocks_of_row(v) {
            let (decided, next) = (decided[block], links[block].next);
            let begins = decided & !(next << 1 | carry);
            let ends = decided & !next;
            let mut events = begins | ends;
            while events != 0 {
                let k = events.trailing_zeros();
                events &= events - 1;
                let place = (block * LANES) as u32 + k;
                if begins >> k & 1 == 1 {
                    begin = place;
                }
                if ends >> k & 1 == 1 {
                    self.unions.add();
                    self.runs.push((begin, place - begin + 1));
                }
            }
            carry = next >> (LANES - 1);
        }
        if v > 0 {
            self.join_rows(grid, v - 1, first, links);
        }
        self.above = first;
    }

    /// Joins the runs of row `v`, which begin at `self.above`, with those of the row below, which begin at `below`.
    fn join_rows(&mut self, grid: Grid, v: usize, below: usize, links: &[Links]) {
        let (mut upper, mut lower) = (self.above, below);
        let (mut upper_end, mut lower_end) = (0, 0);
        for block in grid.blocks_of_row(v) {
            for k in ones(links[block].below) {
                let place = (block * LANES + k) as u32;
                let under = place + grid.stride() as u32;
                if place < upper_end && under < lower_end {
                    continue;
                }
                while self.runs[upper].0 + self.runs[upper].1 <= place {
                    upper += 1;
                }
                while self.runs[lower].0 + self.runs[lower].1 <= under {
                    lower += 1;
                }
                (upper_end, lower_end) =
                    (self.runs[upper].0 + self.runs[upper].1, self.runs[lower].0 + self.runs[lower].1);
                self.unions.unite(upper, lower);
            }
        }
    }

    /// Regions, numbered by their first pixels.
    fn into_regions(self, grid: Grid) -> Regions {
        let mut regions =
            Regions { runs: Vec::with_capacity(self.runs.len()), sizes: Vec::new(), label: vec![NONE; grid.places()] };
        for ((place, length), region) in self.runs.into_iter().zip(self.unions.numbers()) {
            let run = Run { place, length, region };
            regions.sizes.resize(regions.sizes.len().max(region as usize + 1), 0);
            regions.sizes[region as usize] += length;
            regions.label[run.places()].fill(region);
            regions.runs.push(run);
        }
        regions
    }
}

#[cfg(test)]
mod tests {
    use crate::phase::PhaseMap;

    use super::super::super::candidates::Candidate;
    use super::*;

    const TURN: i32 = 65536;

    /// Regions of an image of absolute phases and δ; `None` is not decided.
    fn regions(width: usize, pixels: &[Option<(i32, i16)>], tolerance: i32) -> (Continuity, Regions) {
        let phase: Vec<u16> = pixels.iter().map(|p| p.map_or(0, |(absolute, _)| absolute as u16)).collect();
        let height = pixels.len() / width;
        let valid = pixels.iter().map(Option::is_some).collect();
        let continuity = Continuity::of(&PhaseMap { width, height, phase, valid, ..PhaseMap::default() });
        let mut decisions = Decisions::none(continuity.grid);
        for (pixel, decided) in pixels.iter().enumerate() {
            if let Some((absolute, delta)) = *decided {
                let candidate = Candidate { column_px: 0.0, order: (absolute >> 16) as i16, delta, slope: 0 };
                decisions.decide(continuity.grid.place(pixel), &candidate);
            }
        }
        let regions = Regions::of(&continuity, &decisions, tolerance);
        (continuity, regions)
    }

    #[test]
    fn regions_end_where_the_absolute_phase_or_delta_jumps() {
        let absolute = [0, 6000, 12000, 0, 18000, 18000 + TURN, 25000 + TURN, 31000 + TURN];
        let delta = [0, 0, 5, 0, 0, 0, 9, 50];
        let mut pixels: Vec<_> = absolute.into_iter().zip(delta).map(Some).collect();
        pixels[3] = None;
        let (continuity, regions) = regions(8, &pixels, 10);
        let region = |pixel| regions.region_of(continuity.grid.place(pixel));
        assert_eq!(regions.sizes, [3, 1, 2, 1]);
        assert_eq!(region(3), None);
        assert_eq!(region(6), region(5));
    }

    #[test]
    fn regions_are_those_of_a_flood_fill() {
        let (width, height) = (75, 40);
        let mut state = 7_u64;
        let mut random = move |below: u64| {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 33) % below
        };
        // Patches of three orders on a slope that wraps, with holes, and δ of two kinds.
        let pixels: Vec<Option<(i32, i16)>> = (0..width * height)
            .map(|i| {
                let (u, v) = ((i % width) as i32, (i / width) as i32);
                let order = (u / 9 + v / 7) % 2 - if random(11) == 0 { 1 } else { 0 };
                (random(5) > 0).then_some((order * TURN + 5000 * u + 3000 * v, if random(9) == 0 { 300 } else { 0 }))
            })
            .collect();
        let (continuity, regions) = regions(width, &pixels, 100);
        let mut label = vec![None; pixels.len()];
        let mut sizes = Vec::new();
        for seed in 0..pixels.len() {
            if pixels[seed].is_none() || label[seed].is_some() {
                continue;
            }
            let (mut frontier, mut size) = (vec![seed], 0);
            label[seed] = Some(sizes.len());
            while let Some(pixel) = frontier.pop() {
                size += 1;
                for next in
                    super::super::super::neighbourhood::neighbours(pixel, width, pixels.len()).into_iter().flatten()
                {
                    if let (Some((a, delta_a)), Some((b, delta_b))) = (pixels[pixel], pixels[next])
                        && (a - b).abs() <= super::super::super::neighbourhood::MAX_STEP
                        && (delta_a - delta_b).abs() <= 100
                        && label[next].is_none()
                    {
                        label[next] = Some(sizes.len());
                        frontier.push(next);
                    }
                }
            }
            sizes.push(size);
        }
        assert!(sizes.len() > 20);
        assert_eq!(regions.sizes, sizes);
        for (pixel, label) in label.into_iter().enumerate() {
            assert_eq!(regions.region_of(continuity.grid.place(pixel)), label, "{pixel}");
        }
    }
}
