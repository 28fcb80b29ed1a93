//! The search of one pixel of C1 along its segment and beyond.

use std::ops::ControlFlow;

use crate::correspondence::drift::DepthPolynomial;
use crate::correspondence::epipolar_image::EpipolarImage;
use crate::correspondence::row_view::RowView;
use crate::correspondence::segment::Segment;

/// Columns by which an interval is widened to cover rounding.
const COLUMN_MARGIN_PX: f32 = 0.02;
/// Rise of Φ over all columns below which they are searched as one interval, turns: a projector near C1 lights a ray
/// with one phase.
const FLAT_TURNS: f32 = 2e-3;

/// A pixel of C1 and the columns of C2 in which its candidates are sought.
pub(super) struct PixelSearch<'a> {
    pub(super) row: RowView<'a>,
    pub(super) segment: Segment,
    pub(super) drift: DepthPolynomial,
    pub(super) limits_px: [f32; 2],
    /// Least and greatest Φ within these limits, turns.
    phase_range_turns: [f32; 2],
    pub(super) phase: u16,
}

impl<'a> PixelSearch<'a> {
    /// The search of a pixel with this phase, within these columns.
    pub(super) fn within(
        cam2: &'a EpipolarImage,
        segment: Segment,
        drift: DepthPolynomial,
        phase: u16,
        limits_px: [f32; 2],
    ) -> Self {
        let [a, b] = limits_px.map(|column_px| segment.phase_turns(column_px));
        let phase_range_turns = [a.min(b), a.max(b)];
        Self { row: RowView::new(cam2, segment.row_px), segment, drift, limits_px, phase_range_turns, phase }
    }

    /// The fringe order of a point seen at a column, and δ less the drift, turns: Φ − drift − phase of the pixel, split
    /// into whole turns and rest.
    #[inline]
    pub(super) fn order_and_residual(&self, column_px: f32) -> (i32, f32) {
        let turns = self.segment.phase_turns(column_px) - self.drift.at(column_px) - f32::from(self.phase) / 65536.0;
        let order = (turns + 0.5_f32.copysign(turns)) as i32;
        (order, turns - order as f32)
    }

    /// Whether a column lies on the segment, that is, its point in the measurement volume.
    #[inline]
    pub(super) fn is_in_volume(&self, column_px: f32) -> bool {
        column_px >= self.segment.begin_px && column_px <= self.segment.end_px
    }

    /// The columns in which candidates of an order with |δ − drift| up to `reach_turns` can lie.
    #[inline]
    pub(super) fn columns_of(&self, order: i32, reach_turns: f32) -> Option<[f32; 2]> {
        let [first_px, last_px] = self.limits_px;
        let [least, most] = self.phase_range_turns;
        if most - least <= FLAT_TURNS {
            return Some(self.limits_px);
        }
        let target = order as f32 + f32::from(self.phase) / 65536.0;
        let within = |turns: f32| {
            let (column_px, columns_per_turn) = self.segment.column_and_columns_per_turn(turns.clamp(least, most));
            (column_px.clamp(first_px, last_px), columns_per_turn.abs())
        };
        // The drift in the middle stands for the interval: over its width it changes by far less than the reach.
        let middle = target + self.drift.at(within(target).0);
        if middle + reach_turns < least || middle - reach_turns > most {
            return None;
        }
        let (column_px, columns_per_turn) = within(middle);
        // Clamping moves the middle; the interval grows by as much, so that its other end stays where it was.
        let half_px = (reach_turns + (middle - middle.clamp(least, most)).abs()) * columns_per_turn + COLUMN_MARGIN_PX;
        Some([column_px - half_px, column_px + half_px])
    }

    /// Calls `visit` with the column and slope of every crossing in an interval of columns.
    #[inline]
    pub(super) fn crossings(&self, [begin_px, end_px]: [f32; 2], mut visit: impl FnMut(f32, i32)) {
        let columns = begin_px.max(0.0) as usize..=end_px.max(0.0).ceil() as usize;
        let _ = self.row.crossings(self.limits_px, self.phase, columns, |column_px, slope| {
            visit(column_px, slope);
            ControlFlow::Continue(())
        });
    }
}
