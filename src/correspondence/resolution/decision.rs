//! When what neighbours say decides (paper, Eq. 2).
//!
//! The back-projection phase makes the phase of a correspondence absolute: u = φ_p + order. A decided pixel k that a walk from p
//! meets after a phase rise s says: if p and k lie on one surface, then u_p = u_k − s. That is Eq. (2) with both
//! inequalities in one: k comes before p in C1 and c(k) before q in C2, by the same phase, less than 2π. In whole numbers it
//! holds exactly or not at all.

/// Those who say the same.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Tally {
    pub(super) votes: u16,
    /// Sum of their δ.
    pub(super) delta_sum: i32,
}

impl Tally {
    /// How many, if their δ differs from `delta` by no more than `tolerance`: over one surface δ changes slowly.
    #[inline(always)]
    fn votes_with(self, delta: i16, tolerance: i32) -> u16 {
        let votes = i32::from(self.votes);
        let off = self.delta_sum - i32::from(delta) * votes;
        if off.abs() <= tolerance * votes { self.votes } else { 0 }
    }
}

/// A candidate of a pixel, and what was said for it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Proposal {
    /// Number of the candidate.
    pub(super) k: u8,
    pub(super) delta: i16,
    pub(super) tally: Tally,
}

/// How many votes a candidate needs, and against what.
#[derive(Clone, Copy, Debug)]
pub(super) struct VoteRule {
    /// Decided pixels that must say the same.
    pub(super) min_votes: u16,
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

    /// Whether those who say the same support a candidate's δ, and its absolute phase against `total` who say anything.
    #[inline(always)]
    pub(super) fn supports(self, tally: Tally, total: u16, delta: i16, tolerance: i32) -> bool {
        let votes = tally.votes_with(delta, tolerance);
        votes >= self.min_votes && votes * self.outweighed >= total - votes
    }

    /// The candidate that `total` opinions decide for.
    #[inline(always)]
    pub(super) fn choose(
        self,
        proposals: impl Iterator<Item = Proposal>,
        total: u16,
        tolerance: i32,
    ) -> Option<Proposal> {
        let (mut best, mut best_votes, mut all_votes) = (None, 0, 0);
        for proposal in proposals {
            let votes = proposal.tally.votes_with(proposal.delta, tolerance);
            all_votes += votes;
            if votes > best_votes {
                (best, best_votes) = (Some(proposal), votes);
            }
        }
        let best = best?;
        let leads = best_votes >= Self::LEAD * (all_votes - best_votes);
        (leads && self.supports(best.tally, total, best.delta, tolerance)).then_some(best)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn votes_count_where_delta_agrees_on_the_average() {
        let tally = Tally { votes: 3, delta_sum: 120 };
        let rule = VoteRule::strict(3);
        assert!(rule.supports(tally, 6, 50, 10) && !rule.supports(tally, 7, 50, 10));
        assert!(!rule.supports(tally, 3, 51, 10) && !VoteRule::strict(4).supports(tally, 3, 40, 10));
        assert!(VoteRule::LENIENT.supports(Tally { votes: 2, delta_sum: 0 }, 10, 0, 0));
    }

    #[test]
    fn a_candidate_needs_a_lead() {
        let of = |k: u8, votes: u16| Proposal { k, delta: 0, tally: Tally { votes, delta_sum: 0 } };
        let choose =
            |a, b, total| VoteRule::strict(3).choose([of(0, a), of(1, b)].into_iter(), total, 5).map(|best| best.k);
        assert_eq!(choose(2, 4, 6), Some(1));
        assert_eq!(choose(6, 3, 9), Some(0));
        assert_eq!(choose(3, 2, 5), None);
        assert_eq!(choose(3, 0, 7), None);
        assert_eq!(choose(0, 0, 7), None);
    }
}
