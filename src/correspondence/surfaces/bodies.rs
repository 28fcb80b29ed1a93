//! Finds nodes that lead beyond the measurement volume but hold the border of a body inside it.
//!
//! ```text
//! for each node that leads beyond the volume, next to a node that clearly sees into the volume:
//!     compute δ of its pixels about the drift, by the order of that neighbour, 32 pixels at once
//!     it holds a part of the neighbour's body if most pixels that fit this order at all fit it closely
//! repeat with the neighbours of the nodes found, until there are no more
//! ```
//!
//! Along its border a body may have exactly the phase of a board behind it, so that the board explains both. Over the
//! body, δ by the order of the body scatters like noise. Over the board it runs through zero, and is as often far off
//! as near.

use std::f64::consts::TAU;

use rayon::prelude::*;

use fringeflow_simd::{Kernel, LANES, Lanes, Level};

use crate::correspondence::drift::{DepthRow, Drift};
use crate::correspondence::epipolar_image::EpipolarImage;
use crate::correspondence::segment::SegmentRow;

use super::NO_ORDER;
use super::block::Block;
use super::nodes::{NO_NODE, Node, Nodes};
use super::runs::PhaseRuns;
use super::scratch::{BodyRow, RowScratch};
use crate::correspondence::view::View;

/// Largest |δ − drift| of a pixel that fits the inner order of a neighbour, sd.
pub(super) const WITHIN_SD: f64 = 4.5;
/// |δ − drift| of a close fit, sd.
const CLOSE_SD: f64 = 1.5;
/// Share of the fitting pixels that must fit closely: 0.87 of a surface do, and 0.33 where δ runs through zero.
const MIN_CLOSE: f32 = 0.6;
/// Fewest fitting pixels needed.
const MIN_PIXELS: u32 = 24;

/// Finds the nodes that hold a part of a body, given the neighbours that see into the volume.
pub(super) fn find(view: View<'_>, drift: &Drift, runs: &PhaseRuns, nodes: &mut Nodes, rows: &mut [RowScratch]) {
    let reach_turns = [WITHIN_SD, CLOSE_SD].map(|sd| (sd * drift.residual_sd_rad / TAU) as f32);
    for node in &mut nodes.nodes {
        node.is_body_candidate = !node.is_within && node.inner_label.is_some();
    }
    let mut has_candidates = nodes.nodes.iter().any(|node| node.is_body_candidate);
    while has_candidates {
        let all = &*nodes;
        rows.par_iter_mut().enumerate().for_each(|(tile_row, scratch)| {
            scratch.bodies.counts.clear();
            for v in all.rows_of_tiles(tile_row) {
                scratch.count_fitting(view, drift, reach_turns, (runs, all), v);
            }
        });
        nodes.nodes.iter_mut().for_each(|node| node.is_body_candidate = false);
        has_candidates = false;
        for scratch in &mut *rows {
            // All pieces of a node lie in one row of tiles.
            scratch.bodies.counts.sort_unstable();
            for counts in scratch.bodies.counts.chunk_by(|(a, _), (b, _)| a == b) {
                let [fitting, closely] = [0, 1].map(|k| counts.iter().map(|(_, counts)| counts[k]).sum::<u32>());
                if fitting >= MIN_PIXELS && closely as f32 >= MIN_CLOSE * fitting as f32 {
                    nodes.nodes[counts[0].0 as usize].holds_body = true;
                    has_candidates |= nodes.extend_to_neighbours(counts[0].0);
                }
            }
        }
    }
}

impl Nodes {
    /// Makes the neighbours of a node that holds a part of a body candidates too. Returns whether there are new ones.
    fn extend_to_neighbours(&mut self, node: u32) -> bool {
        let Node { neighbours, inner_label, .. } = self.nodes[node as usize];
        let mut any = false;
        for other in neighbours.into_iter().filter(|&other| other != NO_NODE) {
            let other = &mut self.nodes[other as usize];
            if !other.is_within && other.inner_label.is_none() {
                (other.inner_label, other.is_body_candidate, any) = (inner_label, true, true);
            }
        }
        any
    }
}

impl RowScratch {
    /// Counts the pixels of a row that fit the order of the body.
    fn count_fitting(
        &mut self,
        view: View<'_>,
        image_drift: &Drift,
        reach_turns: [f32; 2],
        (runs, nodes): (&PhaseRuns, &Nodes),
        v: usize,
    ) {
        let (width, first) = (view.cam1.width, v * view.cam1.width);
        let label = |node: &Node| node.inner_label.filter(|_| node.is_body_candidate);
        if !nodes.fill_orders(runs, (v, width), label, &mut self.bodies.orders) {
            return;
        }
        self.load_row(view, image_drift, v);
        let Self { segments, drift, bodies: BodyRow { orders, fitting, counts }, .. } = self;
        let phase = &view.cam1.phase[first..first + width];
        let cam2 = view.cam2;
        fringeflow_simd::run(
            Level::in_use(),
            FittingRow { cam2, segments, drift, phase, orders, reach_turns, fitting },
        );
        for piece in nodes.row(v) {
            if !nodes.nodes[piece.node as usize].is_body_candidate {
                continue;
            }
            let mut sum = [0; 2];
            for pixel in piece.begin as usize - first..piece.end as usize - first {
                let bits = fitting[pixel / LANES];
                sum.iter_mut().zip(bits).for_each(|(sum, bits)| *sum += bits >> (pixel % LANES) & 1);
            }
            counts.push((piece.node, sum));
        }
    }
}

/// Finds the pixels of a row that fit their orders.
struct FittingRow<'a> {
    cam2: &'a EpipolarImage,
    segments: &'a SegmentRow,
    drift: &'a DepthRow,
    phase: &'a [u16],
    orders: &'a [i16],
    reach_turns: [f32; 2],
    fitting: &'a mut Vec<[u32; 2]>,
}

impl Kernel for FittingRow<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let Self { cam2, segments, drift, phase, orders, reach_turns, fitting } = self;
        fitting.clear();
        for (i, orders) in orders.as_chunks::<LANES>().0.iter().enumerate() {
            if *orders == [NO_ORDER; LANES] {
                fitting.push([0; 2]);
                continue;
            }
            let block = Block::new(lanes, segments, drift, phase, i * LANES);
            let offset = block.drift_offset(cam2, &block.order_columns(orders));
            let [wide, close] = reach_turns;
            fitting.push([
                lanes.bits(block.is_within_reach(&offset, wide)),
                lanes.bits(block.is_within_reach(&offset, close)),
            ]);
        }
    }
}
