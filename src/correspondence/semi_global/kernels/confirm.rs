//! Confirms the known orders of 32 pixels.
//!
//! ```text
//! x = the column at which Φ − drift is order + phase of the pixel
//! repeat a few times, while C2 has phases in the columns around x:
//!     x = where the line through these phases has the phase of the pixel
//! confirmed: x lies between the two columns, and |δ − drift| there is small
//! ```

use fringeflow_simd::Lanes;

use crate::correspondence::kernels::{BLOCK, Segments, block_of, load};
use crate::correspondence::surfaces::{NO_ORDER, columns_around_each};

use super::Row;
use super::selection::{Found, SelectedBlock};

/// Largest |δ − drift| of a confirmed pixel, sd.
const MAX_Z: f32 = 4.0;
/// Most iterations. The first column is seldom off by more than one, so more are not needed.
const MAX_ITERATIONS: usize = 3;
/// Largest move per iteration, pixels: where phases hardly change, the line leads anywhere.
const MAX_MOVE_PX: f32 = 2.0;

impl Row<'_> {
    /// Confirms the pixels from `first` on that have an order in `orders`, [`NO_ORDER`] standing for none. Returns the
    /// confirmed pixels, a bit each.
    #[inline(always)]
    pub(in crate::correspondence::semi_global) fn confirm<L: Lanes>(
        &self,
        lanes: L,
        first: usize,
        orders: &[i16; BLOCK],
        out: &mut SelectedBlock<'_>,
    ) -> u32 {
        let float = |value: f32| lanes.float(value);
        let segments = Segments::new(lanes, self.segments, first);
        let phases = lanes.load(block_of(self.phase, first));
        let order = lanes.load_signed(orders);
        let fraction = lanes.times_float(lanes.floats(lanes.widen_unsigned(phases)), float(1.0 / 65536.0));
        let target = lanes.add_float(lanes.floats(lanes.widen(order)), fraction);
        let ([column_px, per_turn], is_sound) = segments.columns_of(target);
        let is_sound = lanes.both(is_sound, lanes.reaches(segments.row, float(0.0)));
        // The drift is constant over such small moves.
        let drift = self.drift.block(lanes, first).at(lanes, column_px);
        let mut column_px = lanes.add_float(column_px, lanes.times_float(drift, per_turn));
        let has_order = lanes.and_not(lanes.mask_of(is_sound), lanes.is_equal(order, lanes.word(NO_ORDER)));
        let (mut found, mut todo) = (lanes.mask(0), has_order);
        let (mut at_px, mut slopes) = (float(0.0), lanes.long(0));
        let last_px = float((self.image.width - 2) as f32);
        for _ in 0..MAX_ITERATIONS {
            column_px = lanes.min_float(lanes.max_float(column_px, float(0.0)), last_px);
            let around = columns_around_each(lanes, self.image, segments.row, phases, column_px);
            let slope = lanes.widen(around.slope);
            let is_flat = lanes.is_equal(around.slope, lanes.word(0));
            // Flat pairs are masked below; 1 avoids a division by zero.
            let slope_or_one = lanes.select_float(lanes.truths(is_flat), float(1.0), lanes.floats(slope));
            let value = lanes.floats(lanes.widen(around.value));
            let share = lanes.over(lanes.sub_float(float(0.0), value), slope_or_one);
            let before_px = lanes.sub_float(column_px, around.share);
            let between = lanes.mask_of(lanes.both(lanes.reaches(share, float(0.0)), lanes.reaches(float(1.0), share)));
            // A pixel without phases around x gives up; one whose crossing lies elsewhere moves on.
            let known = lanes.and(todo, around.known);
            let here = lanes.and_not(lanes.and(known, between), is_flat);
            let is_here = lanes.truths(here);
            at_px = lanes.select_float(is_here, lanes.add_float(before_px, share), at_px);
            slopes = lanes.select_long(is_here, slope, slopes);
            found = lanes.or(found, here);
            todo = lanes.and_not(known, here);
            if !lanes.any(todo) {
                break;
            }
            let most = float(1.0 + MAX_MOVE_PX);
            let step = lanes.min_float(lanes.max_float(share, float(-MAX_MOVE_PX)), most);
            column_px = lanes.add_float(before_px, step);
        }
        let rest = lanes.sub_float(lanes.sub_float(segments.phase_turns(at_px), target), drift);
        let sd_turns = load(lanes, self.sd_turns, first);
        let reach = lanes.times_float(float(MAX_Z), sd_turns);
        let is_near = lanes.both(
            lanes.reaches(at_px, lanes.sub_float(segments.begin, float(self.reach.beyond_px))),
            lanes.reaches(lanes.add_float(segments.end, float(self.reach.beyond_px)), at_px),
        );
        let fits = lanes.both(is_near, lanes.reaches(reach, lanes.abs_float(rest)));
        let decided = lanes.and(found, lanes.mask_of(fits));
        let in_volume = lanes.and(decided, lanes.mask_of(segments.have(at_px)));
        Found { order, phases, present: decided, in_volume, rest, drift, column_px: at_px, slope: slopes }
            .store(lanes, sd_turns, out);
        lanes.bits(decided)
    }
}
