//! Where the wrapped phase of C1 runs on from pixel to pixel: what the walks of Eq. (2) and the regions go along.
//!
//! Around p the phase is unwrapped along straight walks, left and right, up and down, for less than one period and only as
//! long as it runs on without a jump. Whether it does is the same for every walk that passes, so that it is worked out once: a
//! bit for each step, a bit for each pixel that a walk may pass straight through, and the whole turns that the wrapped
//! phase has skipped since the beginning of the row or column.

use std::ops::Range;

use rayon::prelude::*;

use crate::phase::PhaseMap;
use crate::simd::{self, Kernel, LANES, Lanes, Level};

use super::super::grid::{Grid, Plane, bit, bits_from, ones, words};
use super::super::neighbourhood::{MAX_STEP, MAX_STEP_CHANGE};

/// An axis of the image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Axis {
    /// Along the rows.
    Row,
    /// Along the columns.
    Column,
}

/// Continuity along one axis.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Along {
    /// Places from a pixel to the next.
    pub(super) stride: usize,
    /// A bit a place: the phase runs on to the next pixel.
    pub(super) runs_on: Vec<u32>,
    /// A bit a place: the step to the pixel and the step from it are alike, so that a walk may pass.
    pub(super) passes: Vec<u32>,
    /// Whole turns that the wrapped phase has skipped since the first pixel, wrapping around.
    pub(super) turns: Plane<i16>,
}

/// Continuity along one axis, of all places or of those of a row.
#[derive(Clone, Copy)]
pub(super) struct Way<'a> {
    /// As in [`Along`].
    pub(super) stride: usize,
    pub(super) runs_on: &'a [u32],
    pub(super) passes: &'a [u32],
    pub(super) turns: &'a [i16],
}

impl Along {
    pub(super) fn everywhere(&self) -> Way<'_> {
        let Self { stride, runs_on, passes, turns } = self;
        Way { stride: *stride, runs_on, passes, turns }
    }

    /// Continuity along a row.
    pub(super) fn in_row(&self, blocks: Range<usize>) -> Way<'_> {
        let places = blocks.start * LANES..blocks.end * LANES;
        let (runs_on, passes) = (&self.runs_on[blocks.clone()], &self.passes[blocks]);
        Way { stride: self.stride, runs_on, passes, turns: &self.turns[places] }
    }

    fn none(grid: Grid, stride: usize) -> Self {
        let bits = vec![0; grid.all_blocks()];
        Self { stride, runs_on: bits.clone(), passes: bits, turns: Plane::new(grid) }
    }
}

/// Continuity of a phase map.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Continuity {
    pub(super) grid: Grid,
    /// Phase of C1, turns · 65536; 0 in the margin.
    pub(super) phase: Plane<u16>,
    /// A bit a place: pixels that have a phase.
    pub(super) valid: Vec<u32>,
    pub(super) row: Along,
    pub(super) column: Along,
    /// Room for the steps of all blocks.
    steps: Vec<[Steps; 2]>,
}

impl Continuity {
    #[cfg(test)]
    pub(super) fn of(map: &PhaseMap) -> Self {
        let mut continuity = Self::default();
        continuity.measure(map);
        continuity
    }

