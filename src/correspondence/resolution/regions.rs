//! Regions of pixels whose absolute phases run on from one to the next.

use rayon::prelude::*;

use crate::simd::{self, Kernel, LANES, Lanes, Level};

use super::super::grid::{Grid, bit, bits_from, places_of, words};
use super::super::unions::Unions;
use super::continuity::{Along, Continuity};
use super::decisions::Decisions;

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
#[derive(Clone, Debug, Default)]
pub(super) struct Regions {
    /// Row by row, from left to right.
    pub(super) runs: Vec<Run>,
    /// Pixels of each region.
    pub(super) sizes: Vec<u32>,
    /// A bit a place: pixels that are in a region.
    members: Vec<u32>,
    /// A bit a place: pixels that begin and end a run, and those that belong together with the one below.
    begins: Vec<u32>,
    ends: Vec<u32>,
    below: Vec<u32>,
    /// Runs that begin before each block.
    before: Vec<u32>,
    unions: Unions,
    /// For each run the number of its region.
    numbers: Vec<u32>,
}

impl Regions {
    /// Finds the regions of an image: neighbours belong together if their absolute phases run on and their δ differ by no
    /// more than `tolerance`, turns · 65536.
    pub(super) fn find(&mut self, continuity: &Continuity, decisions: Decisions<'_>, tolerance: i32) {
        let grid = continuity.grid;
        for bits in [&mut self.begins, &mut self.ends, &mut self.below, &mut self.before] {
            bits.resize(grid.all_blocks(), 0);
        }
        self.members.clear();
        self.members.extend(decisions.decided);
        let level = Level::in_use();
        let tolerance = tolerance.clamp(0, 0xffff) as u16;
        let rows = (
            grid.rows(&mut self.begins).par_chunks_mut(grid.blocks),
            grid.rows(&mut self.ends).par_chunks_mut(grid.blocks),
            grid.rows(&mut self.below).par_chunks_mut(grid.blocks),
        );
        rows.into_par_iter().enumerate().for_each(|(v, (begins, ends, below))| {
            simd::run(level, LinksOfRow { continuity, decisions, tolerance, v, begins, ends, below });
        });
        self.find_runs(grid);
        self.unite_runs(grid);
        self.unions.number(&mut self.numbers);
        self.sizes.clear();
        for (run, &region) in self.runs.iter_mut().zip(&self.numbers) {
            run.region = region;
            self.sizes.resize(self.sizes.len().max(region as usize + 1), 0);
            self.sizes[region as usize] += run.length;
        }
    }

    fn find_runs(&mut self, grid: Grid) {
        self.runs.clear();
        let mut ended = 0;
        for block in grid.blocks_of_image() {
            self.before[block] = self.runs.len() as u32;
            let begins = places_of(block, self.begins[block]);
            self.runs.extend(begins.map(|place| Run { place: place as u32, length: 0, region: 0 }));
            for place in places_of(block, self.ends[block]) {
                let run = &mut self.runs[ended];
                run.length = place as u32 + 1 - run.place;
                ended += 1;
            }
        }
    }

    fn unite_runs(&mut self, grid: Grid) {
        self.unions.begin(self.runs.len());
        let mut last = None;
        for block in grid.blocks_of_image() {
            let under = block + grid.blocks;
            let begins = self.begins[block] | self.begins[under];
            let mut rest = self.below[block];
            while rest != 0 {
                let first = rest.trailing_zeros();
                let both = [self.run_of(block, first), self.run_of(under, first)];
                if last.replace(both) != Some(both) {
                    self.unions.unite(both[0], both[1]);
                }
                // Up to where another run begins.
                let later = begins & !up_to(first);
                rest = if later == 0 { 0 } else { rest & (u32::MAX << later.trailing_zeros()) };
            }
        }
    }

    /// Number of the run that a place of a region belongs to: that of bit `k` of a block.
    #[inline]
    fn run_of(&self, block: usize, k: u32) -> usize {
        let begun = self.before[block] + (self.begins[block] & up_to(k)).count_ones();
        (begun as usize).wrapping_sub(1)
    }

    /// A bit a place: those of the regions that are wanted, besides those that are set.
    pub(super) fn add_places_where(&self, bits: &mut [u32], is_wanted: impl Fn(usize) -> bool) {
        let wanted = self.runs.iter().filter(|run| is_wanted(run.region as usize));
        wanted.flat_map(|run| run.blocks()).for_each(|(block, places)| bits[block] |= places);
    }

