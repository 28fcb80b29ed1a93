//! Regions of selected candidates whose absolute phases run on from pixel to pixel.
//!
//! Rows are divided into *runs* of such pixels first, each row by itself; runs that touch in neighbouring rows are united.

use std::ops::Range;

use rayon::prelude::*;

use super::super::neighbourhood::MAX_STEP;
use super::super::unions::Unions;
use super::selection::ABSENT;
use crate::simd::{self, Kernel, Lanes, Level};

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
pub(super) struct Regions {
    /// Row by row, from left to right.
    pub(super) runs: Vec<Run>,
    /// Where the runs of each row begin, and where those of the last one end.
    begins: Vec<usize>,
    /// Pixels of each region.
    pub(super) size_px: Vec<u32>,
}

impl Regions {
    /// Pixels beside and above each other belong together if their absolute phases run on and their z differ by no more than
    /// `max_z_step`. In: absolute phases and z of all pixels of an image that is so wide.
    pub(super) fn of(width: usize, absolute: &[i32], z: &[f32], max_z_step: f32) -> Self {
        let rows: Vec<Row<'_>> =
            absolute.chunks_exact(width).zip(z.chunks_exact(width)).map(|(absolute, z)| Row { absolute, z }).collect();
        let of_row = |marks: &mut Vec<u8>, (v, row): (usize, &Row<'_>)| row.runs(v * width, max_z_step, marks);
        let runs: Vec<Vec<Run>> = rows.par_iter().enumerate().map_init(Vec::new, of_row).collect();
        let begins: Vec<usize> = std::iter::once(0)
            .chain(runs.iter().scan(0, |sum, runs| {
                *sum += runs.len();
                Some(*sum)
            }))
            .collect();
        let touching = |marks: &mut Vec<u8>, v: usize| {
            row_below_touches([&rows[v], &rows[v + 1]], [&runs[v], &runs[v + 1]], max_z_step, marks)
        };
        let touching: Vec<Vec<[u32; 2]>> =
            (0..rows.len().saturating_sub(1)).into_par_iter().map_init(Vec::new, touching).collect();
        let mut unions = Unions::of(begins[rows.len()]);
        for (v, pairs) in touching.iter().enumerate() {
            for &[above, below] in pairs {
                unions.unite(begins[v] + above as usize, begins[v + 1] + below as usize);
            }
        }
        let mut runs = runs.concat();
        let mut size_px = Vec::new();
        for (run, number) in runs.iter_mut().zip(unions.numbers()) {
            run.region = number;
            size_px.resize(size_px.len().max(number as usize + 1), 0);
            size_px[number as usize] += run.end - run.begin;
        }
        Self { runs, begins, size_px }
    }

    /// Number of regions.
    pub(super) fn count(&self) -> usize {
        self.size_px.len()
    }

    /// The runs of a row.
    pub(super) fn of_row(&self, v: usize) -> &[Run] {
        &self.runs[self.begins[v]..self.begins[v + 1]]
    }

    /// For each region the sum of what its runs have.
    pub(super) fn sums(&self, of_run: impl Fn(&Run) -> u64) -> Vec<u64> {
        let mut sums = vec![0; self.count()];
        self.runs.iter().for_each(|run| sums[run.region as usize] += of_run(run));
        sums
    }
}

/// A row of pixels.
#[derive(Clone, Copy)]
struct Row<'a> {
    absolute: &'a [i32],
    z: &'a [f32],
}

impl Row<'_> {
    /// Its runs, not numbered yet; its first pixel is `first`.
    fn runs(&self, first: usize, max_z_step: f32, marks: &mut Vec<u8>) -> Vec<Run> {
        marks.resize(self.absolute.len(), 0);
        simd::run(Level::in_use(), Borders { row: *self, max_z_step, marks });
        let mut runs = Vec::new();
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
        runs
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

/// The runs of a row and of the one below that belong together.
fn row_below_touches(rows: [&Row<'_>; 2], runs: [&[Run]; 2], max_z_step: f32, marks: &mut Vec<u8>) -> Vec<[u32; 2]> {
    let width = rows[0].absolute.len();
    marks.resize(width, 0);
    simd::run(Level::in_use(), Touches { rows: rows.map(|row| *row), max_z_step, marks });
    let columns = |run: &Run| run.begin as usize % width..(run.end as usize - 1) % width + 1;
    let [above, below] = runs;
    let (mut pairs, mut i, mut j) = (Vec::new(), 0, 0);
    while let (Some(a), Some(b)) = (above.get(i), below.get(j)) {
        let (a, b) = (columns(a), columns(b));
        let common = a.start.max(b.start)..a.end.min(b.end);
        if !common.is_empty() && marks[common].contains(&1) {
            pairs.push([i as u32, j as u32]);
        }
        if a.end <= b.end {
            i += 1;
        } else {
            j += 1;
        }
    }
    pairs
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
        for (width, height) in [(1, 1), (37, 21), (64, 9), (8, 40)] {
            let pixels = width * height;
            let absolute: Vec<i32> = (0..pixels)
                .map(|_| if random(5) == 0 { ABSENT } else { random(3) as i32 * (MAX_STEP - 7000) })
                .collect();
            let z: Vec<f32> = (0..pixels).map(|_| random(8) as f32).collect();
            for max_z_step in [5.0, f32::INFINITY] {
                let wanted = flooded(width, &absolute, &z, max_z_step);
                let regions = Regions::of(width, &absolute, &z, max_z_step);
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
