//! Resolution: from the candidates of all pixels to at most one correspondence each (paper, section 2.2).
//!
//! 1. *Reference correspondences* (2.2.1): pixels with exactly one candidate that passes the back-projection test and
//!    with neighbours that have just one too and agree by Eq. (2).
//! 2. *Decisions* (2.2.2, 2.2.3): pixels with several candidates, and uncertain ones, are decided by what reference
//!    correspondences around them say by Eq. (2), first along the epipolar direction, then across it too. A candidate
//!    just beyond the threshold takes part here: two-sided 3·sd keeps 99.73 % of normal errors, and the rest is
//!    re-admitted by its neighbourhood; far beyond it not by one side alone.
//! 3. *Contradictions* (2.2.3): against neighbours; against the place in C2, which serves one order; and against chance,
//!    by the evidence of whole regions.
//!
//! Decisions and contradictions alternate for a bounded number of rounds and sweeps; a sweep reads the decisions of the
//! one before and writes its own, so the result does not depend on the number of threads. What is left is counted.

mod changed_tiles;
mod continuity;
mod decision;
mod decisions;
mod grid;
mod lists;
mod opinions;
mod pass;
mod region_delta;
mod regions;
mod steepness;
mod support;
mod uniqueness;

use rayon::prelude::*;

use crate::phase::PhaseMap;
use crate::simd::{self, LANES, Level};

use super::candidates::DeltaGate;
use super::neighbourhood::TURN;
use super::outcome::Outcome;
use super::search::CandidateLists;
use super::segment::SegmentRow;
use super::segment_table::{EpipolarAxis, SegmentTable};

use changed_tiles::{ChangedTiles, Unheard};
use continuity::{Axis, Continuity};
use decision::VoteRule;
use decisions::{Decisions, nearest_column};
use grid::{Grid, places_of};
use lists::Lists;
use opinions::{Ask, Decision, Directions, Question, sides};
pub(super) use pass::Pass;
use region_delta::level_regions;
use regions::Regions;
use support::{Support, SupportedInRow};
use uniqueness::Precedence;

/// Tolerance that every difference of δ meets.
const ANY_DELTA: i32 = TURN;

/// A round that decides or contradicts fewer than one pixel in so many is the last.
const SETTLED_SHARE: usize = 500;

/// Share of the widest δ at which a candidate may be readmitted beyond which one side is too little to do so.
const RIM_SHARE: f32 = 0.8;

/// How the resolution weighs and when it stops.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ResolutionSettings {
    /// Rounds of decisions and contradictions.
    pub max_rounds: usize,
    /// Sweeps of one kind in a round.
    pub max_sweeps: usize,
    /// Decided pixels that must support a decision.
    pub min_votes: u16,
    /// Smallest region of agreeing pixels that is kept, pixels.
    pub min_region_px: u32,
}

impl Default for ResolutionSettings {
    fn default() -> Self {
        Self { max_rounds: 3, max_sweeps: 8, min_votes: 3, min_region_px: 30 }
    }
}

/// Decisions about all pixels of C1, row by row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Resolution {
    /// What became of each pixel.
    pub outcomes: Vec<Outcome>,
    /// Index of the chosen candidate in the pixel's list; meaningless without a found outcome.
    pub chosen: Vec<u8>,
    /// Number of candidates that pass the back-projection test proper.
    pub passing: Vec<u8>,
}

/// Everything the resolution reads.
#[derive(Clone, Copy)]
pub struct Evidence<'a> {
    /// Phase of C1.
    pub cam1: &'a PhaseMap,
    /// Candidates of all pixels, those somewhat beyond the threshold included.
    pub candidates: &'a CandidateLists,
    /// The back-projection test proper: threshold 3·sd.
    pub gate: &'a DeltaGate,
    /// The test that all candidates pass, wider where some are to be readmitted.
    pub readmission: &'a DeltaGate,
    /// Difference of δ between neighbours of one surface that is tolerated, turns.
    pub delta_tolerance_turns: f32,
    /// Change of δ a pixel that no calibration error and no noise makes, turns.
    pub steep_delta_turns: f32,
    /// The segment table of the rig.
    pub table: &'a SegmentTable,
}

