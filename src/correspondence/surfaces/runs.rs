//! Runs: pixels of a row of C1 over which the wrapped phase runs on, and their orders relative to each other.

use std::ops::Range;

use rayon::prelude::*;

use fringeflow_simd::{Kernel, Lanes, Level};

use crate::correspondence::bands::{self, BAND_ROWS};
use crate::correspondence::disjoint_sets::{DisjointSets, Offset};
use crate::correspondence::neighbourhood::MAX_STEP;
use crate::correspondence::segment_table::SegmentTable;
use crate::phase::PhaseMap;

/// Bend of the phase, turns · 65536 (0.034 turns), beyond which a surface ends, if it bends so on both sides of a step: one
/// spoilt pixel bends on one side alone.
const MAX_BEND: u16 = 2200;
/// Greatest step from row to row at which runs are united, turns · 65536.
const MAX_ROW_STEP: u16 = 9000;
/// Fewest pixels that unite two runs.
const MIN_SHARED_PX: u32 = 3;

/// Pixels of a row over which the phase runs on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Run {
    begin: u32,
    end: u32,
    /// Number of its surface.
    pub(super) surface: u32,
    /// Order of its first pixel relative to that of its surface.
    pub(super) offset: i32,
}

impl Run {
    /// Its pixels.
    pub(super) fn pixels(&self) -> Range<usize> {
        self.begin as usize..self.end as usize
    }
}

/// The runs of an image.
#[derive(Clone, Debug, Default)]
pub(super) struct Runs {
    /// Row by row, from left to right.
    pub(super) runs: Vec<Run>,
    /// Where the runs of each row begin, and where those of the last one end.
    begins: Vec<usize>,
    /// Order of each pixel relative to that of the first pixel of its run.
    pub(super) relative: Vec<i16>,
    /// Number of surfaces.
    pub(super) surfaces: usize,
    scratches: Vec<BandScratch>,
    sets: DisjointSets,
}

/// What is found in a band of rows.
#[derive(Clone, Debug, Default)]
struct BandScratch {
    runs: Vec<Run>,
    /// Number of runs of each row.
    counts: Vec<usize>,
    /// Runs of neighbouring rows and by how much the order of the lower one is greater.
    united: Vec<(u32, u32, i32)>,
    row: RowScratch,
}

/// What is known of the pixels of a row.
#[derive(Clone, Debug, Default)]
struct RowScratch {
    /// Whether a pixel has a phase and a segment: 1 or 0.
    usable: Vec<u8>,
    /// Step of the phase to each pixel from the one before.
    step: Vec<i16>,
    /// Whether it runs on from the pixel before: 1 or 0.
    runs_on: Vec<u8>,
    /// By how many orders it changes with that step.
    carry: Vec<i8>,
}

impl Runs {
    /// Finds the runs of pixels with a segment, and unites them.
    pub(super) fn find(&mut self, cam1: &PhaseMap, table: &SegmentTable) {
        let (width, height) = (cam1.width.max(1), cam1.height);
        let Self { runs, begins, relative, surfaces, scratches, sets } = self;
        relative.resize(cam1.phase.len(), 0);
        bands::resize(scratches, height);
        let bands = scratches.par_iter_mut().zip(relative.par_chunks_mut(BAND_ROWS * width)).enumerate();
        bands.for_each(|(band, (scratch, relative))| {
            scratch.runs.clear();
            scratch.counts.clear();
            for (i, relative) in relative.chunks_mut(width).enumerate() {
                let (v, before) = (band * BAND_ROWS + i, scratch.runs.len());
                scratch.row.find(cam1, table, v);
                scratch.row.divide(v * width, relative, &mut scratch.runs);
                scratch.counts.push(scratch.runs.len() - before);
            }
        });
        runs.clear();
        begins.clear();
        begins.push(0);
        for scratch in &*scratches {
            runs.extend_from_slice(&scratch.runs);
            scratch.counts.iter().for_each(|count| begins.push(begins[begins.len() - 1] + count));
        }
        let (all, starts, relative) = (&*runs, &*begins, &*relative);
        scratches.par_iter_mut().enumerate().for_each(|(band, scratch)| {
            scratch.united.clear();
            for v in (band * BAND_ROWS..((band + 1) * BAND_ROWS).min(height)).filter(|&v| v > 0) {
                let rows = [&all[starts[v - 1]..starts[v]], &all[starts[v]..starts[v + 1]]];
                unite_rows(cam1, relative, rows, [starts[v - 1], starts[v]], &mut scratch.united);
            }
        });
        sets.begin(runs.iter().map(|run| run.end - run.begin));
        for &(above, below, by) in scratches.iter().flat_map(|scratch| &scratch.united) {
            sets.unite(above, below, by);
        }
        *surfaces = sets.number(|run, Offset { set, by }| (runs[run].surface, runs[run].offset) = (set, by));
    }

