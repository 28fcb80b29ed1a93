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

mod changed;
mod continuity;
mod decision;
mod decisions;
mod disputed;
mod opinions;
mod pass;
mod references;
mod region_delta;
mod regions;
mod row;
mod scene;
mod steepness;
mod support;
mod tallies;
mod uniqueness;

use rayon::prelude::*;

use crate::phase::PhaseMap;
use crate::simd::{self, LANES, Level};

use super::candidates::DeltaGate;
use super::chosen::ChosenCandidates;
use super::grid::{Grid, places_of};
use super::neighbourhood::TURN;
use super::outcome::Outcome;
use super::pool::Pool;
use super::search::{self, Candidates, Lists, Search, SearchForm};
use super::segment_table::{EpipolarAxis, SegmentTable};

use changed::{Changed, Unheard};
use continuity::{Along, Axis, Continuity, FAR};
use decision::VoteRule;
use decisions::Decisions;
use opinions::{Ask, Ballots, Directions, Question, sides};
pub(super) use pass::Verdict;
use references::{UniqueInRow, Within};
use region_delta::RegionJudge;
use regions::Regions;
use row::Row;
use scene::Scene;
use support::{Support, UnsupportedInRow};
use uniqueness::{Court, Precedence};

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
    /// The chosen candidate of each pixel with a found outcome.
    pub chosen: ChosenCandidates,
    /// Number of candidates that pass the back-projection test proper.
    pub passing: Vec<u8>,
}

/// Everything the resolution reads, but for the candidates.
#[derive(Clone, Copy)]
pub struct Evidence<'a> {
    /// Phase of C1.
    pub cam1: &'a PhaseMap,
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

/// Decides every pixel that has candidates: those that pass the test of readmission, somewhat beyond the threshold.
///
/// Of pixels without candidates the outcome says why there are none, as far as the search was asked.
#[must_use]
pub fn resolve(evidence: Evidence<'_>, candidates: Candidates, settings: &ResolutionSettings) -> Resolution {
    let mut room = Room { candidates, ..Room::default() };
    let (mut outcomes, mut passing) = (Vec::new(), Vec::new());
    room.resolve(evidence, settings, &mut outcomes, &mut passing);
    Resolution { outcomes, chosen: room.candidates.chosen, passing }
}

/// Memory for what is known of each pixel while images are resolved, to be used from image to image.
#[derive(Clone, Debug, Default)]
pub(super) struct Room {
    candidates: Candidates,
    /// Where the phase of C1 runs on.
    continuity: Continuity,
    /// A bit a place: pixels that are decided.
    decided: Vec<u32>,
    /// A bit a place: pixels without decision and with candidates that were not contradicted.
    open: Vec<u32>,
    /// A bit a place: pixels without decision, of which all candidates were contradicted.
    closed: Vec<u32>,
    /// Where decisions changed since their neighbours were last asked.
    unheard: Unheard,
    /// A bit a place: those that what is at work tells apart.
    marked: Vec<u32>,
    /// A bit a place: what stood in `unheard`.
    changed: Vec<u32>,
    /// A bit a place: what a sweep of a row decides.
    newly: Vec<u32>,
    ballots: Pool<Ballots>,
    /// For each row whether anything changed in it.
    changed_rows: Vec<bool>,
    regions: Regions,
    judge: RegionJudge,
    court: Court,
    /// For each region whether it may stand.
    credible: Vec<bool>,
}

impl Room {
    /// Decides the candidates; afterwards they are the chosen ones.
    fn resolve(
        &mut self,
        evidence: Evidence<'_>,
        settings: &ResolutionSettings,
        outcomes: &mut Vec<Outcome>,
        passing: &mut Vec<u8>,
    ) {
        let mut resolver = Resolver::new(evidence, settings, self, outcomes, passing);
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
        resolver.rows().for_each(|(mut row, _)| row.leave_undecided());
    }
}

/// What reference correspondences say of δ, and memory in which they are found.
#[derive(Clone, Debug, Default)]
pub(super) struct References {
    /// δ of each, turns · 65536, and its differences between horizontal neighbours.
    pub(super) deltas: Vec<i16>,
    pub(super) differences: Vec<i16>,
    outcomes: Vec<Outcome>,
    passing: Vec<u8>,
}

