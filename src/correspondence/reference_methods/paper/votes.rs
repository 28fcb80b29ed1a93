//! What the decided pixels around a pixel say about its candidates (paper, Eq. 2), and when that decides.
//!
//! Around p the phase is unwrapped along straight walks, left and right, up and down, for less than one period and only as
//! long as it runs on without a jump. A decided pixel k that is met after a phase rise s proposes the absolute phase u_k − s,
//! see [`crate::correspondence::support`].

use rayon::prelude::*;

use crate::phase::PhaseMap;

use super::Image;
use crate::correspondence::candidates::Candidate;
use crate::correspondence::neighbourhood::{MAX_STEP, MAX_STEP_CHANGE, TURN};
use crate::correspondence::segment_table::EpipolarAxis;
use crate::correspondence::support::NEAR;

/// Pixels of the farthest walk; a period is seldom longer, and one period is all that Eq. (2) uses.
const FAR: usize = 15;

/// Which walks are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Directions {
    /// Along the epipolar direction.
    Along,
    /// Along and across it.
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

/// How many votes a candidate needs, and against what.
#[derive(Clone, Copy, Debug)]
pub(super) struct VoteRule {
    /// Decided pixels that must say the same.
    min_votes: u16,
    /// Opposing votes that one supporting vote outweighs, where the opposed order is no candidate of the pixel: then the
    /// opponent lies on another surface, or the right candidate is hidden.
    outweighed: u16,
}

/// What a decided pixel says.
#[derive(Clone, Copy, Debug)]
struct Opinion {
    /// The absolute phase that it proposes, turns · 65536.
    absolute: i32,
    /// Its own δ.
    delta: i16,
}

impl VoteRule {
    /// Beside regions that are settled already.
    pub(super) const LENIENT: Self = Self { min_votes: 2, outweighed: 4 };
    /// Supporters that a candidate must have for each one of another candidate of the same pixel.
    const LEAD: u16 = 2;

    /// The rule while nothing is settled.
    pub(super) fn strict(min_votes: u16) -> Self {
        Self { min_votes, outweighed: 1 }
    }

    /// The candidate that `total` opinions decide for; in: numbers of candidates and the votes for each.
    fn choose(self, votes: impl Iterator<Item = (u8, u16)>, total: u16) -> Option<u8> {
        let (mut best, mut best_votes, mut all_votes) = (None, 0, 0);
        for (number, votes) in votes {
            all_votes += votes;
            if votes > best_votes {
                (best, best_votes) = (Some(number), votes);
            }
        }
        let leads = best_votes >= Self::LEAD * (all_votes - best_votes);
        let outweighs = best_votes * self.outweighed >= total - best_votes;
        best.filter(|_| best_votes >= self.min_votes && leads && outweighs)
    }
}

/// How many propose an absolute phase, if their mean δ differs from `delta` by no more than `tolerance`: over one surface δ
/// changes slowly.
fn votes_for(opinions: &[Opinion], absolute: i32, delta: i16, tolerance: i32) -> u16 {
    let (mut votes, mut delta_sum) = (0, 0);
    for opinion in opinions.iter().filter(|opinion| opinion.absolute == absolute) {
        votes += 1;
        delta_sum += i32::from(opinion.delta);
    }
    let off = delta_sum - i32::from(delta) * votes;
    if off.abs() <= tolerance * votes { votes as u16 } else { 0 }
}

