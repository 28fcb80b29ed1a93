//! Which neighbours lie on one surface, as far as the wrapped phase of C1 tells, and how their orders continue.
//!
//! In: phases of C1 and the orders of each pixel. Out: for each pixel and each of four axes whether the phase runs on from the
//! pixel before it, and which of its orders continues the first one of that. A jump, or a bend before or behind, parts them;
//! so a link is the same whichever way it is gone.

use rayon::prelude::*;

use crate::phase::PhaseMap;
use crate::simd::{self, Kernel, Lanes, Level};

use super::super::neighbourhood::{MAX_STEP, MAX_STEP_CHANGE};
use super::windows::Windows;

/// Steps of the axes, columns and rows, from a pixel to the next.
pub(super) const AXES: [[isize; 2]; 4] = [[1, 0], [0, 1], [1, 1], [-1, 1]];
/// Orders by which the windows of neighbours may be shifted against each other.
pub(super) const MAX_SHIFT: usize = 8;
/// No link.
const NONE: u8 = u8::MAX;

/// The links of all pixels to those before them.
#[derive(Clone, Debug, Default)]
pub(super) struct Links {
    /// Axis by axis, for each pixel by how many orders its window is shifted against that of the pixel before, [`MAX_SHIFT`]
    /// added; [`NONE`] where there is no link.
    shifts: [Vec<u8>; AXES.len()],
    /// Width of the image, pixels.
    width: usize,
}

impl Links {
    /// Finds the links of all pixels.
    pub(super) fn find(&mut self, cam1: &PhaseMap, windows: &Windows) {
        self.width = cam1.width.max(1);
        for (axis, shifts) in AXES.into_iter().zip(&mut self.shifts) {
            shifts.clear();
            shifts.resize(cam1.phase.len(), NONE);
            shifts.par_chunks_mut(self.width).enumerate().for_each_init(
                || [(); 3].map(|()| Rises::new(cam1.width)),
                |rises, (v, shifts)| LinkRow { cam1, windows, axis, v, rises, shifts }.find(),
            );
        }
    }

    /// Where paths along an axis come from at the pixels of a row, going with the axis or against it.
    #[inline(always)]
    pub(super) fn of_row(&self, axis: usize, v: usize, forward: bool) -> RowLinks<'_> {
        let ([du, dv], shifts) = (AXES[axis], &self.shifts[axis]);
        let row = if forward { v } else { v.wrapping_add_signed(dv) };
        // What lies beyond the end of the image has no link.
        let shifts = row.checked_mul(self.width).and_then(|begin| shifts.get(begin..begin + self.width));
        RowLinks { shifts: shifts.unwrap_or(&[]), du, forward }
    }
}

/// Where paths along an axis come from at the pixels of a row.
#[derive(Clone, Copy)]
pub(super) struct RowLinks<'a> {
    shifts: &'a [u8],
    du: isize,
    forward: bool,
}

impl RowLinks<'_> {
    /// That of a pixel.
    #[inline(always)]
    pub(super) fn towards(&self, u: usize) -> Option<Link> {
        let column = u.wrapping_add_signed(if self.forward { -self.du } else { self.du });
        let shift = usize::from(*self.shifts.get(if self.forward { u } else { column })?);
        // Left of the image there is no link, so the column of one is always in the image.
        (shift != usize::from(NONE))
            .then(|| Link { column, shift: if self.forward { shift } else { 2 * MAX_SHIFT - shift } })
    }
}

/// Where a path comes from.
pub(super) struct Link {
    /// Column of the pixel before.
    pub(super) column: usize,
    /// Where its energies begin, for the first order of the pixel.
    pub(super) shift: usize,
}

/// How the phase rises to the pixels of a row from those before them, with a column of none on either side.
struct Rises {
    rise: Vec<i16>,
    /// Whether both have a phase, as all bits or none.
    known: Vec<i16>,
}

impl Rises {
    fn new(width: usize) -> Self {
        Self { rise: vec![0; width + 2], known: vec![0; width + 2] }
    }
}

/// The links of a row.
struct LinkRow<'a> {
    cam1: &'a PhaseMap,
    windows: &'a Windows,
    axis: [isize; 2],
    v: usize,
    /// Of the pixels before those of the row, of these, and of those behind.
    rises: &'a mut [Rises; 3],
    shifts: &'a mut [u8],
}

