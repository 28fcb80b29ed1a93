//! 32 pixels: their segments, the drift along them, and the searches at their columns.

use fringeflow_simd::Lanes;

use crate::correspondence::drift::{DepthBlock, DepthRow};
use crate::correspondence::epipolar_image::EpipolarImage;
use crate::correspondence::kernels::{Segments, block_of, load};
use crate::correspondence::pixel_search::{COLUMN_MARGIN_PX, FLAT_TURNS, Reach};
use crate::correspondence::segment::SegmentRow;

/// Most columns of an interval.
pub(super) const MAX_WIDTH: i32 = 24;
/// Greatest accepted Φ, turns: beyond it Φ is near its pole.
const MAX_TURNS: f32 = 1e4;
/// Beyond all orders of ranges.
const NO_ORDER: f32 = 32_000.0;
/// Upper bound of columns.
const MAX_COLUMN: f32 = i16::MAX as f32;

/// A row of pixels, with the inputs of its search.
#[derive(Clone, Copy)]
pub(in crate::correspondence::semi_global) struct Row<'a> {
    pub(in crate::correspondence::semi_global) image: &'a EpipolarImage,
    pub(in crate::correspondence::semi_global) segments: &'a SegmentRow,
    pub(in crate::correspondence::semi_global) drift: &'a DepthRow,
    pub(in crate::correspondence::semi_global) reach: Reach,
    pub(in crate::correspondence::semi_global) phase: &'a [u16],
    /// sd of δ of each pixel, turns.
    pub(in crate::correspondence::semi_global) sd_turns: &'a [f32],
}

/// 32 pixels.
pub(super) struct Pixels<L: Lanes> {
    lanes: L,
    pub(super) segments: Segments<L>,
    first_px: L::Floats,
    last_px: L::Floats,
    /// b − a·d.
    rise: L::Floats,
    /// Least and greatest Φ within the limits.
    least: L::Floats,
    most: L::Floats,
    phase_turns: L::Floats,
    drift: DepthBlock<L>,
    pub(super) sd_turns: L::Floats,
}

/// Columns in which candidates can lie.
pub(super) struct Interval<L: Lanes> {
    pub(super) begin: L::Words,
    /// The last column, rounded down and up.
    pub(super) end_floor: L::Words,
    pub(super) end_ceil: L::Words,
    /// Pixels with such columns, and pixels for which there are few enough.
    pub(super) some: L::Mask,
    pub(super) narrow: L::Mask,
}

impl<L: Lanes> Pixels<L> {
    /// The pixels of a row from `first` on. Also returns the regular ones.
    #[inline(always)]
    pub(super) fn new(lanes: L, row: &Row<'_>, first: usize) -> (Self, L::Mask) {
        let segments = Segments::new(lanes, row.segments, first);
        let beyond = lanes.float(row.reach.beyond_px);
        let zero = lanes.float(0.0);
        let phases = lanes.floats(lanes.widen_unsigned(lanes.load(block_of(row.phase, first))));
        let mut pixels = Self {
            lanes,
            first_px: lanes.max_float(lanes.sub_float(segments.begin, beyond), zero),
            last_px: lanes.min_float(lanes.add_float(segments.end, beyond), lanes.float(row.reach.last_column_px)),
            rise: lanes.sub_float(segments.b, lanes.times_float(segments.a, segments.d)),
            segments,
            least: zero,
            most: zero,
            phase_turns: lanes.times_float(phases, lanes.float(1.0 / 65536.0)),
            drift: row.drift.block(lanes, first),
            sd_turns: load(lanes, row.sd_turns, first),
        };
        let (at_first, at_last) =
            (pixels.segments.phase_turns(pixels.first_px), pixels.segments.phase_turns(pixels.last_px));
        pixels.least = lanes.min_float(at_first, at_last);
        pixels.most = lanes.max_float(at_first, at_last);
        let is_small = |turns: L::Floats| lanes.exceeds(lanes.float(MAX_TURNS), lanes.abs_float(turns));
        let changes = lanes.exceeds(lanes.sub_float(pixels.most, pixels.least), lanes.float(FLAT_TURNS));
        let is_known = lanes.both(lanes.exceeds(pixels.sd_turns, zero), lanes.reaches(pixels.segments.row, zero));
        let regular = lanes.both(lanes.both(is_small(at_first), is_small(at_last)), lanes.both(changes, is_known));
        (pixels, lanes.mask_of(regular))
    }

