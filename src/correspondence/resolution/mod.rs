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
mod decision;
mod pass;
mod region_delta;
mod regions;
mod steepness;
mod uniqueness;

use rayon::prelude::*;

use crate::phase::PhaseMap;

use super::candidates::{Candidate, DeltaGate};
use super::neighbourhood::{Decided, Directions, Neighbourhood, Reach, TURN, UNDECIDED};
use super::outcome::Outcome;
use super::search::CandidateLists;
use super::segment_table::SegmentTable;

use changed_tiles::ChangedTiles;
use decision::{Stand, VoteRule};
pub(super) use pass::Pass;
use region_delta::level_regions;
use regions::Regions;
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
        let decided = resolver.sweep_until_settled(Directions::Along, &strict)
            + resolver.sweep_until_settled(Directions::AlongAndAcross, &strict);
        if round > 0 && settled(decided) {
            break;
        }
        resolver.contradict_by_neighbours(&strict);
        if settled(resolver.contradict_by_regions(Precedence::Foundation)) {
            break;
        }
    }
    // The regions stand; pixels at their borders, with few neighbours left, may join them with fewer votes.
    resolver.readmit();
    let strict_tolerance = std::mem::replace(&mut resolver.tolerance, ANY_DELTA);
    resolver.sweep_until_settled(Directions::AlongAndAcross, &VoteRule::LENIENT);
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
    let is_decided = |&i: &usize| resolver.absolute[i] != UNDECIDED;
    let decided: Vec<usize> = (0..resolver.absolute.len()).filter(is_decided).collect();
    let deltas = decided.iter().map(|&i| resolver.delta[i]).collect();
    let pairs = decided.windows(2).filter(|pair| pair[1] == pair[0] + 1);
    (deltas, pairs.map(|pair| resolver.delta[pair[1]].wrapping_sub(resolver.delta[pair[0]])).collect())
}

/// State of the resolution.
struct Resolver<'a> {
    evidence: Evidence<'a>,
    settings: &'a ResolutionSettings,
    around: Neighbourhood<'a>,
    /// Absolute phase of the decided pixels, turns · 65536.
    absolute: Vec<i32>,
    /// δ of the decided pixels, turns · 65536.
    delta: Vec<i16>,
    /// Difference of δ between neighbours of one surface that is tolerated, turns · 65536.
    tolerance: i32,
    /// Bit k set: candidate k of the pixel was contradicted and does not come back.
    excluded: Vec<u32>,
    /// Pixels with candidates and without decision, ascending.
    open: Vec<u32>,
    /// Where decisions changed since neighbours were last asked for contradictions.
    unchecked: ChangedTiles,
    resolution: Resolution,
}

impl<'a> Resolver<'a> {
    fn new(evidence: Evidence<'a>, settings: &'a ResolutionSettings) -> Self {
        let pixels = evidence.cam1.phase.len();
        let outcome = |i: usize| match evidence.candidates.of(i) {
            [] => Outcome::NoCandidate,
            list if list.iter().any(|c| evidence.gate.passes(c.delta)) => Outcome::Ambiguous,
            _ => Outcome::RejectedByDelta,
        };
        Self {
            evidence,
            settings,
            around: Neighbourhood { map: evidence.cam1, axis: evidence.table.epipolar_axis() },
            absolute: vec![UNDECIDED; pixels],
            delta: vec![0; pixels],
            tolerance: (evidence.delta_tolerance_turns * TURN as f32) as i32,
            excluded: vec![0; pixels],
            open: Vec::new(),
            unchecked: ChangedTiles::new(evidence.cam1.width, pixels, true),
            resolution: Resolution {
                outcomes: (0..pixels).into_par_iter().map(outcome).collect(),
                chosen: vec![0; pixels],
            },
        }
    }

