//! Links: which neighbours lie on one surface by the wrapped phase of C1, and how their orders continue.
//!
//! In: phases of C1 and the order range of each pixel. Out: for each pixel and each of four axes whether the phase
//! continues from the pixel before, and which of its orders continues the first order of that pixel.
//!
//! ```text
//! for each axis, for each band of rows, in parallel; for each pixel p and the pixel q before it:
//!     rise = phase(p) − phase(q), wrapped
//!     linked if both have a phase and orders, the rise is small, and the rises to q and behind p differ little from it
//!     carry = the whole turn that the wrapped phase skips from q to p
//!     shift = first order of p − first order of q − carry       no link if it exceeds MAX_SHIFT
//! ```
//!
//! A bend before or behind cuts the link, so a link is the same in both directions.

use rayon::prelude::*;

use fringeflow_simd::{Kernel, Lanes, Level};

use crate::correspondence::neighbourhood::{MAX_STEP, MAX_STEP_CHANGE};
use crate::phase::PhaseMap;

use super::order_ranges::OrderRanges;
use crate::correspondence::bands::{self, BAND_ROWS};

/// Steps of the axes, columns and rows, from a pixel to the next one.
pub(super) const AXES: [[isize; 2]; 4] = [[1, 0], [0, 1], [1, 1], [-1, 1]];
/// Most orders by which the ranges of linked pixels may be shifted against each other.
pub(super) const MAX_SHIFT: usize = 8;
/// No link.
const NONE: u8 = u8::MAX;

/// The links of all pixels to those before them.
#[derive(Clone, Debug, Default)]
pub(super) struct Links {
    /// Axis by axis, for each pixel the shift of its range against that of the pixel before, orders, plus
    /// [`MAX_SHIFT`]; [`NONE`] without link.
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
        // The links of an axis are found once, and read in both directions.
        for (axis, shifts) in AXES.into_iter().zip(&mut self.shifts) {
            shifts.resize(cam1.phase.len(), NONE);
            let bands = shifts.par_chunks_mut(self.width * BAND_ROWS).zip(&mut self.scratches).enumerate();
            bands.for_each(|(band, (shifts, rises))| {
                rises.iter_mut().for_each(|rises| rises.resize(cam1.width));
                LinkBand { cam1, ranges, axis, rises }.find(band * BAND_ROWS, shifts);
            });
        }
    }

    /// The links along an axis at the pixels of a row, in the direction of the axis or against it.
    #[inline(always)]
    pub(super) fn row(&self, axis: usize, v: usize, forward: bool) -> RowLinks<'_> {
        let ([du, dv], shifts) = (AXES[axis], &self.shifts[axis]);
        let row = if forward { v } else { v.wrapping_add_signed(dv) };
        // Pixels beyond the end of the image have no link.
        let shifts = row.checked_mul(self.width).and_then(|begin| shifts.get(begin..begin + self.width));
        RowLinks { shifts: shifts.unwrap_or(&[]), du, forward }
    }
}

/// The links along an axis at the pixels of a row.
#[derive(Clone, Copy)]
pub(super) struct RowLinks<'a> {
    shifts: &'a [u8],
    du: isize,
    forward: bool,
}

impl RowLinks<'_> {
    /// The link of a pixel. Free of branches as far as possible: where links begin and end is unpredictable.
    #[inline(always)]
    pub(super) fn link(&self, u: usize) -> Link {
        let column = u.wrapping_add_signed(if self.forward { -self.du } else { self.du });
        let shift = *self.shifts.get(if self.forward { u } else { column }).unwrap_or(&NONE);
        // Beyond the image there is no link, so the column of a link always lies in the image.
        let is_link = shift != NONE;
        let shift = if self.forward { shift } else { (2 * MAX_SHIFT as u8).wrapping_sub(shift) };
        Link { is_link, column: if is_link { column } else { 0 }, shift: usize::from(shift) }
    }

    /// Carries `places`, the places of orders in their ranges, from each pixel to the next one. The result is
    /// [`NO_PLACE`] if there is no place or no link, and a place beyond every range if the order lies beyond the range.
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

/// Stands for no order of a range. Ranges have fewer than half as many places.
pub(super) const NO_PLACE: u8 = u8::MAX;

/// The link of a pixel to the one before on a path.
#[derive(Clone, Copy)]
pub(super) struct Link {
    /// Whether there is a link; otherwise the rest is undefined.
    pub(super) is_link: bool,
    /// Column of the pixel before; always in the image.
    pub(super) column: usize,
    /// Offset of its costs, for the first order of the pixel.
    pub(super) shift: usize,
}

/// Rise of the phase to the pixels of a row from those before them, with an empty column on either side.
#[derive(Clone, Debug, Default)]
struct Rises {
    rise: Vec<i16>,
    /// All bits set where both have a phase, else 0.
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
    /// The rises to the pixels before those of a row, to these, and to those behind them.
    rises: &'a mut [Rises; 3],
}

impl LinkBand<'_> {
    /// The links of the rows from `first` on.
    fn find(&mut self, first: usize, shifts: &mut [u8]) {
        let [_, dv] = self.axis;
        if dv != 0 {
            self.rise(first.wrapping_sub(1), 0);
            self.rise(first, 1);
        }
        for (i, shifts) in shifts.chunks_mut(self.cam1.width.max(1)).enumerate() {
            let v = first + i;
            // Across rows the rises are those to this row and its neighbours. Along the row all three are in one row.
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

    /// Computes the rises to the pixels of a row.
    fn rise(&mut self, row: usize, place: usize) {
        let begins = self.begin(row).zip(self.begin(row.wrapping_add_signed(-self.axis[1])));
        let rises = &mut self.rises[place];
        rises.known.fill(0);
        if let Some((to, from)) = begins {
            fringeflow_simd::run(Level::in_use(), RiseRow { cam1: self.cam1, du: self.axis[0], from, to, rises });
        }
    }

    /// Where a row begins, if it lies in the image.
    fn begin(&self, row: usize) -> Option<usize> {
        (row < self.cam1.height).then(|| row * self.cam1.width)
    }
}

/// Computes the rises of a row.
struct RiseRow<'a> {
    cam1: &'a PhaseMap,
    du: isize,
    /// Where the rows of the pixels before and of the pixels begin.
    from: usize,
    to: usize,
    rises: &'a mut Rises,
}

/// The columns of a row of `width` whose pixel `du` columns before lies in the row.
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
        let offset_range = |begin: usize, range: &std::ops::Range<usize>| begin + range.start..begin + range.end;
        let (to, from) = (offset_range(self.to, &range), offset_range(self.from, &before));
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
    /// The rises to the pixels before, to these, and to those behind.
    rises: [&'a Rises; 3],
    shifts: &'a mut [u8],
}

impl Kernel for Linking<'_> {
    type Output = ();

    /// In 16 bits throughout: a difference that overflows is no link either way.
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
            // The whole turn that the wrapped phase skips changes the order.
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