impl Room {
    /// Finds the reference correspondences of some rows of C1; the evidence is that of these rows, one below the other.
    pub(super) fn find_references(
        &mut self,
        search: &Search<'_>,
        rows: &[Option<usize>],
        evidence: Evidence<'_>,
        settings: &ResolutionSettings,
        references: &mut References,
    ) {
        search.rows(rows, SearchForm::ProjectorSide, &mut self.candidates);
        let References { deltas, differences, outcomes, passing } = references;
        let mut resolver = Resolver::new(evidence, settings, self, outcomes, passing);
        resolver.select_references();
        let scene = resolver.scene();
        deltas.clear();
        differences.clear();
        for place in (0..rows.len()).flat_map(|v| scene.decided_in_row(v)) {
            deltas.push(scene.decisions.delta[place]);
            if scene.decisions.is_decided(place - 1) {
                differences.push(scene.decisions.delta[place].wrapping_sub(scene.decisions.delta[place - 1]));
            }
        }
    }
}

/// State of the resolution. *Places* are those of pixels in planes with a margin, see [`Grid`].
struct Resolver<'a> {
    evidence: Evidence<'a>,
    settings: &'a ResolutionSettings,
    level: Level,
    /// The axis that is nearest to the epipolar direction.
    along: &'static [Axis],
    /// Least and greatest δ that pass the back-projection test.
    gate_bounds: [i16; 2],
    /// Difference of δ between neighbours of one surface that is tolerated, turns · 65536.
    tolerance: i32,
    room: &'a mut Room,
    outcomes: &'a mut Vec<Outcome>,
    passing: &'a mut Vec<u8>,
}

impl<'a> Resolver<'a> {
    fn new(
        evidence: Evidence<'a>,
        settings: &'a ResolutionSettings,
        room: &'a mut Room,
        outcomes: &'a mut Vec<Outcome>,
        passing: &'a mut Vec<u8>,
    ) -> Self {
        room.continuity.measure(evidence.cam1);
        let grid = room.continuity.grid;
        let Room { decided, open, closed, marked, changed, newly, .. } = room;
        for bits in [&mut *decided, open, closed, marked, changed, newly] {
            bits.clear();
            bits.resize(grid.all_blocks(), 0);
        }
        outcomes.resize(evidence.cam1.phase.len(), Outcome::NoCandidate);
        passing.resize(evidence.cam1.phase.len(), 0);
        Self {
            evidence,
            settings,
            level: Level::in_use(),
            along: match evidence.table.epipolar_axis() {
                EpipolarAxis::Horizontal => &[Axis::Row],
                EpipolarAxis::Vertical => &[Axis::Column],
            },
            gate_bounds: evidence.gate.bounds(),
            tolerance: (evidence.delta_tolerance_turns * TURN as f32) as i32,
            room,
            outcomes,
            passing,
        }
    }

    fn grid(&self) -> Grid {
        self.room.candidates.grid
    }

