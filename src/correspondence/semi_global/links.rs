//! Which neighbours lie on one surface, as far as the wrapped phase of C1 tells, and how their orders continue.
//!
//! In: phases of C1 and the orders of each pixel. Out: for each pixel and each of four axes whether the phase runs on from the
//! pixel before it, and which of its orders continues the first one of that. A jump, or a bend before or behind, parts them;
//! so a link is the same whichever way it is gone.

use rayon::prelude::*;

use fringeflow_simd::{Kernel, Lanes, Level};

use crate::correspondence::neighbourhood::{MAX_STEP, MAX_STEP_CHANGE};
use crate::phase::PhaseMap;

use super::bands::{self, BAND_ROWS};
use super::order_ranges::OrderRanges;

/// Steps of the axes, columns and rows, from a pixel to the next.
pub(super) const AXES: [[isize; 2]; 4] = [[1, 0], [0, 1], [1, 1], [-1, 1]];
/// Orders by which the ranges of neighbours may be shifted against each other.
pub(super) const MAX_SHIFT: usize = 8;
/// No link.
const NONE: u8 = u8::MAX;

/// The links of all pixels to those before them.
#[derive(Clone, Debug, Default)]
pub(super) struct Links {
    /// Axis by axis, for each pixel by how many orders its range is shifted against that of the pixel before, [`MAX_SHIFT`]
    /// added; [`NONE`] where there is no link.
    shifts: [Vec<u8>; AXES.len()],
    /// Width of the image, pixels.
    width: usize,
    scratches: Vec<[Rises; 3]>,
}

impl Links {
    /// Finds the links of all pixels.
    pub(super) fn find(&mut self, cam1: &PhaseMap, ranges: &OrderRanges) {
        self.width = cam1.width.max(1);
        bands::resize(&mut self.scratches, cam1.height);
        for (axis, shifts) in AXES.into_iter().zip(&mut self.shifts) {
            shifts.resize(cam1.phase.len(), NONE);
            let bands = shifts.par_chunks_mut(self.width * BAND_ROWS).zip(&mut self.scratches).enumerate();
            bands.for_each(|(band, (shifts, rises))| {
                rises.iter_mut().for_each(|rises| rises.resize(cam1.width));
                LinkBand { cam1, ranges, axis, rises }.find(band * BAND_ROWS, shifts);
            });
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
    /// That of a pixel. Without branches as far as may be: links begin and end where nobody can foresee it.
    #[inline(always)]
    pub(super) fn towards(&self, u: usize) -> Link {
        let column = u.wrapping_add_signed(if self.forward { -self.du } else { self.du });
        let shift = *self.shifts.get(if self.forward { u } else { column }).unwrap_or(&NONE);
        // Left of the image there is no link, so the column of one is always in the image.
        let is_link = shift != NONE;
        let shift = if self.forward { shift } else { (2 * MAX_SHIFT as u8).wrapping_sub(shift) };
        Link { is_link, column: if is_link { column } else { 0 }, shift: usize::from(shift) }
    }

    /// For each pixel the place that an order of the pixel before has in its range, `places` being those orders' places in
    /// theirs; [`NO_PLACE`] where there is none, or no link. A place beyond the range is beyond all places of ranges.
    #[inline(always)]
    pub(super) fn carry(&self, places: &[u8], out: &mut [u8]) {
        let width = out.len();
        let (to, from) = if self.forward { (self.du, -self.du) } else { (-self.du, self.du) };
        let range = columns(width, to);
        out[..range.start].fill(NO_PLACE);
        out[range.end..].fill(NO_PLACE);
        if self.shifts.is_empty() {
            out.fill(NO_PLACE);
            return;
        }
        let before = range.start.wrapping_add_signed(from)..range.end.wrapping_add_signed(from);
        let places = &places[before.clone()];
        let shifts = if self.forward { &self.shifts[range.clone()] } else { &self.shifts[before] };
        let (out, shifts) = (&mut out[range], &shifts[..places.len()]);
        let none = MAX_SHIFT as u8;
        for i in 0..places.len() {
            let place = if self.forward {
                places[i].wrapping_add(none).wrapping_sub(shifts[i])
            } else {
                places[i].wrapping_sub(none).wrapping_add(shifts[i])
            };
            out[i] = if (places[i] == NO_PLACE) | (shifts[i] == NONE) { NO_PLACE } else { place };
        }
    }
}

/// Stands for no order of a range: ranges have fewer than half of its places.
pub(super) const NO_PLACE: u8 = u8::MAX;

/// Where a path comes from.
#[derive(Clone, Copy)]
pub(super) struct Link {
    /// Whether it comes from anywhere; else the rest has no meaning.
    pub(super) is_link: bool,
    /// Column of the pixel before, always one of the image.
    pub(super) column: usize,
    /// Where its costs begin, for the first order of the pixel.
    pub(super) shift: usize,
}

/// How the phase rises to the pixels of a row from those before them, with a column of none on either side.
#[derive(Clone, Debug, Default)]
struct Rises {
    rise: Vec<i16>,
    /// Whether both have a phase, as all bits or none.
    known: Vec<i16>,
}

impl Rises {
    fn resize(&mut self, width: usize) {
        self.rise.resize(width + 2, 0);
        self.known.resize(width + 2, 0);
    }
}

/// Finds the links along an axis, row after row.
struct LinkBand<'a> {
    cam1: &'a PhaseMap,
    ranges: &'a OrderRanges,
    axis: [isize; 2],
    /// Scratch for the rises to the pixels before those of a row, to these, and to those behind.
    rises: &'a mut [Rises; 3],
}

impl LinkBand<'_> {
    /// Those of the rows from the first one on.
    fn find(&mut self, first: usize, shifts: &mut [u8]) {
        let [_, dv] = self.axis;
        if dv != 0 {
            self.rise(first.wrapping_sub(1), 0);
            self.rise(first, 1);
        }
        for (i, shifts) in shifts.chunks_mut(self.cam1.width.max(1)).enumerate() {
            let v = first + i;
            let places = if dv == 0 { [1; 3] } else { [0, 1, 2] };
            self.rise(v + dv as usize, places[2]);
            shifts.fill(NONE);
            if let Some(from) = self.begin(v.wrapping_add_signed(-dv)) {
                let rises = places.map(|place| &self.rises[place]);
                let (cam1, ranges, du, to) = (self.cam1, self.ranges, self.axis[0], v * self.cam1.width);
                fringeflow_simd::run(Level::in_use(), Linking { cam1, ranges, du, from, to, rises, shifts });
            }
            self.rises.rotate_left(dv as usize);
        }
    }

