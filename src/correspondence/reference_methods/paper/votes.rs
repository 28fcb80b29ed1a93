//! Selection out of multiple candidates by the decided pixels around a pixel (paper, 2.2.2, Eq. 2).
//!
//! ```text
//! for each open pixel p:
//!     proposals = {}
//!     for each side of p: walk from p while the phase continues            "with maximal phase difference of 2π"
//!         for each decided pixel k on the walk, after a phase rise s: proposals += (u_k − s, δ_k)
//!     for each candidate c of p: votes(c) = proposals equal to u_c, if their mean δ agrees with δ_c    Eq. (2)
//!     decide for the candidate with most votes, if it has enough, leads the other candidates clearly,
//!         and outweighs the proposals that are no candidate                "If this holds for just one candidate"
//! ```
//!
//! Pixels k before p in phase are the paper's k_i, those behind it the g_i. A right candidate q has the absolute phase
//! u_k − s by every k on its surface, which is Eq. (2) with both inequalities in one; see
//! [`crate::correspondence::support`].

use rayon::prelude::*;

use crate::phase::PhaseMap;

use super::image::Image;
use crate::correspondence::candidates::Candidate;
use crate::correspondence::neighbourhood::{MAX_STEP, MAX_STEP_CHANGE, TURN, phase_step};
use crate::correspondence::segment_table::EpipolarAxis;
use crate::correspondence::support::NEAR;

/// Longest walk, pixels. A period is seldom longer, and Eq. (2) uses no more than one.
pub(super) const FAR: usize = 15;

/// Directions of the walks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Directions {
    /// Along the epipolar lines (2.2.2).
    Along,
    /// Perpendicular to them too (2.2.3).
    AlongAndAcross,
}

/// A side of a pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::correspondence) enum Side {
    Left,
    Right,
    Above,
    Below,
}

impl Side {
    pub(in crate::correspondence) const ALL: [Self; 4] = [Self::Left, Self::Right, Self::Above, Self::Below];
}

/// How many votes a candidate needs, and against how many others.
#[derive(Clone, Copy, Debug)]
pub(super) struct VoteRule {
    /// Least number of votes.
    min_votes: u16,
    /// Opposing proposals that one vote outweighs if they are no candidate of the pixel: they come from another
    /// surface, or the right candidate is hidden.
    outweighed: u16,
}

/// The absolute phase that a decided pixel proposes for another one.
#[derive(Clone, Copy, Debug)]
struct Proposal {
    /// The absolute phase that it proposes, turns · 65536.
    absolute: i32,
    /// Its own δ.
    delta: i16,
}

impl VoteRule {
    /// The rule beside settled regions.
    pub(super) const LENIENT: Self = Self { min_votes: 2, outweighed: 4 };
    /// Votes that a candidate needs for each vote for another candidate of the pixel.
    const LEAD: u16 = 2;

    /// The rule while nothing is settled.
    pub(super) fn strict(min_votes: u16) -> Self {
        Self { min_votes, outweighed: 1 }
    }

    /// The candidate that wins among `total` proposals, from the numbers of the candidates and their votes. "If this
    /// holds for just one candidate, it must not be valid for all the other possible candidates" (2.2.2).
    fn choose(self, votes: impl Iterator<Item = (u8, u16)>, total: u16) -> Option<u8> {
        let (mut best, mut best_votes, mut all_votes) = (None, 0, 0);
        for (number, votes) in votes {
            all_votes += votes;
            if votes > best_votes {
                (best, best_votes) = (Some(number), votes);
            }
        }
        // Two candidates with similar support: no unique decision is possible (2.2.2).
        let leads = best_votes >= Self::LEAD * (all_votes - best_votes);
        let outweighs = best_votes * self.outweighed >= total - best_votes;
        best.filter(|_| best_votes >= self.min_votes && leads && outweighs)
    }
}

/// Number of proposals of an absolute phase, Eq. (2). 0 if their mean δ differs from `delta` by more than `tolerance`:
/// over one surface δ changes slowly.
fn count_votes(proposals: &[Proposal], absolute: i32, delta: i16, tolerance: i32) -> u16 {
    let (mut votes, mut delta_sum) = (0, 0);
    for proposal in proposals.iter().filter(|proposal| proposal.absolute == absolute) {
        votes += 1;
        delta_sum += i32::from(proposal.delta);
    }
    let off = delta_sum - i32::from(delta) * votes;
    if off.abs() <= tolerance * votes { votes as u16 } else { 0 }
}

