//! An epipolar row of C2 as a pixel of C1 sees it, and where the row has the phase of the pixel.

use std::ops::{ControlFlow, RangeInclusive};

use fringeflow_simd::{Kernel, LANES, Lanes, Level};

use super::epipolar_image::{EpipolarImage, MAX_NEIGHBOUR_STEP};
use super::kernels::{MAX_COLUMN_STEP, interpolate_rows};
use super::neighbourhood::phase_step;

/// Blocks of columns searched at once: more than most segments have.
const BLOCKS_AT_A_TIME: usize = 64;

/// An epipolar row as a pixel of C1 sees it: two rows of the image, interpolated at the fractional row.
pub(super) struct RowView<'a> {
    upper: &'a [u16],
    lower: &'a [u16],
    /// Share of the lower row, 1/65536.
    below: i32,
}

impl<'a> RowView<'a> {
    /// The row of a segment.
    #[inline]
    pub(super) fn new(image: &'a EpipolarImage, row_px: f32) -> Self {
        let last = image.phase.len() / image.width - 1;
        let upper = (row_px as usize).min(last);
        let lower = (upper + 1).min(last);
        let row = |r: usize| r * image.width..(r + 1) * image.width;
        Self {
            upper: &image.phase[row(upper)],
            lower: &image.phase[row(lower)],
            below: ((row_px - upper as f32) * 65536.0) as i32,
        }
    }

    /// Phase at a column, if there is one. Rows of different surfaces are not interpolated.
    #[inline]
    fn at(&self, column: usize) -> Option<u16> {
        let (upper, lower) = (self.upper[column], self.lower[column]);
        let step = phase_step(upper, lower);
        let is_phase = |phase: u16| phase != EpipolarImage::NO_PHASE;
        match (is_phase(upper), is_phase(lower)) {
            (true, true) if step.abs() <= MAX_NEIGHBOUR_STEP => {
                Some(upper.wrapping_add(((i64::from(step) * i64::from(self.below) + 32768) >> 16) as u16))
            }
            (has_upper, _) if self.below < 32768 => has_upper.then_some(upper),
            (_, has_lower) => has_lower.then_some(lower),
        }
    }

    /// Phase at a column less another phase, wrapped, turns · 65536.
    #[inline]
    fn difference(&self, column: usize, phase: u16) -> Option<i32> {
        self.at(column).map(|p| phase_step(phase, p))
    }

    /// Calls `visit` with each place between `columns` and within `limits_px` that has the phase: its column, and the
    /// slope of the phase there, turns · 65536 per pixel. Ends when `visit` breaks.
    #[inline]
    pub(super) fn crossings(
        &self,
        limits_px: [f32; 2],
        phase: u16,
        columns: RangeInclusive<usize>,
        mut visit: impl FnMut(f32, i32) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let [first_px, last_px] = limits_px;
        let mut previous: Option<i32> = None;
        for column in *columns.start()..=(*columns.end()).min(self.upper.len() - 1) {
            let current = self.difference(column, phase);
            if let (Some(before), Some(after)) = (previous, current)
                && let Some(column_px) = crossing(column - 1, before, after)
                && column_px >= first_px
                && column_px <= last_px
            {
                visit(column_px, after - before)?;
            }
            previous = current;
        }
        ControlFlow::Continue(())
    }