impl Image<'_> {
    /// Open pixels that can be decided, of those that are asked, and for which of their candidates.
    pub(super) fn choices(&self, directions: Directions, rule: VoteRule, is_asked: &[bool]) -> Vec<(usize, u8)> {
        let sides = self.sides(directions);
        let is_open =
            |&pixel: &usize| is_asked[pixel] && !self.is_decided(pixel) && !self.candidates.for_pixel(pixel).is_empty();
        let choose = |opinions: &mut Vec<Opinion>, pixel: usize| {
            self.hear(pixel, sides, opinions);
            if opinions.len() < usize::from(rule.min_votes) {
                return None;
            }
            let votes = self.eligible(pixel).map(|(number, candidate)| {
                let absolute = self.absolute_of(pixel, candidate);
                (number, votes_for(opinions, absolute, candidate.delta, self.tolerance))
            });
            rule.choose(votes, opinions.len() as u16).map(|number| (pixel, number))
        };
        (0..self.absolute.len()).into_par_iter().filter(is_open).map_init(Vec::new, choose).flatten().collect()
    }

    /// Marks the pixels from which a walk may come to a pixel.
    pub(super) fn mark_within_reach(&self, pixel: usize, marked: &mut [bool]) {
        let [width, height] = [self.scene.cam1.width, self.scene.cam1.height];
        let (u, v) = (pixel % width, pixel / width);
        let columns = u.saturating_sub(FAR)..(u + FAR + 1).min(width);
        marked[v * width..][columns].fill(true);
        (v.saturating_sub(FAR)..(v + FAR + 1).min(height)).for_each(|v| marked[v * width + u] = true);
    }

    /// Candidates of a pixel that were not contradicted, with their numbers.
    fn eligible(&self, pixel: usize) -> impl Iterator<Item = (u8, &Candidate)> {
        let first = self.candidates.first_index(pixel);
        let all = (0..=u8::MAX).zip(self.candidates.for_pixel(pixel));
        all.filter(move |(number, _)| !self.is_excluded[first + usize::from(*number)])
    }

    fn sides(&self, directions: Directions) -> &'static [Side] {
        match (directions, self.scene.table.epipolar_axis()) {
            (Directions::AlongAndAcross, _) => &Side::ALL,
            (Directions::Along, EpipolarAxis::Horizontal) => &[Side::Left, Side::Right],
            (Directions::Along, EpipolarAxis::Vertical) => &[Side::Above, Side::Below],
        }
    }

    /// The opinions of all decided pixels around a pixel, instead of those before.
    fn hear(&self, pixel: usize, sides: &[Side], opinions: &mut Vec<Opinion>) {
        opinions.clear();
        for &side in sides {
            walk(self.scene.cam1, pixel, side, FAR, |met, rise| {
                if self.is_decided(met) {
                    opinions.push(Opinion { absolute: self.absolute[met] - rise, delta: self.delta[met] });
                }
            });
        }
    }

    /// On how many sides of a decided pixel decided ones near it say the same, with a δ that passes the test.
    pub(super) fn supporting_sides(&self, pixel: usize) -> usize {
        let has_support = |&&side: &&Side| {
            let mut has = false;
            walk(self.scene.cam1, pixel, side, NEAR, |met, rise| {
                has |= self.is_decided(met)
                    && self.absolute[met] - rise == self.absolute[pixel]
                    && self.gate.passes(self.delta[met]);
            });
            has
        };
        Side::ALL.iter().filter(has_support).count()
    }
}

/// Tells of each pixel that a walk of at most `reach` steps meets, and by how much the phase has risen on the way,
/// turns · 65536.
pub(in crate::correspondence) fn walk(
    cam1: &PhaseMap,
    from: usize,
    side: Side,
    reach: usize,
    mut visit: impl FnMut(usize, i32),
) {
    let (u, v) = (from % cam1.width, from / cam1.width);
    let (stride, scratch) = match side {
        Side::Left => (-1, u),
        Side::Right => (1, cam1.width - 1 - u),
        Side::Above => (-(cam1.width as isize), v),
        Side::Below => (cam1.width as isize, cam1.height - 1 - v),
    };
    let (mut here, mut rise, mut last_step) = (from, 0, None);
    for _ in 0..reach.min(scratch) {
        let next = here.wrapping_add_signed(stride);
        let step = i32::from(cam1.phase[next].wrapping_sub(cam1.phase[here]) as i16);
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
        let opinion = |absolute: i32, delta: i16| Opinion { absolute, delta };
        let opinions = [opinion(7, 30), opinion(7, 50), opinion(9, 0), opinion(7, 40)];
        assert_eq!(votes_for(&opinions, 7, 50, 10), 3);
        assert_eq!(votes_for(&opinions, 7, 51, 10), 0);
        assert_eq!(votes_for(&opinions, 9, 1, 10), 1);
        assert_eq!(votes_for(&opinions, 8, 0, 10), 0);
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

    /// Distances of the pixels met by the walks from pixel 5, and by how much the phase has risen.
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
            // A jump that hides as a moderate step is betrayed by its change of slope one pixel on.
            assert_eq!(distances(7000, 9000), [-5, -4, -3, -2, -1, 1]);
            for (distance, rise) in met(&line(size, -7000, 0)) {
                assert_eq!(rise, -7000 * distance);
            }
        }
    }
}
