//! The orders of a pixel of C1 in all of space, and δ of each.
//!
//! ```text
//! for 32 orders k of one pixel, or one order of 32 pixels:
//!     x = the column at which Φ − field is k turns more than the phase φ of the pixel
//!     v, g = phase of C2 at x less φ, and its slope, from the two columns around x
//!     δ − field = −v / g · dΦ/dx, of the crossing near x
//! ```

use fringeflow_simd::{LANES, Lanes, first_lanes};

use crate::correspondence::drift::{DepthBlock, DepthPolynomial};
use crate::correspondence::epipolar_image::EpipolarImage;
use crate::correspondence::kernels::{MAX_COLUMN_STEP, interpolate_rows};
use crate::correspondence::segment::Segment;
use crate::correspondence::segment_table::SegmentTable;

/// Farthest and nearest inverse depth searched, relative to the middle of the volume: from nearly infinity to close to
/// the cameras.
const FARTHEST: f32 = 0.05;
const NEAREST: f32 = 1.5;
/// Least accepted denominator of Φ: below it its pole is near.
const MIN_DENOMINATOR: f32 = 0.1;
/// Slopes of C2 below this share of the rise of Φ are replaced by it: where C2 sees hardly any change, δ takes any
/// value.
const MIN_SLOPE_SHARE: f32 = 0.3;
/// Least rise of Φ, turns per column, that separates orders.
const MIN_RISE: f32 = 1e-5;
/// Largest order.
const MAX_ORDER: f32 = 8000.0;

/// The columns of C2 in which a pixel of C1 sees all of space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct SearchSpace {
    infinity_px: [f32; 3],
    last_px: f32,
    /// Mean half length of a segment, pixels.
    pub(super) half_px: f32,
}

impl SearchSpace {
    pub(super) fn from_table(table: &SegmentTable) -> Self {
        let half_px = table.drift_modes().map_or(1.0, |modes| modes.half_segment_px() as f32);
        Self { infinity_px: table.infinity_px, last_px: (table.epipolar_size_px()[0] - 1) as f32, half_px }
    }

    /// First and last column for a pixel in a column and row of C1.
    #[inline]
    pub(super) fn limits_px(&self, segment: &Segment, [u, v]: [usize; 2]) -> [f32; 2] {
        let [constant, along, across] = self.infinity_px;
        let infinity_px = constant + along * u as f32 + across * v as f32;
        let disparity_px = segment.reference_px - infinity_px;
        let (far, near) = (infinity_px + FARTHEST * disparity_px, infinity_px + NEAREST * disparity_px);
        // Before the volume only the image of C2 counts; behind it surfaces continue outside the image.
        let near = near.max(0.0).min(self.last_px - 1.0);
        [far.min(near).min(segment.begin_px), far.max(near).max(segment.end_px)]
    }
}

/// A pixel of C1 whose orders are asked, with Φ and the field along its segment.
#[derive(Clone, Copy, Debug)]
pub(super) struct Line {
    pub(super) segment: Segment,
    pub(super) field: DepthPolynomial,
    pub(super) phase: u16,
    /// Least and greatest Φ searched, turns.
    pub(super) phase_turns: [f32; 2],
}

impl Line {
    /// The line of a pixel, between two columns. `None` where Φ does not separate orders.
    #[inline]
    pub(super) fn within(
        segment: Segment,
        field: DepthPolynomial,
        phase: u16,
        [begin_px, end_px]: [f32; 2],
    ) -> Option<Self> {
        let [a, b, d] = segment.phase;
        let rise = b - a * d;
        let [mut begin, mut end] = [begin_px, end_px].map(|px| px - segment.reference_px);
        // Φ has its pole where the denominator is 0.
        let pole = (MIN_DENOMINATOR - 1.0) / d;
        if d > 0.0 {
            begin = begin.max(pole);
        } else if d < 0.0 {
            end = end.min(pole);
        }
        let at = |s: f32| (a + b * s) / (1.0 + d * s);
        let phase_turns = [at(begin).min(at(end)), at(begin).max(at(end))];
        let [least, most] = phase_turns;
        let separates_orders = rise.abs() >= MIN_RISE && least >= -MAX_ORDER && most <= MAX_ORDER && begin < end;
        separates_orders.then_some(Self { segment, field, phase, phase_turns })
    }

