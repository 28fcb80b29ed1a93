//! Marks the pixels that see something outside the measurement volume: they are no candidates for points.
//!
//! ```text
//! for each pixel of a clear node most of whose pixels fit its order, 32 at once:
//!     x = the column at which Φ is order + phase of the pixel
//!     it sees something outside if x lies beyond the volume, and either outside the image of C2,
//!         or C2 has the phase near x, with |δ − drift| below a limit;
//!     unless it fits the order of a neighbour that sees into the volume, and its own order less closely,
//!     or its node holds a part of a body there (see bodies)
//! all pixels of a node that leads beyond the volume, if none fits any order within
//! ```

use std::f64::consts::TAU;

use rayon::prelude::*;

use fringeflow_simd::{Kernel, LANES, Lanes, Level};

use crate::correspondence::drift::Drift;

use super::NO_ORDER;
use super::block::{Block, OrderColumns};
use super::bodies::{self, WITHIN_SD};
use super::nodes::{Node, Nodes};
use super::order_scores::SearchSpace;
use super::scratch::{OutsideRow, RowScratch, Scratch};
use crate::correspondence::view::View;

/// Least distance beyond the volume of a point that a marked pixel sees, half segments. Nearer ones are decided pixel
/// by pixel.
const BEYOND_HALVES: f32 = 0.5;
/// A node whose first pixel sees less far beyond the volume than this counts as within it, half segments.
const WITHIN_HALVES: f32 = 0.2;
/// Largest |δ − drift| beyond the volume, turns.
const REACH_TURNS: f32 = 0.06;
/// Largest |δ − drift| beyond the volume of a pixel that also fits an order within, turns.
const CLOSE_TURNS: f32 = 0.02;
/// Least share of the pixels of a node that must fit its order; no other order may fit better. If all neighbours have
/// the same order, the first condition alone is enough, or the second with a smaller share. Mixed nodes are decided
/// pixel by pixel.
const MIN_FITTING: f32 = 0.68;
const MIN_FITTING_AMONG: f32 = 0.48;
/// If its order leads to where C2 cannot see: largest share of the pixels that may fit another order, because other
/// surfaces that C2 sees fit here and there; and the larger share that may fit if neighbours alone lead.
const MAX_RIVAL: f32 = 0.3;
const MAX_BEST: f32 = 0.85;
/// Share of the pixels of a large node that may fit an order in the volume if it counts as seeing nothing there.
const MAX_WITHIN: f32 = 0.025;
/// Neighbours that must have its order.
const MIN_AGREEING: usize = 2;
/// Share of the search distance beyond which a pixel sees far.
const FAR_SHARE: f32 = 0.8;
/// Distance beyond which a pixel sees very far, half segments: surfaces so far away lie outside the image of C2.
const VERY_FAR_HALVES: f32 = 6.0;
/// Least share of the image that must see something outside.
const MIN_SHARE: f32 = 0.03;

