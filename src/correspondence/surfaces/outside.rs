//! Which pixels see something outside the measurement volume: they are no candidates for points.
//!
//! ```text
//! for each pixel of a node that leads clearly, and of which most pixels fit the order, 32 at once:
//!     x = the column at which Φ is the order and the phase of the pixel
//!     it sees something outside if x lies beyond the volume, and either beside the image of C2,
//!     or C2 has the phase near x, so that δ is off the drift by no more than a limit
//! ```

use rayon::prelude::*;

use super::super::drift::Drift;
use super::super::wide::Segments;
use super::NO_ORDER;
use super::evidence::{Room, RowRoom, View};
use super::nodes::{self, Node, Nodes};
use super::sight::{Space, columns_around_each, rest_turns};
use crate::simd::{self, Kernel, LANES, Lanes, Level, filled};

/// How far beyond the volume a pixel must see, half segments: what is nearer is decided pixel by pixel.
const BEYOND_HALVES: f32 = 0.5;
/// The same of the first pixel of a node whose other pixels are not asked.
const WITHIN_HALVES: f32 = 0.2;
/// δ by which a candidate may be off the drift there, turns.
const REACH_TURNS: f32 = 0.06;
/// Share of the pixels of a node that must fit its order, fewer where all nodes beside it have the same; or, where it leads to what
/// C2 cannot see, share of them that may fit any other. Nodes that hold something else too are decided pixel by pixel.
const MIN_FITTING: f32 = 0.68;
const MIN_FITTING_WITHIN: f32 = 0.48;
const MAX_RIVAL: f32 = 0.3;
/// Nodes beside it that must have its order.
const MIN_AGREEING: usize = 2;
/// Share of the distance up to which orders are asked pixel by pixel that is far.
const FAR_SHARE: f32 = 0.8;
/// Distance beyond which orders there are asked pixel by pixel too, half segments: surfaces so far away lead beside the image of C2.
const VERY_FAR_HALVES: f32 = 6.0;
/// Share of the image from which what lies outside is believed to be there.
const MIN_SHARE: f32 = 0.03;
/// Room for a row.
#[derive(Clone, Debug, Default)]
pub(super) struct OutsideRow {
    /// The orders of the pixels that are asked about.
    orders: Vec<i16>,
    /// Marked pixels of all rows that see far beyond the volume, and very far.
    far: [u32; 2],
}

impl Room {
    /// Marks the pixels that see something outside, if a good part of the image sees what is farther beyond the volume than so many
    /// pixels, where orders are asked pixel by pixel; whether it sees what is very far. A few nodes err where a surface is hidden or
    /// dark.
    pub(in super::super) fn mark_outside(
        &mut self,
        view: View<'_>,
        drift: &Drift,
        far_px: f32,
        outside: &mut Vec<bool>,
    ) -> bool {
        let width = view.cam1.width.max(1);
        outside.resize(view.cam1.phase.len(), false);
        let Self { runs, nodes, rows, .. } = self;
        let half_px = Space::of(view.table).half_px;
        for i in 0..nodes.nodes.len() {
            let node = &nodes.nodes[i];
            // Pole and infinity are beyond too.
            let is_within = node.beyond_px(view) < WITHIN_HALVES * half_px;
            nodes.nodes[i].sees_beyond = !is_within && is_asked(nodes, node);
        }
        let (runs, nodes) = (&*runs, &*nodes);
        let beyond_px = [BEYOND_HALVES * half_px, FAR_SHARE * far_px, VERY_FAR_HALVES * half_px];
        let tiles = outside.par_chunks_mut(nodes.tile_px * width).zip(rows).enumerate();
        tiles.for_each(|(tile_row, (outside, room))| {
            room.outside.far = [0; 2];
            for (i, outside) in outside.chunks_mut(width).enumerate() {
                let v = tile_row * nodes.tile_px + i;
                outside.fill(false);
                if !nodes.fill_orders(runs, (v, width), |node| node.sees_beyond, &mut room.outside.orders) {
                    continue;
                }
                view.table.row(v, &mut room.segments);
                drift.along_row(v, width, &mut room.drift);
                let far = simd::run(Level::in_use(), MarkRow { view, beyond_px, room, v, outside });
                room.outside.far.iter_mut().zip(far).for_each(|(sum, count)| *sum += count);
            }
        });
        let is_good_part = |count: fn(&OutsideRow) -> u32| {
            let sum: u32 = self.rows.iter().map(|room| count(&room.outside)).sum();
            sum as f32 >= MIN_SHARE * view.cam1.phase.len() as f32
        };
        if !is_good_part(|row| row.far[0]) {
            outside.fill(false);
        }
        is_good_part(|row| row.far[1])
    }
}

/// Whether the pixels of a node may see something outside by its order.
fn is_asked(nodes: &Nodes, node: &Node) -> bool {
    let asked = node.asked as f32;
    let beside =
        || node.beside.iter().filter(|&&other| other != nodes::NONE).map(|&other| &nodes.nodes[other as usize]);
    let agreeing = beside().filter(|other| other.label == node.label && other.is_clear()).count();
    if !node.is_clear() || agreeing < MIN_AGREEING {
        return false;
    }
    let is_within = agreeing == beside().count();
    let is_founded = node.fitting >= asked * if is_within { MIN_FITTING_WITHIN } else { MIN_FITTING };
    is_founded || (node.is_unseen() && node.rival <= MAX_RIVAL * asked)
}

