//! The proposed algorithm PA as the paper describes it (section 2.2): from the candidates of all pixels to at most one
//! correspondence each, pixel by pixel.
//!
//! In: phase of C1 and C2, the segment table, statistics of δ. Out: for each pixel of C1 its correspondence, or why it
//! has none. This is the scalar reference: plain loops, no state from image to image. It makes the paper's tables, and
//! benches compare it with the product's. The paper leaves the numbers of its steps open; ours are the
//! constants below.
//!
//! ```text
//! candidates(p) = points q of the segment of p with φ(q) = φ(p) and |δ(q) − mean| < 5·sd           2.1, 2.3
//! decide p for its candidate with |δ − mean| < 3·sd, if it has exactly one                         2.2.1
//! reject what decided neighbours do not support                                                    2.2.1
//! reject what violates the monotony along the epipolar line: the reference correspondences are left 2.2.1
//! repeat for a bounded number of rounds:                                                           2.2.3, at the end
//!     decide by Eq. (2) from decided pixels along the epipolar direction, until nothing changes    2.2.2
//!     the same with decided pixels across the epipolar direction too                               2.2.3
//!     reject what decided neighbours do not support any more                                       2.2.2
//!     reject and exclude what violates the monotony along the epipolar line                        2.2.3
//!     divide the decided pixels into regions of continuous absolute phase                          2.2.3
//!     reject and exclude regions that are small, whose δ is not level, or that lose their places in C2
//!     reject and exclude pixels whose place in C2 serves another order of a better founded region
//! admit excluded candidates again; decide with fewer votes: pixels at borders join the regions     2.2.3
//! reject regions whose δ is not level; of two orders in one place of C2 keep the nearer one
//! reject candidates far beyond 3·sd with support on one side only
//! ```
//!
//! A sweep reads the decisions of the sweep before, so the result does not depend on the number of threads. A candidate
//! between 3·sd and 5·sd is decided by its neighbourhood alone: 3·sd keeps 99.73 % of normal errors, and edges err by
//! more.

mod claims;
mod contradictions;
mod explanation;
mod image;
mod monotony;
mod region_delta;
mod regions;
mod votes;

use fringeflow_base::outcome::Outcome;

use crate::correspondence::candidates::DeltaGate;
use crate::correspondence::chosen::ChosenCandidates;
use crate::correspondence::neighbourhood::TURN;
use crate::correspondence::pool::Pool;
use crate::correspondence::search::find_candidates;
use crate::correspondence::support::{Support, SupportRule};

use contradictions::Precedence;
use explanation::explain_missing;
use image::Image;
pub(in crate::correspondence) use image::Scene;
use votes::{Directions, VoteRule};
#[cfg(test)]
pub(in crate::correspondence) use votes::{Side, walk};

/// Factor on thr up to which neighbours may decide for a candidate (5·sd in all).
const READMISSION: f32 = 1.67;
/// Least such limit, turns (0.19 rad): at edges, where a pixel mixes surfaces, δ errs by more than noise.
const MIN_READMISSION_TURNS: f32 = 0.03;
/// A round that changes fewer than one pixel in this many is the last.
const SETTLED_SHARE: usize = 500;
/// A tolerance that every difference of δ meets.
const ANY_DELTA: i32 = TURN;
/// Share of the wider limit beyond which support on one side is not enough.
const RIM_SHARE: f32 = 0.8;

/// Decisions about all pixels of C1, row by row.
#[derive(Clone, Debug)]
pub(in crate::correspondence) struct Decisions {
    pub(in crate::correspondence) outcomes: Vec<Outcome>,
    pub(in crate::correspondence) chosen: ChosenCandidates,
    /// Candidates of each pixel that pass the back-projection test with 3·sd.
    pub(in crate::correspondence) passing: Vec<u8>,
}

/// Decides every pixel (2.2, steps 1 to 4).
pub(in crate::correspondence) fn resolve(scene: Scene<'_>) -> Decisions {
    let gate = scene.delta.gate();
    let threshold_turns = (READMISSION * gate.threshold_turns).max(MIN_READMISSION_TURNS);
    let readmission = DeltaGate { threshold_turns, ..gate };
    let candidates = find_candidates(scene.view.cam1, scene.view.cam2, scene.view.table, &readmission);
    let mut image = Image::new(scene, [gate, readmission], &candidates);
    image.resolve();
    let mut outcomes = image.outcomes.clone();
    explain_missing(scene.view, &mut outcomes, &Pool::default());
    Decisions { outcomes, chosen: image.chosen(), passing: image.passing }
}

