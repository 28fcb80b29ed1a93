//! What decided pixels around a pixel say by Eq. (2): walks in straight lines, for less than a period, as long as the phase
//! runs on without a jump.

use super::super::TURN;
use super::Image;

/// Largest step of the phase from one pixel to the next of one surface, and largest change of the step, turns · 65536.
pub(super) const MAX_STEP: i32 = 24576;
const MAX_STEP_CHANGE: i32 = 4000;
/// Steps of a walk that asks whether a decision fits, and of one that looks for decided pixels.
const NEAR: usize = 3;
const FAR: usize = 16;
/// Different orders of one pixel that are told apart.
const MAX_OPINIONS: usize = 4;

/// Those who propose an absolute phase, and the sum of their δ; all who propose anything.
#[derive(Clone, Copy, Default)]
pub(super) struct Votes {
    absolute: i32,
    votes: u16,
    delta_sum: i32,
    total: u16,
}

/// When votes decide.
#[derive(Clone, Copy)]
pub(super) struct Rule {
    min_votes: u16,
    /// Opposing votes that one supporting vote outweighs.
    outweighed: u16,
}

/// What is proposed around a pixel.
pub(super) struct Opinions {
    proposals: Vec<Votes>,
    total: u16,
}

impl Votes {
    /// Those whose δ in the mean differs by no more than the tolerance.
    pub(super) fn with(&self, delta: i32, tolerance: i32) -> u16 {
        let votes = i32::from(self.votes);
        let off = self.delta_sum - delta * votes;
        if off.abs() <= tolerance.saturating_mul(votes) { self.votes } else { 0 }
    }
}

impl Rule {
    /// Beside regions that stand.
    pub(super) const LENIENT: Self = Self { min_votes: 2, outweighed: 4 };
    /// Supporters for each one of another candidate of the same pixel.
    pub(super) const LEAD: u16 = 2;

    pub(super) fn strict(min_votes: u16) -> Self {
        Self { min_votes, outweighed: 1 }
    }

    pub(super) fn supports(&self, votes: &Votes, delta: i32, tolerance: i32) -> bool {
        let supporting = votes.with(delta, tolerance);
        supporting >= self.min_votes && supporting * self.outweighed >= votes.total - supporting
    }
}

impl Opinions {
    /// The votes for an absolute phase.
    pub(super) fn votes(&self, absolute: i32) -> Votes {
        let known = self.proposals.iter().find(|proposal| proposal.absolute == absolute);
        Votes { total: self.total, ..known.copied().unwrap_or_default() }
    }
}

impl Image<'_> {
    /// What the decided pixels around a pixel propose.
    pub(super) fn opinions(&self, pixel: usize, also_across: bool) -> Opinions {
        let mut opinions = Opinions { proposals: Vec::new(), total: 0 };
        for (stride, room) in self.walks(pixel, FAR, also_across) {
            self.walk(pixel, stride, room, |absolute, delta| {
                opinions.total += 1;
                let known = opinions.proposals.len();
                match opinions.proposals.iter_mut().find(|proposal| proposal.absolute == absolute) {
                    Some(known) => (known.votes, known.delta_sum) = (known.votes + 1, known.delta_sum + delta),
                    None if known < MAX_OPINIONS => {
                        opinions.proposals.push(Votes { absolute, votes: 1, delta_sum: delta, total: 0 });
                    }
                    None => {}
                }
            });
        }
        opinions
    }

    /// What decided pixels next to a pixel say to an absolute phase.
    pub(super) fn votes_near(&self, pixel: usize, absolute: i32) -> Votes {
        let mut votes = Votes { absolute, ..Votes::default() };
        for (stride, room) in self.walks(pixel, NEAR, true) {
            self.walk(pixel, stride, room, |proposed, delta| {
                votes.total += 1;
                if proposed == absolute {
                    (votes.votes, votes.delta_sum) = (votes.votes + 1, votes.delta_sum + delta);
                }
            });
        }
        votes
    }

    /// On how many sides of a pixel there are decided ones that propose its absolute phase and pass the test.
    pub(super) fn supporting_sides(&self, pixel: usize) -> usize {
        let supports = |&(stride, room): &(isize, usize)| {
            let mut has_support = false;
            self.walk(pixel, stride, room, |proposed, delta| {
                has_support |= proposed == self.absolute[pixel] && self.limits.passes(delta);
            });
            has_support
        };
        self.walks(pixel, NEAR, true).iter().filter(|walk| supports(walk)).count()
    }

    /// Stride and greatest length of the walks from a pixel.
    fn walks(&self, pixel: usize, reach: usize, also_across: bool) -> [(isize, usize); 4] {
        let (u, v) = (pixel % self.width, pixel / self.width);
        let along_rows = if also_across || self.is_along_rows() { reach } else { 0 };
        let along_columns = if also_across || !self.is_along_rows() { reach } else { 0 };
        [
            (1, along_rows.min(self.width - 1 - u)),
            (-1, along_rows.min(u)),
            (self.width as isize, along_columns.min(self.height - 1 - v)),
            (-(self.width as isize), along_columns.min(v)),
        ]
    }

    /// Tells of each decided pixel of a walk the absolute phase that it proposes for its beginning, and its δ.
    fn walk(&self, pixel: usize, stride: isize, room: usize, mut tell: impl FnMut(i32, i32)) {
        let (mut at, mut risen, mut last_step): (usize, i32, Option<i32>) = (pixel, 0, None);
        for _ in 0..room {
            let next = at.wrapping_add_signed(stride);
            let step = i32::from(self.cam1.phase[next].wrapping_sub(self.cam1.phase[at]) as i16);
            risen += step;
            let bends = last_step.is_some_and(|last| (last - step).abs() > MAX_STEP_CHANGE);
            if !self.cam1.valid[next] || step.abs() > MAX_STEP || bends || risen.abs() >= TURN {
                return;
            }
            if self.chosen[next].is_some() {
                tell(self.absolute[next] - risen, self.delta(next));
            }
            (at, last_step) = (next, Some(step));
        }
    }
}
