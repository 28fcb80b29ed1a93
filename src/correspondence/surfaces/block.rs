//! A block of pixels, and where C2 sees their orders.

use fringeflow_simd::{LANES, Lanes, filled};

use crate::correspondence::drift::{DepthBlock, DepthRow};
use crate::correspondence::epipolar_image::EpipolarImage;
use crate::correspondence::kernels::Segments;
use crate::correspondence::segment::SegmentRow;

use super::NO_ORDER;
use super::order_scores::{columns_around_each, residual_turns};

/// A block of pixels, with the inputs of their search.
pub(super) struct Block<L: Lanes> {
    lanes: L,
    pub(super) segments: Segments<L>,
    drift: DepthBlock<L>,
    /// Wrapped phases, 1/65536 turns.
    phases: L::Words,
    phase_turns: L::Floats,
}

/// The columns at which Φ is order + phase of the pixels, and columns per turn there.
pub(super) struct OrderColumns<L: Lanes> {
    /// Pixels that have an order and such a column.
    pub(super) has_order: L::Mask,
    pub(super) column: L::Floats,
    columns_per_turn: L::Floats,
}

/// |δ − drift|, turns, of the pixels where C2 shows it.
pub(super) struct DriftOffset<L: Lanes> {
    known: L::Mask,
    turns: L::Floats,
}

impl<L: Lanes> Block<L> {
    /// The block of a row that begins with pixel `first`.
    #[inline(always)]
    pub(super) fn new(lanes: L, segments: &SegmentRow, drift: &DepthRow, phase: &[u16], first: usize) -> Self {
        let phases = lanes.load(&filled(&phase[first..], 0));
        let phase_turns = lanes.times_float(lanes.floats(lanes.widen_unsigned(phases)), lanes.float(1.0 / 65536.0));
        let segments = Segments::new(lanes, segments, first);
        Self { lanes, segments, drift: drift.block(lanes, first), phases, phase_turns }
    }

    /// The columns of the orders without drift.
    #[inline(always)]
    pub(super) fn order_columns(&self, orders: &[i16; LANES]) -> OrderColumns<L> {
        let (lanes, order) = (self.lanes, self.lanes.load_signed(orders));
        let turns = lanes.add_float(lanes.floats(lanes.widen(order)), self.phase_turns);
        let ([column, columns_per_turn], is_sound) = self.segments.columns_of(turns);
        let has_order = lanes.and_not(lanes.mask_of(is_sound), lanes.is_equal(order, lanes.word(NO_ORDER)));
        OrderColumns { has_order, column, columns_per_turn }
    }

    /// The columns where C2 sees the orders: δ equals the drift there.
    #[inline(always)]
    pub(super) fn columns_with_drift(&self, columns: &OrderColumns<L>) -> L::Floats {
        let lanes = self.lanes;
        lanes.add_float(
            columns.column,
            lanes.times_float(self.drift.at(lanes, columns.column), columns.columns_per_turn),
        )
    }

    /// Pixels whose phase C2 shows near these columns, with |δ − drift| below `reach_turns`.
    #[inline(always)]
    pub(super) fn fits(&self, cam2: &EpipolarImage, columns: &OrderColumns<L>, reach_turns: f32) -> L::Mask {
        self.is_within_reach(&self.drift_offset(cam2, columns), reach_turns)
    }

    /// |δ − drift| at these columns.
    #[inline(always)]
    pub(super) fn drift_offset(&self, cam2: &EpipolarImage, columns: &OrderColumns<L>) -> DriftOffset<L> {
        let lanes = self.lanes;
        let last_px = lanes.float((cam2.width - 2) as f32);
        let column = lanes.min_float(lanes.max_float(self.columns_with_drift(columns), lanes.float(0.0)), last_px);
        let around = columns_around_each(lanes, cam2, self.segments.row, self.phases, column);
        let off = lanes.abs_float(residual_turns(lanes, &around, columns.columns_per_turn));
        DriftOffset { known: lanes.and(around.known, columns.has_order), turns: off }
    }

    /// Pixels where it is known and below `reach_turns`.
    #[inline(always)]
    pub(super) fn is_within_reach(&self, offset: &DriftOffset<L>, reach_turns: f32) -> L::Mask {
        let lanes = self.lanes;
        lanes.and(offset.known, lanes.mask_of(lanes.exceeds(lanes.float(reach_turns), offset.turns)))
    }
}