/// Marks the pixels of a row.
struct MarkRow<'a> {
    view: View<'a>,
    beyond_px: [f32; 3],
    room: &'a RowRoom,
    v: usize,
    outside: &'a mut [bool],
}

impl Kernel for MarkRow<'_> {
    /// How many see far beyond the volume, and very far.
    type Output = [u32; 2];

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> [u32; 2] {
        let Self { view, beyond_px, room, v, outside } = self;
        let mut all_far = [0; 2];
        let phase = &view.cam1.phase[v * view.cam1.width..];
        let orders = room.outside.orders.as_chunks::<LANES>().0;
        for (block, (orders, outside)) in orders.iter().zip(outside.chunks_mut(LANES)).enumerate() {
            if *orders == [NO_ORDER; LANES] {
                continue;
            }
            let phases = filled(&phase[block * LANES..], 0);
            let [found, far @ ..] = marks(lanes, view, beyond_px, room, block * LANES, orders, &phases);
            outside.iter_mut().enumerate().for_each(|(k, outside)| *outside = found >> k & 1 == 1);
            all_far.iter_mut().zip(far).for_each(|(sum, bits)| *sum += bits.count_ones());
        }
        all_far
    }
}

/// Which pixels of a block see something outside, and which of them far beyond the volume, a bit each.
#[inline(always)]
fn marks<L: Lanes>(
    lanes: L,
    view: View<'_>,
    [beyond_px, far_px, very_far_px]: [f32; 3],
    room: &RowRoom,
    first: usize,
    orders: &[i16; LANES],
    phases: &[u16; LANES],
) -> [u32; 3] {
    let float = |value: f32| lanes.float(value);
    let segments = Segments::of(lanes, &room.segments, first);
    let order = lanes.load_signed(orders);
    let is_asked = lanes.and_not(lanes.mask(u32::MAX), lanes.is_equal(order, lanes.word(NO_ORDER)));
    let phases = lanes.load(phases);
    let fraction = lanes.times_float(lanes.floats(lanes.widen_unsigned(phases)), float(1.0 / 65536.0));
    let turns = lanes.add_float(lanes.floats(lanes.widen(order)), fraction);
    let denominator = lanes.sub_float(segments.b, lanes.times_float(segments.d, turns));
    let is_sound = lanes.exceeds(lanes.abs_float(denominator), float(f32::MIN_POSITIVE));
    let inverse = lanes.over(float(1.0), lanes.select_float(is_sound, denominator, float(1.0)));
    let along = lanes.times_float(lanes.sub_float(turns, segments.a), inverse);
    let rise = lanes.sub_float(segments.b, lanes.times_float(segments.a, segments.d));
    let per_turn = lanes.times_float(lanes.times_float(rise, inverse), inverse);
    let column = lanes.add_float(along, segments.reference);
    let (beyond, far, very_far) = (float(beyond_px), float(far_px), float(very_far_px));
    let is_before = lanes.mask_of(lanes.exceeds(lanes.sub_float(segments.begin, beyond), column));
    let is_behind = lanes.mask_of(lanes.exceeds(column, lanes.add_float(segments.end, beyond)));
    let is_very_far_before = lanes.mask_of(lanes.exceeds(lanes.sub_float(segments.begin, very_far), column));
    let is_very_far_behind = lanes.mask_of(lanes.exceeds(column, lanes.add_float(segments.end, very_far)));
    let is_far_before = lanes.mask_of(lanes.exceeds(lanes.sub_float(segments.begin, far), column));
    let is_far_behind = lanes.mask_of(lanes.exceeds(column, lanes.add_float(segments.end, far)));
    let is_beyond = lanes.and(lanes.or(is_before, is_behind), lanes.and(is_asked, lanes.mask_of(is_sound)));
    if !lanes.any(is_beyond) {
        return [0; 3];
    }
    let last_px = (view.cam2.width - 2) as f32;
    let is_seen = lanes.mask_of(lanes.both(lanes.reaches(column, float(0.0)), lanes.reaches(float(last_px), column)));
    let drift = room.drift.block(lanes, first).at(lanes, column);
    let column = lanes.add_float(column, lanes.times_float(drift, per_turn));
    let column = lanes.min_float(lanes.max_float(column, float(0.0)), float(last_px));
    let around = columns_around_each(lanes, view.cam2, segments.row, phases, column);
    let rest = rest_turns(lanes, &around, per_turn);
    let fits = lanes.and(around.known, lanes.mask_of(lanes.exceeds(float(REACH_TURNS), lanes.abs_float(rest))));
    let marked = lanes.and(is_beyond, lanes.or(fits, lanes.and_not(is_beyond, is_seen)));
    let far = lanes.and(marked, lanes.or(is_far_before, is_far_behind));
    let very_far = lanes.and(marked, lanes.or(is_very_far_before, is_very_far_behind));
    [lanes.bits(marked), lanes.bits(far), lanes.bits(very_far)]
}