    /// Makes it that of a map.
    pub(super) fn measure(&mut self, map: &PhaseMap) {
        let grid = Grid::new([map.width, map.height]);
        if self.grid != grid {
            *self = Self {
                grid,
                phase: Plane::new(grid),
                valid: vec![0; grid.all_blocks()],
                row: Along::none(grid, 1),
                column: Along::none(grid, grid.stride()),
                steps: vec![Default::default(); grid.all_blocks()],
            };
        }
        let Self { phase, valid, row, column, steps, .. } = self;
        let rows = grid.rows(phase).par_chunks_mut(grid.stride()).zip(grid.rows(valid).par_chunks_mut(grid.blocks));
        let rows = rows.zip(map.phase.par_chunks(map.width).zip(map.valid.par_chunks(map.width)));
        rows.for_each(|((phase, valid), (of_map, is_valid))| {
            phase[LANES..LANES + of_map.len()].copy_from_slice(of_map);
            for (bits, is_valid) in valid[1..].iter_mut().zip(is_valid.chunks(LANES)) {
                *bits = is_valid.iter().enumerate().fold(0, |bits, (k, &valid)| bits | u32::from(valid) << k);
            }
        });
        let level = Level::in_use();
        let (phase, valid) = (&*phase, &*valid);
        let rows = (
            grid.rows(steps).par_chunks_mut(grid.blocks),
            grid.rows(&mut row.runs_on).par_chunks_mut(grid.blocks),
            grid.rows(&mut row.passes).par_chunks_mut(grid.blocks),
            grid.rows(&mut row.turns).par_chunks_mut(grid.stride()),
            grid.rows(&mut column.runs_on).par_chunks_mut(grid.blocks),
            grid.rows(&mut column.passes).par_chunks_mut(grid.blocks),
        );
        let rows = rows.into_par_iter().enumerate();
        rows.for_each(|(v, (steps, row_runs_on, row_passes, turns, column_runs_on, column_passes))| {
            simd::run(level, StepsOfRow { grid, phase, valid, v, steps });
            let mut so_far = 0_i16;
            for (b, turns) in turns.as_chunks_mut::<LANES>().0.iter_mut().enumerate() {
                let [along_row, along_column] = &steps[b];
                (row_runs_on[b], row_passes[b]) = (along_row.runs_on, along_row.passes);
                (column_runs_on[b], column_passes[b]) = (along_column.runs_on, along_column.passes);
                let mut from = 0;
                for k in ones(along_row.up | along_row.down) {
                    turns[from..=k].fill(so_far);
                    so_far = so_far
                        .wrapping_add((along_row.up >> k & 1) as i16)
                        .wrapping_sub((along_row.down >> k & 1) as i16);
                    from = k + 1;
                }
                turns[from..].fill(so_far);
            }
        });
        for v in 1..map.height {
            let (above, here) = column.turns.split_at_mut(grid.row(v) - LANES);
            let above = &above[grid.row(v - 1) - LANES..];
            let steps = &steps[grid.blocks_of_row(v - 1).start - 1..];
            simd::run(level, TurnsOfRow { above, here: &mut here[..grid.stride()], steps });
        }
    }

    #[inline]
    pub(super) fn along(&self, axis: Axis) -> &Along {
        match axis {
            Axis::Row => &self.row,
            Axis::Column => &self.column,
        }
    }

    /// Tells of the pixels of a walk from a place, along an axis forwards or backwards, for at most `reach` pixels: place and
    /// whole turns skipped on the way.
    #[inline(always)]
    pub(super) fn walk(&self, from: usize, axis: Axis, forwards: bool, reach: usize, mut tell: impl FnMut(usize, i16)) {
        let along = self.along(axis);
        let mut here = from;
        for step in 0..reach {
            let next = if forwards { here + along.stride } else { here - along.stride };
            let runs_on = bit(&along.runs_on, here.min(next)) && (step == 0 || bit(&along.passes, here));
            let turns = along.turns[next].wrapping_sub(along.turns[from]);
            if !runs_on || is_a_period(self.phase[from], self.phase[next], turns) {
                return;
            }
            tell(next, turns);
            here = next;
        }
    }
}

/// Pixels of the farthest walk; a period is seldom longer, and one period is all that Eq. (2) uses.
pub(super) const FAR: u32 = 15;

/// Whether the phase has risen or fallen by a period or more.
#[inline(always)]
fn is_a_period(from: u16, to: u16, turns: i16) -> bool {
    ((i32::from(to) - i32::from(from)) + (i32::from(turns) << 16)).abs() >= 1 << 16
}

/// [`is_a_period`] of each lane, a bit each.
#[inline(always)]
pub(super) fn are_periods<L: Lanes>(lanes: L, from: L::Words, to: L::Words, turns: L::Words) -> u32 {
    let (zero, one) = (lanes.word(0), lanes.word(1));
    let up = lanes.bits(lanes.is_greater(turns, zero)) & lanes.bits(lanes.is_at_least(to, from));
    let down = lanes.bits(lanes.is_greater(zero, turns)) & lanes.bits(lanes.is_at_least(from, to));
    up | down | lanes.bits(lanes.is_greater(lanes.abs(turns), one))
}

/// Steps from the pixels of a block to the next ones, a bit each.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Steps {
    runs_on: u32,
    passes: u32,
    /// The wrapped phase runs on, and begins anew at 0.
    up: u32,
    /// The same downwards.
    down: u32,
}

/// Works out the steps of a row.
struct StepsOfRow<'a> {
    grid: Grid,
    phase: &'a [u16],
    valid: &'a [u32],
    v: usize,
    steps: &'a mut [[Steps; 2]],
}

impl Kernel for StepsOfRow<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        for (b, block) in (1..).zip(self.grid.blocks_of_row(self.v)) {
            let place = block * LANES;
            self.steps[b] = [self.of_block(lanes, place, 1), self.of_block(lanes, place, self.grid.stride())];
        }
    }
}