impl Image<'_> {
    /// Applies the steps iteratively (2.2.3: "The complete correspondence finding will be obtained by iterative
    /// application").
    fn resolve(&mut self) {
        let pixels = self.absolute.len();
        let settled = |changed: usize| changed * SETTLED_SHARE < pixels;
        let strict = VoteRule::strict(self.scene.settings.min_votes);
        self.select_reference_correspondences();
        for round in 0..self.scene.settings.max_rounds {
            let decided = self.decide_multiple_candidates(Directions::Along, strict)
                + self.decide_multiple_candidates(Directions::AlongAndAcross, strict);
            if round > 0 && settled(decided) {
                break;
            }
            self.reject_unsupported(Outcome::Contradicted);
            self.exclude(&self.violate_monotony());
            if settled(self.reject_by_contradictions(Precedence::Foundation)) {
                break;
            }
        }
        // Candidates that were excluded beside a wrong region may be right now that the region is gone.
        self.is_excluded.fill(false);
        let strict_tolerance = std::mem::replace(&mut self.tolerance, ANY_DELTA);
        self.decide_multiple_candidates(Directions::AlongAndAcross, VoteRule::LENIENT);
        self.reject_by_region_delta(strict_tolerance);
        self.reject_by_contradictions(Precedence::Nearness);
        self.reject_rims();
    }

    /// Step 1, selection of reference correspondences (2.2.1): pixels with exactly one candidate that passes, supported
    /// by neighbours that are unique and similar too, without violation of the monotony.
    fn select_reference_correspondences(&mut self) {
        for pixel in 0..self.absolute.len() {
            let mut passing = (0..).zip(self.candidates.for_pixel(pixel)).filter(|(_, c)| self.gate.passes(c.delta));
            if let (Some((number, _)), None) = (passing.next(), passing.next()) {
                self.decide(pixel, number, Outcome::Reference);
            }
        }
        self.reject_unsupported(Outcome::Ambiguous);
        self.violate_monotony().into_iter().for_each(|pixel| self.undecide(pixel, Outcome::Ambiguous));
    }

    /// Step 3, decision whether uncertain correspondences are true or false (2.2.2): rejects the pixels that their
    /// decided neighbours do not support.
    fn reject_unsupported(&mut self, outcome: Outcome) {
        let mut support = Support::default();
        let rule = SupportRule { min_votes: self.scene.settings.min_votes, tolerance: self.tolerance };
        support.find(self.scene.view.cam1, &self.absolute, &self.delta, rule);
        for pixel in (0..self.absolute.len()).filter(|&pixel| !support.is_supported[pixel]) {
            self.undecide(pixel, outcome);
        }
    }

    /// Step 2, selection out of the points with multiple candidates (2.2.2; across the epipolar lines too, 2.2.3).
    /// Repeats sweeps until nothing changes, a bounded number of times. Returns the number of decided pixels.
    fn decide_multiple_candidates(&mut self, directions: Directions, rule: VoteRule) -> usize {
        let outcome_of_several = match directions {
            Directions::Along => Outcome::AlongEpipolar,
            Directions::AlongAndAcross => Outcome::AcrossEpipolar,
        };
        let mut decided = 0;
        // A pixel is tried again only if a decision within reach of its walks changed.
        let mut is_pending = vec![true; self.absolute.len()];
        for _ in 0..self.scene.settings.max_sweeps {
            let choices = self.choose_candidates(directions, rule, &is_pending);
            if choices.is_empty() {
                break;
            }
            is_pending.fill(false);
            choices.iter().for_each(|&(pixel, _)| self.mark_within_reach(pixel, &mut is_pending));
            decided += choices.len();
            for (pixel, number) in choices {
                let has_several = self.candidates.for_pixel(pixel).len() > 1;
                self.decide(pixel, number, if has_several { outcome_of_several } else { Outcome::Unique });
            }
        }
        decided
    }

    /// Additional decision (2.2.3): rejects candidates far beyond the threshold with support on one side only. There a
    /// surface is continued beyond its edge, onto a wall that C2 does not see.
    fn reject_rims(&mut self) {
        let threshold_turns = RIM_SHARE * self.readmission.threshold_turns;
        let rim = DeltaGate { threshold_turns, ..self.readmission };
        let is_rim = |&pixel: &usize| {
            self.is_decided(pixel) && !rim.passes(self.delta[pixel]) && self.supporting_sides(pixel) == 1
        };
        let rims: Vec<usize> = (0..self.absolute.len()).filter(is_rim).collect();
        rims.into_iter().for_each(|pixel| self.undecide(pixel, Outcome::RejectedByDelta));
    }
}

#[cfg(test)]
mod tests;