    /// First and last order; the first exceeds the last if there is none.
    pub(super) fn orders(&self) -> [i32; 2] {
        let ([least, most], phase_turns) = (self.phase_turns, f32::from(self.phase) / 65536.0);
        [(least - phase_turns).ceil() as i32, (most - phase_turns).floor() as i32]
    }
}

/// Φ and the field along the segments of some pixels, one lane each.
pub(super) struct Lines<L: Lanes> {
    /// Coefficients of Φ, and the column from which they count.
    pub(super) phase: [L::Floats; 3],
    pub(super) reference_px: L::Floats,
    pub(super) field: DepthBlock<L>,
    /// Least and greatest Φ searched, turns.
    pub(super) phase_turns: [L::Floats; 2],
}

/// Where C2 sees some orders.
pub(super) struct Places<L: Lanes> {
    pub(super) column_px: L::Floats,
    /// Columns per turn of Φ.
    per_turn: L::Floats,
    /// The places within the image.
    is_seen: L::Mask,
}

impl<L: Lanes> Lines<L> {
    /// The line of one pixel in all lanes.
    #[inline(always)]
    pub(super) fn splat(lanes: L, line: &Line) -> Self {
        let ([a, b, d], [least, most]) = (line.segment.phase, line.phase_turns);
        Self {
            phase: [lanes.float(a), lanes.float(b), lanes.float(d)],
            reference_px: lanes.float(line.segment.reference_px),
            field: DepthBlock::splat(lanes, &line.field),
            phase_turns: [lanes.float(least), lanes.float(most)],
        }
    }

    /// The places at which Φ − field has these values, turns.
    #[inline(always)]
    pub(super) fn places(&self, lanes: L, image: &EpipolarImage, turns: L::Floats) -> Places<L> {
        let ([a, b, d], [least, most]) = (self.phase, self.phase_turns);
        let turns = lanes.min_float(lanes.max_float(turns, least), most);
        let inverse = lanes.over(lanes.float(1.0), lanes.sub_float(b, lanes.times_float(d, turns)));
        let along = lanes.times_float(lanes.sub_float(turns, a), inverse);
        let rise = lanes.sub_float(b, lanes.times_float(a, d));
        let per_turn = lanes.times_float(lanes.times_float(inverse, inverse), rise);
        let column = lanes.add_float(along, self.reference_px);
        let column = lanes.add_float(column, lanes.times_float(self.field.at(lanes, column), per_turn));
        let last_px = lanes.float((image.width - 2) as f32);
        let (is_behind, is_before) = (lanes.reaches(column, lanes.float(0.0)), lanes.reaches(last_px, column));
        let is_seen = lanes.mask_of(lanes.both(is_behind, is_before));
        Places { column_px: lanes.min_float(lanes.max_float(column, lanes.float(0.0)), last_px), per_turn, is_seen }
    }
}

/// δ less the field of some orders.
pub(super) struct Rests<L: Lanes> {
    /// Turns.
    pub(super) rest_turns: L::Floats,
    /// The orders whose place C2 sees.
    pub(super) known: L::Mask,
}

/// δ less the field of the next `count` orders of a pixel, up to [`LANES`], the first of which has an absolute phase of
/// `first_turns`.
#[inline(always)]
pub(super) fn rests_of_orders<L: Lanes>(
    lanes: L,
    image: &EpipolarImage,
    line: &Line,
    first_turns: f32,
    count: usize,
) -> Rests<L> {
    let ramp = lanes.floats(lanes.widen(lanes.load_signed(&RAMP)));
    let turns = lanes.add_float(ramp, lanes.float(first_turns));
    let places = Lines::splat(lanes, line).places(lanes, image, turns);
    let around = columns_around(lanes, image, line.segment.row_px, line.phase, places.column_px);
    rests(lanes, &places, &around, lanes.mask(first_lanes(count)))
}

/// δ less the field of the crossings near some places, of those that are asked.
#[inline(always)]
pub(super) fn rests<L: Lanes>(lanes: L, places: &Places<L>, around: &Around<L>, asked: L::Mask) -> Rests<L> {
    let known = lanes.and(asked, lanes.and(places.is_seen, around.known));
    Rests { rest_turns: residual_turns(lanes, around, places.per_turn), known }
}

const RAMP: [i16; LANES] = {
    let mut ramp = [0; LANES];
    let mut k = 0;
    while k < LANES {
        ramp[k] = k as i16;
        k += 1;
    }
    ramp
};