    /// The decisions so far, to be read.
    fn scene(&self) -> Scene<'_> {
        let Room { candidates, continuity, decided, .. } = &*self.room;
        Scene {
            evidence: self.evidence,
            continuity,
            decisions: Decisions::of(candidates, decided),
            cam2_row: &candidates.cam2_row,
            gate_bounds: self.gate_bounds,
            min_region_px: self.settings.min_region_px,
            level: self.level,
        }
    }

    /// The rows of the image, to be decided about: each with what is marked of it.
    fn rows(&mut self) -> impl IndexedParallelIterator<Item = (Row<'_>, &[u32])> {
        let grid = self.grid();
        let Room { candidates, decided, open, closed, unheard, marked, .. } = &mut *self.room;
        let Unheard { along, across, by_decided } = unheard;
        let rows = (
            candidates.rows(),
            self.outcomes.par_chunks_mut(grid.width()),
            grid.rows(decided).par_chunks_mut(grid.blocks),
            grid.rows(open).par_chunks_mut(grid.blocks),
            grid.rows(closed).par_chunks_mut(grid.blocks),
            grid.rows(along).par_chunks_mut(grid.blocks),
            grid.rows(across).par_chunks_mut(grid.blocks),
            grid.rows(by_decided).par_chunks_mut(grid.blocks),
            grid.rows(marked).par_chunks(grid.blocks),
        );
        rows.into_par_iter().map(|(candidates, outcomes, decided, open, closed, along, across, by_decided, marked)| {
            let unheard = [along, across, by_decided];
            (Row { candidates, outcomes, decided, open, closed, unheard }, marked)
        })
    }

    /// Selects the reference correspondences (paper, 2.2.1) and opens all other pixels with candidates.
    fn select_references(&mut self) {
        let (grid, level, gate_bounds) = (self.grid(), self.level, self.gate_bounds);
        let Room { candidates, decided, .. } = &mut *self.room;
        let rows = candidates.rows().zip(grid.rows(decided).par_chunks_mut(grid.blocks));
        rows.zip(self.passing.par_chunks_mut(grid.width())).for_each(|((candidates, unique), passing)| {
            simd::run(level, UniqueInRow { candidates, gate_bounds, unique, passing });
        });
        self.mark_unsupported(VoteRule::strict(self.settings.min_votes), None);
        self.room.unheard.by_open(grid);
        let (passing, valid) = (std::mem::take(self.passing), std::mem::take(&mut self.room.continuity.valid));
        let of_rows = passing.par_chunks(grid.width()).zip(grid.rows_of(&valid).par_chunks(grid.blocks));
        self.rows().zip(of_rows).for_each(|((mut row, unsupported), (passing, valid))| {
            row.begin(unsupported, passing, valid);
        });
        (*self.passing, self.room.continuity.valid) = (passing, valid);
    }

    /// Marks the decided pixels that their neighbours do not support: of those that a change is near, if that is asked for.
    fn mark_unsupported(&mut self, rule: VoteRule, changed: Option<&[u32]>) {
        let (grid, level, tolerance) = (self.grid(), self.level, self.tolerance);
        let Room { candidates, continuity, decided, marked, .. } = &mut *self.room;
        let support = Support { continuity, decisions: Decisions::of(candidates, decided), rule, tolerance };
        let changed = changed.map(|bits| Changed { grid, bits });
        grid.rows(marked).par_chunks_mut(grid.blocks).enumerate().for_each(|(v, unsupported)| {
            let first = grid.blocks_of_row(v).start - 1;
            simd::run(level, UnsupportedInRow { support, first, changed, unsupported });
        });
    }

    /// Sweeps until nothing more is decided, a bounded number of times; yields how many pixels were.
    ///
    /// A sweep decides open pixels that those decided before say enough about; only those are asked around whom decisions
    /// changed since they were asked last.
    fn sweep_until_settled(&mut self, directions: Directions, rule: VoteRule) -> usize {
        if directions == Directions::Along && self.along == [Axis::Row] {
            return self.sweep_rows(rule);
        }
        let mut decided = 0;
        for _ in 0..self.settings.max_sweeps {
            let of_sweep = self.sweep(directions, rule);
            if of_sweep == 0 {
                break;
            }
            decided += of_sweep;
        }
        decided
    }

    /// All sweeps along the rows: as no walk leaves its row, each row has all of its sweeps one after the other.
    fn sweep_rows(&mut self, rule: VoteRule) -> usize {
        let (grid, level, tolerance, max_sweeps) = (self.grid(), self.level, self.tolerance, self.settings.max_sweeps);
        let continuity = std::mem::take(&mut self.room.continuity);
        let (mut newly, mut changed) = (std::mem::take(&mut self.room.newly), std::mem::take(&mut self.room.changed));
        let ballots = std::mem::take(&mut self.room.ballots);
        let rooms = grid.rows(&mut newly).par_chunks_mut(grid.blocks);
        let rooms = rooms.zip(grid.rows(&mut changed).par_chunks_mut(grid.blocks));
        let rows = self.rows().zip(rooms).enumerate().map_init(
            || ballots.take(),
            |ballots, (v, ((mut row, _), (newly, changed)))| {
                ballots.begin(grid.blocks);
                let first = grid.blocks_of_row(v).start - 1;
                let blocks = first..first + grid.blocks;
                let phase = &continuity.phase[first * LANES..blocks.end * LANES];
                let ways = [continuity.row.in_row(blocks)];
                let mut decided = 0;
                for _ in 0..max_sweeps {
                    let [along, _, _] = &mut row.unheard;
                    changed.copy_from_slice(along);
                    along.fill(0);
                    let search::Row { order, delta, column, several, before, lists, .. } = &mut row.candidates;
                    let decisions = Decisions { order, delta, column, decided: row.decided };
                    let axes = &[Axis::Row];
                    let question = Question { phase, axes, ways: &ways, decisions, several, rule, tolerance };
                    let changed = Changed { grid, bits: changed };
                    let (first, open) = (0, &*row.open);
                    simd::run(level, Ask { question, first, open, changed, before, lists, ballots, decided: newly });
                    let of_sweep: u32 = newly.iter().map(|bits| bits.count_ones()).sum();
                    if of_sweep == 0 {
                        break;
                    }
                    decided += of_sweep as usize;
                    row.decide(newly, Directions::Along);
                }
                decided
            },
        );
        let decided = rows.sum();
        let Room { continuity: of_room, newly: of_newly, changed: of_changed, ballots: of_ballots, .. } =
            &mut *self.room;
        (*of_room, *of_newly, *of_changed, *of_ballots) = (continuity, newly, changed, ballots);
        decided
    }

    /// One sweep over all rows; yields how many pixels it decides.
    fn sweep(&mut self, directions: Directions, rule: VoteRule) -> usize {
        let (grid, level, tolerance) = (self.grid(), self.level, self.tolerance);
        let axes = if directions == Directions::Along { self.along } else { &[Axis::Row, Axis::Column] };
        let Room { candidates, continuity, decided, open, unheard, marked, changed, ballots, changed_rows, .. } =
            &mut *self.room;
        let ballots = &*ballots;
        std::mem::swap(changed, unheard.of(directions));
        unheard.of(directions).fill(0);
        let Candidates { order, delta, column, several, before, lists, .. } = candidates;
        let decisions = Decisions { order, delta, column, decided };
        let ways = [&continuity.row, &continuity.column].map(Along::everywhere);
        let ways = if axes == [Axis::Column] { &ways[1..] } else { &ways[..axes.len()] };
        let question = Question { phase: &continuity.phase, axes, ways, decisions, several, rule, tolerance };
        let (open, changed) = (open.as_slice(), Changed { grid, bits: changed });
        let rows = (
            grid.rows(marked).par_chunks_mut(grid.blocks),
            grid.rows(before).par_chunks(grid.blocks),
            lists.par_iter_mut(),
        );
        changed_rows.clear();
        changed_rows.extend(changed.bits.chunks(grid.blocks).map(|row| row.iter().any(|&bits| bits != 0)));
        let rows = rows.into_par_iter().zip(grid.rows_around(changed_rows, FAR as usize)).enumerate();
        rows.for_each_init(
            || ballots.take(),
            |ballots, (v, ((decided, before, lists), around))| {
                if around.contains(&true) {
                    ballots.begin(grid.blocks);
                    let first = grid.blocks_of_row(v).start - 1;
                    simd::run(level, Ask { question, first, open, changed, before, lists, ballots, decided });
                } else {
                    decided.fill(0);
                }
            },
        );
        self.rows().for_each(|(mut row, decided)| row.decide(decided, directions));
        self.marked()
    }

    /// How many pixels are marked.
    fn marked(&self) -> usize {
        self.room.marked.iter().map(|bits| bits.count_ones() as usize).sum()
    }

    /// Undoes decisions that their neighbours do not support any more.
    fn contradict_by_neighbours(&mut self, rule: VoteRule) {
        let Room { unheard, changed, .. } = &mut *self.room;
        std::mem::swap(changed, &mut unheard.by_decided);
        unheard.by_decided.fill(0);
        let changed = std::mem::take(changed);
        self.mark_unsupported(rule, Some(&changed));
        self.room.changed = changed;
        self.rows().for_each(|(mut row, contradicted)| row.undo(contradicted));
    }

    /// Undoes and excludes what whole regions contradict: small ones, those whose δ is not level, and those whose places
    /// in C2 serve others; yields how many pixels.
    fn contradict_by_regions(&mut self, precedence: Precedence) -> usize {
        let mut court = std::mem::take(&mut self.room.court);
        self.contradict(self.tolerance, |scene, regions, credible, marked| {
            for (credible, &size) in credible.iter_mut().zip(&regions.sizes) {
                *credible &= size >= scene.min_region_px;
            }
            court.contest(scene, regions, credible, precedence, marked);
        });
        self.room.court = court;
        self.marked()
    }

    /// Undoes and excludes regions, their δ running on within a tolerance, whose δ is not level: what votes alone joined to
    /// a region that stands is judged by itself.
    fn contradict_by_delta(&mut self, tolerance: i32) {
        self.contradict(tolerance, |_, regions, level, marked| {
            regions.add_places_where(marked, |region| !level[region]);
        });
    }

    /// Undoes and excludes decisions: those that `mark` marks, who is told the regions within a tolerance and which of them have
    /// a level δ.
    fn contradict(&mut self, tolerance: i32, mark: impl FnOnce(&Scene<'_>, &Regions, &mut Vec<bool>, &mut [u32])) {
        let Room { regions, judge, credible, marked, .. } = &mut *self.room;
        let (mut regions, mut judge) = (std::mem::take(regions), std::mem::take(judge));
        let (mut credible, mut marked) = (std::mem::take(credible), std::mem::take(marked));
        let scene = self.scene();
        regions.find(scene.continuity, scene.decisions, tolerance);
        judge.level(&scene, &regions, &mut credible);
        marked.fill(0);
        mark(&scene, &regions, &mut credible, &mut marked);
        let Room { regions: room, judge: of_judge, credible: of_credible, marked: of_marked, .. } = &mut *self.room;
        (*room, *of_judge, *of_credible, *of_marked) = (regions, judge, credible, marked);
        self.rows().for_each(|(mut row, contradicted)| {
            row.undo(contradicted);
            row.exclude(contradicted);
        });
    }

    /// Gives contradicted candidates another chance beside the regions that stand.
    fn readmit(&mut self) {
        let Room { candidates, open, closed, unheard, .. } = &mut *self.room;
        candidates.lists.iter_mut().for_each(Lists::readmit);
        open.iter_mut().zip(closed).for_each(|(open, closed)| *open |= std::mem::take(closed));
        unheard.across.fill(u32::MAX);
    }

    /// Rejects candidates far beyond the threshold that only one side readmits: there a surface is continued beyond its
    /// edge, onto a wall that C2 does not see.
    fn reject_rims(&mut self) {
        let Evidence { gate, readmission, .. } = self.evidence;
        let rim = DeltaGate { threshold_turns: RIM_SHARE * readmission.threshold_turns, ..*readmission };
        let bounds = rim.bounds();
        let mut marked = std::mem::take(&mut self.room.marked);
        let grid = self.grid();
        let Scene { continuity, decisions, level, .. } = self.scene();
        grid.rows(&mut marked).par_chunks_mut(grid.blocks).enumerate().for_each(|(v, marked)| {
            for (block, marked) in grid.blocks_of_row(v).zip(&mut marked[1..]) {
                *marked = 0;
                let decided = decisions.decided[block];
                if decided != 0 {
                    let beyond = decided & !simd::run(level, Within { delta: decisions.delta, block, bounds });
                    let is_rim = |&place: &usize| sides(continuity, decisions, place, gate) == 1;
                    *marked = places_of(block, beyond).filter(is_rim).fold(0, |all, place| all | 1 << (place % LANES));
                }
            }
        });
        self.room.marked = marked;
        self.rows().for_each(|(mut row, rims)| row.reject(rims));
    }
}

#[cfg(test)]
mod test_scene;
