//! Regions of selected candidates whose absolute phases run on from pixel to pixel.
//!
//! Rows are divided into *runs* of such pixels first, each row by itself; runs that touch in neighbouring rows are united.

use std::ops::Range;

use rayon::prelude::*;

use fringeflow_simd::{Kernel, Lanes, Level};

use super::bands::{self, BAND_ROWS};
use super::disjoint_sets::{DisjointSets, Offset};
use super::neighbourhood::{ABSENT, MAX_STEP};

/// Pixels of a row that belong together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Run {
    begin: u32,
    end: u32,
    /// Number of its region.
    pub(super) region: u32,
}

impl Run {
    /// Its pixels.
    pub(super) fn pixels(&self) -> Range<usize> {
        self.begin as usize..self.end as usize
    }
}

/// Division of the selected pixels into regions.
#[derive(Clone, Debug, Default)]
pub(super) struct Regions {
    /// Row by row, from left to right.
    pub(super) runs: Vec<Run>,
    /// Where the runs of each row begin, and where those of the last one end.
    begins: Vec<usize>,
    /// Pixels of each region.
    pub(super) size_px: Vec<u32>,
    scratches: Vec<BandScratch>,
    sets: DisjointSets,
}

/// What is found in a band of rows.
#[derive(Clone, Debug, Default)]
struct BandScratch {
    runs: Vec<Run>,
    /// Number of runs of each row.
    counts: Vec<usize>,
    /// Runs that touch runs of the row above.
    touching: Vec<[u32; 2]>,
    /// Scratch for marks of the pixels of a row.
    marks: Vec<u8>,
}

impl Regions {
    /// Finds them. Pixels beside and above each other belong together if their absolute phases run on and their z differ by no
    /// more than `max_z_step`. In: absolute phases and z of all pixels of an image that is so wide.
    pub(super) fn find(&mut self, width: usize, absolute: &[i32], z: &[f32], max_z_step: f32) {
        let Self { runs, begins, size_px, scratches, sets } = self;
        let height = absolute.len() / width;
        let row = |v: usize| Row { absolute: &absolute[v * width..][..width], z: &z[v * width..][..width] };
        let rows_of = |band: usize| band * BAND_ROWS..((band + 1) * BAND_ROWS).min(height);
        bands::resize(scratches, height);
        scratches.par_iter_mut().enumerate().for_each(|(band, scratch)| {
            scratch.runs.clear();
            scratch.counts.clear();
            for v in rows_of(band) {
                let before = scratch.runs.len();
                row(v).runs(v * width, max_z_step, &mut scratch.marks, &mut scratch.runs);
                scratch.counts.push(scratch.runs.len() - before);
            }
        });
        runs.clear();
        begins.clear();
        begins.push(0);
        for scratch in &*scratches {
            runs.extend_from_slice(&scratch.runs);
            for count in &scratch.counts {
                begins.push(begins[begins.len() - 1] + count);
            }
        }
        let (all, starts) = (&*runs, &*begins);
        scratches.par_iter_mut().enumerate().for_each(|(band, scratch)| {
            scratch.touching.clear();
            for v in rows_of(band).filter(|&v| v > 0) {
                let runs = [&all[starts[v - 1]..starts[v]], &all[starts[v]..starts[v + 1]]];
                let first = [starts[v - 1], starts[v]];
                touching_runs([row(v - 1), row(v)], runs, first, max_z_step, &mut scratch.marks, &mut scratch.touching);
            }
        });
        sets.begin(runs.iter().map(|run| run.end - run.begin));
        for &[above, below] in scratches.iter().flat_map(|scratch| &scratch.touching) {
            sets.unite(above, below, 0);
        }
        size_px.clear();
        sets.number(|run, Offset { set, .. }| {
            let run = &mut runs[run];
            run.region = set;
            size_px.resize(size_px.len().max(set as usize + 1), 0);
            size_px[set as usize] += run.end - run.begin;
        });
    }

