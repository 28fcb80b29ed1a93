//! The drift over the image of C1, for display.

use std::f64::consts::TAU;

use super::Drift;
use super::coordinates::DepthRow;
use crate::correspondence::segment::SegmentRow;
use crate::correspondence::segment_table::SegmentTable;

/// DriftCoordinates along a segment, as shares of it, at which the greatest drift is sought.
const PLACES: [f32; 5] = [0.0, 0.25, 0.5, 0.75, 1.0];

/// The drift about its mean, for every pixel of C1 with a segment.
#[derive(Clone, Debug, PartialEq)]
pub struct DriftMap {
    /// Width and height of the image of C1, pixels.
    pub size_px: [usize; 2],
    /// Drift in the middle of the segment, row by row, rad; `None` where there is no segment.
    pub middle_rad: Vec<Option<f32>>,
    /// Greatest magnitude over the whole volume, rad.
    pub greatest_rad: f32,
}

impl DriftMap {
    /// The map of a drift over the segments of its rig.
    #[must_use]
    pub fn new(drift: &Drift, table: &SegmentTable) -> Self {
        let size_px @ [width, height] = table.size_px();
        let (mut middle_rad, mut greatest_rad) = (Vec::with_capacity(width * height), 0.0_f32);
        let (mut segments, mut along_row) = (SegmentRow::default(), DepthRow::default());
        for v in 0..height {
            drift.along_row(v, width, &mut along_row);
            table.row(v, &mut segments);
            for u in 0..width {
                let segment = segments.segment(u);
                let along_segment = along_row.segment(u);
                let [begin_px, end_px] = segment.limits_px();
                let about_mean_rad = |place: f32| {
                    let turns = along_segment.at(begin_px + place * (end_px - begin_px));
                    (f64::from(turns) * TAU - drift.mean_rad) as f32
                };
                if segment.is_none() {
                    middle_rad.push(None);
                    continue;
                }
                middle_rad.push(Some(about_mean_rad(0.5)));
                greatest_rad = PLACES.map(about_mean_rad).into_iter().map(f32::abs).fold(greatest_rad, f32::max);
            }
        }
        Self { size_px, middle_rad, greatest_rad }
    }
}
