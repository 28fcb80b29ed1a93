//! Order ranges: the fringe orders that each pixel can have.

use fringeflow_simd::{Kernel, Lanes, Level};

use crate::correspondence::fingerprint::Fingerprint;
use crate::correspondence::segment::SegmentRow;
use crate::correspondence::segment_table::SegmentTable;

use crate::correspondence::pixel_search::Reach;
use crate::correspondence::scene::Scene;

/// How far the search reaches beyond the volume on either side: half the mean length of a segment; more if that holds
/// fewer orders than [`ORDERS_BEYOND`], but at most its length. Surfaces behind a shallow volume are only a few orders
/// away. Segments with fewer than [`FEW_ORDERS`] need no more: there are hardly any orders to confuse.
const BEYOND_VOLUME: f32 = 0.5;
const ORDERS_BEYOND: f32 = 9.0;
const FEW_ORDERS: f32 = 2.0;
/// Reach beyond the volume, in lengths of a segment, if part of the scene lies far beyond it.
const FAR_BEYOND_VOLUME: f32 = 6.0;
/// Distance of the pixels of C1 from which the mean number of orders is taken.
const STRIDE: usize = 97;
/// Turns by which a range is wider than its segment, so that it contains the order of a candidate at its end.
const DELTA_MARGIN_TURNS: f32 = 0.25;
/// Orders handled at a time.
pub(super) const LANE_STEP: usize = 8;
/// Most orders of a pixel; further ones beyond the volume are dropped.
pub(super) const MAX_LANES: usize = 128;

/// For each pixel of C1 the orders that a candidate can have.
#[derive(Clone, Debug, Default)]
pub(super) struct OrderRanges {
    /// First order of each pixel.
    pub(super) first: Vec<i16>,
    /// Number of orders of each pixel; 0 without phase or segment.
    pub(super) count: Vec<u8>,
    /// Orders per pixel in memory, a multiple of [`LANE_STEP`].
    pub(super) lanes: usize,
    pub(super) reach: Reach,
    /// The table for which `lanes` and `reach` were computed, and whether part of the scene lies far beyond the volume.
    found_for: Option<(Fingerprint, bool)>,
    /// The table for which the usual reach was computed, and that reach, pixels.
    near: Option<(Fingerprint, f32)>,
}

impl OrderRanges {
    /// Prepares for a scene. `lanes` and `reach` are computed once per table. Some pixel may have more orders than
    /// `lanes`; see [`Self::grow`].
    pub(super) fn prepare(&mut self, scene: &Scene<'_>, looks_far: bool) {
        self.first.resize(scene.view.cam1.phase.len(), 0);
        self.count.resize(scene.view.cam1.phase.len(), 0);
        let found_for = Some((scene.view.table.fingerprint, looks_far));
        if self.found_for == found_for {
            return;
        }
        self.found_for = found_for;
        let length_px = length_px(scene.view.table);
        let near_px = self.near_px(scene.view.table);
        let beyond_px = if looks_far { FAR_BEYOND_VOLUME * length_px } else { near_px };
        let last_column_px = (scene.view.table.epipolar_size_px()[0] - 1) as f32;
        self.reach = Reach { beyond_px, last_column_px };
        // Another table: start again from the usual number of orders.
        self.lanes = 0;
        self.grow(usual_orders(scene.view.table, self.reach));
    }

    /// The reach beyond the volume if nothing is known to lie farther, pixels.
    pub(super) fn near_px(&mut self, table: &SegmentTable) -> f32 {
        match self.near {
            Some((found_for, near_px)) if found_for == table.fingerprint => near_px,
            _ => {
                let orders = mean_orders(table);
                let wanted = if orders < FEW_ORDERS { BEYOND_VOLUME } else { ORDERS_BEYOND / orders };
                let near_px = length_px(table) * wanted.clamp(BEYOND_VOLUME, 1.0);
                self.near = Some((table.fingerprint, near_px));
                near_px
            }
        }
    }

    /// Grows `lanes` to this number of orders.
    pub(super) fn grow(&mut self, orders: usize) {
        self.lanes = self.lanes.max(orders.div_ceil(LANE_STEP).max(1) * LANE_STEP);
    }
}

/// Computes the order ranges of a row of pixels.
pub(super) struct OrderRangeRow<'a> {
    pub(super) reach: Reach,
    pub(super) segments: &'a SegmentRow,
    pub(super) phase: &'a [u16],
    pub(super) valid: &'a [bool],
    /// Pixels known to see something outside the volume: they are skipped.
    pub(super) outside: &'a [bool],
    pub(super) first: &'a mut [i16],
    pub(super) count: &'a mut [u8],
}

