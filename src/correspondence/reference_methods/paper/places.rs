//! The places of C2 in which pixels of C1 have their correspondence, and how near to C2 their points lie.

use fringeflow_simd::{Kernel, Lanes, Level};

use crate::correspondence::segment::SegmentRow;
use crate::correspondence::segment_table::SegmentTable;

/// One entry per pixel of C1, row by row.
#[derive(Clone, Debug, Default)]
pub(super) struct Places {
    /// Index of the place in the epipolar frame. Undefined for pixels without correspondence.
    pub(super) of_pixels: Vec<u32>,
    /// How near to C2 the point lies, see [`SegmentTable::nearness_to_cam2`].
    pub(super) nearness: Vec<f32>,
}

impl Places {
    /// Resizes to `pixels`.
    pub(super) fn resize(&mut self, pixels: usize) {
        self.of_pixels.resize(pixels, 0);
        self.nearness.resize(pixels, 0.0);
    }
}

impl PlaceRow<'_> {
    /// Finds the places of a row of pixels from the columns of their correspondences.
    pub(super) fn find(self, table: &SegmentTable, segments: &SegmentRow, column_px: &[f32]) {
        let [width, height] = table.epipolar_size_px().map(|side| side as u32);
        fringeflow_simd::run(
            Level::in_use(),
            PlaceKernel { table, segments, column_px, last: [width - 1, height - 1], row: self },
        );
    }
}

/// The places of a row, to be written.
pub(super) struct PlaceRow<'a> {
    pub(super) of_pixels: &'a mut [u32],
    pub(super) nearness: &'a mut [f32],
}

/// Computes the places of a row.
struct PlaceKernel<'a> {
    table: &'a SegmentTable,
    segments: &'a SegmentRow,
    column_px: &'a [f32],
    /// Last column and row of the epipolar frame.
    last: [u32; 2],
    row: PlaceRow<'a>,
}

impl Kernel for PlaceKernel<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let Self { table, segments, column_px, last: [last_column, last_row], row } = self;
        let PlaceRow { of_pixels, nearness } = row;
        let width = of_pixels.len();
        let (column_px, row_px) = (&column_px[..width], &segments.row_px[..width]);
        let (x, y) = (&segments.ray_x[..width], &segments.ray_y[..width]);
        let nearness = &mut nearness[..width];
        for u in 0..width {
            let row = ((row_px[u] + 0.5) as u32).min(last_row);
            of_pixels[u] = row * (last_column + 1) + ((column_px[u] + 0.5) as u32).min(last_column);
            nearness[u] = table.nearness_of_ray([x[u], y[u]]);
        }
    }
}
