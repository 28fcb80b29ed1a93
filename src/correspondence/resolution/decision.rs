//! When the opinions of neighbours decide.

use super::super::neighbourhood::Opinions;

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

impl Stand {
    fn votes(self, opinions: &Opinions, tolerance: i32) -> u16 {
        opinions.votes_for(self.absolute, self.delta, tolerance)
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

    /// Whether opinions support a stand against all others.
    pub(super) fn supports(&self, stand: Stand, opinions: &Opinions, tolerance: i32) -> bool {
        let votes = stand.votes(opinions, tolerance);
        votes >= self.min_votes && votes * self.outweighed >= opinions.total - votes
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
            let votes = stand.votes(opinions, tolerance);
            all_votes += votes;
            if votes > best_votes {
                (best, best_votes) = (Some((k, stand)), votes);
            }
        }
        let (k, stand) = best?;
        let leads = best_votes >= Self::LEAD * (all_votes - best_votes);
        (leads && self.supports(stand, opinions, tolerance)).then_some(k)
    }
}
