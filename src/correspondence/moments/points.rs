//! Points, or reasons why there is none, from the decisions about all pixels.

use fringeflow_base::outcome::Outcome;
use rayon::prelude::*;

use super::confidence::Confidence;
use super::verdict::Verdict;
use super::{BEYOND, INSIDE, OPEN, Part, Pixels};
use crate::correspondence::delta_statistics::DeltaSums;
use crate::correspondence::pool::Pool;
use crate::correspondence::view::View;

/// What is counted over the pixels.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Counts {
    /// Pixels with an order, and those that could have one.
    pub(super) decided: u32,
    pub(super) usable: u32,
    /// δ less the field of the points that were not adopted.
    pub(super) rests: DeltaSums,
}

impl Counts {
    fn merged(self, other: Self) -> Self {
        Self {
            decided: self.decided + other.decided,
            usable: self.usable + other.usable,
            rests: self.rests.merged(other.rests),
        }
    }
}

/// The planes that are written.
pub(super) struct Written<'a> {
    pub(super) outcomes: &'a mut [Outcome],
    pub(super) passing: &'a mut [u8],
    pub(super) confidence: &'a mut [Confidence],
}

/// What the points follow from.
pub(super) struct Foundation<'a> {
    pub(super) view: View<'a>,
    pub(super) parts: &'a [Part],
    pub(super) verdict: &'a Verdict,
    /// How many of the eight pixels around each pixel continue it.
    pub(super) continuing: &'a [u8],
    /// Depth at which each pixel was adopted.
    pub(super) depths: &'a [u8],
    pub(super) min_confidence: f32,
}

impl Foundation<'_> {
    /// Writes the outcome, the confidence and the number of passing candidates of every pixel, and removes the chosen
    /// candidates of those without a point. `outcomes` tell which pixels were dropped.
    pub(super) fn write(&self, pixels: &mut Pixels<'_>, decisions: &mut Written<'_>, pool: &Pool<Vec<u8>>) -> Counts {
        let Written { outcomes, passing, confidence } = decisions;
        let width = self.view.cam1.width;
        let (owner, state, rest) = (&*pixels.owner, &*pixels.state, &*pixels.rest);
        let planes = (
            outcomes.par_chunks_mut(width),
            passing.par_chunks_mut(width),
            confidence.par_chunks_mut(width),
            pixels.chosen.rows_mut(width),
        );
        let rows = planes.into_par_iter().enumerate().map(|(v, (outcomes, passing, confidence, mut chosen))| {
            let mut counts = Counts::default();
            let mut has_segment = pool.take();
            has_segment.resize(width, 0);
            self.view.table.mark_segments(v, &mut has_segment);
            for u in 0..width {
                let pixel = v * width + u;
                let is_usable = state[pixel] != OPEN || (self.view.cam1.valid[pixel] && has_segment[u] != 0);
                let mut outcome = self.outcome(pixel, state[pixel], owner[pixel], is_usable, outcomes[u]);
                (passing[u], confidence[u]) = (0, Confidence::NONE);
                counts.decided += u32::from(state[pixel] != OPEN);
                counts.usable += u32::from(is_usable);
                if outcome.is_found() {
                    let own = Confidence::of(&self.verdict.grounds(
                        pixel,
                        owner[pixel],
                        [self.continuing[pixel], self.depths[pixel]],
                    ));
                    if own.probability() < self.min_confidence {
                        outcome = Outcome::Ambiguous;
                    } else {
                        (passing[u], confidence[u]) = (self.parts[owner[pixel] as usize].candidates, own);
                        // At rims, where pixels are adopted, two surfaces mix.
                        if self.depths[pixel] == 0 {
                            counts.rests = counts.rests.merged(DeltaSums::of(rest[pixel]));
                        }
                    }
                }
                if !outcome.is_found() {
                    chosen.set(u, None);
                }
                outcomes[u] = outcome;
            }
            counts
        });
        rows.reduce(Counts::default, Counts::merged)
    }

    /// The outcome of a pixel before its confidence is known. `is_usable` tells whether it could have an order, `dropped`
    /// why a decision was taken back.
    fn outcome(&self, pixel: usize, state: u8, owner: u32, is_usable: bool, dropped: Outcome) -> Outcome {
        match state {
            INSIDE => match self.parts[owner as usize] {
                Part { candidates: 1, level: 0, .. } => Outcome::Reference,
                Part { candidates: 1, .. } => Outcome::Unique,
                _ => Outcome::AcrossEpipolar,
            },
            BEYOND => Outcome::OutsideVolume,
            _ if dropped != Outcome::RejectedByDelta => dropped,
            _ if is_usable => Outcome::RejectedByDelta,
            _ if self.view.cam1.valid[pixel] => Outcome::OutsideVolume,
            _ => Outcome::Invalid,
        }
    }
}