impl StepsOfRow<'_> {
    /// Steps to the pixels one stride on, from those of a block that begins at `place`.
    #[inline(always)]
    fn of_block<L: Lanes>(&self, lanes: L, place: usize, stride: usize) -> Steps {
        let [before, here, next] = [place - stride, place, place + stride].map(|place| words(self.phase, place));
        let [before, here, next] = [lanes.load(before), lanes.load(here), lanes.load(next)];
        steps(lanes, [before, here, next], bits_from(self.valid, place) & bits_from(self.valid, place + stride))
    }
}

#[inline(always)]
fn steps<L: Lanes>(lanes: L, [before, here, next]: [L::Words; 3], valid: u32) -> Steps {
    let zero = lanes.word(0);
    let step = lanes.sub(next, here);
    let change = lanes.abs(lanes.sub(lanes.sub(here, before), step));
    let runs_on = valid & lanes.bits(lanes.is_at_least(lanes.word(MAX_STEP as i16), lanes.abs(step)));
    let passes = lanes.bits(lanes.is_at_least(lanes.word(MAX_STEP_CHANGE as i16), change));
    let up = lanes.bits(lanes.is_greater(step, zero)) & !lanes.bits(lanes.is_at_least(next, here));
    let down = lanes.bits(lanes.is_greater(zero, step)) & !lanes.bits(lanes.is_at_least(here, next));
    Steps { runs_on, passes, up: up & runs_on, down: down & runs_on }
}

/// Adds the steps of a row to the turns skipped down to it.
struct TurnsOfRow<'a> {
    above: &'a [i16],
    here: &'a mut [i16],
    steps: &'a [[Steps; 2]],
}

impl Kernel for TurnsOfRow<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let (zero, one) = (lanes.word(0), lanes.word(1));
        let here: &mut [u16] = bytemuck::cast_slice_mut(self.here);
        for (b, here) in here.as_chunks_mut::<LANES>().0.iter_mut().enumerate() {
            let [_, Steps { up, down, .. }] = self.steps[b];
            let mut turns = lanes.load(words(self.above, b * LANES));
            if up | down != 0 {
                turns = lanes.add(turns, lanes.select(lanes.mask(up), one, zero));
                turns = lanes.sub(turns, lanes.select(lanes.mask(down), one, zero));
            }
            lanes.store(turns, here);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A row of pixels whose phase rises by `step` a pixel, with a jump of `jump` before pixel 6.
    fn row(step: i32, jump: i32) -> PhaseMap {
        let phase = |i: i32| (i * step + if i >= 6 { jump } else { 0 }) as u16;
        PhaseMap {
            width: 12,
            height: 1,
            phase: (0..12).map(phase).collect(),
            valid: vec![true; 12],
            ..PhaseMap::default()
        }
    }

    fn transposed(map: &PhaseMap) -> PhaseMap {
        PhaseMap { width: map.height, height: map.width, ..map.clone() }
    }

    /// Places met by the walks from pixel 5, as distances, and the absolute phases that they come to.
    fn met(map: &PhaseMap, axis: Axis) -> Vec<(i32, i32)> {
        let continuity = Continuity::of(map);
        let from = continuity.grid.place(5);
        let mut met = Vec::new();
        for forwards in [false, true] {
            continuity.walk(from, axis, forwards, FAR as usize, |place, turns| {
                let distance = (continuity.grid.pixel(place) as i32) - 5;
                met.push((distance, i32::from(turns) * 65536 + i32::from(continuity.phase[place])));
            });
        }
        met.sort_unstable();
        met
    }

    #[test]
    fn walks_unwrap_for_less_than_a_period_and_end_at_jumps() {
        let distances = |map: &PhaseMap| met(map, Axis::Row).into_iter().map(|(d, _)| d).collect::<Vec<_>>();
        assert_eq!(distances(&row(7000, 0)), [-5, -4, -3, -2, -1, 1, 2, 3, 4, 5, 6]);
        assert_eq!(distances(&row(15000, 0)), [-4, -3, -2, -1, 1, 2, 3, 4]);
        assert_eq!(distances(&row(7000, 20000)), [-5, -4, -3, -2, -1]);
        // A jump that hides as a moderate step is betrayed by its change of slope one pixel on.
        assert_eq!(distances(&row(7000, 9000)), [-5, -4, -3, -2, -1, 1]);
        let here = 5 * 7000;
        for (distance, absolute) in met(&row(7000, 0), Axis::Row) {
            assert_eq!(absolute - here, 7000 * distance);
        }
    }

    #[test]
    fn rows_and_columns_are_the_same() {
        for map in [row(7000, 0), row(-9000, 0), row(15000, 0), row(7000, 20000), row(7000, 9000), row(-15000, 3000)] {
            assert_eq!(met(&map, Axis::Row), met(&transposed(&map), Axis::Column));
        }
    }
}
