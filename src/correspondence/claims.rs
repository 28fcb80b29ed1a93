//! Claims on places of C2: one place serves one order (paper, 2.2.3).

use super::neighbourhood::TURN;

/// Absolute phases in one place of C2 that differ by more than this are different orders.
const SAME_ORDER: i32 = TURN / 2;

/// Who has a place.
#[derive(Clone, Copy, Debug)]
struct Owner {
    precedence: f32,
    absolute: i32,
}

/// Nobody has it.
const NOBODY: Owner = Owner { precedence: f32::NEG_INFINITY, absolute: 0 };

/// A claim on a place.
#[derive(Clone, Copy)]
pub(super) struct Claim {
    /// Index of the place in the epipolar frame.
    pub(super) place: u32,
    pub(super) precedence: f32,
    /// Absolute phase, turns · 65536.
    pub(super) absolute: i32,
}

/// For each place of the epipolar frame the greatest precedence, and the absolute phase that has it.
#[derive(Clone, Debug, Default)]
pub(super) struct Claims {
    owners: Vec<Owner>,
}

impl Claims {
    /// Nobody claims any of so many places.
    pub(super) fn clear(&mut self, places: usize) {
        self.owners.clear();
        self.owners.resize(places, NOBODY);
    }

    /// Takes a claim into account: of equal ones the first has the place.
    #[inline(always)]
    pub(super) fn make(&mut self, claim: Claim) {
        let owner = &mut self.owners[claim.place as usize];
        if claim.precedence > owner.precedence {
            *owner = Owner { precedence: claim.precedence, absolute: claim.absolute };
        }
    }

    /// Whether another order takes the place: its precedence must be greater by more than a handicap.
    #[inline(always)]
    pub(super) fn is_lost(&self, claim: Claim, handicap: f32) -> bool {
        let place = claim.place as usize;
        // A surface that C2 sees larger than C1 leaves gaps between its claims; a gap between two is claimed too.
        self.loses(place, claim, handicap)
            || (self.loses(place.wrapping_sub(1), claim, handicap) && self.loses(place + 1, claim, handicap))
    }

    #[inline(always)]
    fn loses(&self, place: usize, claim: Claim, handicap: f32) -> bool {
        let owner = self.owners.get(place).unwrap_or(&NOBODY);
        (owner.precedence > claim.precedence + handicap) & ((owner.absolute - claim.absolute).abs() > SAME_ORDER)
    }
}