    /// Whether the phase runs on to a pixel of a row from the pixel to the left.
    pub(super) fn run_on(&self, v: usize, pixel: usize) -> bool {
        let runs = self.of_row(v);
        let behind = runs.partition_point(|run| (run.begin as usize) < pixel);
        behind.checked_sub(1).is_some_and(|place| pixel < runs[place].end as usize)
    }

    /// The runs of a row.
    pub(super) fn of_row(&self, v: usize) -> &[Run] {
        &self.runs[self.begins[v]..self.begins[v + 1]]
    }
}

impl RowScratch {
    fn find(&mut self, cam1: &PhaseMap, table: &SegmentTable, v: usize) {
        let width = cam1.width;
        let Self { usable, step, runs_on, carry } = self;
        usable.resize(width, 0);
        step.resize(width + 1, 0);
        runs_on.resize(width, 0);
        carry.resize(width, 0);
        table.mark_segments(v, usable);
        let pixels = v * width..(v + 1) * width;
        let (phase, valid) = (&cam1.phase[pixels.clone()], &cam1.valid[pixels]);
        fringeflow_simd::run(Level::in_use(), StepKernel { phase, valid, row: self });
    }

    /// Adds the runs of a row that begins with such a pixel.
    fn divide(&self, first: usize, relative: &mut [i16], runs: &mut Vec<Run>) {
        let mut order = 0_i16;
        for (u, relative) in relative.iter_mut().enumerate() {
            order = if self.runs_on[u] == 1 { order.wrapping_add(i16::from(self.carry[u])) } else { 0 };
            *relative = order;
        }
        let mut begin = 0;
        let mut end_at = |begin: usize, end: usize| {
            if begin < end && self.usable[begin] == 1 {
                let (begin, end) = ((first + begin) as u32, (first + end) as u32);
                runs.push(Run { begin, end, ..Run::default() });
            }
        };
        let (words, rest) = self.runs_on.as_chunks::<8>();
        const ALL: u64 = u64::from_le_bytes([1; 8]);
        for (i, word) in words.iter().enumerate() {
            let mut ends = u64::from_le_bytes(*word) ^ ALL;
            while ends != 0 {
                let u = 8 * i + ends.trailing_zeros() as usize / 8;
                end_at(std::mem::replace(&mut begin, u), u);
                ends &= ends - 1;
            }
        }
        for (i, _) in rest.iter().enumerate().filter(|(_, runs_on)| **runs_on == 0) {
            let u = 8 * words.len() + i;
            end_at(std::mem::replace(&mut begin, u), u);
        }
        end_at(begin, self.runs_on.len());
    }
}

/// Finds where the phase of a row runs on.
struct StepKernel<'a> {
    phase: &'a [u16],
    valid: &'a [bool],
    row: &'a mut RowScratch,
}

