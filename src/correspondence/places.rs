//! Places of C2 that pixels of C1 have their correspondence in, and how near to C2 their points lie.

use rayon::prelude::*;

use crate::simd::{self, Kernel, Lanes, Level};

use super::segment::SegmentRow;
use super::segment_table::SegmentTable;

/// For each pixel of C1, row by row.
#[derive(Clone, Debug, Default)]
pub(super) struct Places {
    /// Index of the place in the epipolar frame; [`Self::NOWHERE`] of pixels without correspondence.
    pub(super) of_pixels: Vec<u32>,
    /// How near to C2 the point lies, see [`SegmentTable::nearness_to_cam2`].
    pub(super) nearness: Vec<f32>,
}

impl Places {
    /// Place of a pixel without correspondence.
    pub(super) const NOWHERE: u32 = u32::MAX;

    /// The places of correspondences whose columns are told pixel by pixel.
    pub(super) fn of(table: &SegmentTable, column_px: impl Fn(usize) -> Option<f32> + Sync) -> Self {
        let ([width, height], [epipolar_width, epipolar_height]) = (table.size_px(), table.epipolar_size_px());
        let mut places = Self { of_pixels: vec![Self::NOWHERE; width * height], nearness: vec![0.0; width * height] };
        let rows = places.of_pixels.par_chunks_mut(width).zip(places.nearness.par_chunks_mut(width)).enumerate();
        rows.for_each_init(SegmentRow::default, |segments, (v, (of_pixels, nearness))| {
            table.row(v, segments);
            for (u, place) in of_pixels.iter_mut().enumerate() {
                if let Some(column_px) = column_px(v * width + u) {
                    let row = ((segments.row_px[u] + 0.5) as usize).min(epipolar_height - 1);
                    let column = ((column_px + 0.5) as usize).min(epipolar_width - 1);
                    *place = (row * epipolar_width + column) as u32;
                }
            }
            for (u, nearness) in nearness.iter_mut().enumerate() {
                *nearness = table.nearness_of_ray([segments.ray_x[u], segments.ray_y[u]]);
            }
        });
        places
    }

    /// Makes room for the places of so many pixels.
    pub(super) fn resize(&mut self, pixels: usize) {
        self.of_pixels.resize(pixels, Self::NOWHERE);
        self.nearness.resize(pixels, 0.0);
    }
}

impl PlaceRow<'_> {
    /// Finds the places of the pixels of a row of C1, of whose correspondences the columns are told; those of pixels without
    /// one have no meaning.
    pub(super) fn find(self, table: &SegmentTable, segments: &SegmentRow, column_px: &[f32]) {
        let [width, height] = table.epipolar_size_px().map(|side| side as u32);
        simd::run(
            Level::in_use(),
            PlaceKernel { table, segments, column_px, last: [width - 1, height - 1], row: self },
        );
    }
}

/// Room for the places of a row.
pub(super) struct PlaceRow<'a> {
    pub(super) of_pixels: &'a mut [u32],
    pub(super) nearness: &'a mut [f32],
}

/// Fills in the places of a row.
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