impl Image<'_> {
    /// The pending pixels that can be decided, and the numbers of their candidates (2.2.2).
    pub(super) fn choose_candidates(
        &self,
        directions: Directions,
        rule: VoteRule,
        is_pending: &[bool],
    ) -> Vec<(usize, u8)> {
        let sides = self.sides(directions);
        let is_open = |&pixel: &usize| {
            is_pending[pixel] && !self.is_decided(pixel) && !self.candidates.for_pixel(pixel).is_empty()
        };
        let choose = |proposals: &mut Vec<Proposal>, pixel: usize| {
            self.find_proposals(pixel, sides, proposals);
            if proposals.len() < usize::from(rule.min_votes) {
                return None;
            }
            let votes = self.remaining_candidates(pixel).map(|(number, candidate)| {
                let absolute = self.absolute_of(pixel, candidate);
                (number, count_votes(proposals, absolute, candidate.delta, self.tolerance))
            });
            rule.choose(votes, proposals.len() as u16).map(|number| (pixel, number))
        };
        (0..self.absolute.len()).into_par_iter().filter(is_open).map_init(Vec::new, choose).flatten().collect()
    }

    /// Marks the pixels whose walks may reach a pixel.
    pub(super) fn mark_within_reach(&self, pixel: usize, marked: &mut [bool]) {
        let [width, height] = [self.scene.view.cam1.width, self.scene.view.cam1.height];
        let (u, v) = (pixel % width, pixel / width);
        let columns = u.saturating_sub(FAR)..(u + FAR + 1).min(width);
        marked[v * width..][columns].fill(true);
        (v.saturating_sub(FAR)..(v + FAR + 1).min(height)).for_each(|v| marked[v * width + u] = true);
    }

    /// Candidates of a pixel that were not contradicted, with their numbers.
    fn remaining_candidates(&self, pixel: usize) -> impl Iterator<Item = (u8, &Candidate)> {
        let first = self.candidates.first_index(pixel);
        let all = (0..=u8::MAX).zip(self.candidates.for_pixel(pixel));
        all.filter(move |(number, _)| !self.is_excluded[first + usize::from(*number)])
    }

    /// The sides on which walks look.
    pub(super) fn sides(&self, directions: Directions) -> &'static [Side] {
        match (directions, self.scene.view.table.epipolar_axis()) {
            (Directions::AlongAndAcross, _) => &Side::ALL,
            (Directions::Along, EpipolarAxis::Horizontal) => &[Side::Left, Side::Right],
            (Directions::Along, EpipolarAxis::Vertical) => &[Side::Above, Side::Below],
        }
    }

    /// Searches the reference correspondences around a pixel (2.2.2: "Search for reference correspondences around p and
    /// q"). Replaces the content of `proposals`.
    fn find_proposals(&self, pixel: usize, sides: &[Side], proposals: &mut Vec<Proposal>) {
        proposals.clear();
        for &side in sides {
            walk(self.scene.view.cam1, pixel, side, FAR, |met, rise| {
                if self.is_decided(met) {
                    proposals.push(Proposal { absolute: self.absolute[met] - rise, delta: self.delta[met] });
                }
            });
        }
    }

    /// Number of sides on which decided pixels near a decided one propose the same absolute phase with a δ that passes.
    pub(super) fn supporting_sides(&self, pixel: usize) -> usize {
        let has_support = |&&side: &&Side| {
            let mut has = false;
            walk(self.scene.view.cam1, pixel, side, NEAR, |met, rise| {
                has |= self.is_decided(met)
                    && self.absolute[met] - rise == self.absolute[pixel]
                    && self.gate.passes(self.delta[met]);
            });
            has
        };
        Side::ALL.iter().filter(has_support).count()
    }
}