    /// As [`Self::crossings`], fast over many columns.
    pub(super) fn crossings_of_many(
        &self,
        limits_px: [f32; 2],
        phase: u16,
        columns: RangeInclusive<usize>,
        mut visit: impl FnMut(f32, i32) -> ControlFlow<()>,
    ) -> ControlFlow<()> {
        let (level, last) = (Level::in_use(), (*columns.end()).min(self.upper.len() - 1));
        let mut may_cross = [0; BLOCKS_AT_A_TIME];
        for first in (*columns.start()..last).step_by(BLOCKS_AT_A_TIME * LANES) {
            let may_cross = &mut may_cross[..(last - first).div_ceil(LANES).min(BLOCKS_AT_A_TIME)];
            fringeflow_simd::run(level, MayCross { row: self, phase, first, may_cross });
            for (block, &bits) in may_cross.iter().enumerate() {
                let mut rest = bits;
                while rest != 0 {
                    let before = first + block * LANES + rest.trailing_zeros() as usize;
                    rest &= rest - 1;
                    if before < last {
                        self.crossings(limits_px, phase, before..=before + 1, &mut visit)?;
                    }
                }
            }
        }
        ControlFlow::Continue(())
    }

    /// The column before a crossing within `limits_px`, in the first of the `ranges` that has one.
    pub(super) fn any_crossing(
        &self,
        limits_px: [f32; 2],
        phase: u16,
        ranges: &[RangeInclusive<usize>],
    ) -> Option<usize> {
        fringeflow_simd::run(Level::in_use(), AnyCrossing { row: self, limits_px, phase, ranges })
    }
}

/// Searches ranges of columns for a crossing.
struct AnyCrossing<'a, 'b> {
    row: &'a RowView<'b>,
    limits_px: [f32; 2],
    phase: u16,
    ranges: &'a [RangeInclusive<usize>],
}

impl Kernel for AnyCrossing<'_, '_> {
    type Output = Option<usize>;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> Option<usize> {
        let Self { row, limits_px, phase, ranges } = self;
        let mut range = 0;
        while range < ranges.len() {
            let (mut first, end) = (*ranges[range].start(), (*ranges[range].end()).min(row.upper.len() - 1));
            range += 1;
            while first < end {
                let mut crossed = [0];
                MayCross { row, phase, first, may_cross: &mut crossed }.run(lanes);
                let [mut crossed] = crossed;
                while crossed != 0 {
                    let before = first + crossed.trailing_zeros() as usize;
                    crossed &= crossed - 1;
                    let mut is_one = |_, _| ControlFlow::Break(());
                    if before < end && row.crossings(limits_px, phase, before..=before + 1, &mut is_one).is_break() {
                        return Some(before);
                    }
                }
                first += LANES;
            }
        }
        None
    }
}

/// Marks the columns between which and the next the row may cross the phase, a bit each. Both have a phase, the signs
/// of their differences differ, and one of them is near.
struct MayCross<'a, 'b> {
    row: &'a RowView<'b>,
    phase: u16,
    first: usize,
    may_cross: &'a mut [u32],
}

impl Kernel for MayCross<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(mut self, lanes: L) {
        let may_cross = std::mem::take(&mut self.may_cross);
        let mut here = self.columns(lanes, self.first);
        for (block, may_cross) in may_cross.iter_mut().enumerate() {
            let next = self.columns(lanes, self.first + (block + 1) * LANES);
            // Bits of the next columns.
            let right = |bits: fn(&ColumnBits) -> u32| bits(&here) >> 1 | bits(&next) << (LANES - 1);
            *may_cross = here.has_phase
                & right(|bits| bits.has_phase)
                & (here.is_behind ^ right(|bits| bits.is_behind))
                & (here.is_near | right(|bits| bits.is_near));
            here = next;
        }
    }
}

/// Properties of [`LANES`] columns, a bit each.
#[derive(Clone, Copy)]
struct ColumnBits {
    has_phase: u32,
    /// The phase of the row exceeds that of the pixel.
    is_behind: u32,
    /// The difference is at most half the largest step of a crossing.
    is_near: u32,
}

impl MayCross<'_, '_> {
    #[inline(always)]
    fn columns<L: Lanes>(&self, lanes: L, first: usize) -> ColumnBits {
        let (difference, has_phase) = self.differences(lanes, first);
        let is_behind = lanes.bits(lanes.is_greater(difference, lanes.word(0)));
        let half_step = lanes.word((MAX_COLUMN_STEP / 2) as i16);
        let is_near = lanes.bits(lanes.is_at_least(half_step, lanes.abs(difference)));
        ColumnBits { has_phase, is_behind, is_near }
    }

