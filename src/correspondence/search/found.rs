//! The candidates of all pixels of an image: most pixels have one, which stands in planes; the few that have several have a
//! list beside.

use std::ops::Range;

use rayon::prelude::*;

use crate::simd::LANES;

use super::super::candidates::Candidate;
use super::super::chosen::{ChosenCandidates, ChosenRow};
use super::super::grid::{Grid, Plane, bit};
use super::super::pool::Pool;
use super::super::segment::SegmentRow;

/// Candidates of all pixels of C1. Equal to others if each pixel has the same.
#[derive(Clone, Debug, Default)]
pub struct Candidates {
    pub(in super::super) grid: Grid,
    /// The candidate of each pixel that has one; without meaning for others. Once they are resolved, the chosen ones.
    pub(in super::super) chosen: ChosenCandidates,
    /// Of the same candidate in planes: fringe order, δ (turns · 65536), and the nearest column of the epipolar frame. What
    /// stands at places without candidate means nothing.
    pub(in super::super) order: Plane<i16>,
    pub(in super::super) delta: Plane<i16>,
    pub(in super::super) column: Plane<u16>,
    /// For each place of a row that was searched the row of the epipolar frame that is nearest to its segment.
    pub(in super::super) cam2_row: Plane<u16>,
    /// A bit a place: pixels that have a phase and a segment; those without candidates whose phase occurs on their segments
    /// all the same, where that was asked; those with candidates, and those with several.
    pub(in super::super) searched: Vec<u32>,
    pub(in super::super) elsewhere: Vec<u32>,
    pub(in super::super) any: Vec<u32>,
    pub(in super::super) several: Vec<u32>,
    /// Before each block the pixels of its row with several candidates.
    pub(in super::super) before: Vec<u16>,
    /// Row by row.
    pub(in super::super) lists: Vec<Lists>,
    /// Room for the segments of rows.
    pub(super) segments: Pool<SegmentRow>,
}

/// All candidates of the pixels of a row that have several.
#[derive(Clone, Debug, Default)]
pub(in super::super) struct Lists {
    /// Where those of each pixel begin, and where those of the last end.
    begins: Vec<u32>,
    all: Vec<Candidate>,
    /// For each candidate whether it was contradicted.
    excluded: Vec<bool>,
    /// Of each pixel the number of the candidate that it was decided for.
    pub(in super::super) decided_for: Vec<u8>,
}

/// A row of candidates.
pub(in super::super) struct Row<'a> {
    pub(in super::super) chosen: ChosenRow<'a>,
    pub(in super::super) order: &'a mut [i16],
    pub(in super::super) delta: &'a mut [i16],
    pub(in super::super) column: &'a mut [u16],
    pub(in super::super) cam2_row: &'a mut [u16],
    pub(in super::super) searched: &'a mut [u32],
    pub(in super::super) elsewhere: &'a mut [u32],
    pub(in super::super) any: &'a mut [u32],
    pub(in super::super) several: &'a mut [u32],
    pub(in super::super) before: &'a mut [u16],
    pub(in super::super) lists: &'a mut Lists,
}

impl Candidates {
    /// Makes room for an image of a size; what it holds is to be overwritten.
    pub(super) fn resize(&mut self, size_px: [usize; 2]) {
        let grid = Grid::new(size_px);
        let [width, height] = size_px;
        self.chosen.resize(width * height);
        if self.grid != grid {
            let blocks = grid.all_blocks();
            *self = Self {
                grid,
                chosen: std::mem::take(&mut self.chosen),
                order: Plane::new(grid),
                delta: Plane::new(grid),
                column: Plane::new(grid),
                cam2_row: Plane::new(grid),
                searched: vec![0; blocks],
                elsewhere: vec![0; blocks],
                any: vec![0; blocks],
                several: vec![0; blocks],
                before: vec![0; blocks],
                lists: vec![Lists::default(); height],
                segments: std::mem::take(&mut self.segments),
            };
        }
    }

    /// Rows of the image.
    pub(in super::super) fn rows(&mut self) -> impl IndexedParallelIterator<Item = Row<'_>> {
        let (grid, stride, blocks) = (self.grid, self.grid.stride(), self.grid.blocks);
        let planes = (
            self.chosen.rows_mut(grid.width()),
            grid.rows(&mut self.order).par_chunks_mut(stride),
            grid.rows(&mut self.delta).par_chunks_mut(stride),
            grid.rows(&mut self.column).par_chunks_mut(stride),
            grid.rows(&mut self.cam2_row).par_chunks_mut(stride),
            grid.rows(&mut self.searched).par_chunks_mut(blocks),
            grid.rows(&mut self.elsewhere).par_chunks_mut(blocks),
            grid.rows(&mut self.any).par_chunks_mut(blocks),
            grid.rows(&mut self.several).par_chunks_mut(blocks),
            grid.rows(&mut self.before).par_chunks_mut(blocks),
            self.lists.par_iter_mut(),
        );
        planes.into_par_iter().map(
            |(chosen, order, delta, column, cam2_row, searched, elsewhere, any, several, before, lists)| Row {
                chosen,
                order,
                delta,
                column,
                cam2_row,
                searched,
                elsewhere,
                any,
                several,
                before,
                lists,
            },
        )
    }

    /// Candidates of a pixel that is not resolved, by ascending column.
    #[must_use]
    pub fn of(&self, pixel: usize) -> Vec<Candidate> {
        let (width, v) = (self.grid.width(), pixel / self.grid.width());
        let place = self.grid.row(v) + pixel % width;
        if bit(&self.several, place) {
            let below = self.several[place / LANES] & ((1 << (place % LANES)) - 1);
            self.lists[v].of(usize::from(self.before[place / LANES]) + below.count_ones() as usize).to_vec()
        } else {
            bit(&self.any, place).then(|| self.chosen.at(pixel)).into_iter().collect()
        }
    }

    fn pixels(&self) -> usize {
        self.chosen.delta.len()
    }

    /// All candidates, pixel by pixel.
    pub fn all(&self) -> impl Iterator<Item = Candidate> {
        (0..self.pixels()).flat_map(|pixel| self.of(pixel))
    }

    /// Candidates of so many pixels, row by row.
    #[cfg(test)]
    pub(in super::super) fn of_pixels(size_px: [usize; 2], pixels: &[Vec<Candidate>]) -> Self {
        let mut all = Self::default();
        all.resize(size_px);
        all.rows().zip(pixels.par_chunks(size_px[0])).for_each(|(mut row, pixels)| {
            row.clear();
            for (u, list) in pixels.iter().enumerate() {
                row.begin_block(u);
                row.lists.all.extend(list);
                row.close_list(u);
            }
            row.end();
        });
        all
    }
}

