//! Places of C2 that pixels of C1 have their correspondence in, and how near to C2 their points lie.

use rayon::prelude::*;

use super::segment::SegmentRow;
use super::segment_table::SegmentTable;

/// For each pixel of C1, row by row.
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
}
