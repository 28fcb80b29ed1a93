//! The paper's method (section 2.2): from the candidates of all pixels to at most one correspondence each, pixel by pixel.
//!
//! In: phase of C1 and C2, the segment table, what was measured of δ. Out: for each pixel of C1 its correspondence, or why
//! it has none. This is the scalar reference: plain loops, no state from image to image. It makes the paper's tables, and
//! benches time it beside the semi-global resolution. The paper leaves the numbers of its steps open; ours stand here.
//!
//! ```text
//! candidates(p) = points q of the segment of p with φ(q) = φ(p) and |δ(q) − mean| < 5·sd           2.1, 2.3
//! decide p for its candidate with |δ − mean| < 3·sd, if it has just one                            2.2.1
//! undecide what decided neighbours do not support: the references are left
//! repeat, a bounded number of rounds:
//!     decide what decided pixels along the epipolar direction agree on by Eq. (2); again, until nothing changes   2.2.2
//!     the same with decided pixels across the epipolar direction too                               2.2.3
//!     undecide what decided neighbours do not support any more
//!     divide the decided pixels into regions of continuous absolute phase
//!     undecide and exclude regions that are small, whose δ is not level, or that lose their places in C2
//!     undecide and exclude pixels whose place in C2 serves another order of a better founded region
//! admit excluded candidates again; decide with fewer votes: pixels at borders join the regions that stand
//! undecide regions whose δ is not level; of two orders in one place of C2 keep the nearer
//! undecide candidates far beyond 3·sd with support on one side only
//! ```
//!
//! A sweep reads the decisions of the sweep before, so the result does not depend on the number of threads. A candidate
//! between 3·sd and 5·sd is decided by its neighbourhood alone: 3·sd keeps 99.73 % of normal errors, edges err by more.

mod contradictions;
mod region_delta;
mod votes;

use rayon::prelude::*;

use fringeflow_base::outcome::Outcome;

use crate::correspondence::candidates::{Candidate, DeltaGate};
use crate::correspondence::chosen::ChosenCandidates;
use crate::correspondence::delta_statistics::DeltaStatistics;
use crate::correspondence::epipolar_image::EpipolarImage;
use crate::correspondence::explanation::explain_missing;
use crate::correspondence::neighbourhood::{ABSENT, TURN};
use crate::correspondence::pool::Pool;
use crate::correspondence::search::{Candidates, find_candidates};
use crate::correspondence::segment_table::SegmentTable;
use crate::correspondence::settings::ResolutionSettings;
use crate::correspondence::support::{Support, SupportRule};
use crate::phase::PhaseMap;

use contradictions::Precedence;
use votes::{Directions, VoteRule};
#[cfg(test)]
pub(in crate::correspondence) use votes::{Side, walk};

/// Factor on thr within which a candidate may still be decided by its neighbours (5·sd in all).
const READMISSION: f32 = 1.67;
/// Least such bound, turns (0.19 rad): at edges, where a pixel mixes surfaces, δ errs by more than the noise of the rest.
const MIN_READMISSION_TURNS: f32 = 0.03;
/// A round that decides or contradicts fewer than one pixel in so many is the last.
const SETTLED_SHARE: usize = 500;
/// Tolerance that every difference of δ meets.
const ANY_DELTA: i32 = TURN;
/// Share of the widest δ at which a candidate may be readmitted beyond which one side is too little to do so.
const RIM_SHARE: f32 = 0.8;

/// What the method reads.
#[derive(Clone, Copy)]
pub(in crate::correspondence) struct Scene<'a> {
    /// Phase of C1.
    pub(in crate::correspondence) cam1: &'a PhaseMap,
    /// Phase of C2 in the epipolar frame.
    pub(in crate::correspondence) cam2: &'a EpipolarImage,
    pub(in crate::correspondence) table: &'a SegmentTable,
    pub(in crate::correspondence) delta: &'a DeltaStatistics,
    pub(in crate::correspondence) settings: &'a ResolutionSettings,
}

/// Decisions about all pixels of C1, row by row.
#[derive(Clone, Debug)]
pub(in crate::correspondence) struct Decisions {
    pub(in crate::correspondence) outcomes: Vec<Outcome>,
    pub(in crate::correspondence) chosen: ChosenCandidates,
    /// Candidates of each pixel that pass the back-projection test with 3·sd.
    pub(in crate::correspondence) passing: Vec<u8>,
}

