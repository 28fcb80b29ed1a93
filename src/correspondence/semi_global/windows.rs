//! The orders that are asked about, pixel by pixel.

use rayon::prelude::*;

use super::super::segment::{Segment, SegmentRow};
use super::Scene;

/// How far segments reach beyond the volume on either side: half their mean length, further where that is fewer orders than
/// these, but no more than their length. What stands behind a shallow volume is few orders away. Where a segment has hardly
/// more than one order, none is to be told from it.
const BEYOND_VOLUME: f32 = 0.5;
const ORDERS_BEYOND: f32 = 9.0;
const FEW_ORDERS: f32 = 2.0;
/// Pixels of C1 of which one is asked for the mean number of orders on a segment.
const STRIDE: usize = 97;
/// Turns of δ by which a window is wider than its segment, so that a candidate at its end has its order.
const DELTA_MARGIN_TURNS: f32 = 0.25;
/// Orders are handled so many at a time.
pub(super) const LANE_STEP: usize = 16;
/// Most orders of a pixel; further ones beyond the volume are left out.
pub(super) const MAX_LANES: usize = 128;

/// For each pixel of C1 the orders that a candidate can have.
pub(super) struct Windows {
    /// Least order of each pixel.
    pub(super) first: Vec<i16>,
    /// Number of orders of each pixel; 0 where there is no phase or no segment.
    pub(super) count: Vec<u8>,
    /// Room for the orders of a pixel, a multiple of [`LANE_STEP`].
    pub(super) lanes: usize,
    /// How far segments reach beyond the volume, pixels of the epipolar frame.
    beyond_px: f32,
    /// Last column of the epipolar frame, pixels.
    last_column_px: f32,
}

impl Windows {
    pub(super) fn of(scene: &Scene<'_>) -> Self {
        let length_px = scene.table.drift_modes().map_or(0.0, |modes| 2.0 * modes.half_segment_px() as f32);
        let orders = mean_orders(scene);
        let wanted = if orders < FEW_ORDERS { BEYOND_VOLUME } else { ORDERS_BEYOND / orders };
        let beyond_px = length_px * wanted.clamp(BEYOND_VOLUME, 1.0);
        let last_column_px = (scene.table.epipolar_size_px()[0] - 1) as f32;
        let mut windows = Self { first: Vec::new(), count: Vec::new(), lanes: 0, beyond_px, last_column_px };
        let ranges: Vec<(i16, u8)> =
            (0..scene.cam1.height).into_par_iter().flat_map_iter(|v| windows.orders_of_row(scene, v)).collect();
        let most = ranges.iter().map(|range| usize::from(range.1)).max().unwrap_or(0);
        windows.lanes = most.div_ceil(LANE_STEP).max(1) * LANE_STEP;
        (windows.first, windows.count) = ranges.into_iter().unzip();
        windows
    }

    /// First and last column at which candidates of a segment are sought, pixels.
    #[inline]
    pub(super) fn limits_px(&self, segment: &Segment) -> [f32; 2] {
        let first_px = (segment.begin_px - self.beyond_px).max(0.0);
        [first_px, (segment.end_px + self.beyond_px).min(self.last_column_px)]
    }

    fn orders_of_row(&self, scene: &Scene<'_>, v: usize) -> Vec<(i16, u8)> {
        let width = scene.cam1.width;
        let mut segments = SegmentRow::default();
        scene.table.row(v, &mut segments);
        (0..width).map(|u| self.orders(scene, &segments.segment(u), v * width + u)).collect()
    }

    fn orders(&self, scene: &Scene<'_>, segment: &Segment, pixel: usize) -> (i16, u8) {
        if !scene.cam1.valid[pixel] || segment.is_none() {
            return (0, 0);
        }
        let phase_turns = f32::from(scene.cam1.phase[pixel]) / 65536.0;
        let at = |column_px: f32| segment.phase_turns(column_px) - phase_turns;
        let range = |[first_px, last_px]: [f32; 2]| {
            let (a, b) = (at(first_px), at(last_px));
            let least = (a.min(b) - DELTA_MARGIN_TURNS).ceil();
            (least, (a.max(b) + DELTA_MARGIN_TURNS).floor() - least + 1.0)
        };
        let (first, count) = range(self.limits_px(segment));
        let (within, _) = range(segment.limits_px());
        // Beyond the volume Φ may run into its pole: then the orders around the segment proper are asked about.
        let fits = count <= MAX_LANES as f32 && first.abs() < f32::from(i16::MAX / 2);
        let first = if fits { first } else { within - (MAX_LANES / 4) as f32 };
        (first as i16, count.clamp(1.0, MAX_LANES as f32) as u8)
    }
}

/// Mean rise of Φ over a segment, turns; at least one.
fn mean_orders(scene: &Scene<'_>) -> f32 {
    let pixels = (0..scene.cam1.phase.len()).step_by(STRIDE).filter(|&pixel| scene.table.has_segment(pixel));
    let rises = pixels.map(|pixel| {
        let segment = scene.table.segment(pixel);
        (segment.phase_turns(segment.end_px) - segment.phase_turns(segment.begin_px)).abs()
    });
    let (sum, count) = rises.fold((0.0_f32, 0.0_f32), |(sum, count), rise| (sum + rise, count + 1.0));
    (sum / count.max(1.0)).max(1.0)
}