    /// Selects the reference correspondences (paper, 2.2.1) and opens all other pixels with candidates.
    fn select_references(&mut self) {
        let pixels = self.absolute.len();
        let only: Vec<Option<u8>> = (0..pixels).into_par_iter().map(|i| self.only_passing(i)).collect();
        let (absolute, delta): (Vec<i32>, Vec<i16>) = (0..pixels)
            .into_par_iter()
            .map(|i| only[i].map_or((UNDECIDED, 0), |k| self.stand(i, usize::from(k)).into()))
            .unzip();
        let unique = Decided { absolute: &absolute, delta: &delta };
        let rule = VoteRule::strict(self.settings.min_votes);
        let is_reference: Vec<bool> = (0..pixels)
            .into_par_iter()
            .map(|i| {
                only[i].is_some() && {
                    let support = self.around.support(i, unique, absolute[i]);
                    rule.supports(support, delta[i], self.tolerance)
                }
            })
            .collect();
        for i in 0..pixels {
            match only[i] {
                Some(k) if is_reference[i] => self.decide(i, usize::from(k), Outcome::Reference),
                _ if !self.evidence.candidates.of(i).is_empty() => self.open.push(i as u32),
                _ => {}
            }
        }
    }

    /// The candidate of a pixel that alone passes the back-projection test.
    fn only_passing(&self, pixel: usize) -> Option<u8> {
        let list = self.evidence.candidates.of(pixel);
        let mut passing = (0..list.len()).filter(|&k| self.evidence.gate.passes(list[k].delta));
        match (passing.next(), passing.next()) {
            (Some(k), None) => Some(k as u8),
            _ => None,
        }
    }

