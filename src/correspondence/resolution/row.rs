//! A row of the image while it is decided about: rows are changed side by side.

use crate::simd::LANES;

use super::super::grid::ones;
use super::super::outcome::Outcome;
use super::super::search;
use super::opinions::Directions;

/// A row and the decisions about it. Bits are those of its places, with a block of margin on either side.
pub(super) struct Row<'a> {
    pub(super) candidates: search::Row<'a>,
    pub(super) outcomes: &'a mut [Outcome],
    pub(super) decided: &'a mut [u32],
    pub(super) open: &'a mut [u32],
    pub(super) closed: &'a mut [u32],
    /// Where decisions changed since each kind of neighbours were asked.
    pub(super) unheard: [&'a mut [u32]; 3],
}

impl Row<'_> {
    /// Leaves those that are decided for now and not supported open, as all others with candidates; tells of each pixel
    /// what is known of it so far.
    pub(super) fn begin(&mut self, unsupported: &[u32], passing: &[u8], valid: &[u32]) {
        let blocks = self.outcomes.chunks_mut(LANES).zip(passing.chunks(LANES)).enumerate();
        for (b, (outcomes, passing)) in blocks.map(|(b, block)| (b + 1, block)) {
            let [_, _, by_decided] = &mut self.unheard;
            by_decided[b] = unsupported[b];
            let (any, references) = (self.candidates.any[b], self.decided[b] & !unsupported[b]);
            self.decided[b] = references;
            self.open[b] = any & !references;
            if references == u32::MAX {
                outcomes.fill(Outcome::Reference);
                continue;
            }
            if any == 0 && valid[b] == 0 {
                outcomes.fill(Outcome::Invalid);
                continue;
            }
            let (searched, elsewhere) = (self.candidates.searched[b], self.candidates.elsewhere[b]);
            for (k, (outcome, &passing)) in outcomes.iter_mut().zip(passing).enumerate() {
                let is_in = |bits: u32| bits >> k & 1 == 1;
                *outcome = match (is_in(references), is_in(any)) {
                    (true, _) => Outcome::Reference,
                    (_, true) if passing > 0 => Outcome::Ambiguous,
                    (_, true) => Outcome::RejectedByDelta,
                    _ if !is_in(valid[b]) => Outcome::Invalid,
                    _ if !is_in(searched) => Outcome::OutsideVolume,
                    _ if is_in(elsewhere) => Outcome::RejectedByDelta,
                    _ => Outcome::NoCandidate,
                };
            }
        }
    }

    /// Decides pixels: those with several candidates for the one that they have been given.
    pub(super) fn decide(&mut self, decided: &[u32], directions: Directions) {
        let of_several = match directions {
            Directions::Along => Outcome::AlongEpipolar,
            Directions::AlongAndAcross => Outcome::AcrossEpipolar,
        };
        for (b, &bits) in decided.iter().enumerate().filter(|(_, bits)| **bits != 0) {
            self.decided[b] |= bits;
            self.open[b] &= !bits;
            self.unheard.iter_mut().for_each(|unheard| unheard[b] |= bits);
            for k in ones(bits) {
                let u = (b - 1) * LANES + k;
                let has_several = self.candidates.several[b] >> k & 1 == 1;
                self.outcomes[u] = if has_several { of_several } else { Outcome::Unique };
                if has_several {
                    self.candidates.decide(u);
                }
            }
        }
    }

    /// Takes back the decisions of some pixels and opens them again.
    pub(super) fn undo(&mut self, contradicted: &[u32]) {
        for (b, &bits) in contradicted.iter().enumerate().filter(|(_, bits)| **bits != 0) {
            self.decided[b] &= !bits;
            self.open[b] |= bits;
            self.unheard.iter_mut().for_each(|unheard| unheard[b] |= bits);
            ones(bits).for_each(|k| self.outcomes[(b - 1) * LANES + k] = Outcome::Contradicted);
        }
    }

    /// Leaves out the candidates that some pixels were decided for; who has no other is closed.
    pub(super) fn exclude(&mut self, contradicted: &[u32]) {
        for (b, &bits) in contradicted.iter().enumerate().filter(|(_, bits)| **bits != 0) {
            let several = self.candidates.several[b];
            let mut closed = bits & !several;
            for k in ones(bits & several) {
                let number = self.candidates.number((b - 1) * LANES + k);
                closed |= u32::from(!self.candidates.lists.exclude(number)) << k;
            }
            self.open[b] &= !closed;
            self.closed[b] |= closed;
        }
    }

    /// Rejects decided pixels for their δ.
    pub(super) fn reject(&mut self, rejected: &[u32]) {
        for (b, &bits) in rejected.iter().enumerate().filter(|(_, bits)| **bits != 0) {
            self.decided[b] &= !bits;
            ones(bits).for_each(|k| self.outcomes[(b - 1) * LANES + k] = Outcome::RejectedByDelta);
        }
    }

    /// Leaves those that are not decided without candidate.
    pub(super) fn leave_undecided(&mut self) {
        let blocks = self.outcomes.len().div_ceil(LANES);
        for (block, &decided) in self.decided[1..=blocks].iter().enumerate() {
            self.candidates.chosen.keep(block * LANES, decided);
        }
    }
}