/// Unwraps the phase along a walk of at most `reach` steps. Calls `visit` with each pixel on the way, and the rise of
/// the phase to it, turns · 65536. The walk ends before a jump, a bend, or a full period ("maximal phase difference of
/// 2π", 2.2.2).
pub(in crate::correspondence) fn walk(
    cam1: &PhaseMap,
    from: usize,
    side: Side,
    reach: usize,
    mut visit: impl FnMut(usize, i32),
) {
    let (u, v) = (from % cam1.width, from / cam1.width);
    let (stride, available) = match side {
        Side::Left => (-1, u),
        Side::Right => (1, cam1.width - 1 - u),
        Side::Above => (-(cam1.width as isize), v),
        Side::Below => (cam1.width as isize, cam1.height - 1 - v),
    };
    let (mut here, mut rise, mut last_step) = (from, 0, None);
    for _ in 0..reach.min(available) {
        let next = here.wrapping_add_signed(stride);
        let step = phase_step(cam1.phase[here], cam1.phase[next]);
        rise += step;
        let bends = last_step.is_some_and(|last: i32| (step - last).abs() > MAX_STEP_CHANGE);
        if !cam1.valid[next] || step.abs() > MAX_STEP || bends || rise.abs() >= TURN {
            return;
        }
        visit(next, rise);
        (here, last_step) = (next, Some(step));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn votes_count_where_delta_agrees_on_the_average() {
        let proposal = |absolute: i32, delta: i16| Proposal { absolute, delta };
        let proposals = [proposal(7, 30), proposal(7, 50), proposal(9, 0), proposal(7, 40)];
        assert_eq!(count_votes(&proposals, 7, 50, 10), 3);
        assert_eq!(count_votes(&proposals, 7, 51, 10), 0);
        assert_eq!(count_votes(&proposals, 9, 1, 10), 1);
        assert_eq!(count_votes(&proposals, 8, 0, 10), 0);
    }

    #[test]
    fn a_candidate_needs_votes_and_a_lead() {
        let choose = |rule: VoteRule, a, b, total| rule.choose([(0, a), (1, b)].into_iter(), total);
        let strict = VoteRule::strict(3);
        assert_eq!(choose(strict, 2, 4, 6), Some(1));
        assert_eq!(choose(strict, 6, 3, 9), Some(0));
        assert_eq!(choose(strict, 3, 2, 5), None);
        assert_eq!(choose(strict, 3, 0, 6), Some(0));
        assert_eq!(choose(strict, 3, 0, 7), None);
        assert_eq!(choose(strict, 2, 0, 2), None);
        assert_eq!(choose(strict, 0, 0, 7), None);
        assert_eq!(choose(VoteRule::LENIENT, 2, 0, 10), Some(0));
        assert_eq!(choose(VoteRule::LENIENT, 2, 0, 11), None);
    }

    /// Pixels of a row or a column whose phase rises by `step` a pixel, with a jump of `jump` before pixel 6.
    fn line([width, height]: [usize; 2], step: i32, jump: i32) -> PhaseMap {
        let phase = |i: i32| (i * step + if i >= 6 { jump } else { 0 }) as u16;
        let (phase, valid) = ((0..12).map(phase).collect(), vec![true; 12]);
        PhaseMap { width, height, phase, valid, ..PhaseMap::default() }
    }

    /// Distances of the pixels met by the walks from pixel 5, and the rise of the phase to each.
    fn met(map: &PhaseMap) -> Vec<(i32, i32)> {
        let mut met = Vec::new();
        for side in Side::ALL {
            walk(map, 5, side, FAR, |pixel, rise| met.push((pixel as i32 - 5, rise)));
        }
        met.sort_unstable();
        met
    }

    #[test]
    fn walks_unwrap_for_less_than_a_period_and_end_at_jumps() {
        for size in [[12, 1], [1, 12]] {
            let distances =
                |step, jump| met(&line(size, step, jump)).into_iter().map(|(distance, _)| distance).collect::<Vec<_>>();
            assert_eq!(distances(7000, 0), [-5, -4, -3, -2, -1, 1, 2, 3, 4, 5, 6]);
            assert_eq!(distances(15000, 0), [-4, -3, -2, -1, 1, 2, 3, 4]);
            assert_eq!(distances(7000, 20000), [-5, -4, -3, -2, -1]);
            // A jump that looks like a moderate step shows by the change of slope one pixel later.
            assert_eq!(distances(7000, 9000), [-5, -4, -3, -2, -1, 1]);
            for (distance, rise) in met(&line(size, -7000, 0)) {
                assert_eq!(rise, -7000 * distance);
            }
        }
    }
}