impl LinkRow<'_> {
    fn find(mut self) {
        let [_, dv] = self.axis;
        for (place, rises) in [-1, 0, 1].into_iter().zip(self.rises.iter_mut()) {
            let row = self.v.wrapping_add_signed(place * dv);
            let begin = Self::begin(self.cam1, row).zip(Self::begin(self.cam1, row.wrapping_add_signed(-dv)));
            rises.known.fill(0);
            if let Some((to, from)) = begin {
                simd::run(Level::in_use(), RiseRow { cam1: self.cam1, du: self.axis[0], from, to, rises });
            }
        }
        if let Some(from) = Self::begin(self.cam1, self.v.wrapping_add_signed(-dv)) {
            simd::run(Level::in_use(), Linking { row: &mut self, from });
        }
    }

    /// Where a row begins, if the image has it.
    fn begin(cam1: &PhaseMap, row: usize) -> Option<usize> {
        (row < cam1.height).then(|| row * cam1.width)
    }
}

/// Fills in the rises of a row.
struct RiseRow<'a> {
    cam1: &'a PhaseMap,
    du: isize,
    /// Where the rows of the pixels before and of the pixels begin.
    from: usize,
    to: usize,
    rises: &'a mut Rises,
}

/// Columns of a row of so many whose pixel so many columns before is in the row.
#[inline(always)]
fn columns(width: usize, du: isize) -> std::ops::Range<usize> {
    du.max(0) as usize..width - (-du).max(0) as usize
}

impl Kernel for RiseRow<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let width = self.cam1.width;
        let range = columns(width, self.du);
        let before = range.start.wrapping_add_signed(-self.du)..range.end.wrapping_add_signed(-self.du);
        let of = |begin: usize, range: &std::ops::Range<usize>| begin + range.start..begin + range.end;
        let (to, from) = (of(self.to, &range), of(self.from, &before));
        let (phase_to, phase_from) = (&self.cam1.phase[to.clone()], &self.cam1.phase[from.clone()]);
        let (valid_to, valid_from) = (&self.cam1.valid[to], &self.cam1.valid[from]);
        let (rise, known) = (
            &mut self.rises.rise[range.start + 1..range.end + 1],
            &mut self.rises.known[range.start + 1..range.end + 1],
        );
        for i in 0..rise.len() {
            rise[i] = phase_to[i].wrapping_sub(phase_from[i]) as i16;
            known[i] = -i16::from(valid_to[i] & valid_from[i]);
        }
    }
}

/// Finds the links of a row from its rises.
struct Linking<'a, 'b> {
    row: &'a mut LinkRow<'b>,
    /// Where the row of the pixels before begins.
    from: usize,
}

impl Kernel for Linking<'_, '_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let Linking { row, from } = self;
        let (width, [du, _]) = (row.cam1.width, row.axis);
        let range = columns(width, du);
        let shifted = |by: isize| {
            let (begin, end) = (range.start.wrapping_add_signed(1 + by), range.end.wrapping_add_signed(1 + by));
            begin..end
        };
        let at = |begin: usize, by: isize| {
            (begin + range.start).wrapping_add_signed(by)..(begin + range.end).wrapping_add_signed(by)
        };
        let [before, here, behind] = &*row.rises;
        let (rise, known) = (&here.rise[shifted(0)], &here.known[shifted(0)]);
        let (rise_before, known_before) = (&before.rise[shifted(-du)], &before.known[shifted(-du)]);
        let (rise_behind, known_behind) = (&behind.rise[shifted(du)], &behind.known[shifted(du)]);
        let (own, other) = (at(row.v * width, 0), at(from, -du));
        let (phase, phase_before) = (&row.cam1.phase[own.clone()], &row.cam1.phase[other.clone()]);
        let (first, first_before) = (&row.windows.first[own.clone()], &row.windows.first[other.clone()]);
        let (count, count_before) = (&row.windows.count[own], &row.windows.count[other]);
        let shifts = &mut row.shifts[range.clone()];
        for i in 0..shifts.len() {
            let here = i32::from(rise[i]);
            let bends = |other: i16, known: i16| (known != 0) & ((i32::from(other) - here).abs() > MAX_STEP_CHANGE);
            let carry = (i32::from(phase_before[i]) + here - i32::from(phase[i])) >> 16;
            let shift = i32::from(first[i]) - carry - i32::from(first_before[i]) + MAX_SHIFT as i32;
            let linked = (known[i] != 0)
                & (here.abs() <= MAX_STEP)
                & !bends(rise_before[i], known_before[i])
                & !bends(rise_behind[i], known_behind[i])
                & (count[i] > 0)
                & (count_before[i] > 0)
                & (shift >= 0)
                & (shift <= 2 * MAX_SHIFT as i32);
            shifts[i] = if linked { shift as u8 } else { NONE };
        }
    }
}