/// Decides every pixel.
pub(in crate::correspondence) fn resolve(scene: Scene<'_>) -> Decisions {
    let gate = scene.delta.gate();
    let threshold_turns = (READMISSION * gate.threshold_turns).max(MIN_READMISSION_TURNS);
    let readmission = DeltaGate { threshold_turns, ..gate };
    let candidates = find_candidates(scene.cam1, scene.cam2, scene.table, &readmission);
    let mut image = Image::new(scene, [gate, readmission], &candidates);
    image.resolve();
    let mut outcomes = image.outcomes.clone();
    explain_missing(scene.cam1, scene.cam2, scene.table, &mut outcomes, &Pool::default());
    Decisions { outcomes, chosen: image.chosen(), passing: image.passing }
}

/// An image, and what has been decided about it so far.
struct Image<'a> {
    scene: Scene<'a>,
    /// The back-projection test with 3·sd, and the wider one that all candidates pass.
    gate: DeltaGate,
    readmission: DeltaGate,
    candidates: &'a Candidates,
    /// Of every candidate whether it was contradicted.
    is_excluded: Vec<bool>,
    passing: Vec<u8>,
    outcomes: Vec<Outcome>,
    /// Absolute phase that each pixel is decided for, turns · 65536; [`ABSENT`] where it is not decided.
    absolute: Vec<i32>,
    /// δ and number of the candidate that it is decided for; without meaning elsewhere.
    delta: Vec<i16>,
    number: Vec<u8>,
    /// Difference of δ between neighbours of one surface that is tolerated, turns · 65536.
    tolerance: i32,
}

impl<'a> Image<'a> {
    /// An image of which nothing is decided yet.
    fn new(scene: Scene<'a>, [gate, readmission]: [DeltaGate; 2], candidates: &'a Candidates) -> Self {
        let pixels = scene.cam1.phase.len();
        let passing = |pixel: usize| candidates.for_pixel(pixel).iter().filter(|c| gate.passes(c.delta)).count() as u8;
        let passing: Vec<u8> = (0..pixels).into_par_iter().map(passing).collect();
        let outcome = |(pixel, &passing): (usize, &u8)| match (candidates.for_pixel(pixel), passing) {
            ([], _) => Outcome::NoCandidate,
            (_, 0) => Outcome::RejectedByDelta,
            _ => Outcome::Ambiguous,
        };
        Self {
            scene,
            gate,
            readmission,
            candidates,
            is_excluded: vec![false; candidates.all().len()],
            outcomes: passing.iter().enumerate().map(outcome).collect(),
            passing,
            absolute: vec![ABSENT; pixels],
            delta: vec![0; pixels],
            number: vec![0; pixels],
            tolerance: scene.delta.tolerance(),
        }
    }

    fn resolve(&mut self) {
        let pixels = self.absolute.len();
        let settled = |changed: usize| changed * SETTLED_SHARE < pixels;
        let strict = VoteRule::strict(self.scene.settings.min_votes);
        self.select_references();
        for round in 0..self.scene.settings.max_rounds {
            let decided = self.sweep_until_settled(Directions::Along, strict)
                + self.sweep_until_settled(Directions::AlongAndAcross, strict);
            if round > 0 && settled(decided) {
                break;
            }
            self.undecide_unsupported(Outcome::Contradicted);
            if settled(self.contradict_by_regions(Precedence::Foundation)) {
                break;
            }
        }
        self.is_excluded.fill(false);
        let strict_tolerance = std::mem::replace(&mut self.tolerance, ANY_DELTA);
        self.sweep_until_settled(Directions::AlongAndAcross, VoteRule::LENIENT);
        self.contradict_by_delta(strict_tolerance);
        self.contradict_by_regions(Precedence::Nearness);
        self.reject_rims();
    }

    /// Selects the reference correspondences: pixels with exactly one candidate that passes, supported by neighbours that
    /// have just one too (2.2.1).
    fn select_references(&mut self) {
        for pixel in 0..self.absolute.len() {
            let mut passing = (0..).zip(self.candidates.for_pixel(pixel)).filter(|(_, c)| self.gate.passes(c.delta));
            if let (Some((number, _)), None) = (passing.next(), passing.next()) {
                self.decide(pixel, number, Outcome::Reference);
            }
        }
        self.undecide_unsupported(Outcome::Ambiguous);
    }