/// Decides every pixel that has candidates.
///
/// The outcomes of pixels without candidates are left at [`Outcome::NoCandidate`]; the caller knows why there are none.
#[must_use]
pub fn resolve(evidence: Evidence<'_>, settings: &ResolutionSettings) -> Resolution {
    let mut resolver = Resolver::new(evidence, settings);
    resolver.select_references();
    let strict = VoteRule::strict(settings.min_votes);
    let settled = |changed: usize| changed * SETTLED_SHARE < evidence.cam1.phase.len();
    for round in 0..settings.max_rounds {
        let decided = resolver.sweep_until_settled(Directions::Along, strict)
            + resolver.sweep_until_settled(Directions::AlongAndAcross, strict);
        if round > 0 && settled(decided) {
            break;
        }
        resolver.contradict_by_neighbours(strict);
        if settled(resolver.contradict_by_regions(Precedence::Foundation)) {
            break;
        }
    }
    // The regions stand; pixels at their borders, with few neighbours left, may join them with fewer votes.
    resolver.readmit();
    let strict_tolerance = std::mem::replace(&mut resolver.tolerance, ANY_DELTA);
    resolver.sweep_until_settled(Directions::AlongAndAcross, VoteRule::LENIENT);
    resolver.contradict_by_delta(strict_tolerance);
    resolver.contradict_by_regions(Precedence::Nearness);
    resolver.reject_rims();
    resolver.resolution
}

/// δ of the reference correspondences, turns · 65536: of each, and its differences between horizontal neighbours.
#[must_use]
pub(super) fn reference_deltas(evidence: Evidence<'_>, settings: &ResolutionSettings) -> (Vec<i16>, Vec<i16>) {
    let mut resolver = Resolver::new(evidence, settings);
    resolver.select_references();
    let decisions = &resolver.decisions;
    let (mut deltas, mut differences) = (Vec::new(), Vec::new());
    for place in (0..evidence.cam1.height).flat_map(|v| resolver.decided_in_row(v)) {
        deltas.push(decisions.delta[place]);
        if decisions.is_decided(place - 1) {
            differences.push(decisions.delta[place].wrapping_sub(decisions.delta[place - 1]));
        }
    }
    (deltas, differences)
}

/// State of the resolution. *Places* are those of pixels in planes with a margin, see [`Grid`].
struct Resolver<'a> {
    evidence: Evidence<'a>,
    settings: &'a ResolutionSettings,
    level: Level,
    /// Where the phase of C1 runs on.
    continuity: Continuity,
    /// The axis that is nearest to the epipolar direction.
    along: &'static [Axis],
    lists: Lists<'a>,
    decisions: Decisions,
    /// Least and greatest δ that pass the back-projection test.
    gate_bounds: [i16; 2],
    /// Difference of δ between neighbours of one surface that is tolerated, turns · 65536.
    tolerance: i32,
    /// A bit a place: pixels without decision and with candidates that were not contradicted.
    open: Vec<u32>,
    /// A bit a place: pixels without decision, of which all candidates were contradicted.
    closed: Vec<u32>,
    /// Where decisions changed since their neighbours were last asked.
    unheard: Unheard,
    /// For each place the row of the epipolar frame that is nearest to its segment.
    epipolar_rows: Vec<u16>,
    resolution: Resolution,
}

