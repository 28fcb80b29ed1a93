//! The segments of 32 pixels.

use fringeflow_simd::{Lanes, filled};

use crate::correspondence::segment::SegmentRow;

/// The segments of 32 pixels; the fields of [`crate::correspondence::segment::Segment`].
pub(in crate::correspondence) struct Segments<L: Lanes> {
    lanes: L,
    /// First and last column, pixels.
    pub(in crate::correspondence) begin: L::Floats,
    pub(in crate::correspondence) end: L::Floats,
    /// Row, pixels.
    pub(in crate::correspondence) row: L::Floats,
    pub(in crate::correspondence) reference: L::Floats,
    pub(in crate::correspondence) a: L::Floats,
    pub(in crate::correspondence) b: L::Floats,
    pub(in crate::correspondence) d: L::Floats,
}

impl<L: Lanes> Segments<L> {
    /// The segments of a row from pixel `first` on.
    #[inline(always)]
    pub(in crate::correspondence) fn new(lanes: L, row: &SegmentRow, first: usize) -> Self {
        Self {
            lanes,
            begin: load(lanes, &row.begin_px, first),
            end: load(lanes, &row.end_px, first),
            row: load(lanes, &row.row_px, first),
            reference: load(lanes, &row.reference_px, first),
            a: load(lanes, &row.a, first),
            b: load(lanes, &row.b, first),
            d: load(lanes, &row.d, first),
        }
    }

    /// Back-projection phases Φ at columns, turns.
    #[inline(always)]
    pub(in crate::correspondence) fn phase_turns(&self, column_px: L::Floats) -> L::Floats {
        let lanes = self.lanes;
        let s = lanes.sub_float(column_px, self.reference);
        let above = lanes.add_float(self.a, lanes.times_float(self.b, s));
        let below = lanes.add_float(lanes.float(1.0), lanes.times_float(self.d, s));
        lanes.over(above, below)
    }

    /// Columns at which Φ has a value in turns, columns per turn there, and the pixels that have such a column.
    #[inline(always)]
    pub(in crate::correspondence) fn columns_of(&self, turns: L::Floats) -> ([L::Floats; 2], L::Truths) {
        let lanes = self.lanes;
        let denominator = lanes.sub_float(self.b, lanes.times_float(self.d, turns));
        let is_sound = lanes.exceeds(lanes.abs_float(denominator), lanes.float(f32::MIN_POSITIVE));
        let inverse = lanes.over(lanes.float(1.0), lanes.select_float(is_sound, denominator, lanes.float(1.0)));
        let along = lanes.times_float(lanes.sub_float(turns, self.a), inverse);
        let rise = lanes.sub_float(self.b, lanes.times_float(self.a, self.d));
        let per_turn = lanes.times_float(lanes.times_float(rise, inverse), inverse);
        ([lanes.add_float(self.reference, along), per_turn], is_sound)
    }

    /// The pixels whose column lies on their segment.
    #[inline(always)]
    pub(in crate::correspondence) fn have(&self, column_px: L::Floats) -> L::Truths {
        self.lanes.both(self.lanes.reaches(column_px, self.begin), self.lanes.reaches(self.end, column_px))
    }
}

/// The floats of a block, zeros beyond the end of the row. Not a closure: a closure that is not inlined at once turns
/// every instruction into a call.
#[inline(always)]
pub(in crate::correspondence) fn load<L: Lanes>(lanes: L, row: &[f32], first: usize) -> L::Floats {
    lanes.load_floats(&filled(&row[first..], 0.0))
}