    /// What has been decided so far.
    fn decided(&self) -> Decided<'_> {
        Decided { absolute: &self.absolute, delta: &self.delta }
    }

    fn stand(&self, pixel: usize, k: usize) -> Stand {
        let candidate = &self.evidence.candidates.of(pixel)[k];
        let absolute = i32::from(candidate.order) * TURN + i32::from(self.evidence.cam1.phase[pixel]);
        Stand { absolute, delta: candidate.delta }
    }

    fn chosen_candidate(&self, pixel: usize) -> &'a Candidate {
        &self.evidence.candidates.of(pixel)[usize::from(self.resolution.chosen[pixel])]
    }

    fn decide(&mut self, pixel: usize, k: usize, outcome: Outcome) {
        Stand { absolute: self.absolute[pixel], delta: self.delta[pixel] } = self.stand(pixel, k);
        self.resolution.chosen[pixel] = k as u8;
        self.resolution.outcomes[pixel] = outcome;
        self.unchecked.mark(pixel);
    }

    /// Takes back the decisions of some pixels (ascending) and opens them again.
    fn undo(&mut self, pixels: &[u32]) {
        for &pixel in pixels {
            self.absolute[pixel as usize] = UNDECIDED;
            self.resolution.outcomes[pixel as usize] = Outcome::Contradicted;
            self.unchecked.mark(pixel as usize);
        }
        self.open.extend_from_slice(pixels);
        self.open.sort_unstable();
    }

    /// Sweeps until nothing more is decided, a bounded number of times; yields how many pixels were.
    fn sweep_until_settled(&mut self, directions: Directions, rule: &VoteRule) -> usize {
        let open_before = self.open.len();
        let tiles = |marked| ChangedTiles::new(self.evidence.cam1.width, self.absolute.len(), marked);
        let (mut changed, mut changing) = (tiles(true), tiles(false));
        for _ in 0..self.settings.max_sweeps {
            if self.sweep(directions, rule, &changed, &mut changing) == 0 {
                break;
            }
            std::mem::swap(&mut changed, &mut changing);
            changing.clear();
        }
        open_before - self.open.len()
    }

    /// Decides open pixels by what the pixels decided before this sweep say; yields how many. Only those that see a tile
    /// `changed` since they were asked last are asked; the tiles of those decided are marked in `changing`.
    fn sweep(
        &mut self,
        directions: Directions,
        rule: &VoteRule,
        changed: &ChangedTiles,
        changing: &mut ChangedTiles,
    ) -> usize {
        let decisions: Vec<Option<u8>> = self
            .open
            .par_iter()
            .map(|&pixel| {
                if !changed.reach(pixel as usize) {
                    return None;
                }
                let opinions = self.around.opinions(pixel as usize, self.decided(), directions, Reach::Far);
                rule.choose(self.eligible(pixel as usize), &opinions, self.tolerance).map(|k| k as u8)
            })
            .collect();
        let open = std::mem::take(&mut self.open);
        let before = open.len();
        for (&pixel, decision) in open.iter().zip(decisions) {
            match decision {
                Some(k) => {
                    self.decide(pixel as usize, usize::from(k), self.outcome_of(pixel as usize, directions));
                    changing.mark(pixel as usize);
                }
                None => self.open.push(pixel),
            }
        }
        before - self.open.len()
    }

    /// Candidates of a pixel that were not contradicted, with where they stand.
    fn eligible(&self, pixel: usize) -> impl Iterator<Item = (usize, Stand)> + '_ {
        let count = self.evidence.candidates.of(pixel).len();
        let excluded = self.excluded[pixel];
        (0..count).filter(move |&k| k >= 32 || excluded >> k & 1 == 0).map(move |k| (k, self.stand(pixel, k)))
    }

    fn outcome_of(&self, pixel: usize, directions: Directions) -> Outcome {
        match (self.evidence.candidates.of(pixel).len(), directions) {
            (1, _) => Outcome::Unique,
            (_, Directions::Along) => Outcome::AlongEpipolar,
            (_, Directions::AlongAndAcross) => Outcome::AcrossEpipolar,
        }
    }

    /// Undoes decisions that their neighbours do not support any more.
    fn contradict_by_neighbours(&mut self, rule: &VoteRule) {
        let contradicted: Vec<u32> = (0..self.absolute.len() as u32)
            .into_par_iter()
            .filter(|&pixel| {
                let pixel = pixel as usize;
                self.absolute[pixel] != UNDECIDED && self.unchecked.reach(pixel) && {
                    let support = self.around.support(pixel, self.decided(), self.absolute[pixel]);
                    !rule.supports(support, self.delta[pixel], self.tolerance)
                }
            })
            .collect();
        self.unchecked.clear();
        self.undo(&contradicted);
    }

    /// Undoes and excludes what whole regions contradict: small ones, those whose δ is not level, and those whose places
    /// in C2 serve others; yields how many pixels.
    fn contradict_by_regions(&mut self, precedence: Precedence) -> usize {
        let regions = Regions::of(self.decided(), self.tolerance, self.evidence.cam1.width);
        let large_enough = regions.sizes.iter().map(|&size| size >= self.settings.min_region_px);
        let credible: Vec<bool> =
            level_regions(self, &regions).into_iter().zip(large_enough).map(|(level, large)| level && large).collect();
        let contested = uniqueness::contested(self, &regions, &credible, precedence);
        self.exclude(|pixel| contested[pixel])
    }

    /// Undoes and excludes regions, their δ running on within a tolerance, whose δ is not level: what votes alone joined to
    /// a region that stands is judged by itself.
    fn contradict_by_delta(&mut self, tolerance: i32) {
        let regions = Regions::of(self.decided(), tolerance, self.evidence.cam1.width);
        let level = level_regions(self, &regions);
        self.exclude(|pixel| regions.region_of(pixel).is_some_and(|region| !level[region]));
    }

    /// Undoes and excludes the decisions that are false; yields how many.
    fn exclude(&mut self, is_false: impl Fn(usize) -> bool) -> usize {
        let contradicted: Vec<u32> = (0..self.absolute.len()).filter(|&i| is_false(i)).map(|i| i as u32).collect();
        for &pixel in &contradicted {
            let k = u32::from(self.resolution.chosen[pixel as usize]);
            self.excluded[pixel as usize] |= 1_u32.checked_shl(k).unwrap_or(0);
        }
        self.undo(&contradicted);
        contradicted.len()
    }

    /// Rejects candidates far beyond the threshold that only one side readmits: there a surface is continued beyond its
    /// edge, onto a wall that C2 does not see.
    fn reject_rims(&mut self) {
        let (gate, readmission) = (self.evidence.gate, self.evidence.readmission);
        let rim = DeltaGate { threshold_turns: RIM_SHARE * readmission.threshold_turns, ..*readmission };
        let is_rim = |&pixel: &u32| {
            let pixel = pixel as usize;
            self.absolute[pixel] != UNDECIDED
                && !rim.passes(self.delta[pixel])
                && self.around.sides(pixel, self.decided(), self.absolute[pixel], |delta| gate.passes(delta)) == 1
        };
        let rims: Vec<u32> = (0..self.absolute.len() as u32).into_par_iter().filter(is_rim).collect();
        for pixel in rims {
            self.absolute[pixel as usize] = UNDECIDED;
            self.resolution.outcomes[pixel as usize] = Outcome::RejectedByDelta;
        }
    }

    /// Gives contradicted candidates another chance beside the regions that stand.
    fn readmit(&mut self) {
        self.excluded.fill(0);
    }
}