impl<'a> Resolver<'a> {
    fn new(evidence: Evidence<'a>, settings: &'a ResolutionSettings) -> Self {
        let continuity = Continuity::of(evidence.cam1);
        let grid = continuity.grid;
        let pixels = evidence.cam1.phase.len();
        Self {
            evidence,
            settings,
            level: Level::in_use(),
            continuity,
            along: match evidence.table.epipolar_axis() {
                EpipolarAxis::Horizontal => &[Axis::Row],
                EpipolarAxis::Vertical => &[Axis::Column],
            },
            lists: Lists::new(evidence.candidates, grid),
            decisions: Decisions::none(grid),
            gate_bounds: evidence.gate.bounds(),
            tolerance: (evidence.delta_tolerance_turns * TURN as f32) as i32,
            open: vec![0; grid.all_blocks()],
            closed: vec![0; grid.all_blocks()],
            unheard: Unheard::all(grid),
            epipolar_rows: Vec::new(),
            resolution: Resolution {
                outcomes: vec![Outcome::NoCandidate; pixels],
                chosen: vec![0; pixels],
                passing: vec![0; pixels],
            },
        }
    }

    fn grid(&self) -> Grid {
        self.continuity.grid
    }

    /// Selects the reference correspondences (paper, 2.2.1) and opens all other pixels with candidates.
    fn select_references(&mut self) {
        self.decide_unique();
        let references = self.supported(VoteRule::strict(self.settings.min_votes), |_| true);
        let grid = self.grid();
        for block in grid.blocks_of_image() {
            let references = references[block];
            self.decisions.decided[block] = references;
            self.open[block] &= !references;
            for place in places_of(block, references) {
                self.resolution.outcomes[grid.pixel(place)] = Outcome::Reference;
            }
        }
    }

    /// Decides, for now, all pixels of which one candidate alone passes the back-projection test, and opens all that have
    /// candidates.
    fn decide_unique(&mut self) {
        let (grid, evidence) = (self.grid(), self.evidence);
        let width = evidence.cam1.width;
        let [least, greatest] = self.gate_bounds;
        let Resolution { outcomes, chosen, passing } = &mut self.resolution;
        let Decisions { order, delta, column, decided } = &mut self.decisions;
        let planes = grid.rows(order).par_chunks_mut(grid.stride()).zip(grid.rows(delta).par_chunks_mut(grid.stride()));
        let planes = planes.zip(grid.rows(column).par_chunks_mut(grid.stride()));
        let bits =
            grid.rows(decided).par_chunks_mut(grid.blocks).zip(grid.rows(&mut self.open).par_chunks_mut(grid.blocks));
        let outcomes =
            outcomes.par_chunks_mut(width).zip(chosen.par_chunks_mut(width)).zip(passing.par_chunks_mut(width));
        let rows = planes.zip(bits).zip(outcomes).enumerate();
        rows.for_each(|(v, ((((order, delta), column), (decided, open)), ((outcomes, chosen), passing)))| {
            for u in 0..width {
                let list = evidence.candidates.of(v * width + u);
                if list.is_empty() {
                    continue;
                }
                let place = u + LANES;
                for (k, candidate) in list.iter().enumerate() {
                    if (least..=greatest).contains(&candidate.delta) {
                        passing[u] += 1;
                        (order[place], delta[place], chosen[u]) = (candidate.order, candidate.delta, k as u8);
                        column[place] = nearest_column(candidate);
                    }
                }
                open[place / LANES] |= 1 << (place % LANES);
                decided[place / LANES] |= u32::from(passing[u] == 1) << (place % LANES);
                outcomes[u] = if passing[u] > 0 { Outcome::Ambiguous } else { Outcome::RejectedByDelta };
            }
        });
    }

    /// A bit a place: decided pixels that their neighbours support; only blocks that are `asked` about.
    fn supported(&self, rule: VoteRule, asked: impl Fn(usize) -> bool + Sync) -> Vec<u32> {
        let (grid, tolerance) = (self.grid(), self.tolerance);
        let support = Support { continuity: &self.continuity, decisions: &self.decisions, rule, tolerance };
        let mut supported = vec![0; grid.all_blocks()];
        grid.rows(&mut supported).par_chunks_mut(grid.blocks).enumerate().for_each(|(v, supported)| {
            let first = grid.blocks_of_row(v).start - 1;
            simd::run(self.level, SupportedInRow { support, first, asked: &asked, supported });
        });
        supported
    }

