//! The candidates of all pixels of an image, by scanning every segment.

use rayon::prelude::*;

use crate::phase::PhaseMap;

use super::candidates::{Candidate, DeltaGate, scan_segment};
use super::epipolar_image::EpipolarImage;
use super::row_view::RowView;
use super::segment::SegmentRow;
use super::segment_table::SegmentTable;

/// Candidates of all pixels of C1, row by row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Candidates {
    /// Index of the first candidate of each pixel, and the number of candidates.
    begins: Vec<usize>,
    all: Vec<Candidate>,
}

/// Finds the candidates that pass `gate`, for every valid pixel of C1 that has a segment (paper, 2.3).
///
/// In: phase of C1 (raw pixels), phase of C2 in the epipolar frame, segment table of the rig. Cost: every column of
/// every segment.
#[must_use]
pub fn find_candidates(cam1: &PhaseMap, cam2: &EpipolarImage, table: &SegmentTable, gate: &DeltaGate) -> Candidates {
    let of_row = |segments: &mut SegmentRow, v: usize| {
        let (mut ends, mut found) = (Vec::with_capacity(cam1.width), Vec::new());
        table.row(v, segments);
        for u in 0..cam1.width {
            let (pixel, segment) = (v * cam1.width + u, segments.segment(u));
            if cam1.valid[pixel] && !segment.is_none() {
                let row = RowView::new(cam2, segment.row_px);
                scan_segment(&row, &segment, cam1.phase[pixel], gate, &mut found);
            }
            ends.push(found.len());
        }
        (ends, found)
    };
    let rows: Vec<_> = (0..cam1.height).into_par_iter().map_init(SegmentRow::default, of_row).collect();
    let mut candidates = Candidates { begins: vec![0], all: Vec::new() };
    for (ends, found) in rows {
        let before = candidates.all.len();
        candidates.begins.extend(ends.into_iter().map(|end| before + end));
        candidates.all.extend(found);
    }
    candidates
}

impl Candidates {
    /// Candidates of a pixel, by ascending column.
    #[must_use]
    #[inline]
    pub fn for_pixel(&self, pixel: usize) -> &[Candidate] {
        &self.all[self.begins[pixel]..self.begins[pixel + 1]]
    }

    /// All candidates, pixel by pixel.
    #[must_use]
    pub fn all(&self) -> &[Candidate] {
        &self.all
    }

    /// Index of the first candidate of a pixel among all.
    #[inline]
    pub(super) fn first_index(&self, pixel: usize) -> usize {
        self.begins[pixel]
    }

    /// The candidates of these pixels.
    #[cfg(test)]
    pub(super) fn from_pixels(pixels: &[Vec<Candidate>]) -> Self {
        let ends = pixels.iter().scan(0, |end, list| {
            *end += list.len();
            Some(*end)
        });
        Self { begins: std::iter::once(0).chain(ends).collect(), all: pixels.concat() }
    }
}
