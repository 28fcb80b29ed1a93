//! Votes for the pixels of a block, and what δ the voters have.

use crate::simd::{LANES, Lanes};

use super::decision::Tally;

/// Those who say the same about each pixel of a block.
#[derive(Clone, Debug)]
pub(super) struct Tallies {
    pub(super) votes: [u16; LANES],
    /// Sums of their δ + 32768: high and low bytes.
    high: [u16; LANES],
    low: [u16; LANES],
}

/// The same in vectors, while they are counted.
#[derive(Clone, Copy)]
pub(super) struct Counting<L: Lanes> {
    lanes: L,
    votes: L::Words,
    high: L::Words,
    low: L::Words,
}

impl Tallies {
    pub(super) const NONE: Self = {
        let zero = [0; LANES];
        Self { votes: zero, high: zero, low: zero }
    };

    /// Those of a lane.
    #[inline(always)]
    pub(super) fn of(&self, lane: usize) -> Tally {
        let votes = self.votes[lane];
        let delta_sum = (i32::from(self.high[lane]) << 8) + i32::from(self.low[lane]) - 32768 * i32::from(votes);
        Tally { votes, delta_sum }
    }
}

impl<L: Lanes> Counting<L> {
    /// Counts from nothing.
    #[inline(always)]
    pub(super) fn new(lanes: L) -> Self {
        let zero = lanes.word(0);
        Self { lanes, votes: zero, high: zero, low: zero }
    }

    /// Counts on.
    #[inline(always)]
    pub(super) fn from(lanes: L, tallies: &Tallies) -> Self {
        let Tallies { votes, high, low } = tallies;
        Self { lanes, votes: lanes.load(votes), high: lanes.load(high), low: lanes.load(low) }
    }

    /// Adds voters, a pixel's each, with such δ.
    #[inline(always)]
    pub(super) fn add(&mut self, voters: L::Mask, delta: L::Words) {
        let (lanes, zero, one) = (self.lanes, self.lanes.word(0), self.lanes.word(1));
        self.votes = lanes.add(self.votes, lanes.select(voters, one, zero));
        let delta = lanes.add(delta, lanes.word(i16::MIN));
        let high = lanes.shift_right::<8>(delta);
        let low = lanes.sub(delta, lanes.shift_left::<8>(high));
        self.high = lanes.add(self.high, lanes.select(voters, high, zero));
        self.low = lanes.add(self.low, lanes.select(voters, low, zero));
    }

    #[inline(always)]
    pub(super) fn store(&self, tallies: &mut Tallies) {
        self.lanes.store(self.votes, &mut tallies.votes);
        self.lanes.store(self.high, &mut tallies.high);
        self.lanes.store(self.low, &mut tallies.low);
    }
}