    /// Undecides the pixels that their decided neighbours do not support.
    fn undecide_unsupported(&mut self, outcome: Outcome) {
        let mut support = Support::default();
        let rule = SupportRule { min_votes: self.scene.settings.min_votes, tolerance: self.tolerance };
        support.find(self.scene.cam1, &self.absolute, &self.delta, rule);
        for pixel in (0..self.absolute.len()).filter(|&pixel| !support.is_supported[pixel]) {
            self.undecide(pixel, outcome);
        }
    }

    /// Sweeps until nothing more is decided, a bounded number of times; yields how many pixels were (2.2.2, 2.2.3).
    fn sweep_until_settled(&mut self, directions: Directions, rule: VoteRule) -> usize {
        let outcome_of_several = match directions {
            Directions::Along => Outcome::AlongEpipolar,
            Directions::AlongAndAcross => Outcome::AcrossEpipolar,
        };
        let mut decided = 0;
        // Nobody is asked again unless a decision changed within reach of its walks.
        let mut is_asked = vec![true; self.absolute.len()];
        for _ in 0..self.scene.settings.max_sweeps {
            let choices = self.choices(directions, rule, &is_asked);
            if choices.is_empty() {
                break;
            }
            is_asked.fill(false);
            choices.iter().for_each(|&(pixel, _)| self.mark_within_reach(pixel, &mut is_asked));
            decided += choices.len();
            for (pixel, number) in choices {
                let has_several = self.candidates.for_pixel(pixel).len() > 1;
                self.decide(pixel, number, if has_several { outcome_of_several } else { Outcome::Unique });
            }
        }
        decided
    }

    /// Rejects candidates far beyond the threshold that only one side admits: there a surface is continued beyond its edge,
    /// onto a wall that C2 does not see.
    fn reject_rims(&mut self) {
        let threshold_turns = RIM_SHARE * self.readmission.threshold_turns;
        let rim = DeltaGate { threshold_turns, ..self.readmission };
        let is_rim = |&pixel: &usize| {
            self.is_decided(pixel) && !rim.passes(self.delta[pixel]) && self.supporting_sides(pixel) == 1
        };
        let rims: Vec<usize> = (0..self.absolute.len()).filter(is_rim).collect();
        rims.into_iter().for_each(|pixel| self.undecide(pixel, Outcome::RejectedByDelta));
    }

    fn is_decided(&self, pixel: usize) -> bool {
        self.absolute[pixel] != ABSENT
    }

    /// Absolute phase of a candidate of a pixel, turns · 65536.
    fn absolute_of(&self, pixel: usize, candidate: &Candidate) -> i32 {
        i32::from(candidate.order) * TURN + i32::from(self.scene.cam1.phase[pixel])
    }

    /// The candidate that a pixel is decided for.
    fn candidate(&self, pixel: usize) -> Option<&Candidate> {
        self.is_decided(pixel).then(|| &self.candidates.for_pixel(pixel)[usize::from(self.number[pixel])])
    }

    fn decide(&mut self, pixel: usize, number: u8, outcome: Outcome) {
        let candidate = &self.candidates.for_pixel(pixel)[usize::from(number)];
        self.absolute[pixel] = self.absolute_of(pixel, candidate);
        (self.delta[pixel], self.number[pixel], self.outcomes[pixel]) = (candidate.delta, number, outcome);
    }

    /// Takes a decision back, if there is one.
    fn undecide(&mut self, pixel: usize, outcome: Outcome) {
        if self.is_decided(pixel) {
            (self.absolute[pixel], self.outcomes[pixel]) = (ABSENT, outcome);
        }
    }

    /// Takes decisions back, and the candidates out.
    fn exclude(&mut self, pixels: &[usize]) {
        for &pixel in pixels {
            self.is_excluded[self.candidates.first_index(pixel) + usize::from(self.number[pixel])] = true;
            self.undecide(pixel, Outcome::Contradicted);
        }
    }

    fn chosen(&self) -> ChosenCandidates {
        let mut chosen = ChosenCandidates::default();
        chosen.resize(self.absolute.len());
        let width = self.scene.cam1.width.max(1);
        chosen.rows_mut(width).enumerate().for_each(|(v, mut row)| {
            (0..width).for_each(|u| row.set(u, self.candidate(v * width + u).copied()));
        });
        chosen
    }
}

#[cfg(test)]
mod tests;
