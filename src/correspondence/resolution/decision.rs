//! When the opinions of neighbours decide.

use super::super::neighbourhood::{Opinions, Support};

/// Where a candidate stands: its absolute phase and δ, turns · 65536.
#[derive(Clone, Copy)]
pub(super) struct Stand {
    pub(super) absolute: i32,
    pub(super) delta: i16,
}

impl From<Stand> for (i32, i16) {
    fn from(stand: Stand) -> Self {
        (stand.absolute, stand.delta)
    }
}

/// How many votes a candidate needs, and against what.
pub(super) struct VoteRule {
    /// Decided pixels that must say the same.
    min_votes: u16,
    /// Opposing votes that one supporting vote outweighs, where the opposed order is no candidate of the pixel: then the
    /// opponent lies on another surface, or the right candidate is hidden.
    outweighed: u16,
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

    /// Whether decided pixels support a candidate's δ, and its absolute phase against all others.
    pub(super) fn supports(&self, support: Support, delta: i16, tolerance: i32) -> bool {
        let votes = support.votes_with(delta, tolerance);
        votes >= self.min_votes && votes * self.outweighed >= support.total - votes
    }

    /// The candidate that opinions decide for; `candidates` yields indices and where they stand.
    pub(super) fn choose(
        &self,
        candidates: impl Iterator<Item = (usize, Stand)>,
        opinions: &Opinions,
        tolerance: i32,
    ) -> Option<usize> {
        let (mut best, mut best_votes, mut all_votes) = (None, 0, 0);
        for (k, stand) in candidates {
            let votes = opinions.support(stand.absolute).votes_with(stand.delta, tolerance);
            all_votes += votes;
            if votes > best_votes {
                (best, best_votes) = (Some((k, stand)), votes);
            }
        }
        let (k, stand) = best?;
        let leads = best_votes >= Self::LEAD * (all_votes - best_votes);
        (leads && self.supports(opinions.support(stand.absolute), stand.delta, tolerance)).then_some(k)
    }
}
