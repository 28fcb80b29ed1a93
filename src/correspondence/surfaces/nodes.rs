//! Nodes: the parts of surfaces in square tiles of the image over which the absolute phase continues.
//!
//! ```text
//! for each row, for each run, for each tile that it crosses: the pixels of the run in the tile are a piece
//!     if a piece of the row above in the same tile continues it: it belongs to the node of that piece
//!     else: it begins a new node, a neighbour of the node above that continues it across the border of tiles
//!     it is a neighbour of the node of the run's piece in the tile to the left
//! ```
//!
//! Around a hole, a surface may be united with itself so that its orders contradict each other along a seam. Nodes end
//! there too.

use std::ops::Range;

use fringeflow_simd::LANES;

use super::order_scores::{Gate, MAX_ORDER, OrderScorer, SearchSpace, UNSEEN_SCORE};
use super::runs::PhaseRuns;
use super::{FULL_SCORE, LABELS, NO_ORDER};
use crate::correspondence::drift::DepthPolynomial;
use crate::correspondence::view::View;

/// Side of a tile, pixels, and side in a large image: the detail of images grows with their size.
const TILE_PX: usize = 16;
const LARGE_TILE_PX: usize = 32;
/// Pixels of a large image.
const LARGE_PX: usize = 800_000;
/// Least lead of a clear node, pixels that fit.
const CLEAR_LEAD: f32 = 6.0;
/// Fewest sampled pixels of a clear node.
const MIN_SAMPLED: u32 = 4;
/// Least share of a node's own pixels that fit: neighbours alone do not decide it.
const MIN_FITTING: f32 = 0.3;
/// Share of a node's own pixels that neighbours may outvote, unless most fit anyway: a wrong order may fit a narrow
/// strip better.
const MAX_OUTVOTED: f32 = 0.1;
const MOST_FITTING: f32 = 0.75;
/// Stands for no node.
pub(super) const NO_NODE: u32 = u32::MAX;
/// Sides of a node: left, right, above, below. Side k ^ 1 lies opposite side k.
const LEFT: usize = 0;
const ABOVE: usize = 2;

/// Part of a surface in a tile.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Node {
    surface: u32,
    /// Its first pixel, and the order of that pixel relative to the surface.
    pixel: u32,
    relative: i32,
    /// Nodes in the tiles to the left, to the right, above and below into which its phase continues.
    pub(super) neighbours: [u32; 4],
    /// Whether any of its pixels is ever sampled.
    is_sampled: bool,
    /// Index of its evidence; [`NO_NODE`] if it has none.
    pub(super) evidence: u32,
    /// Pixels.
    pub(super) size_px: u32,
    /// Base of its surface: the order of label 0 of the first run of the surface.
    pub(super) base: i32,
    /// The decided label, and its lead in pixels that fit.
    pub(super) label: u8,
    pub(super) lead: f32,
    /// Sampled pixels, and how many of them fit the label; partial fits count as fractions.
    pub(super) sampled: u32,
    pub(super) fitting: f32,
    /// Sampled pixels that fit the label that fits best, regardless of neighbours.
    pub(super) best_fitting: f32,
    /// Sampled pixels that fit the best other label that C2 can see.
    pub(super) rival: f32,
    /// Whether more of its pixels are to be sampled.
    pub(super) is_doubtful: bool,
    /// Whether its first pixel sees into the volume or close to it.
    pub(super) is_within: bool,
    /// Whether its order leads beyond the volume, and no order within fits its pixels.
    pub(super) is_beyond: bool,
    /// Whether its pixels may see something outside the volume.
    pub(super) sees_beyond: bool,
    /// Label of a neighbour that sees into the volume, if there is one.
    pub(super) inner_label: Option<u8>,
    /// Whether its pixels are to be tested for a part of the body of that neighbour, and whether they hold one.
    pub(super) is_body_candidate: bool,
    pub(super) holds_body: bool,
}

/// Pixels of a run in one tile.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Piece {
    pub(super) begin: u32,
    pub(super) end: u32,
    pub(super) node: u32,
    /// Order of the run relative to its surface.
    pub(super) offset: i32,
}

impl Node {
    /// A node without pixels, of a surface and its base.
    fn new((surface, base): (u32, i32), (pixel, relative): (u32, i32)) -> Self {
        let (neighbours, evidence) = ([NO_NODE; 4], NO_NODE);
        Self { surface, base, pixel, relative, neighbours, evidence, is_doubtful: true, ..Self::default() }
    }