    #[inline(always)]
    pub(super) fn drift_at(&self, column_px: L::Floats) -> L::Floats {
        self.drift.at(self.lanes, column_px)
    }

    #[inline(always)]
    pub(super) fn order_and_residual(&self, column_px: L::Floats) -> (L::Longs, L::Floats) {
        let lanes = self.lanes;
        let turns = lanes.sub_float(self.segments.phase_turns(column_px), self.drift_at(column_px));
        let turns = lanes.sub_float(turns, self.phase_turns);
        let nearest = lanes.add_float(turns, lanes.with_sign(lanes.float(0.5), turns));
        let nearest = lanes.min_float(lanes.max_float(nearest, lanes.float(-NO_ORDER)), lanes.float(NO_ORDER));
        let order = lanes.longs(nearest);
        (order, lanes.sub_float(turns, lanes.floats(order)))
    }

    #[inline(always)]
    pub(super) fn is_within_limits(&self, column_px: L::Floats) -> L::Truths {
        self.lanes.both(self.lanes.reaches(column_px, self.first_px), self.lanes.reaches(self.last_px, column_px))
    }

    /// Column at which Φ has a value, clamped to the limits, and the inverse of b − d·Φ.
    #[inline(always)]
    fn column_at(&self, turns: L::Floats) -> (L::Floats, L::Floats) {
        let lanes = self.lanes;
        let segments = &self.segments;
        let inverse = lanes.over(lanes.float(1.0), lanes.sub_float(segments.b, lanes.times_float(segments.d, turns)));
        let offset = lanes.times_float(lanes.sub_float(turns, segments.a), inverse);
        let column_px = lanes.add_float(segments.reference, offset);
        (lanes.min_float(lanes.max_float(column_px, self.first_px), self.last_px), inverse)
    }

    /// The columns in which candidates of an order can lie, as
    /// [`crate::correspondence::pixel_search::PixelSearch::columns_of`] gives them.
    #[inline(always)]
    pub(super) fn columns_of(&self, order: L::Longs, reach: L::Floats) -> Interval<L> {
        let lanes = self.lanes;
        let clamp = |turns: L::Floats| lanes.min_float(lanes.max_float(turns, self.least), self.most);
        let target = lanes.add_float(lanes.floats(order), self.phase_turns);
        let (at_target, _) = self.column_at(clamp(target));
        let middle = lanes.add_float(target, self.drift_at(at_target));
        let some = lanes.both(
            lanes.reaches(lanes.add_float(middle, reach), self.least),
            lanes.reaches(self.most, lanes.sub_float(middle, reach)),
        );
        let clamped = clamp(middle);
        let (column_px, inverse) = self.column_at(clamped);
        let per_turn = lanes.abs_float(lanes.times_float(lanes.times_float(self.rise, inverse), inverse));
        let off = lanes.abs_float(lanes.sub_float(middle, clamped));
        let half = lanes.times_float(lanes.add_float(reach, off), per_turn);
        let half = lanes.add_float(half, lanes.float(COLUMN_MARGIN_PX));
        let narrow = lanes.reaches(lanes.float((MAX_WIDTH / 2 - 1) as f32), half);
        let within = |px: L::Floats| lanes.min_float(lanes.max_float(px, lanes.float(0.0)), lanes.float(MAX_COLUMN));
        let end = within(lanes.add_float(column_px, half));
        let end_floor = lanes.longs(end);
        let is_between = lanes.exceeds(end, lanes.floats(end_floor));
        let next = lanes.add_long(end_floor, lanes.long(1));
        Interval {
            begin: lanes.narrow(lanes.longs(within(lanes.sub_float(column_px, half)))),
            end_floor: lanes.narrow(end_floor),
            end_ceil: lanes.narrow(lanes.select_long(is_between, next, end_floor)),
            some: lanes.mask_of(some),
            narrow: lanes.mask_of(narrow),
        }
    }
}
