//! The candidates of all pixels of an image.

mod found;
mod wide;

use rayon::prelude::*;

use crate::phase::PhaseMap;
use crate::simd::{self, Kernel, LANES, Lanes, Level};

use super::candidates::{Candidate, DeltaGate, keep_best_of_place, occurs, plain_scan, projector_side_search};
use super::epipolar_image::EpipolarImage;
use super::grid::ones;
use super::row_view::RowView;
use super::segment::{Segment, SegmentRow};
use super::segment_table::SegmentTable;
use super::wide::BLOCK;

pub use found::Candidates;
pub(super) use found::{Lists, Row};

/// How candidates are searched; all forms yield the same bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SearchForm {
    /// Every pair of columns of the segment: the oracle.
    PlainScan,
    /// One interval of columns a fringe order.
    ProjectorSide,
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
) -> Candidates {
    let mut candidates = Candidates::default();
    Search { cam1, cam2, table, gate, asks_elsewhere: false }.all(form, &mut candidates);
    candidates
}

/// What candidates are searched in, and the test that they pass.
#[derive(Clone, Copy)]
pub(super) struct Search<'a> {
    /// Phase of C1.
    pub(super) cam1: &'a PhaseMap,
    /// Phase of C2 in the epipolar frame.
    pub(super) cam2: &'a EpipolarImage,
    pub(super) table: &'a SegmentTable,
    pub(super) gate: &'a DeltaGate,
    /// Whether is to be found out if the phases of pixels without candidates occur elsewhere on their segments.
    pub(super) asks_elsewhere: bool,
}

impl Search<'_> {
    /// The candidates of all pixels.
    pub(super) fn all(&self, form: SearchForm, candidates: &mut Candidates) {
        candidates.resize([self.cam1.width, self.cam1.height]);
        let segments = std::mem::take(&mut candidates.segments);
        candidates.rows().enumerate().for_each_init(
            || segments.take(),
            |segments, (v, row)| {
                self.row(v, form, segments, row);
            },
        );
        candidates.segments = segments;
    }

    /// Those of some rows of C1, one below the other; a row that is `None` has none.
    pub(super) fn rows(&self, rows: &[Option<usize>], form: SearchForm, candidates: &mut Candidates) {
        candidates.resize([self.cam1.width, rows.len()]);
        let segments = std::mem::take(&mut candidates.segments);
        candidates.rows().zip(rows).for_each_init(
            || segments.take(),
            |segments, (mut row, v)| match *v {
                Some(v) => self.row(v, form, segments, row),
                None => row.clear(),
            },
        );
        candidates.segments = segments;
    }

    fn row(&self, v: usize, form: SearchForm, segments: &mut SegmentRow, mut candidates: Row<'_>) {
        let Self { cam1, cam2, table, gate, asks_elsewhere } = *self;
        table.row(v, segments);
        let last = table.epipolar_size_px()[1] - 1;
        for (row, row_px) in candidates.cam2_row[LANES..].iter_mut().zip(&segments.row_px) {
            *row = ((row_px + 0.5) as usize).min(last) as u16;
        }
        let pixels = v * cam1.width..(v + 1) * cam1.width;
        let row = SearchedRow { phase: &cam1.phase[pixels.clone()], valid: &cam1.valid[pixels], segments, cam2, gate };
        candidates.clear();
        row.search(form, &mut candidates);
        candidates.end();
        if asks_elsewhere {
            row.look_elsewhere(&mut candidates);
        }
    }
}

/// A row of C1 and what it is searched in.
struct SearchedRow<'a> {
    phase: &'a [u16],
    valid: &'a [bool],
    segments: &'a SegmentRow,
    cam2: &'a EpipolarImage,
    gate: &'a DeltaGate,
}

impl SearchedRow<'_> {
    fn search(&self, form: SearchForm, candidates: &mut Row<'_>) {
        let (search, first): (ScalarSearch, _) = match form {
            SearchForm::PlainScan => (plain_scan, 0),
            SearchForm::ProjectorSide => {
                (projector_side_search, simd::run(Level::in_use(), Blocks { searched: self, candidates }))
            }
        };
        (first..self.phase.len()).for_each(|u| self.search_pixel(search, u, candidates));
    }

    /// Finds out of which pixels without candidates the phase occurs on the segment all the same.
    fn look_elsewhere(&self, candidates: &mut Row<'_>) {
        let mut guess_px = 0.0;
        for b in 1..candidates.any.len() {
            for k in ones(candidates.searched[b] & !candidates.any[b]) {
                let u = (b - 1) * LANES + k;
                let segment = self.segments.segment(u);
                let row = RowView::new(self.cam2, segment.row_px);
                let is_there = occurs(&row, &segment, self.phase[u], &mut guess_px);
                candidates.elsewhere[b] |= u32::from(is_there) << k;
            }
        }
    }

    /// Enters what was found of a block, and searches the pixels that were left out there.
    #[inline]
    fn enter(&self, first: usize, found: &wide::Found, candidates: &mut Row<'_>) {
        if found.searched == 0 {
            return;
        }
        candidates.searched[first / BLOCK + 1] = found.searched;
        let several = found.passing[1..].iter().fold(found.irregular, |all, slot| all | slot);
        found.enter(first, found.passing[0] & !several, candidates);
        for k in ones(several) {
            if found.irregular >> k & 1 == 1 {
                self.search_pixel(projector_side_search, first + k, candidates);
            } else {
                let (list, before) = candidates.open_list();
                for slot in (0..found.passing.len()).filter(|&slot| found.passing[slot] >> k & 1 == 1) {
                    keep_best_of_place(found.candidate(slot, k), before, list);
                }
                candidates.close_list(first + k);
            }
        }
    }

    fn search_pixel(&self, search: ScalarSearch, u: usize, candidates: &mut Row<'_>) {
        candidates.begin_block(u);
        let segment = self.segments.segment(u);
        if self.valid[u] && !segment.is_none() {
            candidates.searched[u / LANES + 1] |= 1 << (u % LANES);
            let (list, _) = candidates.open_list();
            search(&RowView::new(self.cam2, segment.row_px), &segment, self.phase[u], self.gate, list);
            candidates.close_list(u);
        }
    }
}

/// Searches the whole blocks of a row; yields how many pixels they have.
struct Blocks<'a, 'b> {
    searched: &'a SearchedRow<'a>,
    candidates: &'a mut Row<'b>,
}

impl Kernel for Blocks<'_, '_> {
    type Output = usize;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> usize {
        let Self { searched, candidates } = self;
        let search = wide::Search { image: searched.cam2, segments: searched.segments, gate: searched.gate };
        let mut found = wide::Found::new();
        let valid: &[u8] = bytemuck::cast_slice(searched.valid);
        let (phase, valid) = (searched.phase.as_chunks().0, valid.as_chunks().0);
        for block in 0..phase.len() {
            let first = block * BLOCK;
            candidates.begin_block(first);
            search.block(lanes, first, &phase[block], &valid[block], &mut found);
            searched.enter(first, &found, candidates);
        }
        phase.len() * BLOCK
    }
}

/// Finds the candidates of a pixel.
type ScalarSearch = fn(&RowView<'_>, &Segment, u16, &DeltaGate, &mut Vec<Candidate>);