    /// The order of a pixel by a label, from its order relative to the surface.
    fn order_of(&self, label: u8, relative: i32) -> i32 {
        i32::from(label) + self.base + relative
    }

    /// The order of a pixel by the decided label.
    pub(super) fn order(&self, relative: i32) -> i32 {
        self.order_of(self.label, relative)
    }

    /// How far beyond the volume its first pixel sees by its order, pixels of the epipolar frame; negative within.
    pub(super) fn beyond_px(&self, View { cam1, table, .. }: View<'_>) -> f32 {
        let segment = table.segment(self.pixel as usize);
        let turns = self.order(self.relative) as f32 + f32::from(cam1.phase[self.pixel as usize]) / 65536.0;
        let (column_px, _) = segment.column_and_columns_per_turn(turns);
        (segment.begin_px - column_px).max(column_px - segment.end_px)
    }

    /// How many pixels fit the best label in the volume; half a segment is at least `half_px`.
    pub(super) fn fitting_within(&self, view: View<'_>, half_px: f32, evidence: &[i16; LABELS]) -> f32 {
        let segment = view.table.segment(self.pixel as usize);
        let (begin_px, end_px) = (segment.reference_px - half_px, segment.reference_px + half_px);
        let phase_turns = f32::from(view.cam1.phase[self.pixel as usize]) / 65536.0;
        let label_at = |px: f32| segment.phase_turns(px) - phase_turns - (self.base + self.relative) as f32;
        let ends = [label_at(begin_px.min(segment.begin_px)), label_at(end_px.max(segment.end_px))];
        let label = |at: f32| at.clamp(0.0, (LABELS - 1) as f32) as usize;
        let (first, last) = (label(ends[0].min(ends[1]).floor()), label(ends[0].max(ends[1]).ceil()));
        f32::from(evidence[first..=last].iter().copied().fold(0, i16::max)) / f32::from(FULL_SCORE)
    }

    /// Whether it fills half a tile.
    pub(super) fn is_large(&self, tile_px: usize) -> bool {
        2 * self.size_px as usize >= tile_px * tile_px
    }

    /// Whether its order leads to where C2 cannot see.
    pub(super) fn is_unseen(&self) -> bool {
        self.fitting == self.sampled as f32 * f32::from(UNSEEN_SCORE) / f32::from(FULL_SCORE)
    }

    /// Whether its order leads clearly, and its own pixels agree.
    pub(super) fn is_clear(&self) -> bool {
        let sampled = self.sampled as f32;
        let own = (self.best_fitting - MAX_OUTVOTED * sampled).min(MOST_FITTING * sampled);
        // Neighbours may decide for an order that few of its own pixels fit; such a node is not clear.
        let is_own = self.fitting >= own.max(MIN_FITTING * sampled);
        self.leads() && is_own
    }

    /// Whether its order leads clearly, by its own pixels and those of its neighbours.
    pub(super) fn leads(&self) -> bool {
        self.sampled >= MIN_SAMPLED && self.lead >= CLEAR_LEAD
    }
}

impl Piece {
    /// Whether its absolute phases continue those of an overlapping piece of the row above.
    fn continues(&self, above: &Piece, width: usize, absolute: impl Fn(&Piece, usize) -> i32) -> bool {
        let begin = self.begin.max(above.begin + width as u32) as usize;
        let end = self.end.min(above.end + width as u32) as usize;
        // Three samples suffice: the phases of both pieces are continuous.
        let places = [1, 2, 3].map(|quarter| begin + (end - begin) * quarter / 4);
        let step = |pixel: usize| absolute(self, pixel).wrapping_sub(absolute(above, pixel - width));
        let near = |&&pixel: &&usize| step(pixel).unsigned_abs() <= HALF_TURN;
        places.iter().filter(near).count() >= 2
    }

    /// Columns of its sampled pixels; the first pixel of its row is `row`.
    pub(super) fn sampled_columns(&self, row: usize, stride: usize) -> impl Iterator<Item = usize> + use<> {
        let (begin, end) = (self.begin as usize - row, self.end as usize - row);
        let first = begin + (stride / 2 + stride - begin % stride) % stride;
        (first..end).step_by(stride)
    }
}