    /// Fills in the rises to the pixels of a row.
    fn rise(&mut self, row: usize, place: usize) {
        let begins = self.begin(row).zip(self.begin(row.wrapping_add_signed(-self.axis[1])));
        let rises = &mut self.rises[place];
        rises.known.fill(0);
        if let Some((to, from)) = begins {
            fringeflow_simd::run(Level::in_use(), RiseRow { cam1: self.cam1, du: self.axis[0], from, to, rises });
        }
    }

    /// Where a row begins, if the image has it.
    fn begin(&self, row: usize) -> Option<usize> {
        (row < self.cam1.height).then(|| row * self.cam1.width)
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
struct Linking<'a> {
    cam1: &'a PhaseMap,
    ranges: &'a OrderRanges,
    du: isize,
    /// Where the rows of the pixels before and of the pixels begin.
    from: usize,
    to: usize,
    /// Those to the pixels before, to these, and to those behind.
    rises: [&'a Rises; 3],
    shifts: &'a mut [u8],
}

impl Kernel for Linking<'_> {
    type Output = ();

    /// In 16 bits throughout: differences that leave them are no links either way.
    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let Self { cam1, ranges, du, from, to, rises: [before, here, behind], shifts } = self;
        let range = columns(cam1.width, du);
        let shifted = |by: isize| {
            let (begin, end) = (range.start.wrapping_add_signed(1 + by), range.end.wrapping_add_signed(1 + by));
            begin..end
        };
        let at = |begin: usize, by: isize| {
            (begin + range.start).wrapping_add_signed(by)..(begin + range.end).wrapping_add_signed(by)
        };
        let shifts = &mut shifts[range.clone()];
        let width = shifts.len();
        let (rise, known) = (&here.rise[shifted(0)][..width], &here.known[shifted(0)][..width]);
        let (rise_before, known_before) = (&before.rise[shifted(-du)][..width], &before.known[shifted(-du)][..width]);
        let (rise_behind, known_behind) = (&behind.rise[shifted(du)][..width], &behind.known[shifted(du)][..width]);
        let (own, other) = (at(to, 0), at(from, -du));
        let (phase, phase_before) = (&cam1.phase[own.clone()][..width], &cam1.phase[other.clone()][..width]);
        let (first, first_before) = (&ranges.first[own.clone()][..width], &ranges.first[other.clone()][..width]);
        let (count, count_before) = (&ranges.count[own][..width], &ranges.count[other][..width]);
        for i in 0..width {
            let here = rise[i];
            let bends = |other: i16, known: i16| {
                (known != 0) & (other.saturating_sub(here).unsigned_abs() > MAX_STEP_CHANGE as u16)
            };
            let up = i16::from((here > 0) & (phase[i] < phase_before[i]));
            let down = i16::from((here < 0) & (phase[i] > phase_before[i]));
            let shift = first[i].saturating_sub(first_before[i]).saturating_add(MAX_SHIFT as i16 + down - up);
            let linked = (known[i] != 0)
                & (here.unsigned_abs() <= MAX_STEP as u16)
                & !bends(rise_before[i], known_before[i])
                & !bends(rise_behind[i], known_behind[i])
                & (count[i] > 0)
                & (count_before[i] > 0)
                & (shift as u16 <= 2 * MAX_SHIFT as u16);
            shifts[i] = if linked { shift as u8 } else { NONE };
        }
    }
}
