//! Points, or reasons why there is none, from the decisions about all pixels.

use std::ops::Range;

use fringeflow_base::outcome::Outcome;
use rayon::prelude::*;

use super::confidence::{Confidence, OfPart};
use super::verdict::Verdict;
use super::{BEYOND, OPEN, Part, Pixels};
use crate::correspondence::chosen::ChosenRow;
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

/// A row of them.
struct WrittenRow<'a> {
    outcomes: &'a mut [Outcome],
    passing: &'a mut [u8],
    confidence: &'a mut [Confidence],
    chosen: ChosenRow<'a>,
}

impl WrittenRow<'_> {
    /// A pixel without a point.
    #[inline]
    fn nothing(&mut self, u: usize, outcome: Outcome) {
        (self.outcomes[u], self.passing[u], self.confidence[u]) = (outcome, 0, Confidence::NONE);
        self.chosen.set(u, None);
    }
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
        let rows = planes.into_par_iter().enumerate().map(|(v, (outcomes, passing, confidence, chosen))| {
            let mut written = WrittenRow { outcomes, passing, confidence, chosen };
            let mut counts = Counts::default();
            let mut has_segment = pool.take();
            has_segment.resize(width, 0);
            self.view.table.mark_segments(v, &mut has_segment);
            let mut begin = 0;
            while begin < width {
                // What follows from the part is the same for all its pixels beside each other.
                let first = v * width + begin;
                let of_part = (owner[first], state[first]);
                let of_row = owner[first..(v + 1) * width].iter().zip(&state[first..]);
                let end = begin + of_row.take_while(|(owner, state)| (**owner, **state) == of_part).count();
                let run = begin..end;
                begin = end;
                let (part, state) = of_part;
                if state != OPEN {
                    counts.decided += run.len() as u32;
                    counts.usable += run.len() as u32;
                }
                match state {
                    OPEN => run.for_each(|u| {
                        let is_usable = self.view.cam1.valid[v * width + u] && has_segment[u] != 0;
                        counts.usable += u32::from(is_usable);
                        written.nothing(u, self.reason(v * width + u, is_usable, written.outcomes[u]));
                    }),
                    BEYOND => run.for_each(|u| written.nothing(u, Outcome::OutsideVolume)),
                    _ => self.write_points((v, run), part, rest, &mut written, &mut counts.rests),
                }
            }
            counts
        });
        rows.reduce(Counts::default, Counts::merged)
    }

    /// Writes pixels of row `v` that belong to one part in the volume.
    fn write_points(
        &self,
        (v, columns): (usize, Range<usize>),
        part: u32,
        rest: &[i16],
        written: &mut WrittenRow<'_>,
        rests: &mut DeltaSums,
    ) {
        let part_of = &self.parts[part as usize];
        let outcome = match part_of {
            Part { candidates: 1, level: 0, .. } => Outcome::Reference,
            Part { candidates: 1, .. } => Outcome::Unique,
            _ => Outcome::AcrossEpipolar,
        };
        let first = v * self.view.cam1.width;
        let pixels = first + columns.start..first + columns.end;
        let of_part = OfPart {
            part: self.verdict.grounds_of_part(part),
            costs_nats: &self.verdict.costs_nats()[pixels.clone()],
            continuing: &self.continuing[pixels.clone()],
            depths: &self.depths[pixels],
        };
        of_part.write(&mut written.confidence[columns.clone()]);
        for u in columns {
            if written.confidence[u].probability() < self.min_confidence {
                written.nothing(u, Outcome::Ambiguous);
                continue;
            }
            (written.outcomes[u], written.passing[u]) = (outcome, part_of.candidates);
            // At rims, where pixels are adopted, two surfaces mix.
            if self.depths[first + u] == 0 {
                *rests = rests.merged(DeltaSums::of(rest[first + u]));
            }
        }
    }

    /// Why an open pixel has no point. `is_usable` tells whether it could have an order, `dropped` why a decision was
    /// taken back.
    fn reason(&self, pixel: usize, is_usable: bool, dropped: Outcome) -> Outcome {
        if dropped != Outcome::RejectedByDelta {
            dropped
        } else if is_usable {
            Outcome::RejectedByDelta
        } else if self.view.cam1.valid[pixel] {
            Outcome::OutsideVolume
        } else {
            Outcome::Invalid
        }
    }
}