    /// Decided places of a row.
    fn decided_in_row(&self, v: usize) -> impl Iterator<Item = usize> + '_ {
        self.grid().blocks_of_row(v).flat_map(|block| places_of(block, self.decisions.decided[block]))
    }

    /// For each place the nearest row of the epipolar frame.
    fn find_epipolar_rows(&mut self) {
        let (grid, table) = (self.grid(), self.evidence.table);
        let last = table.epipolar_size_px()[1] - 1;
        self.epipolar_rows.resize(grid.places(), 0);
        let rows = grid.rows(&mut self.epipolar_rows).par_chunks_mut(grid.stride()).enumerate();
        rows.for_each_init(SegmentRow::default, |segments, (v, rows)| {
            table.row(v, segments);
            for (row, row_px) in rows[LANES..].iter_mut().zip(&segments.row_px[..grid.width()]) {
                *row = ((row_px + 0.5) as usize).min(last) as u16;
            }
        });
    }

    fn decide(&mut self, Decision { place, k }: Decision, directions: Directions) {
        let place = place as usize;
        let list = self.lists.of(place);
        let candidate = &list[usize::from(k)];
        self.decisions.decide(place, candidate);
        self.open[place / LANES] &= !(1 << (place % LANES));
        self.unheard.mark(place / LANES);
        let pixel = self.grid().pixel(place);
        self.resolution.chosen[pixel] = k;
        self.resolution.outcomes[pixel] = match (list.len(), directions) {
            (1, _) => Outcome::Unique,
            (_, Directions::Along) => Outcome::AlongEpipolar,
            (_, Directions::AlongAndAcross) => Outcome::AcrossEpipolar,
        };
    }

    /// Takes back the decisions of some places of a block and opens them again.
    fn undo(&mut self, block: usize, places: u32) {
        self.decisions.decided[block] &= !places;
        self.open[block] |= places;
        self.unheard.mark(block);
        for place in places_of(block, places) {
            let pixel = self.grid().pixel(place);
            self.resolution.outcomes[pixel] = Outcome::Contradicted;
        }
    }

    /// Sweeps until nothing more is decided, a bounded number of times; yields how many pixels were.
    fn sweep_until_settled(&mut self, directions: Directions, rule: VoteRule) -> usize {
        let mut decided = 0;
        for _ in 0..self.settings.max_sweeps {
            let unheard = ChangedTiles::new(self.grid(), false);
            let changed = std::mem::replace(self.unheard.of(directions), unheard);
            let decisions = self.sweep(directions, rule, &changed);
            if decisions.is_empty() {
                break;
            }
            decided += decisions.len();
            decisions.into_iter().for_each(|decision| self.decide(decision, directions));
        }
        decided
    }

    /// Open pixels that those decided before say enough about; only those that see a tile `changed` since they were asked
    /// last are asked.
    fn sweep(&self, directions: Directions, rule: VoteRule, changed: &ChangedTiles) -> Vec<Decision> {
        let question = Question {
            continuity: &self.continuity,
            decisions: &self.decisions,
            lists: &self.lists,
            axes: if directions == Directions::Along { self.along } else { &[Axis::Row, Axis::Column] },
            rule,
            tolerance: self.tolerance,
        };
        let of_row = |v: usize| {
            let mut decided = Vec::new();
            let blocks = self.grid().blocks_of_row(v);
            simd::run(self.level, Ask { question, blocks, open: &self.open, changed, decided: &mut decided });
            decided
        };
        let rows: Vec<Vec<Decision>> = (0..self.evidence.cam1.height).into_par_iter().map(of_row).collect();
        rows.concat()
    }

    /// Undoes decisions that their neighbours do not support any more.
    fn contradict_by_neighbours(&mut self, rule: VoteRule) {
        let grid = self.grid();
        let changed = std::mem::replace(&mut self.unheard.by_decided, ChangedTiles::new(grid, false));
        let supported = self.supported(rule, |block| changed.reach(block));
        let asked = |&block: &usize| changed.reach(block);
        for block in grid.blocks_of_image().filter(asked) {
            let contradicted = self.decisions.decided[block] & !supported[block];
            if contradicted != 0 {
                self.undo(block, contradicted);
            }
        }
    }

    /// Undoes and excludes what whole regions contradict: small ones, those whose δ is not level, and those whose places
    /// in C2 serve others; yields how many pixels.
    fn contradict_by_regions(&mut self, precedence: Precedence) -> usize {
        if self.epipolar_rows.is_empty() {
            self.find_epipolar_rows();
        }
        let regions = Regions::of(&self.continuity, &self.decisions, self.tolerance);
        let large_enough = regions.sizes.iter().map(|&size| size >= self.settings.min_region_px);
        let credible: Vec<bool> =
            level_regions(self, &regions).into_iter().zip(large_enough).map(|(level, large)| level && large).collect();
        let contested = uniqueness::contested(self, &regions, &credible, precedence);
        self.exclude(&contested)
    }

    /// Undoes and excludes regions, their δ running on within a tolerance, whose δ is not level: what votes alone joined to
    /// a region that stands is judged by itself.
    fn contradict_by_delta(&mut self, tolerance: i32) {
        let regions = Regions::of(&self.continuity, &self.decisions, tolerance);
        let level = level_regions(self, &regions);
        self.exclude(&regions.places_where(self.grid(), |region| !level[region]));
    }

    /// Undoes and excludes the decisions that are false, a bit a place; yields how many.
    fn exclude(&mut self, false_ones: &[u32]) -> usize {
        let mut excluded = 0;
        for (block, &places) in false_ones.iter().enumerate().filter(|(_, places)| **places != 0) {
            excluded += places.count_ones() as usize;
            self.undo(block, places);
            for place in places_of(block, places) {
                let k = self.resolution.chosen[self.grid().pixel(place)];
                if !self.lists.exclude(place, k) {
                    self.open[block] &= !(1 << (place % LANES));
                    self.closed[block] |= 1 << (place % LANES);
                }
            }
        }
        excluded
    }

    /// Gives contradicted candidates another chance beside the regions that stand.
    fn readmit(&mut self) {
        self.lists.readmit();
        self.open.iter_mut().zip(&mut self.closed).for_each(|(open, closed)| *open |= std::mem::take(closed));
        self.unheard = Unheard::all(self.grid());
    }

    /// Rejects candidates far beyond the threshold that only one side readmits: there a surface is continued beyond its
    /// edge, onto a wall that C2 does not see.
    fn reject_rims(&mut self) {
        let (gate, readmission) = (self.evidence.gate, self.evidence.readmission);
        let rim = DeltaGate { threshold_turns: RIM_SHARE * readmission.threshold_turns, ..*readmission };
        let [least, greatest] = rim.bounds();
        let (continuity, decisions) = (&self.continuity, &self.decisions);
        let of_row = |v: usize| {
            let rims = self.decided_in_row(v).filter(|&place| {
                !(least..=greatest).contains(&decisions.delta[place]) && sides(continuity, decisions, place, gate) == 1
            });
            rims.collect::<Vec<_>>()
        };
        let rims: Vec<Vec<usize>> = (0..self.evidence.cam1.height).into_par_iter().map(of_row).collect();
        for place in rims.into_iter().flatten() {
            self.decisions.decided[place / LANES] &= !(1 << (place % LANES));
            let pixel = self.grid().pixel(place);
            self.resolution.outcomes[pixel] = Outcome::RejectedByDelta;
        }
    }
}

#[cfg(test)]
mod test_scene;
