//! The candidates of all pixels of an image.

use rayon::prelude::*;

use crate::phase::PhaseMap;

use super::candidates::{Candidate, DeltaGate, plain_scan, projector_side_search};
use super::epipolar_image::EpipolarImage;
use super::row_view::RowView;
use super::segment::SegmentRow;
use super::segment_table::SegmentTable;

/// How candidates are searched; all forms yield the same bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SearchForm {
    /// Every pair of columns of the segment: the oracle.
    PlainScan,
    /// One interval of columns a fringe order.
    ProjectorSide,
}

/// Candidates of all pixels of C1: those of pixel `i` are `all[start[i]..start[i + 1]]`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CandidateLists {
    start: Vec<u32>,
    all: Vec<Candidate>,
}

impl CandidateLists {
    /// Candidates of a pixel, by ascending column.
    #[must_use]
    #[inline]
    pub fn of(&self, pixel: usize) -> &[Candidate] {
        &self.all[self.start[pixel] as usize..self.start[pixel + 1] as usize]
    }

    /// All candidates, pixel by pixel.
    #[must_use]
    pub fn all(&self) -> &[Candidate] {
        &self.all
    }
}

/// Finds the candidates that pass `gate` for every valid pixel of C1 that has a segment.
///
/// In: phase of C1 (raw pixels), phase of C2 in the epipolar frame, the segment table of the same rig.
#[must_use]
pub fn find_candidates(
    cam1: &PhaseMap,
    cam2: &EpipolarImage,
    table: &SegmentTable,
    gate: &DeltaGate,
    form: SearchForm,
) -> CandidateLists {
    let search = match form {
        SearchForm::PlainScan => plain_scan,
        SearchForm::ProjectorSide => projector_side_search,
    };
    let rows: Vec<(Vec<u8>, Vec<Candidate>)> = (0..cam1.height)
        .into_par_iter()
        .map_init(SegmentRow::default, |segments, v| {
            table.row(v, segments);
            let (mut counts, mut found) = (vec![0_u8; cam1.width], Vec::with_capacity(2 * cam1.width));
            for (u, count) in counts.iter_mut().enumerate() {
                let i = v * cam1.width + u;
                let segment = segments.segment(u);
                if cam1.valid[i] && !segment.is_none() {
                    let before = found.len();
                    search(&RowView::new(cam2, segment.row_px), &segment, cam1.phase[i], gate, &mut found);
                    // A segment has far fewer than 255 fringe periods; should one have more, the rest is left out.
                    found.truncate(before + usize::from(u8::MAX));
                    *count = (found.len() - before) as u8;
                }
            }
            (counts, found)
        })
        .collect();
    concatenate(&rows)
}

fn concatenate(rows: &[(Vec<u8>, Vec<Candidate>)]) -> CandidateLists {
    let (pixels, candidates) = rows.iter().fold((0, 0), |(p, c), (counts, found)| (p + counts.len(), c + found.len()));
    let mut lists = CandidateLists { start: Vec::with_capacity(pixels + 1), all: Vec::with_capacity(candidates) };
    let mut next = 0;
    lists.start.push(0);
    for (counts, found) in rows {
        lists.start.extend(counts.iter().map(|&count| {
            next += u32::from(count);
            next
        }));
        lists.all.extend_from_slice(found);
    }
    lists
}
