//! When the opinions of neighbours decide.

use super::super::neighbourhood::Opinions;

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

    /// Whether opinions support an absolute phase against all others.
    pub(super) fn supports(&self, absolute: i32, opinions: &Opinions) -> bool {
        let votes = opinions.votes_for(absolute);
        votes >= self.min_votes && votes * self.outweighed >= opinions.total - votes
    }

    /// The candidate that opinions decide for; `candidates` yields indices and absolute phases.
    pub(super) fn choose(&self, candidates: impl Iterator<Item = (usize, i32)>, opinions: &Opinions) -> Option<usize> {
        let (mut best, mut best_votes, mut all_votes) = (None, 0, 0);
        for (k, absolute) in candidates {
            let votes = opinions.votes_for(absolute);
            all_votes += votes;
            if votes > best_votes {
                (best, best_votes) = (Some((k, absolute)), votes);
            }
        }
        let (k, absolute) = best?;
        let leads = best_votes >= Self::LEAD * (all_votes - best_votes);
        (leads && self.supports(absolute, opinions)).then_some(k)
    }
}