    /// Number of regions.
    pub(super) fn count(&self) -> usize {
        self.size_px.len()
    }

    /// The runs of a row.
    pub(super) fn of_row(&self, v: usize) -> &[Run] {
        &self.runs[self.begins[v]..self.begins[v + 1]]
    }

    /// The columns of a row from the first one of its runs to the last.
    pub(super) fn columns_of_row(&self, v: usize, width: usize) -> Range<usize> {
        match self.of_row(v) {
            [] => 0..0,
            runs @ [first, ..] => first.begin as usize - v * width..runs[runs.len() - 1].end as usize - v * width,
        }
    }

    /// For each region the sum of what its runs have, into `sums`.
    pub(super) fn sum(&self, sums: &mut Vec<u64>, of_run: impl Fn(&Run) -> u64) {
        sums.clear();
        sums.resize(self.count(), 0);
        self.runs.iter().for_each(|run| sums[run.region as usize] += of_run(run));
    }
}

/// A row of pixels.
#[derive(Clone, Copy)]
struct Row<'a> {
    absolute: &'a [i32],
    z: &'a [f32],
}

impl Row<'_> {
    /// Adds its runs, not numbered yet; its first pixel is `first`.
    fn runs(&self, first: usize, max_z_step: f32, marks: &mut Vec<u8>, runs: &mut Vec<Run>) {
        marks.resize(self.absolute.len(), 0);
        fringeflow_simd::run(Level::in_use(), Borders { row: *self, max_z_step, marks });
        let mut open = None;
        let mut border = |u: usize| {
            if let Some(begin) = open.take() {
                runs.push(Run { begin, end: (first + u) as u32, region: 0 });
            }
            open = (u < self.absolute.len() && self.absolute[u] != ABSENT).then_some((first + u) as u32);
        };
        let (words, rest) = marks.as_chunks::<8>();
        for (i, word) in words.iter().enumerate() {
            let mut bits = u64::from_le_bytes(*word);
            while bits != 0 {
                border(8 * i + bits.trailing_zeros() as usize / 8);
                bits &= bits - 1;
            }
        }
        rest.iter().enumerate().filter(|(_, mark)| **mark != 0).for_each(|(i, _)| border(8 * words.len() + i));
        border(self.absolute.len());
    }
}

/// Whether neighbours belong together.
#[inline(always)]
fn runs_on(absolute: [i32; 2], z: [f32; 2], max_z_step: f32) -> bool {
    let step = absolute[1].wrapping_sub(absolute[0]).wrapping_abs();
    (absolute[0] != ABSENT) & (absolute[1] != ABSENT) & (step <= MAX_STEP) & ((z[1] - z[0]).abs() <= max_z_step)
}

/// Marks the pixels of a row at which a run begins, or the one before ends, by 1.
struct Borders<'a> {
    row: Row<'a>,
    max_z_step: f32,
    marks: &'a mut [u8],
}

impl Kernel for Borders<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let Self { row, max_z_step, marks } = self;
        let Some(last) = marks.len().checked_sub(1) else { return };
        marks[0] = u8::from(row.absolute[0] != ABSENT);
        let (before, here) = (&row.absolute[..last], &row.absolute[1..][..last]);
        let (z_before, z_here) = (&row.z[..last], &row.z[1..][..last]);
        let marks = &mut marks[1..][..last];
        for i in 0..last {
            let any = (before[i] != ABSENT) | (here[i] != ABSENT);
            marks[i] = u8::from(any & !runs_on([before[i], here[i]], [z_before[i], z_here[i]], max_z_step));
        }
    }
}

/// Marks the pixels that belong to the one above by 1.
struct Touches<'a> {
    rows: [Row<'a>; 2],
    max_z_step: f32,
    marks: &'a mut [u8],
}

