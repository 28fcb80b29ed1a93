//! The pixels that have one candidate alone: what reference correspondences are selected from (paper, 2.2.1).
//!
//! The same as [`super::find_candidates`] finds, many pixels at once; lists of several candidates are not kept.

mod wide;

use rayon::prelude::*;

use crate::phase::PhaseMap;
use crate::simd::{self, Kernel, Lanes, Level};

use super::candidates::{Candidate, DeltaGate, keep_best_of_place, scan_segment};
use super::epipolar_image::EpipolarImage;
use super::neighbourhood::{ABSENT, TURN};
use super::pool::Pool;
use super::row_view::RowView;
use super::segment::SegmentRow;
use super::segment_table::SegmentTable;
use super::wide::BLOCK;

/// The candidates of pixels that have one alone, row by row.
#[derive(Clone, Debug, Default)]
pub struct UniqueCandidates {
    /// Absolute phases, turns · 65536; the least number where a pixel has none or several.
    pub absolute: Vec<i32>,
    /// δ, turns · 65536; without meaning there.
    pub delta: Vec<i16>,
    rooms: Pool<SegmentRow>,
}

/// Where candidates are searched, and the test that they pass.
#[derive(Clone, Copy)]
pub(super) struct Search<'a> {
    /// Phase of C1.
    pub(super) cam1: &'a PhaseMap,
    /// Phase of C2 in the epipolar frame.
    pub(super) cam2: &'a EpipolarImage,
    pub(super) table: &'a SegmentTable,
    pub(super) gate: &'a DeltaGate,
}

/// Finds the pixels of C1 of which one candidate alone passes `gate`.
#[must_use]
pub fn find_unique_candidates(
    cam1: &PhaseMap,
    cam2: &EpipolarImage,
    table: &SegmentTable,
    gate: &DeltaGate,
) -> UniqueCandidates {
    let mut unique = UniqueCandidates::default();
    let rows: Vec<_> = (0..cam1.height).map(Some).collect();
    unique.find(Search { cam1, cam2, table, gate }, &rows);
    unique
}

impl UniqueCandidates {
    /// Those of some rows of C1, one below the other; a row that is `None` has none.
    pub(super) fn find(&mut self, search: Search<'_>, rows: &[Option<usize>]) {
        let Self { absolute, delta, rooms } = self;
        let width = search.cam1.width;
        absolute.resize(width * rows.len(), ABSENT);
        delta.resize(width * rows.len(), 0);
        let places = absolute.par_chunks_mut(width.max(1)).zip(delta.par_chunks_mut(width.max(1))).zip(rows);
        places.for_each_init(
            || rooms.take(),
            |segments, ((absolute, delta), v)| {
                absolute.fill(ABSENT);
                if let Some(v) = *v {
                    search.table.row(v, segments);
                    let pixels = v * width..(v + 1) * width;
                    let (phase, valid) = (&search.cam1.phase[pixels.clone()], &search.cam1.valid[pixels]);
                    simd::run(Level::in_use(), Row { search, phase, valid, segments, absolute, delta });
                }
            },
        );
    }
}

/// A row of C1, and what is found for it.
struct Row<'a> {
    search: Search<'a>,
    phase: &'a [u16],
    valid: &'a [bool],
    segments: &'a SegmentRow,
    absolute: &'a mut [i32],
    delta: &'a mut [i16],
}

impl Kernel for Row<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(mut self, lanes: L) {
        let Search { cam2: image, gate, .. } = self.search;
        let search = wide::Search { image, segments: self.segments, gate };
        let (mut found, mut list) = (wide::Found::new(), Vec::new());
        let (phase, valid) = (self.phase.as_chunks().0, bytemuck::cast_slice(self.valid).as_chunks().0);
        for block in 0..phase.len() {
            search.block(lanes, block * BLOCK, &phase[block], &valid[block], &mut found);
            self.enter(block * BLOCK, &found, &mut list);
        }
        (phase.len() * BLOCK..self.phase.len()).for_each(|u| self.scan(u, &mut list));
    }
}

impl Row<'_> {
    /// Enters what was found of a block, and scans for the pixels that were left out there. `list` is room.
    #[inline]
    fn enter(&mut self, first: usize, found: &wide::Found, list: &mut Vec<Candidate>) {
        if found.searched == 0 {
            return;
        }
        for k in 0..BLOCK {
            let slots = found.passing.map(|passing| passing >> k & 1);
            if found.irregular >> k & 1 == 1 {
                self.scan(first + k, list);
            } else if slots.iter().sum::<u32>() == 1 && slots[0] == 1 {
                self.decide(first + k, found.candidate(0, k));
            } else if slots.contains(&1) {
                list.clear();
                (0..slots.len()).filter(|&slot| slots[slot] == 1).for_each(|slot| {
                    keep_best_of_place(found.candidate(slot, k), 0, list);
                });
                self.decide_for_one(first + k, list);
            }
        }
    }

    fn scan(&mut self, u: usize, list: &mut Vec<Candidate>) {
        let segment = self.segments.segment(u);
        if self.valid[u] && !segment.is_none() {
            list.clear();
            let row = RowView::new(self.search.cam2, segment.row_px);
            scan_segment(&row, &segment, self.phase[u], self.search.gate, list);
            self.decide_for_one(u, list);
        }
    }

    fn decide_for_one(&mut self, u: usize, list: &[Candidate]) {
        if let [candidate] = list {
            self.decide(u, *candidate);
        }
    }

    #[inline(always)]
    fn decide(&mut self, u: usize, candidate: Candidate) {
        self.absolute[u] = i32::from(candidate.order) * TURN + i32::from(self.phase[u]);
        self.delta[u] = candidate.delta;
    }
}