impl Kernel for StepKernel<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let Self { phase, valid, row: RowScratch { usable, step, runs_on, carry } } = self;
        let width = phase.len();
        let (usable, valid) = (&mut usable[..width], &valid[..width]);
        for u in 0..width {
            usable[u] &= u8::from(valid[u]);
        }
        let step = &mut step[..width + 1];
        step[0] = i16::MIN;
        step[width] = i16::MIN;
        let (before, here) = (&phase[..width - 1], &phase[1..][..width - 1]);
        let (known_before, known) = (&usable[..width - 1], &usable[1..][..width - 1]);
        {
            let step = &mut step[1..][..width - 1];
            for i in 0..width - 1 {
                // No step has the least number, which bends from everything.
                let rise = (here[i].wrapping_sub(before[i]) as i16).max(-i16::MAX);
                step[i] = if known_before[i] & known[i] == 1 { rise } else { i16::MIN };
            }
        }
        runs_on[0] = 0;
        carry[0] = 0;
        let (of, to, next) = (&step[..width - 1], &step[1..][..width - 1], &step[2..][..width - 1]);
        let (runs_on, carry) = (&mut runs_on[1..][..width - 1], &mut carry[1..][..width - 1]);
        for i in 0..width - 1 {
            let bends = |other: i16| (other == i16::MIN) | (other.saturating_sub(to[i]).unsigned_abs() > MAX_BEND);
            let small = to[i].unsigned_abs() <= MAX_STEP as u16;
            runs_on[i] = u8::from(small & !(bends(of[i]) & bends(next[i])));
            let up = i8::from((to[i] > 0) & (here[i] < before[i]));
            let down = i8::from((to[i] < 0) & (here[i] > before[i]));
            carry[i] = up - down;
        }
    }
}

/// Adds the runs of a row and of the one below over which one whole number makes the phases run on.
fn unite_rows(
    cam1: &PhaseMap,
    relative: &[i16],
    [above, below]: [&[Run]; 2],
    first: [usize; 2],
    united: &mut Vec<(u32, u32, i32)>,
) {
    let width = cam1.width;
    let (mut i, mut j) = (0, 0);
    while let (Some(a), Some(b)) = (above.get(i), below.get(j)) {
        // In pixels of the row below.
        let (a, b) = (a.begin as usize + width..a.end as usize + width, b.pixels());
        let shared = a.start.max(b.start)..a.end.min(b.end);
        if shared.len() >= MIN_SHARED_PX as usize {
            let rows = [shared.start - width..shared.end - width, shared];
            if let Some(by) = fringeflow_simd::run(Level::in_use(), UniteKernel { cam1, relative, rows }) {
                united.push(((first[0] + i) as u32, (first[1] + j) as u32, by));
            }
        }
        if a.end <= b.end {
            i += 1;
        } else {
            j += 1;
        }
    }
}

/// By how much the orders of the lower pixels are greater, if nine in ten of those whose phases run on say so.
struct UniteKernel<'a> {
    cam1: &'a PhaseMap,
    relative: &'a [i16],
    rows: [Range<usize>; 2],
}

impl Kernel for UniteKernel<'_> {
    type Output = Option<i32>;

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) -> Option<i32> {
        let Self { cam1, relative, rows: [above, below] } = self;
        let count = above.len();
        let (phase_above, phase_below) = (&cam1.phase[above.clone()][..count], &cam1.phase[below.clone()][..count]);
        let (of_above, of_below) = (&relative[above][..count], &relative[below][..count]);
        let by = |i: usize| {
            let step = phase_below[i].wrapping_sub(phase_above[i]) as i16;
            let up = i16::from((step > 0) & (phase_below[i] < phase_above[i]));
            let down = i16::from((step < 0) & (phase_below[i] > phase_above[i]));
            let by = of_above[i].wrapping_sub(of_below[i]).wrapping_add(up - down);
            (step.unsigned_abs() <= MAX_ROW_STEP, by)
        };
        // A guess from a pixel, then how many say the same.
        let guess = |from: usize| (from..count).chain(0..from).map(by).find(|(near, _)| *near).map(|(_, by)| by);
        let mut before = None;
        for from in [0, count / 2] {
            let wanted = guess(from)?;
            if before == Some(wanted) {
                break;
            }
            let (mut near, mut same) = (0_u32, 0_u32);
            for i in 0..count {
                let (is_near, by) = by(i);
                near += u32::from(is_near);
                same += u32::from(is_near & (by == wanted));
            }
            if near >= MIN_SHARED_PX && 3 * near >= 2 * count as u32 && 10 * same >= 9 * near {
                return Some(i32::from(wanted));
            }
            before = Some(wanted);
        }
        None
    }
}
