//! Absolute phase of a pixel from its Gray code and its wrapped phase. In: bits and phase. Out: the absolute phase, or
//! `None`. Cost: up to four readings per pixel.
//!
//! A bit too close to its threshold is read both ways. Each reading votes for the absolute phases that agree with its
//! cell:
//!
//! - At a border between two cells exactly one bit is unsure. There both readings agree with the wrapped phase, on the
//!   same absolute phase, which wins with two votes.
//! - Elsewhere, with half-period cells, the wrong reading is half a turn off, contradicts the wrapped phase and has no
//!   vote. With whole-period cells it has one vote, and so has the correct reading: a tie decides nothing.
//!
//! A cell without unsure bits that contradicts the wrapped phase decides nothing either.

use crate::geometry::FringePattern;

/// Turns by which the wrapped phase may exceed the border of its cell, because of blur and phase error.
const BORDER_TOLERANCE_TURNS: f64 = 0.1;
/// Pixels with more unsure bits stay undecided.
const MAX_UNSURE_BITS: usize = 2;

/// The Gray-code word of a pixel, and its unsure bits.
pub(super) struct Bits {
    word: u32,
    unsure: [u32; MAX_UNSURE_BITS],
    unsure_count: usize,
}

impl Bits {
    /// Reads the bits from grey levels minus threshold, most significant bit first. Within `margin` a bit is unsure.
    pub(super) fn read(above_threshold: impl ExactSizeIterator<Item = f32>, margin: f32) -> Self {
        let mut bits = Self { word: 0, unsure: [0; MAX_UNSURE_BITS], unsure_count: 0 };
        let top = above_threshold.len();
        for (k, level) in above_threshold.enumerate() {
            let bit = 1_u32 << (top - 1 - k);
            if level > 0.0 {
                bits.word |= bit;
            }
            if level.abs() < margin {
                if let Some(slot) = bits.unsure.get_mut(bits.unsure_count) {
                    *slot = bit;
                }
                bits.unsure_count += 1;
            }
        }
        bits
    }

    /// All possible words; none if too many bits are unsure.
    fn readings(&self) -> impl Iterator<Item = u32> + '_ {
        let count = if self.unsure_count > MAX_UNSURE_BITS { 0 } else { 1 << self.unsure_count };
        (0..count).map(|which: usize| {
            let flipped = self.unsure.iter().enumerate().filter(|&(k, _)| which >> k & 1 == 1);
            flipped.fold(self.word, |word, (_, bit)| word ^ bit)
        })
    }
}

/// Position of the cells of a code along the absolute phase.
pub(super) struct Cells {
    sign: f64,
    /// Column phase at the left edge of column 0, turns.
    origin_turns: f64,
    width_turns: f64,
}

impl Cells {
    pub(super) fn new(pattern: &FringePattern, width_turns: f64) -> Self {
        // Pixel centres are at integers, so the first cell begins at column −0.5.
        let origin_turns = pattern.sign * pattern.phase_turns(-0.5);
        Self { sign: pattern.sign, origin_turns, width_turns }
    }

    /// Absolute phase from the bits and a wrapped phase, turns; `None` if they do not determine it.
    pub(super) fn absolute_turns(&self, bits: &Bits, wrapped_turns: f64) -> Option<f64> {
        if bits.unsure_count == 0 {
            return self.nearest(bits.word, wrapped_turns);
        }
        let mut votes = Votes::default();
        for word in bits.readings() {
            for turns in self.consistent(word, wrapped_turns).into_iter().flatten() {
                votes.add(turns);
            }
        }
        votes.winner()
    }

    /// Absolute phase at the centre of the cell of a code word, turns.
    fn centre(&self, word: u32) -> f64 {
        self.sign * ((f64::from(binary_of_gray(word)) + 0.5) * self.width_turns + self.origin_turns)
    }

    /// The absolute phase closest to the centre of a cell, if it is within the cell or just beyond its border.
    fn nearest(&self, word: u32, wrapped_turns: f64) -> Option<f64> {
        let centre = self.centre(word);
        let turns = wrapped_turns + (centre - wrapped_turns).round();
        ((turns - centre).abs() <= self.width_turns / 2.0 + BORDER_TOLERANCE_TURNS).then_some(turns)
    }

    /// The absolute phases within a cell or just beyond its borders, at most two.
    fn consistent(&self, word: u32, wrapped_turns: f64) -> [Option<f64>; 2] {
        let reach = self.width_turns / 2.0 + BORDER_TOLERANCE_TURNS;
        let centre = self.centre(word);
        let below = wrapped_turns + (centre - wrapped_turns).floor();
        [below, below + 1.0].map(|turns| ((turns - centre).abs() <= reach).then_some(turns))
    }
}

/// Votes for absolute phases.
#[derive(Default)]
struct Votes {
    /// Absolute phase (turns) and its votes; at most two per reading.
    entries: [(f64, u32); 2 << MAX_UNSURE_BITS],
    count: usize,
}

impl Votes {
    fn add(&mut self, turns: f64) {
        // All candidates are whole turns apart.
        match self.entries[..self.count].iter_mut().find(|(t, _)| (*t - turns).abs() < 0.5) {
            Some((_, votes)) => *votes += 1,
            None => {
                self.entries[self.count] = (turns, 1);
                self.count += 1;
            }
        }
    }

    /// The absolute phase with the most votes; `None` if there is a tie.
    fn winner(&self) -> Option<f64> {
        let entries = &self.entries[..self.count];
        let most = entries.iter().map(|&(_, votes)| votes).max()?;
        let mut winners = entries.iter().filter(|&&(_, votes)| votes == most);
        let winner = winners.next()?;
        winners.next().is_none().then_some(winner.0)
    }
}

/// The number encoded by a binary-reflected Gray code.
fn binary_of_gray(word: u32) -> u32 {
    [16, 8, 4, 2, 1].into_iter().fold(word, |n, shift| n ^ n >> shift)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_binary_of_a_gray_code_is_its_inverse() {
        for n in 0..1_u32 << 12 {
            assert_eq!(binary_of_gray(n ^ n >> 1), n);
        }
        assert_eq!(binary_of_gray(0xFFFF_FFFF ^ 0xFFFF_FFFF >> 1), 0xFFFF_FFFF);
    }

    #[test]
    fn unsure_bits_are_read_both_ways() {
        let readings = |levels: [f32; 4]| -> Vec<u32> {
            let mut words: Vec<u32> = Bits::read(levels.into_iter(), 3.0).readings().collect();
            words.sort_unstable();
            words
        };
        assert_eq!(readings([50.0, -50.0, 50.0, 50.0]), [0b1011]);
        assert_eq!(readings([50.0, -50.0, -2.0, 50.0]), [0b1001, 0b1011]);
        assert_eq!(readings([2.0, -50.0, -2.0, 50.0]), [0b0001, 0b0011, 0b1001, 0b1011]);
        assert!(readings([2.0, -2.0, 1.0, 50.0]).is_empty());
    }
}