impl Kernel for Touches<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let Self { rows: [above, below], max_z_step, marks } = self;
        let width = marks.len();
        let (above, z_above) = (&above.absolute[..width], &above.z[..width]);
        let (below, z_below) = (&below.absolute[..width], &below.z[..width]);
        for i in 0..width {
            marks[i] = u8::from(runs_on([above[i], below[i]], [z_above[i], z_below[i]], max_z_step));
        }
    }
}

/// Adds the runs of a row and of the one below that belong together; the first ones have such numbers.
fn touching_runs(
    rows: [Row<'_>; 2],
    [above, below]: [&[Run]; 2],
    first: [usize; 2],
    max_z_step: f32,
    marks: &mut Vec<u8>,
    touching: &mut Vec<[u32; 2]>,
) {
    let width = rows[0].absolute.len();
    marks.resize(width, 0);
    fringeflow_simd::run(Level::in_use(), Touches { rows, max_z_step, marks });
    let columns = |run: &Run| run.begin as usize % width..(run.end as usize - 1) % width + 1;
    let (mut i, mut j) = (0, 0);
    while let (Some(a), Some(b)) = (above.get(i), below.get(j)) {
        let (a, b) = (columns(a), columns(b));
        let common = a.start.max(b.start)..a.end.min(b.end);
        if !common.is_empty() && marks[common].contains(&1) {
            touching.push([(first[0] + i) as u32, (first[1] + j) as u32]);
        }
        if a.end <= b.end {
            i += 1;
        } else {
            j += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::correspondence::neighbourhood::neighbours;

    /// The region of each pixel, pixel by pixel: the oracle.
    fn flooded(width: usize, absolute: &[i32], z: &[f32], max_z_step: f32) -> Vec<Option<usize>> {
        let mut label = vec![None; absolute.len()];
        let mut regions = 0;
        for seed in 0..absolute.len() {
            if absolute[seed] == ABSENT || label[seed].is_some() {
                continue;
            }
            label[seed] = Some(regions);
            let mut next = vec![seed];
            while let Some(pixel) = next.pop() {
                for other in neighbours(pixel, width, absolute.len()).into_iter().flatten() {
                    let linked = absolute[other] != ABSENT
                        && (absolute[other] - absolute[pixel]).abs() <= MAX_STEP
                        && (z[other] - z[pixel]).abs() <= max_z_step;
                    if linked && label[other].is_none() {
                        label[other] = Some(regions);
                        next.push(other);
                    }
                }
            }
            regions += 1;
        }
        label
    }

    #[test]
    fn regions_are_those_of_a_flood() {
        let mut state = 3_u32;
        let mut random = |below: u32| {
            state = state.wrapping_mul(747_796_405).wrapping_add(2_891_336_453);
            (state >> 16) % below
        };
        // The same scratch memory for all: what it held before makes no difference.
        let mut regions = Regions::default();
        for (width, height) in [(1, 1), (37, 71), (64, 9), (8, 40)] {
            let pixels = width * height;
            let absolute: Vec<i32> = (0..pixels)
                .map(|_| if random(5) == 0 { ABSENT } else { random(3) as i32 * (MAX_STEP - 7000) })
                .collect();
            let z: Vec<f32> = (0..pixels).map(|_| random(8) as f32).collect();
            for max_z_step in [5.0, f32::INFINITY] {
                let wanted = flooded(width, &absolute, &z, max_z_step);
                regions.find(width, &absolute, &z, max_z_step);
                let mut found = vec![None; pixels];
                for run in &regions.runs {
                    run.pixels().for_each(|pixel| found[pixel] = Some(run.region as usize));
                }
                assert_eq!(found, wanted);
                let size_px: Vec<u32> = (0..regions.count())
                    .map(|region| wanted.iter().filter(|label| **label == Some(region)).count() as u32)
                    .collect();
                assert_eq!(regions.size_px, size_px);
                assert_eq!((0..height).map(|v| regions.of_row(v).len()).sum::<usize>(), regions.runs.len());
            }
        }
    }
}
