//! The candidates of all pixels of an image.

#[cfg(target_arch = "x86_64")]
mod wide;

use rayon::prelude::*;

use crate::phase::PhaseMap;
#[cfg(target_arch = "x86_64")]
use crate::simd::Avx512;

use super::candidates::{Candidate, DeltaGate, keep_best_of_place, plain_scan, projector_side_search};
use super::epipolar_image::EpipolarImage;
use super::row_view::RowView;
use super::segment::{Segment, SegmentRow};
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
    /// Lists of so many pixels.
    #[cfg(test)]
    pub(super) fn of_pixels(lists: &[Vec<Candidate>]) -> Self {
        let rows: Vec<_> = lists.iter().map(|list| (vec![list.len() as u8], list.clone())).collect();
        concatenate(&rows)
    }

    /// Candidates of a pixel, by ascending column.
    #[must_use]
    #[inline]
    pub fn of(&self, pixel: usize) -> &[Candidate] {
        &self.all[self.range(pixel)]
    }

    /// Where the candidates of a pixel stand among all.
    #[inline]
    pub(super) fn range(&self, pixel: usize) -> std::ops::Range<usize> {
        self.start[pixel] as usize..self.start[pixel + 1] as usize
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
    let rows: Vec<Option<usize>> = (0..cam1.height).map(Some).collect();
    find_candidates_of_rows(cam1, &rows, cam2, table, gate, form)
}

/// As [`find_candidates`], of some rows of C1 one below the other; a row that is `None` has no candidates.
pub(super) fn find_candidates_of_rows(
    cam1: &PhaseMap,
    rows: &[Option<usize>],
    cam2: &EpipolarImage,
    table: &SegmentTable,
    gate: &DeltaGate,
    form: SearchForm,
) -> CandidateLists {
    let rows: Vec<(Vec<u8>, Vec<Candidate>)> = rows
        .par_iter()
        .map_init(SegmentRow::default, |segments, v| {
            let Some(v) = *v else { return (vec![0; cam1.width], Vec::new()) };
            table.row(v, segments);
            let pixels = v * cam1.width..(v + 1) * cam1.width;
            let row = Row { phase: &cam1.phase[pixels.clone()], valid: &cam1.valid[pixels], segments, cam2, gate };
            let mut found = FoundInRow { counts: vec![0; cam1.width], all: Vec::with_capacity(2 * cam1.width) };
            row.search(form, &mut found);
            (found.counts, found.all)
        })
        .collect();
    concatenate(&rows)
}

/// A row of C1 and what it is searched in.
struct Row<'a> {
    phase: &'a [u16],
    valid: &'a [bool],
    segments: &'a SegmentRow,
    cam2: &'a EpipolarImage,
    gate: &'a DeltaGate,
}

/// The candidates of a row, pixel by pixel, and how many each has.
struct FoundInRow {
    counts: Vec<u8>,
    all: Vec<Candidate>,
}

impl Row<'_> {
    fn search(&self, form: SearchForm, found: &mut FoundInRow) {
        #[cfg(target_arch = "x86_64")]
        if let Some(lanes) = Avx512::in_use().filter(|_| form == SearchForm::ProjectorSide) {
            let whole = self.search_blocks(lanes, found);
            return (whole..self.phase.len()).for_each(|u| self.search_pixel(projector_side_search, u, found));
        }
        let search = match form {
            SearchForm::PlainScan => plain_scan,
            SearchForm::ProjectorSide => projector_side_search,
        };
        (0..self.phase.len()).for_each(|u| self.search_pixel(search, u, found));
    }

    /// Searches whole blocks at once; yields how many pixels they have.
    #[cfg(target_arch = "x86_64")]
    fn search_blocks(&self, lanes: Avx512, found: &mut FoundInRow) -> usize {
        let search = wide::Search { image: self.cam2, segments: self.segments, gate: self.gate };
        let mut of_block = wide::Found::new();
        let (blocks, _) = self.phase.as_chunks::<{ wide::BLOCK }>();
        for (block, phase) in blocks.iter().enumerate() {
            let first = block * wide::BLOCK;
            let wanted = (0..wide::BLOCK).fold(0, |bits, k| {
                let is_wanted =
                    self.valid[first + k] & (self.segments.begin_px[first + k] <= self.segments.end_px[first + k]);
                bits | u32::from(is_wanted) << k
            });
            if wanted == 0 {
                continue;
            }
            search.block(lanes, first, phase, wanted, &mut of_block);
            let several = of_block.passing[1..].iter().fold(of_block.irregular, |all, slot| all | slot);
            let mut any = (several | of_block.passing[0]) & wanted;
            while any != 0 {
                let k = any.trailing_zeros() as usize;
                any &= any - 1;
                if several >> k & 1 == 0 {
                    found.all.push(of_block.candidate(0, k));
                    found.counts[first + k] = 1;
                } else if of_block.irregular >> k & 1 == 1 {
                    self.search_pixel(projector_side_search, first + k, found);
                } else {
                    let before = found.all.len();
                    for slot in (0..of_block.passing.len()).filter(|&slot| of_block.passing[slot] >> k & 1 == 1) {
                        keep_best_of_place(of_block.candidate(slot, k), before, &mut found.all);
                    }
                    found.counts[first + k] = (found.all.len() - before) as u8;
                }
            }
        }
        blocks.len() * wide::BLOCK
    }

    fn search_pixel(&self, search: ScalarSearch, u: usize, found: &mut FoundInRow) {
        let segment = self.segments.segment(u);
        if self.valid[u] && !segment.is_none() {
            let before = found.all.len();
            search(&RowView::new(self.cam2, segment.row_px), &segment, self.phase[u], self.gate, &mut found.all);
            // A segment has far fewer than 255 fringe periods; should one have more, the rest is left out.
            found.all.truncate(before + usize::from(u8::MAX));
            found.counts[u] = (found.all.len() - before) as u8;
        }
    }
}

/// Finds the candidates of a pixel.
type ScalarSearch = fn(&RowView<'_>, &Segment, u16, &DeltaGate, &mut Vec<Candidate>);

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