/// The nodes of an image, tile row by tile row.
#[derive(Clone, Debug, Default)]
pub(super) struct Nodes {
    pub(super) nodes: Vec<Node>,
    /// Pixels along the side of a tile.
    pub(super) tile_px: usize,
    /// The pieces, row by row.
    pub(super) pieces: Vec<Piece>,
    /// Index of the first piece of each row, and the number of pieces.
    begins: Vec<usize>,
    /// Index of the first node of each tile row, and the number of nodes.
    tile_rows: Vec<usize>,
    /// Base of each surface.
    bases: Vec<i32>,
    /// Nodes with evidence. Noise makes twenty times as many nodes without evidence.
    pub(super) with_evidence: Vec<u32>,
    /// Index of the first of these of each tile row, and their number.
    pub(super) evidence_rows: Vec<usize>,
}

/// Stands for a base that is not known yet.
const NO_BASE: i32 = i32::MIN;
/// Half a turn of absolute phase.
const HALF_TURN: u32 = 1 << 15;

impl Nodes {
    /// Divides surfaces into nodes.
    pub(super) fn find(&mut self, view: View<'_>, space: &SearchSpace, runs: &PhaseRuns) {
        self.tile_px = if view.cam1.phase.len() < LARGE_PX { TILE_PX } else { LARGE_TILE_PX };
        let tile_px = self.tile_px;
        let Self { nodes, pieces, begins, tile_rows, bases, .. } = self;
        nodes.clear();
        pieces.clear();
        begins.clear();
        tile_rows.clear();
        bases.clear();
        bases.resize(runs.surfaces, NO_BASE);
        let cam1 = view.cam1;
        let width = cam1.width.max(1);
        let absolute = |piece: &Piece, pixel: usize| {
            let order = piece.offset + i32::from(runs.relative[pixel]);
            (order << 16) + i32::from(cam1.phase[pixel])
        };
        for v in 0..cam1.height {
            let above = begins.last().map_or(0..0, |&begin| begin..pieces.len());
            begins.push(pieces.len());
            let is_first_row = v % tile_px == 0;
            if is_first_row {
                tile_rows.push(nodes.len());
            }
            let mut first_met = above.start;
            for run in runs.runs.row(v) {
                let pixels = run.pixels();
                let base = &mut bases[run.set as usize];
                if *base == NO_BASE {
                    let pixel = pixels.start + pixels.len() / 2;
                    let own = run.order_offset + i32::from(runs.relative[pixel]);
                    *base = base_of(view, space, pixel) - own;
                }
                let (mut begin, mut left) = (pixels.start, None);
                while begin < pixels.end {
                    let tile = (begin - v * width) / tile_px;
                    let end = pixels.end.min(v * width + (tile + 1) * tile_px);
                    let piece = Piece { begin: begin as u32, end: end as u32, node: NO_NODE, offset: run.order_offset };
                    // The pieces of a row go from left to right: those above that end before this one meet no later
                    // one.
                    while first_met < above.end && pieces[first_met].end as usize + width <= begin {
                        first_met += 1;
                    }
                    let met = pieces[first_met..above.end].iter();
                    let met = met.take_while(|other| (other.begin as usize + width) < end);
                    let of_surface = met.filter(|other| nodes[other.node as usize].surface == run.set);
                    let continued = of_surface.clone().find(|other| piece.continues(other, width, absolute));
                    // In the first row of a tile, the node above is a neighbour instead.
                    let continued = continued.map(|other| other.node);
                    let node = continued.filter(|_| !is_first_row).unwrap_or_else(|| {
                        let relative = run.order_offset + i32::from(runs.relative[begin]);
                        nodes.push(Node::new((run.set, *base), (begin as u32, relative)));
                        nodes.len() as u32 - 1
                    });
                    link_neighbours(nodes, left, node, LEFT);
                    if is_first_row {
                        link_neighbours(nodes, continued, node, ABOVE);
                    }
                    nodes[node as usize].size_px += (end - begin) as u32;
                    pieces.push(Piece { node, ..piece });
                    (begin, left) = (end, Some(node));
                }
            }
        }
        begins.push(pieces.len());
        tile_rows.push(nodes.len());
    }

    /// Selects the nodes that get evidence, with pixels sampled at these strides: those with a sampled pixel, with
    /// neighbours, or of half a tile.
    pub(super) fn find_evidence_nodes(&mut self, width: usize, strides: [usize; 2]) {
        let Self { nodes, pieces, begins, tile_rows, with_evidence, evidence_rows, tile_px, .. } = self;
        for stride in strides {
            for (row, piece) in pieces_of_sampled_rows(pieces, begins, width, stride) {
                nodes[piece.node as usize].is_sampled |= piece.sampled_columns(row, stride).next().is_some();
            }
        }
        with_evidence.clear();
        evidence_rows.clear();
        for ends in tile_rows.windows(2) {
            evidence_rows.push(with_evidence.len());
            for (node, id) in nodes[ends[0]..ends[1]].iter_mut().zip(ends[0] as u32..) {
                let has_neighbour = node.neighbours.iter().any(|&other| other != NO_NODE);
                if node.is_sampled || has_neighbour || node.is_large(*tile_px) {
                    node.evidence = with_evidence.len() as u32;
                    with_evidence.push(id);
                }
            }
        }
        evidence_rows.push(with_evidence.len());
    }