impl Scratch {
    /// Marks the pixels that see something outside, if a good part of the image sees farther beyond the volume than the
    /// search of single pixels reaches, `far_px`. Otherwise a few nodes may err where a surface is hidden or dark.
    pub(in crate::correspondence) fn mark_outside(
        &mut self,
        view: View<'_>,
        drift: &Drift,
        far_px: f32,
        outside: &mut Vec<bool>,
    ) -> Far {
        let width = view.cam1.width.max(1);
        outside.resize(view.cam1.phase.len(), false);
        let half_px = SearchSpace::from_table(view.table).half_px;
        self.judge_nodes(view, half_px);
        let Self { runs, nodes, rows, .. } = self;
        bodies::find(view, drift, runs, nodes, rows);
        let (runs, nodes) = (&*runs, &*nodes);
        let beyond_px = [BEYOND_HALVES * half_px, FAR_SHARE * far_px, VERY_FAR_HALVES * half_px];
        let within_turns = (WITHIN_SD * drift.residual_sd_rad / TAU) as f32;
        let limits = Limits { beyond_px, within_turns };
        let tiles = outside.par_chunks_mut(nodes.tile_px * width).zip(rows).enumerate();
        tiles.for_each(|(tile_row, (outside, scratch))| {
            scratch.outside.far = [0; 2];
            for (i, outside) in outside.chunks_mut(width).enumerate() {
                let v = tile_row * nodes.tile_px + i;
                outside.fill(false);
                let OutsideRow { orders, within, of_bodies, .. } = &mut scratch.outside;
                if !nodes.fill_orders(runs, (v, width), |node| node.sees_beyond.then_some(node.label), orders) {
                    continue;
                }
                let label_within = |holds_body: bool| {
                    move |node: &Node| node.inner_label.filter(|_| node.sees_beyond && node.holds_body == holds_body)
                };
                nodes.fill_orders(runs, (v, width), label_within(false), within);
                nodes.fill_orders(runs, (v, width), label_within(true), of_bodies);
                scratch.load_row(view, drift, v);
                let far = fringeflow_simd::run(Level::in_use(), MarkRow { view, limits, scratch, v, outside });
                scratch.outside.far.iter_mut().zip(far).for_each(|(sum, count)| *sum += count);
            }
        });
        let is_good_part = |count: fn(&OutsideRow) -> u32| {
            let sum: u32 = self.rows.iter().map(|scratch| count(&scratch.outside)).sum();
            sum as f32 >= MIN_SHARE * view.cam1.phase.len() as f32
        };
        let found = Far { is_far: is_good_part(|row| row.far[0]), is_very_far: is_good_part(|row| row.far[1]) };
        // Near the volume the search of single pixels finds the orders of surfaces outside too.
        if !found.is_far {
            outside.fill(false);
        }
        for piece in self.nodes.pieces.iter().filter(|piece| self.nodes.nodes[piece.node as usize].is_beyond) {
            outside[piece.begin as usize..piece.end as usize].fill(true);
        }
        found
    }

    /// Finds for each node with evidence whether it lies within the volume or beyond, whether its pixels may see
    /// something outside, and the label of a neighbour within.
    fn judge_nodes(&mut self, view: View<'_>, half_px: f32) {
        let Self { nodes, evidence, .. } = self;
        for (&node, evidence) in nodes.with_evidence.iter().zip(&*evidence) {
            let node = &mut nodes.nodes[node as usize];
            // NaN at the pole and at infinity counts as beyond.
            node.is_within = node.beyond_px(view) < WITHIN_HALVES * half_px;
            let fitting = || node.fitting_within(view, half_px, evidence);
            node.is_beyond =
                node.is_large(nodes.tile_px) && !node.is_within && fitting() <= MAX_WITHIN * node.sampled as f32;
        }
        for i in 0..nodes.with_evidence.len() {
            let i = nodes.with_evidence[i] as usize;
            let node = &nodes.nodes[i];
            let inner = nodes.neighbours_of(node).find(|other| other.is_within && other.is_clear());
            let (inner_label, sees_beyond) = (inner.map(|other| other.label), may_see_beyond(nodes, node));
            (nodes.nodes[i].sees_beyond, nodes.nodes[i].inner_label) = (sees_beyond, inner_label);
        }
    }
}

/// Whether a good part of the image sees far beyond the volume, and very far.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(in crate::correspondence) struct Far {
    pub(in crate::correspondence) is_far: bool,
    pub(in crate::correspondence) is_very_far: bool,
}

/// Limits of the marks.
#[derive(Clone, Copy)]
struct Limits {
    /// Distances beyond the volume of marked pixels, of far ones and of very far ones, pixels.
    beyond_px: [f32; 3],
    /// Largest |δ − drift| within the volume, turns.
    within_turns: f32,
}

/// Whether the pixels of a node may see something outside by its order.
fn may_see_beyond(nodes: &Nodes, node: &Node) -> bool {
    let sampled = node.sampled as f32;
    let has_order = |node: &Node| {
        // No pixel can fit where C2 does not see; there the order may come from neighbours alone.
        let is_led = node.is_unseen() && node.leads() && node.best_fitting <= MAX_BEST * node.sampled as f32;
        is_led || node.is_clear()
    };
    let agreeing = nodes.neighbours_of(node).filter(|other| other.label == node.label && has_order(other)).count();
    if node.is_within || !has_order(node) || agreeing < MIN_AGREEING {
        return false;
    }
    if node.is_unseen() {
        let is_among = agreeing == nodes.neighbours_of(node).count();
        return is_among || node.rival <= MAX_RIVAL * sampled;
    }
    let fits = node.fitting >= MIN_FITTING * sampled;
    let is_best = node.fitting >= node.rival;
    let is_among = agreeing == node.neighbours.len();
    if is_among { fits || (node.fitting >= MIN_FITTING_AMONG * sampled && is_best) } else { fits && is_best }
}

