//! Evidence of nodes: the scores of all orders, summed over some pixels of each node.
//!
//! ```text
//! for each row with sampled pixels, for each piece of a node in it, for each sampled pixel of the piece:
//!     orders = those that the pixel can have in all of space
//!     for each 32 of them at once: evidence[node][label of the order] += order score
//! decide the nodes by belief propagation
//! ```
//!
//! Rows of tiles run in parallel: all pieces of a node lie in one of them.

use fringeflow_simd::{Kernel, LANES, Lanes, Level};

use crate::correspondence::drift::Drift;
use crate::correspondence::view::View;

use super::nodes::{NO_NODE, Node, Nodes, Piece};
use super::order_scores::{Gate, OrderScorer, SearchSpace, UNSEEN_SCORE, order_scores};
use super::runs::{MAX_BEND, PhaseRuns};
use super::scratch::{RowScratch, Scratch};
use super::{FULL_SCORE, LABELS, belief};

/// A node gives the orders of its pixels if this share of the sampled ones fits its order, or if no other order fits
/// more than the second share of these: then the rest is hidden from C2.
const MIN_FITTING: f32 = 0.6;
const MAX_RIVAL: f32 = 0.8;
/// Least lead for that, as share of the sampled pixels.
const MIN_LEAD: f32 = 0.2;

/// Sampled pixels along either axis of a tile, few and many. Their number need not grow with the image.
const FEW_OF_TILE: usize = 3;
const MANY_OF_TILE: usize = 6;
/// Least ratio of many samples to few.
const FEW_FOR_MANY: i16 = 4;
/// Share of the sampled pixels of a clear node that fit, from which its order is certain.
const DOUBTLESS: f32 = 0.95;

/// Which pixels are sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Sampling {
    /// Few pixels of all nodes, to estimate the drift.
    Few,
    /// Many pixels of all nodes.
    Many,
    /// Many pixels of the nodes that few pixels left in doubt.
    ManyOfDoubtful,
}

impl Scratch {
    /// Divides the image into nodes.
    pub(super) fn divide(&mut self, view: View<'_>) {
        self.runs.find(view.cam1, view.table, MAX_BEND);
        self.nodes.find(view, &SearchSpace::from_table(view.table), &self.runs);
        let strides = [FEW_OF_TILE, MANY_OF_TILE].map(|of_tile| self.nodes.tile_px / of_tile);
        self.nodes.find_evidence_nodes(view.cam1.width, strides);
    }

    /// Decides the order of every node by δ about a drift. Nodes that are not sampled keep their evidence.
    pub(super) fn decide(&mut self, view: View<'_>, drift: &Drift, gate: Gate, sampling: Sampling) {
        let Self { runs, nodes, evidence, messages, rows, .. } = self;
        let (tile_px, of_all) = (nodes.tile_px, sampling != Sampling::ManyOfDoubtful);
        let stride = tile_px / if sampling == Sampling::Few { FEW_OF_TILE } else { MANY_OF_TILE };
        evidence.resize(nodes.with_evidence.len(), [0; LABELS]);
        for (&node, evidence) in nodes.with_evidence.iter().zip(&mut *evidence) {
            let node = &mut nodes.nodes[node as usize];
            node.is_doubtful = of_all || !(node.is_clear() && node.fitting > DOUBTLESS * node.sampled as f32);
            if node.is_doubtful {
                *evidence = [0; LABELS];
            } else {
                // Scaled as if as many pixels had been sampled as of the others.
                evidence.iter_mut().for_each(|sum| *sum *= FEW_FOR_MANY);
                node.sampled *= FEW_FOR_MANY as u32;
            }
        }
        rows.resize(view.cam1.height.div_ceil(tile_px), RowScratch::default());
        let pass = EvidencePass { view, space: SearchSpace::from_table(view.table), drift, gate, stride, runs, nodes };
        pass.gather(0, rows, evidence);
        belief::decide(nodes, evidence, messages);
        nodes.count_sampled(view.cam1.width, stride);
        for (&node, evidence) in nodes.with_evidence.iter().zip(&*evidence) {
            let node = &mut nodes.nodes[node as usize];
            let unseen = node.sampled as i16 * UNSEEN_SCORE;
            // Orders that C2 cannot see have half a score per sample. They are no rivals.
            let most =
                |labels: &[i16]| labels.iter().fold(0, |most: i16, &sum| most.max(if sum == unseen { 0 } else { sum }));
            let (before, behind) = evidence.split_at(usize::from(node.label));
            node.rival = f32::from(most(before).max(most(&behind[1..]))) / f32::from(FULL_SCORE);
        }
    }

    /// Computes the orders of the pixels of a row that nodes give, [`super::NO_ORDER`] elsewhere. Returns whether there
    /// are any.
    pub(in crate::correspondence) fn fill_orders(&self, row: (usize, usize), orders: &mut Vec<i16>) -> bool {
        let label = |node: &Node| {
            let sampled = node.sampled as f32;
            let gives_order = node.is_clear()
                && !node.holds_body
                && (node.fitting >= MIN_FITTING * sampled || node.rival <= MAX_RIVAL * node.fitting)
                && node.lead >= MIN_LEAD * sampled;
            gives_order.then_some(node.label)
        };
        self.nodes.fill_orders(&self.runs, row, label, orders)
    }