    /// The run of a place, if it is decided.
    #[inline]
    pub(super) fn run_at(&self, place: usize) -> Option<&Run> {
        let run = bit(&self.members, place).then(|| self.run_of(place / LANES, (place % LANES) as u32))?;
        self.runs.get(run)
    }

    /// Whether a place belongs together with the one below it by themselves, not only by way of others.
    #[inline]
    pub(super) fn goes_on_below(&self, place: usize) -> bool {
        bit(&self.below, place)
    }

    /// Region of a place, if it is decided.
    #[inline]
    pub(super) fn region_of(&self, place: usize) -> Option<usize> {
        self.run_at(place).map(|run| run.region as usize)
    }
}

/// A bit and those before it.
#[inline]
fn up_to(bit: u32) -> u32 {
    u32::MAX >> (31 - bit)
}

/// Divides a row into runs, and finds what belongs together with the row below.
struct LinksOfRow<'a> {
    continuity: &'a Continuity,
    decisions: Decisions<'a>,
    tolerance: u16,
    v: usize,
    begins: &'a mut [u32],
    ends: &'a mut [u32],
    below: &'a mut [u32],
}

impl Kernel for LinksOfRow<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let first = self.continuity.grid.blocks_of_row(self.v).start - 1;
        let (mut b, mut carry) = (1, 0);
        while b + 1 < self.begins.len() {
            let decided = self.decisions.decided[first + b];
            let (mut next, mut below) = (0, 0);
            if decided != 0 {
                next = self.links_along(lanes, &self.continuity.row, first + b);
                below = self.links_along(lanes, &self.continuity.column, first + b);
            }
            self.begins[b] = decided & !(next << 1 | carry);
            self.ends[b] = decided & !next;
            self.below[b] = below;
            carry = next >> (LANES - 1);
            b += 1;
        }
    }
}

impl LinksOfRow<'_> {
    /// Which pixels of a block belong together with those one stride on.
    #[inline(always)]
    fn links_along<L: Lanes>(&self, lanes: L, along: &Along, block: usize) -> u32 {
        let (here, there) = (block * LANES, block * LANES + along.stride);
        let decided = self.decisions.decided;
        let both = along.runs_on[block] & decided[block] & bits_from(decided, there);
        if both == 0 {
            return 0;
        }
        let (order, delta) = (self.decisions.order, self.decisions.delta);
        let turns = lanes.sub(lanes.load(words(&along.turns, there)), lanes.load(words(&along.turns, here)));
        let expected = lanes.add(lanes.load(words(order, here)), turns);
        let runs_on = lanes.bits(lanes.is_equal(expected, lanes.load(words(order, there))));
        let change = lanes.sub_saturating(lanes.load(words(delta, there)), lanes.load(words(delta, here)));
        let level = lanes.bits(lanes.is_at_least(lanes.word(self.tolerance as i16), lanes.abs(change)));
        both & runs_on & level
    }
}

#[cfg(test)]
mod tests {
    use crate::phase::PhaseMap;

    use super::super::super::candidates::Candidate;
    use super::super::super::search::Candidates;
    use super::*;

    const TURN: i32 = 65536;

    /// Regions of an image of absolute phases and δ; `None` is not decided.
    fn regions(width: usize, pixels: &[Option<(i32, i16)>], tolerance: i32) -> (Continuity, Regions) {
        let phase: Vec<u16> = pixels.iter().map(|p| p.map_or(0, |(absolute, _)| absolute as u16)).collect();
        let height = pixels.len() / width;
        let valid = pixels.iter().map(Option::is_some).collect();
        let continuity = Continuity::of(&PhaseMap { width, height, phase, valid, ..PhaseMap::default() });
        let candidate = |(absolute, delta): (i32, i16)| Candidate {
            column_px: 0.0,
            order: (absolute >> 16) as i16,
            delta,
            slope: 0,
        };
        let lists: Vec<Vec<Candidate>> =
            pixels.iter().map(|pixel| pixel.map(candidate).into_iter().collect()).collect();
        let candidates = Candidates::of_pixels([width, height], &lists);
        let mut regions = Regions::default();
        regions.find(&continuity, Decisions::of(&candidates, &candidates.any), tolerance);
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