/// Marks the pixels of a row.
struct MarkRow<'a> {
    view: View<'a>,
    limits: Limits,
    scratch: &'a RowScratch,
    v: usize,
    outside: &'a mut [bool],
}

impl Kernel for MarkRow<'_> {
    /// Pixels that see far, and very far.
    type Output = [u32; 2];

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> [u32; 2] {
        let Self { view, limits, scratch, v, outside } = self;
        let mut all_far = [0; 2];
        let phase = &view.cam1.phase[v * view.cam1.width..];
        let OutsideRow { orders, within, of_bodies, .. } = &scratch.outside;
        let [orders, within, of_bodies] = [orders, within, of_bodies].map(|row| row.as_chunks::<LANES>().0);
        let all = orders.iter().zip(within.iter().zip(of_bodies)).zip(outside.chunks_mut(LANES));
        for (block, ((orders, (within, of_bodies)), outside)) in all.enumerate() {
            if *orders == [NO_ORDER; LANES] {
                continue;
            }
            let block = Block::new(lanes, &scratch.segments, &scratch.drift, phase, block * LANES);
            let [found, far @ ..] = BlockMarker { lanes, view, block }.marks(limits, orders, [within, of_bodies]);
            outside.iter_mut().enumerate().for_each(|(k, outside)| *outside = found >> k & 1 == 1);
            all_far.iter_mut().zip(far).for_each(|(sum, bits)| *sum += bits.count_ones());
        }
        all_far
    }
}

/// Marks the pixels of a block.
struct BlockMarker<'a, L: Lanes> {
    lanes: L,
    view: View<'a>,
    block: Block<L>,
}

impl<L: Lanes> BlockMarker<'_, L> {
    #[inline(always)]
    fn fits(&self, columns: &OrderColumns<L>, reach_turns: f32) -> L::Mask {
        self.block.fits(self.view.cam2, columns, reach_turns)
    }

    /// Pixels whose columns lie farther beyond the volume than `px`.
    #[inline(always)]
    fn beyond(&self, columns: &OrderColumns<L>, px: f32) -> L::Mask {
        let (lanes, px, segments) = (self.lanes, self.lanes.float(px), &self.block.segments);
        let before = lanes.mask_of(lanes.exceeds(lanes.sub_float(segments.begin, px), columns.column));
        let behind = lanes.mask_of(lanes.exceeds(columns.column, lanes.add_float(segments.end, px)));
        lanes.and(columns.has_order, lanes.or(before, behind))
    }

    /// The pixels that see something outside, and those of them that see far and very far, a bit each.
    #[inline(always)]
    fn marks(&self, limits: Limits, orders: &[i16; LANES], [within, of_bodies]: [&[i16; LANES]; 2]) -> [u32; 3] {
        let (lanes, columns) = (self.lanes, self.block.order_columns(orders));
        let [beyond_px, far_px, very_far_px] = limits.beyond_px;
        let beyond = self.beyond(&columns, beyond_px);
        if !lanes.any(beyond) {
            return [0; 3];
        }
        let last_px = lanes.float((self.view.cam2.width - 2) as f32);
        let is_seen =
            lanes.both(lanes.reaches(columns.column, lanes.float(0.0)), lanes.reaches(last_px, columns.column));
        let unseen = lanes.and_not(beyond, lanes.mask_of(is_seen));
        let mut marked = lanes.and(beyond, lanes.or(unseen, self.fits(&columns, REACH_TURNS)));
        if *within != [NO_ORDER; LANES] {
            // A close fit beyond the volume outweighs a fit within. Points that C2 cannot see never fit closely.
            let closely = lanes.and_not(self.fits(&columns, CLOSE_TURNS), unseen);
            let seen_within = lanes.and_not(self.fits(&self.block.order_columns(within), limits.within_turns), closely);
            marked = lanes.and_not(marked, seen_within);
        }
        if *of_bodies != [NO_ORDER; LANES] {
            marked = lanes.and_not(marked, self.fits(&self.block.order_columns(of_bodies), limits.within_turns));
        }
        let far = lanes.and(marked, self.beyond(&columns, far_px));
        let very_far = lanes.and(marked, self.beyond(&columns, very_far_px));
        [lanes.bits(marked), lanes.bits(far), lanes.bits(very_far)]
    }
}
