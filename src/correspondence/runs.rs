//! Runs: neighbouring pixels of a row that belong together, and the sets of runs that touch from row to row.
//!
//! ```text
//! in bands of rows, in parallel:   divide each row into runs
//! then, in one thread:             put all runs into one list
//! in bands of rows, in parallel:   list the pairs of runs of neighbouring rows that belong together
//! then, in one thread:             unite the pairs in disjoint sets, in the order of the rows; number the sets
//! ```
//!
//! The result does not depend on the number of threads. The surfaces of [`super::moments`] and the regions of the
//! paper's method say which pixels belong together.

use std::ops::Range;

use rayon::prelude::*;

use super::bands::{self, BAND_ROWS};
use super::disjoint_sets::{DisjointSets, Offset};

/// Neighbouring pixels of a row that belong together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Run {
    begin: u32,
    end: u32,
    /// Number of its set.
    pub(super) set: u32,
    /// Fringe order of its first pixel relative to that of its set.
    pub(super) order_offset: i32,
}

/// A run of a row and one of the row below that belong together.
#[derive(Clone, Copy, Debug)]
pub(super) struct Union {
    /// The numbers of both runs, the upper one first.
    pub(super) runs: [u32; 2],
    /// Fringe orders by which the lower run exceeds the upper one.
    pub(super) order_step: i32,
}

/// The runs of an image. `S` is the scratch memory of the caller for a row.
#[derive(Clone, Debug, Default)]
pub(super) struct Runs<S> {
    /// Row by row, from left to right.
    pub(super) all: Vec<Run>,
    /// Index of the first run of each row, and the number of runs.
    row_begins: Vec<usize>,
    bands: Vec<Band<S>>,
    sets: DisjointSets,
}

/// Scratch for a band of rows.
#[derive(Clone, Debug, Default)]
struct Band<S> {
    runs: Vec<Run>,
    /// Number of runs of each row.
    counts: Vec<usize>,
    unions: Vec<Union>,
    row: S,
}

impl Run {
    /// A run that is a set of its own.
    pub(super) fn new(pixels: Range<usize>) -> Self {
        Self { begin: pixels.start as u32, end: pixels.end as u32, set: 0, order_offset: 0 }
    }

    /// Its pixels.
    pub(super) fn pixels(&self) -> Range<usize> {
        self.begin as usize..self.end as usize
    }
}

impl<S: Default + Clone + Send> Runs<S> {
    /// Divides each row of an image into runs. `divide` adds the runs of a row; its third parameter is the item of
    /// `out` for the band of rows.
    pub(super) fn divide<B: Send>(
        &mut self,
        height: usize,
        out: impl IndexedParallelIterator<Item = B>,
        divide: impl Fn(usize, &mut S, &mut B, &mut Vec<Run>) + Sync,
    ) {
        let Self { all, row_begins, bands, .. } = self;
        bands::resize(bands, height);
        bands.par_iter_mut().zip(out).enumerate().with_max_len(1).for_each(|(i, (band, mut out))| {
            band.runs.clear();
            band.counts.clear();
            for v in rows_of_band(i, height) {
                let before = band.runs.len();
                divide(v, &mut band.row, &mut out, &mut band.runs);
                band.counts.push(band.runs.len() - before);
            }
        });
        all.clear();
        row_begins.clear();
        row_begins.push(0);
        for band in &*bands {
            all.extend_from_slice(&band.runs);
            band.counts.iter().for_each(|count| row_begins.push(row_begins[row_begins.len() - 1] + count));
        }
    }

    /// Unites the runs of an image of `width` columns. `unite` receives the overlaps of a row with the row above, and
    /// adds the pairs of runs that belong together. Returns the number of sets.
    pub(super) fn unite(
        &mut self,
        width: usize,
        unite: impl Fn(usize, &mut S, Overlaps<'_>, &mut Vec<Union>) + Sync,
    ) -> usize {
        let Self { all, row_begins, bands, sets } = self;
        let (runs, begins) = (&*all, &*row_begins);
        bands.par_iter_mut().enumerate().with_max_len(1).for_each(|(i, band)| {
            band.unions.clear();
            for v in rows_of_band(i, begins.len() - 1).filter(|&v| v > 0) {
                let (above, below) = (begins[v - 1]..begins[v], begins[v]..begins[v + 1]);
                unite(v, &mut band.row, Overlaps { runs, above, below, width }, &mut band.unions);
            }
        });
        sets.reset(all.iter().map(|run| run.end - run.begin));
        for &Union { runs: [above, below], order_step } in bands.iter().flat_map(|band| &band.unions) {
            sets.unite(above, below, order_step);
        }
        sets.number(|run, Offset { set, orders }| (all[run].set, all[run].order_offset) = (set, orders))
    }

    /// The runs of a row.
    pub(super) fn row(&self, v: usize) -> &[Run] {
        &self.all[self.row_begins[v]..self.row_begins[v + 1]]
    }
}

/// The rows of a band of an image of `height` rows.
fn rows_of_band(band: usize, height: usize) -> Range<usize> {
    band * BAND_ROWS..((band + 1) * BAND_ROWS).min(height)
}

/// The runs of a row and of the one below that have columns in common, and the pixels of the lower row in these.
pub(super) struct Overlaps<'a> {
    runs: &'a [Run],
    above: Range<usize>,
    below: Range<usize>,
    width: usize,
}

impl Iterator for Overlaps<'_> {
    type Item = ([u32; 2], Range<usize>);

    #[inline]
    fn next(&mut self) -> Option<Self::Item> {
        while !self.above.is_empty() && !self.below.is_empty() {
            let pair = [self.above.start as u32, self.below.start as u32];
            let [above, below] = pair.map(|run| self.runs[run as usize].pixels());
            let above = above.start + self.width..above.end + self.width;
            // The run that ends first meets no further one.
            if above.end <= below.end {
                self.above.start += 1;
            } else {
                self.below.start += 1;
            }
            let shared = above.start.max(below.start)..above.end.min(below.end);
            if !shared.is_empty() {
                return Some((pair, shared));
            }
        }
        None
    }
}

/// Adds the runs of a row whose first pixel is number `first`. `marks` is 1 where a run may begin or the one before
/// ends, else 0. Pixels between two marks are a run only if `is_inside` accepts the first of them.
pub(super) fn divide_at_marks(first: usize, marks: &[u8], is_inside: impl Fn(usize) -> bool, runs: &mut Vec<Run>) {
    let mut begin = 0;
    let mut end_at = |end: usize| {
        if begin < end && is_inside(begin) {
            runs.push(Run::new(first + begin..first + end));
        }
        begin = end;
    };
    // Marks are rare: eight columns without any are skipped at once.
    let (words, rest) = marks.as_chunks::<8>();
    for (i, word) in words.iter().enumerate() {
        let mut bits = u64::from_le_bytes(*word);
        while bits != 0 {
            end_at(8 * i + bits.trailing_zeros() as usize / 8);
            bits &= bits - 1;
        }
    }
    rest.iter().enumerate().filter(|(_, mark)| **mark != 0).for_each(|(i, _)| end_at(8 * words.len() + i));
    end_at(marks.len());
}