impl OrderRangeRow<'_> {
    pub(super) fn fill(self) {
        fringeflow_simd::run(Level::in_use(), self);
    }
}

impl Kernel for OrderRangeRow<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let Self { reach, segments: s, phase, valid, outside, first, count } = self;
        let width = phase.len();
        let (begin, end, reference) = (&s.begin_px[..width], &s.end_px[..width], &s.reference_px[..width]);
        let (a, b, d) = (&s.a[..width], &s.b[..width], &s.d[..width]);
        let (valid, outside) = (&valid[..width], &outside[..width]);
        let (first, count) = (&mut first[..width], &mut count[..width]);
        // Without branches over the whole row first; the rare row with a pole is corrected below.
        let mut all_fit = true;
        for u in 0..width {
            let limits_px = reach.limits_px([begin[u], end[u]]);
            let phase_turns = f32::from(phase[u]) / 65536.0;
            let (least, orders) = orders(limits_px, reference[u], [a[u], b[u], d[u]], phase_turns);
            let is_searched = valid[u] & !outside[u] & (begin[u] <= end[u]);
            all_fit &= !is_searched | fits(least, orders);
            first[u] = if is_searched { least as i16 } else { 0 };
            count[u] = if is_searched { orders.clamp(1.0, MAX_LANES as f32) as u8 } else { 0 };
        }
        if all_fit {
            return;
        }
        // Beyond the volume Φ may reach its pole. Such pixels get the orders around the segment without its extensions.
        for u in 0..width {
            let (coefficients, phase_turns) = ([a[u], b[u], d[u]], f32::from(phase[u]) / 65536.0);
            let (least, most) = orders(reach.limits_px([begin[u], end[u]]), reference[u], coefficients, phase_turns);
            if count[u] > 0 && !fits(least, most) {
                let (within, _) = orders([begin[u], end[u]], reference[u], coefficients, phase_turns);
                first[u] = (within - (MAX_LANES / 4) as f32) as i16;
            }
        }
    }
}

/// Whether a range can be stored.
#[inline(always)]
fn fits(least: f32, orders: f32) -> bool {
    (orders <= MAX_LANES as f32) & (least.abs() < f32::from(i16::MAX / 2))
}

/// The first order within limits, and the number of orders.
#[inline(always)]
fn orders([first_px, last_px]: [f32; 2], reference_px: f32, [a, b, d]: [f32; 3], phase_turns: f32) -> (f32, f32) {
    let (s, t) = (first_px - reference_px, last_px - reference_px);
    let at_first = (a + b * s) / (1.0 + d * s) - phase_turns;
    let at_last = (a + b * t) / (1.0 + d * t) - phase_turns;
    let least = (at_first.min(at_last) - DELTA_MARGIN_TURNS).ceil();
    (least, (at_first.max(at_last) + DELTA_MARGIN_TURNS).floor() - least + 1.0)
}

/// Mean length of a segment, pixels.
fn length_px(table: &SegmentTable) -> f32 {
    table.drift_modes().map_or(0.0, |modes| 2.0 * modes.half_segment_px() as f32)
}

/// Mean rise of Φ over a segment, turns; at least one.
fn mean_orders(table: &SegmentTable) -> f32 {
    let rises = some_pixels(table).map(|pixel| {
        let segment = table.segment(pixel);
        (segment.phase_turns(segment.end_px) - segment.phase_turns(segment.begin_px)).abs()
    });
    let (sum, count) = rises.fold((0.0_f32, 0.0_f32), |(sum, count), rise| (sum + rise, count + 1.0));
    (sum / count.max(1.0)).max(1.0)
}

/// The most orders of the sampled pixels, independent of their phase; a pixel may have one more.
fn usual_orders(table: &SegmentTable, reach: Reach) -> usize {
    let of_pixel = |pixel: usize| {
        let segment = table.segment(pixel);
        let [first_px, last_px] = reach.limits_px(segment.limits_px());
        let rise = (segment.phase_turns(last_px) - segment.phase_turns(first_px)).abs();
        (rise + 2.0 * DELTA_MARGIN_TURNS).min(MAX_LANES as f32) as usize
    };
    some_pixels(table).map(of_pixel).max().unwrap_or(0)
}

/// A sample of the pixels with a segment.
fn some_pixels(table: &SegmentTable) -> impl Iterator<Item = usize> {
    let [width, height] = table.size_px();
    (0..width * height).step_by(STRIDE).filter(|&pixel| table.has_segment(pixel))
}