    /// The phase of the row less that of the pixel, as by [`RowView::difference`], and the columns that have one.
    #[inline(always)]
    fn differences<L: Lanes>(&self, lanes: L, first: usize) -> (L::Words, u32) {
        let upper = lanes.load(&columns(self.row.upper, first));
        let lower = lanes.load(&columns(self.row.lower, first));
        let (phase, known) = interpolate_rows(lanes, upper, lower, lanes.word(self.row.below as i16));
        (lanes.sub(phase, lanes.word(self.phase as i16)), lanes.bits(known))
    }
}

/// [`LANES`] columns of a row. Columns beyond its end have no phase.
#[inline(always)]
fn columns(row: &[u16], first: usize) -> [u16; LANES] {
    fringeflow_simd::filled(row.get(first..).unwrap_or_default(), EpipolarImage::NO_PHASE)
}

/// Sub-pixel column at which the phase difference changes sign between neighbouring columns of one surface.
#[inline]
fn crossing(column: usize, before: i32, after: i32) -> Option<f32> {
    let changes_sign = (before <= 0 && after > 0) || (before > 0 && after <= 0);
    if !changes_sign || (after - before).abs() > MAX_COLUMN_STEP {
        return None;
    }
    Some(column as f32 + before as f32 / (before - after) as f32)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::correspondence::test_random::random;

    #[test]
    fn many_columns_at_once_are_each_by_itself() {
        let mut random = random(5);
        let width = 333;
        for row_px in [0.0, 0.3, 0.5, 0.9999, 1.0] {
            // Rising and falling surfaces with holes, the second row a little ahead, now and then by half a turn.
            let slope = random(20_000) as i32 - 10_000;
            let mut phase = Vec::new();
            for row in 0..2 {
                phase.extend((0..width).map(|column: i32| match random(12) {
                    0 => EpipolarImage::NO_PHASE,
                    1 => random(65536) as u16,
                    _ => (slope * column + 700 * row + random(2000) as i32) as u16,
                }));
            }
            let image = EpipolarImage { width: width as usize, phase, ..EpipolarImage::default() };
            let row = RowView::new(&image, row_px);
            for phase in (0..65536).step_by(4099).map(|phase| phase as u16) {
                let limits_px = [7.3, 329.1];
                let mut expected = Vec::new();
                let all = row.crossings(limits_px, phase, 7..=330, |column_px, slope| {
                    expected.push((column_px, slope));
                    ControlFlow::Continue(())
                });
                assert!(all.is_continue());
                let mut found = Vec::new();
                let all = row.crossings_of_many(limits_px, phase, 7..=330, |column_px, slope| {
                    found.push((column_px, slope));
                    ControlFlow::Continue(())
                });
                assert!(all.is_continue());
                assert_eq!(found, expected);
                let columns: Vec<usize> = expected.iter().map(|(column_px, _)| *column_px as usize).collect();
                let later = columns.iter().copied().find(|&column| (150..330).contains(&column));
                for level in Level::ALL {
                    let of = |ranges: &[RangeInclusive<usize>]| {
                        fringeflow_simd::run(level, AnyCrossing { row: &row, limits_px, phase, ranges })
                    };
                    assert_eq!(of(&[7..=330]), columns.first().copied());
                    assert_eq!(of(&[150..=330, 7..=330]), later.or(columns.first().copied()));
                }
                for first in [0, 7, 300, 332] {
                    let bits = Level::ALL.map(|level| {
                        let mut may_cross = [0; 3];
                        fringeflow_simd::run(level, MayCross { row: &row, phase, first, may_cross: &mut may_cross });
                        may_cross
                    });
                    assert_eq!(bits, [bits[0]; 3]);
                }
            }
        }
    }
}