    /// Clears the decided pixels of each piece where these are a minority: a wrong order fits where its δ runs through
    /// zero.
    pub(in crate::correspondence) fn clear_minorities(&self, (v, width): (usize, usize), is_decided: &mut [bool]) {
        for piece in self.nodes.row(v) {
            let of_piece = &mut is_decided[piece.begin as usize - v * width..piece.end as usize - v * width];
            let decided = of_piece.iter().map(|&decided| usize::from(decided)).sum::<usize>();
            if decided > 0 && 2 * decided < of_piece.len() {
                of_piece.fill(false);
            }
        }
    }

    /// Whether the phase of C1 continues to a pixel of row `v` from the pixel to the left.
    pub(in crate::correspondence) fn continues_to(&self, v: usize, pixel: usize) -> bool {
        self.runs.continues_to(v, pixel)
    }

    /// Share of the sampled pixels that fit the orders of their nodes, where C2 can see these.
    pub(in crate::correspondence) fn fitting_share(&self) -> f32 {
        let seen = self.nodes.nodes.iter().filter(|node| !node.is_unseen());
        let (fitting, sampled) = seen.fold((0.0, 0), |(f, a), node| (f + node.fitting, a + u64::from(node.sampled)));
        fitting / sampled.max(1) as f32
    }

    /// Share of the pixels whose nodes are clear.
    pub(super) fn clear_share(&self) -> f64 {
        let sum =
            |nodes: &mut dyn Iterator<Item = &Node>| nodes.map(|node| u64::from(node.size_px)).sum::<u64>() as f64;
        let nodes = &self.nodes.nodes;
        sum(&mut nodes.iter().filter(|node| node.is_clear())) / sum(&mut nodes.iter()).max(1.0)
    }
}

/// Inputs of sampling.
#[derive(Clone, Copy)]
struct EvidencePass<'a> {
    view: View<'a>,
    space: SearchSpace,
    drift: &'a Drift,
    gate: Gate,
    stride: usize,
    runs: &'a PhaseRuns,
    nodes: &'a Nodes,
}

impl EvidencePass<'_> {
    /// Samples the rows of tiles from `first` on; `evidence` is that of their nodes.
    fn gather(self, first: usize, rows: &mut [RowScratch], evidence: &mut [[i16; LABELS]]) {
        match rows {
            [] => {}
            [row] => self.gather_tiles(first, row, evidence),
            rows => {
                let half = rows.len() / 2;
                let (upper, lower) = rows.split_at_mut(half);
                let ends = &self.nodes.evidence_rows;
                let (above, below) = evidence.split_at_mut(ends[first + half] - ends[first]);
                rayon::join(|| self.gather(first, upper, above), || self.gather(first + half, lower, below));
            }
        }
    }

    fn gather_tiles(self, tile_row: usize, scratch: &mut RowScratch, evidence: &mut [[i16; LABELS]]) {
        let Self { view, drift, stride, .. } = self;
        for v in self.nodes.rows_of_tiles(tile_row).filter(|v| v % stride == stride / 2) {
            scratch.load_row(view, drift, v);
            let first = self.nodes.evidence_rows[tile_row];
            fringeflow_simd::run(
                Level::in_use(),
                EvidenceRow { pass: self, scratch, v, first, evidence: &mut *evidence },
            );
        }
    }
}

/// Samples some pixels of a row.
struct EvidenceRow<'a> {
    pass: EvidencePass<'a>,
    scratch: &'a RowScratch,
    v: usize,
    /// Where the evidence of the row of tiles begins.
    first: usize,
    evidence: &'a mut [[i16; LABELS]],
}

impl Kernel for EvidenceRow<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let Self { pass, scratch, v, first, evidence } = self;
        let EvidencePass { view, space, gate, stride, runs, nodes, .. } = pass;
        let row = v * view.cam1.width;
        for piece in nodes.row(v) {
            let &Piece { node, offset, .. } = piece;
            let of_node = &nodes.nodes[node as usize];
            if !of_node.is_doubtful || of_node.evidence == NO_NODE {
                continue;
            }
            let base = of_node.base;
            let scores = &mut evidence[of_node.evidence as usize - first];
            for u in piece.sampled_columns(row, stride) {
                let pixel = row + u;
                let segment = scratch.segments.segment(u);
                let scorer = OrderScorer {
                    limits_px: space.limits_px(&segment, [u, v]),
                    segment,
                    drift: scratch.drift.segment(u),
                    phase: view.cam1.phase[pixel],
                    gate,
                    half_px: space.half_px,
                };
                let Some(orders) = scorer.orders() else { continue };
                // The label of order 0.
                let zero = -(base + offset + i32::from(runs.relative[pixel]));
                let from = orders.first.max(-zero);
                let to = orders.last.min(LABELS as i32 - 1 - zero);
                for order in (from..=to).step_by(LANES) {
                    let found = order_scores(lanes, view.cam2, &scorer, &orders, order);
                    let label = (order + zero) as usize;
                    // Near the last label fewer than 32 are left.
                    match scores[label..].first_chunk_mut::<LANES>() {
                        Some(scores) => {
                            let sum = lanes.add(lanes.load_signed(scores), found);
                            lanes.store_signed(sum, scores);
                        }
                        None => {
                            let mut of_lanes = [0; LANES];
                            lanes.store_signed(found, &mut of_lanes);
                            scores[label..].iter_mut().zip(of_lanes).for_each(|(sum, score)| *sum += score);
                        }
                    }
                }
            }
        }
    }
}
