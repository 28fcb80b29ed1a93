//! Claims on places of C2: one place serves one fringe order (paper, 2.2.3).

use crate::correspondence::neighbourhood::TURN;

/// Absolute phases in one place of C2 that differ by more than this are different orders.
const SAME_ORDER: i32 = TURN / 2;

/// The claim that holds a place.
#[derive(Clone, Copy, Debug)]
struct Owner {
    precedence: f32,
    absolute: i32,
}

/// A place without a claim.
const UNCLAIMED: Owner = Owner { precedence: f32::NEG_INFINITY, absolute: 0 };

/// A pixel's claim on a place.
#[derive(Clone, Copy)]
pub(super) struct Claim {
    /// Index of the place in the epipolar frame.
    pub(super) place: u32,
    /// The claim with the greatest precedence holds the place.
    pub(super) precedence: f32,
    /// Absolute phase, turns · 65536.
    pub(super) absolute: i32,
}

/// The strongest claim on each place of the epipolar frame.
#[derive(Clone, Debug, Default)]
pub(super) struct Claims {
    owners: Vec<Owner>,
}

impl Claims {
    /// Resets to `places` unclaimed places.
    pub(super) fn clear(&mut self, places: usize) {
        self.owners.clear();
        self.owners.resize(places, UNCLAIMED);
    }

    /// Adds a claim. Of equal ones the first keeps the place.
    #[inline(always)]
    pub(super) fn add(&mut self, claim: Claim) {
        let owner = &mut self.owners[claim.place as usize];
        if claim.precedence > owner.precedence {
            *owner = Owner { precedence: claim.precedence, absolute: claim.absolute };
        }
    }

    /// Whether another order holds the place of a claim, with a precedence that is greater by more than `handicap`.
    #[inline(always)]
    pub(super) fn is_lost(&self, claim: Claim, handicap: f32) -> bool {
        let place = claim.place as usize;
        // A surface that C2 sees larger than C1 leaves gaps between its claims. A gap between two claimed places counts
        // as claimed.
        self.loses(place, claim, handicap)
            || (self.loses(place.wrapping_sub(1), claim, handicap) && self.loses(place + 1, claim, handicap))
    }

    #[inline(always)]
    fn loses(&self, place: usize, claim: Claim, handicap: f32) -> bool {
        let owner = self.owners.get(place).unwrap_or(&UNCLAIMED);
        (owner.precedence > claim.precedence + handicap) & ((owner.absolute - claim.absolute).abs() > SAME_ORDER)
    }
}
