//! An epipolar segment, and a row of them.

use super::patches::{PATCH_PX, POWERS};
use super::segment_fields::FIELDS;

/// The epipolar segment of one pixel of C1, in the epipolar frame of C2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// Row, pixels.
    pub row_px: f32,
    /// First column, pixels. It exceeds `end_px` if the pixel has no segment.
    pub begin_px: f32,
    /// Last column, pixels.
    pub end_px: f32,
    /// Column from which the back-projection phase is counted, pixels: where the middle of the measurement volume is
    /// seen.
    pub reference_px: f32,
    /// Coefficients (a, b, d) of the back-projection phase, see [`Self::phase_turns`].
    pub phase: [f32; 3],
}

impl Segment {
    /// Whether the pixel has no segment.
    #[must_use]
    #[inline]
    pub fn is_none(&self) -> bool {
        self.begin_px > self.end_px
    }

    /// First and last column, pixels.
    #[must_use]
    #[inline]
    pub fn limits_px(&self) -> [f32; 2] {
        [self.begin_px, self.end_px]
    }

    /// Back-projection phase Φ, turns, of the point seen at a column: `(a + b·s) / (1 + d·s)`, s the column from
    /// `reference_px`. Exact for a projector without distortion, to 0.002 turns with distortion.
    #[must_use]
    #[inline]
    pub fn phase_turns(&self, column_px: f32) -> f32 {
        let [a, b, d] = self.phase;
        let s = column_px - self.reference_px;
        (a + b * s) / (1.0 + d * s)
    }

    /// Column at which Φ has a value in turns, and columns per turn there; infinite or NaN if there is none.
    #[inline]
    pub(super) fn column_and_columns_per_turn(&self, phase_turns: f32) -> (f32, f32) {
        let [a, b, d] = self.phase;
        let inverse = 1.0 / (b - d * phase_turns);
        (self.reference_px + (phase_turns - a) * inverse, (b - a * d) * inverse * inverse)
    }
}

/// The segments of one row of C1, one array per quantity. Filled by [`super::SegmentTable::row`] and reused from row to
/// row. The length of each array is a multiple of sixteen; pixels beyond the image have no segment.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SegmentRow {
    /// First columns, pixels; beyond `end_px` where there is no segment.
    pub begin_px: Vec<f32>,
    /// Last columns, pixels.
    pub end_px: Vec<f32>,
    /// Rows of the epipolar frame, pixels.
    pub row_px: Vec<f32>,
    /// Columns from which the back-projection phase is counted, pixels.
    pub reference_px: Vec<f32>,
    /// Coefficients of the back-projection phase `(a + b·s) / (1 + d·s)`, s the column from `reference_px`: a, turns.
    pub a: Vec<f32>,
    /// b, turns a pixel.
    pub b: Vec<f32>,
    /// d, 1/pixel.
    pub d: Vec<f32>,
    /// Scratch for the coefficients of the table's fields along the row.
    pub(super) along_row: Vec<[[f32; POWERS]; FIELDS]>,
}

impl SegmentRow {
    /// The segment of the pixel in a column.
    #[must_use]
    #[inline]
    pub fn segment(&self, u: usize) -> Segment {
        Segment {
            row_px: self.row_px[u],
            begin_px: self.begin_px[u],
            end_px: self.end_px[u],
            reference_px: self.reference_px[u],
            phase: [self.a[u], self.b[u], self.d[u]],
        }
    }

    /// Makes room for the segments of a number of pixels, to be set one by one.
    pub(super) fn make_room(&mut self, count: usize) {
        let room = self.a.len().max(count);
        self.arrays().into_iter().for_each(|array| array.resize(room, 0.0));
    }

    /// Sets the segment of a pixel.
    #[inline]
    pub(super) fn set(&mut self, pixel: usize, segment: &Segment) {
        let Segment { row_px, begin_px, end_px, reference_px, phase: [a, b, d] } = *segment;
        let numbers = [begin_px, end_px, row_px, reference_px, a, b, d];
        self.arrays().into_iter().zip(numbers).for_each(|(array, number)| array[pixel] = number);
    }

    /// Resizes to `patches`; all numbers are to be overwritten.
    pub(super) fn resize(&mut self, patches: usize) {
        for array in self.arrays() {
            array.resize(patches * PATCH_PX, 0.0);
        }
        self.along_row.resize(patches, [[0.0; POWERS]; FIELDS]);
    }

    fn arrays(&mut self) -> [&mut Vec<f32>; 7] {
        [
            &mut self.begin_px,
            &mut self.end_px,
            &mut self.row_px,
            &mut self.reference_px,
            &mut self.a,
            &mut self.b,
            &mut self.d,
        ]
    }
}