/// The phase of C2 in the two columns around a place.
pub(super) struct Around<L: Lanes> {
    /// Phase in the column before it less that of the pixel, and the step to the column behind it.
    pub(super) value: L::Words,
    pub(super) slope: L::Words,
    /// Distance of the place from the first column, pixels.
    pub(super) share: L::Floats,
    /// Whether both columns have a phase, on one surface.
    pub(super) known: L::Mask,
}

/// δ less the field of the crossing near the places, turns. `per_turn` is the columns per turn of Φ.
#[inline(always)]
fn residual_turns<L: Lanes>(lanes: L, around: &Around<L>, per_turn: L::Floats) -> L::Floats {
    let slope = lanes.floats(lanes.widen(around.slope));
    let off = lanes.add_float(lanes.floats(lanes.widen(around.value)), lanes.times_float(around.share, slope));
    // Beyond C1, the projector sees a nearer point move against the way in which C2 sees it move.
    let steepness = lanes.times_float(slope, per_turn);
    let amount = lanes.max_amount(steepness, lanes.float(MIN_SLOPE_SHARE * 65536.0));
    let minus_off = lanes.sub_float(lanes.float(0.0), off);
    let is_against = lanes.reaches(lanes.float(0.0), steepness);
    lanes.over(lanes.select_float(is_against, off, minus_off), amount)
}

/// The phase of C2 around many columns of the row of one pixel.
#[inline(always)]
fn columns_around<L: Lanes>(lanes: L, image: &EpipolarImage, row_px: f32, phase: u16, column: L::Floats) -> Around<L> {
    let last = image.phase.len() / image.width - 1;
    let upper = (row_px.max(0.0) as usize).min(last);
    let lower = (upper + 1).min(last);
    let below = lanes.word(((row_px - upper as f32) * 65536.0) as i32 as u16 as i16);
    let row = |row: usize| &image.phase[row * image.width..(row + 1) * image.width];
    let before = lanes.longs(column);
    let rows = [lanes.pairs(row(upper), before), lanes.pairs(row(lower), before)];
    around(lanes, rows, below, lanes.word(phase as i16), lanes.sub_float(column, lanes.floats(before)))
}

/// The phase of C2 around one column for each of many pixels.
#[inline(always)]
pub(super) fn columns_around_each<L: Lanes>(
    lanes: L,
    image: &EpipolarImage,
    row_px: L::Floats,
    phases: L::Words,
    column: L::Floats,
) -> Around<L> {
    let last = (image.phase.len() / image.width - 1) as f32;
    let row_px = lanes.min_float(lanes.max_float(row_px, lanes.float(0.0)), lanes.float(last));
    let upper = lanes.longs(row_px);
    let share = lanes.times_float(lanes.sub_float(row_px, lanes.floats(upper)), lanes.float(65536.0));
    let below = lanes.narrow(lanes.longs(lanes.min_float(share, lanes.float(65535.0))));
    let before = lanes.longs(column);
    // Below 2^24, places are exact as floats.
    let width = lanes.float(image.width as f32);
    let begins = lanes.longs(lanes.times_float(lanes.floats(upper), width));
    let next = lanes.min_float(lanes.add_float(lanes.floats(upper), lanes.float(1.0)), lanes.float(last));
    let next = lanes.longs(lanes.times_float(next, width));
    // Written out: a closure would not be compiled for the SIMD level of the kernel.
    let upper = lanes.pairs(&image.phase, lanes.add_long(begins, before));
    let rows = [upper, lanes.pairs(&image.phase, lanes.add_long(next, before))];
    around(lanes, rows, below, phases, lanes.sub_float(column, lanes.floats(before)))
}

/// The phase of C2 between two columns of two rows; `below` is the share of the lower row in 1/65536.
#[inline(always)]
fn around<L: Lanes>(
    lanes: L,
    [upper, lower]: [[L::Words; 2]; 2],
    below: L::Words,
    phases: L::Words,
    share: L::Floats,
) -> Around<L> {
    let (first, has_first) = interpolate_rows(lanes, upper[0], lower[0], below);
    let (second, has_second) = interpolate_rows(lanes, upper[1], lower[1], below);
    let slope = lanes.sub(second, first);
    let moderate = lanes.is_at_least(lanes.word(MAX_COLUMN_STEP as i16), lanes.abs(slope));
    let known = lanes.and(lanes.and(has_first, has_second), moderate);
    Around { value: lanes.sub(first, phases), slope, share, known }
}
