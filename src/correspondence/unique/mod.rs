//! Unique candidates: pixels with exactly one candidate, from which reference correspondences are selected (paper,
//! 2.2.1).
//!
//! They equal the candidates that [`super::find_candidates`] finds, but are computed 32 pixels at a time and without
//! lists.

mod kernel;

use rayon::prelude::*;

use fringeflow_simd::{Kernel, Lanes, Level};

use crate::phase::PhaseMap;

use super::candidates::{Candidate, DeltaGate, keep_best_of_place, scan_segment};
use super::epipolar_image::EpipolarImage;
use super::kernels::BLOCK;
use super::moments::Model;
use super::neighbourhood::{ABSENT, TURN};
use super::pool::Pool;
use super::row_view::RowView;
use super::segment::SegmentRow;
use super::segment_table::SegmentTable;
use super::view::View;

/// The candidates of pixels with exactly one, row by row.
#[derive(Clone, Debug, Default)]
pub struct UniqueCandidates {
    /// Absolute phases, turns · 65536; `i32::MIN` for pixels with no candidate or several.
    pub absolute: Vec<i32>,
    /// δ, turns · 65536; undefined for such pixels.
    pub delta: Vec<i16>,
    scratches: Pool<Scratch>,
}

/// Scratch for the segments of a row, and for the candidates of a pixel.
#[derive(Debug, Default)]
struct Scratch {
    segments: SegmentRow,
    list: Vec<Candidate>,
}

/// Inputs of the search: the phases and the back-projection test.
#[derive(Clone, Copy)]
pub(super) struct Search<'a> {
    pub(super) view: View<'a>,
    pub(super) gate: &'a DeltaGate,
}

/// Finds the pixels of C1 with exactly one candidate that passes `gate`.
#[must_use]
pub fn find_unique_candidates(
    cam1: &PhaseMap,
    cam2: &EpipolarImage,
    table: &SegmentTable,
    gate: &DeltaGate,
) -> UniqueCandidates {
    let mut unique = UniqueCandidates::default();
    let rows: Vec<_> = (0..cam1.height).map(Some).collect();
    unique.find(Search { view: View { cam1, cam2, table, model: &Model::USUAL }, gate }, &rows);
    unique
}

impl UniqueCandidates {
    /// Searches some rows of C1 and stores their results one below the other. A row that is `None` has none.
    pub(super) fn find(&mut self, search: Search<'_>, rows: &[Option<usize>]) {
        let Self { absolute, delta, scratches } = self;
        let width = search.view.cam1.width;
        absolute.resize(width * rows.len(), ABSENT);
        delta.resize(width * rows.len(), 0);
        let places = absolute.par_chunks_mut(width.max(1)).zip(delta.par_chunks_mut(width.max(1))).zip(rows);
        places.for_each_init(
            || scratches.take(),
            |scratch, ((absolute, delta), v)| {
                let Scratch { segments, list } = &mut **scratch;
                absolute.fill(ABSENT);
                if let Some(v) = *v {
                    search.view.table.row(v, segments);
                    let pixels = v * width..(v + 1) * width;
                    let (phase, valid) = (&search.view.cam1.phase[pixels.clone()], &search.view.cam1.valid[pixels]);
                    fringeflow_simd::run(
                        Level::in_use(),
                        Row { search, phase, valid, segments, list, absolute, delta },
                    );
                }
            },
        );
    }
}

/// A row of C1, and the results for it.
struct Row<'a> {
    search: Search<'a>,
    phase: &'a [u16],
    valid: &'a [bool],
    segments: &'a SegmentRow,
    list: &'a mut Vec<Candidate>,
    absolute: &'a mut [i32],
    delta: &'a mut [i16],
}

impl Kernel for Row<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(mut self, lanes: L) {
        let Search { view, gate } = self.search;
        let search = kernel::Search { image: view.cam2, segments: self.segments, gate };
        let mut found = kernel::Found::new();
        let (phase, valid) = (self.phase.as_chunks().0, bytemuck::cast_slice(self.valid).as_chunks().0);
        for block in 0..phase.len() {
            search.block(lanes, block * BLOCK, &phase[block], &valid[block], &mut found);
            if found.searched != 0 {
                self.store(block, &found);
            }
        }
        (phase.len() * BLOCK..self.phase.len()).for_each(|u| self.scan(u));
    }
}

impl Row<'_> {
    /// Stores the results of a block, and scans the segments of irregular pixels.
    #[inline(always)]
    fn store(&mut self, block: usize, found: &kernel::Found) {
        // The first slot decides alone where no further slot passes; the rest of the pixels need their lists.
        let [first, others @ ..] = &found.passing;
        let mut rest = others.iter().fold(found.irregular, |all, slot| all | slot);
        let alone = first & !rest;
        let (order, delta) = found.of_first_slot();
        let absolute = &mut self.absolute.as_chunks_mut::<BLOCK>().0[block];
        let phase = &self.phase.as_chunks::<BLOCK>().0[block];
        for k in 0..BLOCK {
            let of_candidate = i32::from(order[k]) * TURN + i32::from(phase[k]);
            absolute[k] = if alone >> k & 1 == 1 { of_candidate } else { ABSENT };
        }
        self.delta.as_chunks_mut().0[block] = *delta;
        while rest != 0 {
            let k = rest.trailing_zeros() as usize;
            rest &= rest - 1;
            if found.irregular >> k & 1 == 1 {
                self.scan(block * BLOCK + k);
            } else {
                self.list.clear();
                for slot in (0..found.passing.len()).filter(|&slot| found.passing[slot] >> k & 1 == 1) {
                    keep_best_of_place(found.candidate(slot, k), 0, self.list);
                }
                self.decide(block * BLOCK + k);
            }
        }
    }

    /// Scans the whole segment of a pixel.
    fn scan(&mut self, u: usize) {
        let segment = self.segments.segment(u);
        if self.valid[u] && !segment.is_none() {
            self.list.clear();
            let row = RowView::new(self.search.view.cam2, segment.row_px);
            scan_segment(&row, &segment, self.phase[u], self.search.gate, self.list);
            self.decide(u);
        }
    }

    /// Stores the candidate of a pixel if the list holds only one.
    fn decide(&mut self, u: usize) {
        if let [candidate] = **self.list {
            self.absolute[u] = i32::from(candidate.order) * TURN + i32::from(self.phase[u]);
            self.delta[u] = candidate.delta;
        }
    }
}