impl PartialEq for Candidates {
    fn eq(&self, other: &Self) -> bool {
        self.grid == other.grid && (0..self.pixels()).all(|pixel| self.of(pixel) == other.of(pixel))
    }
}

impl Row<'_> {
    /// Takes all candidates away.
    pub(super) fn clear(&mut self) {
        self.searched.fill(0);
        self.elsewhere.fill(0);
        self.any.fill(0);
        self.several.fill(0);
        self.lists.clear();
    }

    /// Is to be called before the candidates of the first pixel of a block are entered.
    #[inline]
    pub(super) fn begin_block(&mut self, u: usize) {
        if u.is_multiple_of(LANES) {
            self.before[u / LANES + 1] = (self.lists.begins.len() - 1) as u16;
        }
    }

    /// Makes a candidate that of a pixel.
    #[inline]
    pub(in super::super) fn enter(&mut self, u: usize, candidate: Candidate) {
        self.chosen.set(u, Some(candidate));
        self.order[LANES + u] = candidate.order;
        self.delta[LANES + u] = candidate.delta;
        self.column[LANES + u] = nearest_column(&candidate);
    }

    /// Makes the candidate that a pixel with several was decided for that of the pixel.
    #[inline]
    pub(in super::super) fn decide(&mut self, u: usize) {
        let number = self.number(u);
        let candidate = self.lists.of(number)[usize::from(self.lists.decided_for[number])];
        self.enter(u, candidate);
    }

    /// Candidates of the next pixel with candidates, to be written behind those of all others; as many as are there before.
    #[inline]
    pub(super) fn open_list(&mut self) -> (&mut Vec<Candidate>, usize) {
        let before = self.lists.all.len();
        (&mut self.lists.all, before)
    }

    /// Gives the candidates that were written last to a pixel.
    #[inline]
    pub(super) fn close_list(&mut self, u: usize) {
        let begin = self.lists.begins.last().map_or(0, |&begin| begin as usize);
        let list = &mut self.lists;
        // A segment has far fewer than 255 fringe periods; should one have more, the rest is left out.
        list.all.truncate(begin + usize::from(u8::MAX));
        let Some(&first) = list.all.get(begin) else { return };
        let (block, here) = (u / LANES + 1, 1 << (u % LANES));
        self.any[block] |= here;
        if list.all.len() == begin + 1 {
            list.all.truncate(begin);
            self.enter(u, first);
        } else {
            self.several[block] |= here;
            list.begins.push(list.all.len() as u32);
        }
    }

    /// Is to be called when the candidates of all pixels have been entered.
    pub(super) fn end(&mut self) {
        let lists = &mut *self.lists;
        lists.excluded.resize(lists.all.len(), false);
        lists.decided_for.resize(lists.begins.len() - 1, 0);
    }

    /// Number of a pixel with several candidates among those of the row.
    #[inline]
    pub(in super::super) fn number(&self, u: usize) -> usize {
        let below = self.several[u / LANES + 1] & ((1 << (u % LANES)) - 1);
        usize::from(self.before[u / LANES + 1]) + below.count_ones() as usize
    }
}

impl Lists {
    fn clear(&mut self) {
        self.begins.clear();
        self.begins.push(0);
        self.all.clear();
        self.excluded.clear();
        self.decided_for.clear();
    }

    #[inline]
    fn range(&self, number: usize) -> Range<usize> {
        self.begins[number] as usize..self.begins[number + 1] as usize
    }

    /// Candidates of a pixel.
    #[inline]
    pub(in super::super) fn of(&self, number: usize) -> &[Candidate] {
        &self.all[self.range(number)]
    }

    /// Those of a pixel that were not contradicted, with their numbers.
    #[inline]
    pub(in super::super) fn eligible(&self, number: usize) -> impl Iterator<Item = (u8, &Candidate)> {
        let range = self.range(number);
        let all = (0..).zip(&self.all[range.clone()]).zip(&self.excluded[range]);
        all.filter(|(_, excluded)| !**excluded).map(|(candidate, _)| candidate)
    }

    /// Leaves out the candidate that a pixel was decided for; whether others are left.
    #[inline]
    pub(in super::super) fn exclude(&mut self, number: usize) -> bool {
        let range = self.range(number);
        let excluded = &mut self.excluded[range];
        excluded[usize::from(self.decided_for[number])] = true;
        excluded.contains(&false)
    }

    /// Admits all candidates again.
    pub(in super::super) fn readmit(&mut self) {
        self.excluded.fill(false);
    }
}

/// The column of the epipolar frame that is nearest to a candidate: the frame has fewer than 65536.
#[inline]
fn nearest_column(candidate: &Candidate) -> u16 {
    (candidate.column_px + 0.5) as u16
}