    /// Counts the sampled pixels of each doubtful node.
    pub(super) fn count_sampled(&mut self, width: usize, stride: usize) {
        self.nodes.iter_mut().filter(|node| node.is_doubtful).for_each(|node| node.sampled = 0);
        for (row, piece) in pieces_of_sampled_rows(&self.pieces, &self.begins, width, stride) {
            let node = &mut self.nodes[piece.node as usize];
            if node.is_doubtful {
                node.sampled += piece.sampled_columns(row, stride).count() as u32;
            }
        }
    }

    /// Computes the orders of the pixels of a row by the labels that `label` gives their nodes, [`NO_ORDER`] where it
    /// gives none. Returns whether there are any.
    pub(super) fn fill_orders(
        &self,
        runs: &PhaseRuns,
        (v, width): (usize, usize),
        label: impl Fn(&Node) -> Option<u8>,
        orders: &mut Vec<i16>,
    ) -> bool {
        orders.clear();
        orders.resize(width.next_multiple_of(LANES), NO_ORDER);
        let mut any = false;
        for piece in self.row(v) {
            let node = &self.nodes[piece.node as usize];
            let Some(label) = label(node) else { continue };
            any = true;
            let pixels = piece.begin as usize..piece.end as usize;
            let first = node.order_of(label, piece.offset).clamp(-MAX_ORDER as i32, MAX_ORDER as i32) as i16;
            let own = &mut orders[pixels.start - v * width..pixels.end - v * width];
            for (order, relative) in own.iter_mut().zip(&runs.relative[pixels]) {
                *order = first.wrapping_add(*relative);
            }
        }
        any
    }

    /// The rows of pixels of a row of tiles.
    pub(super) fn rows_of_tiles(&self, tile_row: usize) -> Range<usize> {
        tile_row * self.tile_px..((tile_row + 1) * self.tile_px).min(self.begins.len() - 1)
    }

    /// The neighbours of a node.
    pub(super) fn neighbours_of(&self, node: &Node) -> impl Iterator<Item = &Node> + use<'_> {
        node.neighbours.into_iter().filter(|&other| other != NO_NODE).map(|other| &self.nodes[other as usize])
    }

    /// The pieces of a row.
    pub(super) fn row(&self, v: usize) -> &[Piece] {
        &self.pieces[self.begins[v]..self.begins[v + 1]]
    }
}

/// The order of label 0 of a surface, from a pixel of relative order 0: the orders of the pixel lie in the middle of
/// the labels.
fn base_of(View { cam1, table, .. }: View<'_>, space: &SearchSpace, pixel: usize) -> i32 {
    let segment = table.segment(pixel);
    let limits_px = space.limits_px(&segment, [pixel % cam1.width, pixel / cam1.width]);
    let (drift, gate) = (DepthPolynomial::default(), Gate::default());
    let scorer = OrderScorer { limits_px, segment, drift, phase: cam1.phase[pixel], gate, half_px: space.half_px };
    let middle = scorer.orders().map_or(0, |orders| (orders.first + orders.last) / 2);
    middle - LABELS as i32 / 2
}

/// The pieces of the rows with sampled pixels, each with the first pixel of its row.
fn pieces_of_sampled_rows<'a>(
    pieces: &'a [Piece],
    begins: &'a [usize],
    width: usize,
    stride: usize,
) -> impl Iterator<Item = (usize, &'a Piece)> {
    let rows = (stride / 2..begins.len() - 1).step_by(stride);
    rows.flat_map(move |v| pieces[begins[v]..begins[v + 1]].iter().map(move |piece| (v * width, piece)))
}

/// Makes a node the neighbour of `other` on a side, unless one of them already has a neighbour there.
fn link_neighbours(nodes: &mut [Node], other: Option<u32>, node: u32, side: usize) {
    let Some(other) = other else { return };
    if nodes[node as usize].neighbours[side] == NO_NODE && nodes[other as usize].neighbours[side ^ 1] == NO_NODE {
        nodes[node as usize].neighbours[side] = other;
        nodes[other as usize].neighbours[side ^ 1] = node;
    }
}
