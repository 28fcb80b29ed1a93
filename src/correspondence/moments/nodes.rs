//! Nodes: the parts of a surface in one tile of the image. Their orders are decided, not those of pixels.
//!
//! ```text
//! for each tile row, in parallel:
//!     for each row, each run, each tile that it crosses: its open pixels in the tile are pieces
//!     all pieces of one surface in one tile form a node
//! nodes of one surface in neighbouring tiles are neighbours
//! ```
//!
//! A pixel is *open* until its order is decided. The first level of nodes covers all pixels; finer ones cover what is
//! still open.

use std::ops::Range;

use rayon::prelude::*;

use super::OPEN;
use super::likelihood::radians;
use super::phase_runs::PhaseRuns;

/// Stands for no node.
pub(super) const NONE: u32 = u32::MAX;
/// Label of a node that sees nothing.
pub(super) const NOTHING: u8 = (LABELS - 1) as u8;
/// Labels of a node: orders from the base of its surface on, and [`NOTHING`].
pub(super) const LABELS: usize = 128;

/// The part of a surface in one tile.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Node {
    pub(super) surface: u32,
    /// Column of its tile.
    pub(super) tile: u32,
    /// Pixels, and samples taken of them.
    pub(super) size_px: u32,
    pub(super) sampled: u32,
    /// Its pieces.
    pub(super) pieces: [u32; 2],
    /// Nodes of the same surface in the tiles to the left, to the right, above and below.
    pub(super) neighbours: [u32; 4],
    /// The order of label 0 of the surface's first pixel.
    pub(super) base: i32,
    /// The label with which it continues decided pixels beside it; [`NOTHING`] if there are none.
    pub(super) continued: u8,
    /// The decided label, its lead over the next one, and its own ratio, nats.
    pub(super) label: u8,
    pub(super) lead: f32,
    pub(super) ratio: f32,
    /// Mean variance of δ of a sample, rad².
    pub(super) noise: f32,
    /// First and last label that lie in the volume.
    pub(super) inside: [u8; 2],
    /// What was seen of all labels.
    pub(super) outlook: Outlook,
}

/// The labels of a node by what a few samples tell of them, one bit each.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Outlook {
    /// They may fit.
    pub(super) open: u128,
    /// Too few samples fit. Of the others, C2 sees too few.
    pub(super) unfit: u128,
    /// The field about which they were asked, turns, and how far δ could be off, rad.
    pub(super) field_turns: f32,
    pub(super) cap: f32,
}

impl Outlook {
    /// The labels whose bits are set.
    pub(super) fn labels(mut bits: u128) -> impl Iterator<Item = u8> {
        std::iter::from_fn(move || {
            let label = bits.trailing_zeros() as u8;
            (bits != 0).then(|| bits &= bits - 1).map(|()| label)
        })
    }

    /// Whether it holds for δ closer to another field.
    pub(super) fn holds_about(&self, field_turns: f32, cap: f32) -> bool {
        radians((field_turns - self.field_turns).abs()) + cap <= self.cap
    }
}

/// Neighbouring pixels of a row that belong to one node.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Piece {
    /// Row, and columns.
    pub(super) v: u32,
    pub(super) begin: u32,
    pub(super) end: u32,
    /// Order of the run relative to the surface.
    pub(super) offset: i32,
    /// Number of the node in its tile row while nodes are built.
    node: u32,
}

impl Node {
    /// The order of a pixel, from its order relative to the surface.
    #[inline]
    pub(super) fn order(&self, relative: i32) -> i32 {
        i32::from(self.label) + self.base + relative
    }

    /// Whether a label lies in the volume.
    pub(super) fn has_inside(&self, label: u8) -> bool {
        let [first, last] = self.inside;
        (first..=last).contains(&label)
    }

    /// Index range of its pieces.
    #[inline]
    pub(super) fn piece_range(&self) -> Range<usize> {
        self.pieces[0] as usize..self.pieces[1] as usize
    }
}

impl Piece {
    pub(super) fn columns(&self) -> Range<usize> {
        self.begin as usize..self.end as usize
    }

    /// Column and row of the pixel in its middle.
    pub(super) fn middle(&self) -> [usize; 2] {
        [(self.begin + self.end) as usize / 2, self.v as usize]
    }
}

/// The nodes of an image, tile row by tile row.
#[derive(Clone, Debug, Default)]
pub(super) struct Nodes {
    pub(super) nodes: Vec<Node>,
    /// The pieces, node by node, each node's from top to bottom.
    pub(super) pieces: Vec<Piece>,
    /// Index of the first node of each tile row, and the number of nodes.
    pub(super) tile_rows: Vec<usize>,
    /// Pixels along the side of a tile.
    pub(super) tile_px: usize,
    bands: Vec<Band>,
}

/// Scratch for a tile row.
#[derive(Clone, Debug, Default)]
struct Band {
    nodes: Vec<Node>,
    pieces: Vec<Piece>,
    sorted: Vec<Piece>,
    /// Last node of each tile, and the node before it in the same tile for each node.
    last: Vec<u32>,
    before: Vec<u32>,
    begins: Vec<u32>,
}

impl Nodes {
    /// The nodes of which samples were taken, with their numbers.
    pub(super) fn sampled(&self) -> impl Iterator<Item = (usize, &Node)> {
        self.nodes.iter().enumerate().filter(|(_, node)| node.sampled > 0)
    }

    /// Divides the open pixels of all surfaces into nodes. `states` are those of all pixels, if any is decided, and `bases`
    /// the order of label 0 of each surface.
    pub(super) fn divide(
        &mut self,
        [width, height]: [usize; 2],
        tile_px: usize,
        runs: &PhaseRuns,
        bases: &[i32],
        states: Option<&[u8]>,
    ) {
        let Self { nodes, pieces, tile_rows, bands, .. } = self;
        self.tile_px = tile_px;
        // Rows of smaller tiles are more: their memory is kept for the next image.
        let rows = height.div_ceil(tile_px);
        bands.resize(bands.len().max(rows), Band::default());
        let bands = &mut bands[..rows];
        bands.par_iter_mut().enumerate().with_max_len(1).for_each(|(i, band)| {
            band.divide(width, tile_px, i * tile_px..((i + 1) * tile_px).min(height), runs, bases, states);
        });
        nodes.clear();
        pieces.clear();
        tile_rows.clear();
        for band in &*bands {
            tile_rows.push(nodes.len());
            let (first, first_piece) = (nodes.len() as u32, pieces.len() as u32);
            nodes.extend(band.nodes.iter().map(|node| Node {
                pieces: node.pieces.map(|piece| piece + first_piece),
                neighbours: node.neighbours.map(|other| if other == NONE { NONE } else { other + first }),
                ..*node
            }));
            pieces.extend_from_slice(&band.sorted);
        }
        tile_rows.push(nodes.len());
        self.link_rows();
    }

    /// Links the nodes of neighbouring tile rows.
    fn link_rows(&mut self) {
        let Self { nodes, tile_rows, bands, .. } = self;
        for i in 1..tile_rows.len() - 1 {
            let (above, below) = (&bands[i - 1], tile_rows[i]);
            for node in below..tile_rows[i + 1] {
                if let Some(other) = above.node_of(nodes[node].tile, nodes[node].surface) {
                    let other = other + tile_rows[i - 1] as u32;
                    nodes[node].neighbours[2] = other;
                    nodes[other as usize].neighbours[3] = node as u32;
                }
            }
        }
    }

    /// The nodes of a tile row.
    pub(super) fn of_tile_row(&self, row: usize) -> Range<usize> {
        self.tile_rows[row]..self.tile_rows[row + 1]
    }

    /// The pieces of a node.
    pub(super) fn pieces_of(&self, node: &Node) -> &[Piece] {
        &self.pieces[node.piece_range()]
    }

    /// The piece in the middle of a node.
    pub(super) fn middle_of(&self, node: &Node) -> &Piece {
        let pieces = self.pieces_of(node);
        &pieces[pieces.len() / 2]
    }
}

impl Band {
    fn divide(
        &mut self,
        width: usize,
        tile_px: usize,
        rows: Range<usize>,
        runs: &PhaseRuns,
        bases: &[i32],
        states: Option<&[u8]>,
    ) {
        let Self { nodes, pieces, last, before, .. } = self;
        last.clear();
        before.clear();
        nodes.clear();
        pieces.clear();
        last.resize(width.div_ceil(tile_px), NONE);
        for v in rows {
            for run in runs.runs.row(v) {
                let pixels = run.pixels();
                let (mut u, end) = (pixels.start - v * width, pixels.end - v * width);
                let state_of = states.map(|states| &states[v * width..(v + 1) * width]);
                // How many pixels from a column on are open, or are not.
                let count = |from: usize, to: usize, open: bool| {
                    let other = |states: &[u8]| states[from..to].iter().position(|state| (*state == OPEN) != open);
                    state_of.map_or(if open { to - from } else { 0 }, |states| other(states).unwrap_or(to - from))
                };
                while u < end {
                    u += count(u, end, false);
                    if u == end {
                        break;
                    }
                    let (tile, begin) = (u / tile_px, u);
                    u += count(u, end.min((tile + 1) * tile_px), true);
                    let node = find(nodes, last[tile], before, run.set).unwrap_or_else(|| {
                        let node = nodes.len() as u32;
                        before.push(std::mem::replace(&mut last[tile], node));
                        nodes.push(Node::new(run.set, tile, bases[run.set as usize]));
                        node
                    });
                    nodes[node as usize].size_px += (u - begin) as u32;
                    let [v, begin, end] = [v, begin, u].map(|n| n as u32);
                    pieces.push(Piece { v, begin, end, offset: run.order_offset, node });
                }
            }
        }
        self.sort_pieces();
        self.link_tiles();
    }

    /// Sorts the pieces by node; within a node they keep their order.
    fn sort_pieces(&mut self) {
        let Self { nodes, pieces, sorted, begins, .. } = self;
        begins.clear();
        begins.resize(nodes.len() + 1, 0);
        pieces.iter().for_each(|piece| begins[piece.node as usize + 1] += 1);
        (0..nodes.len()).for_each(|i| begins[i + 1] += begins[i]);
        for (node, pair) in nodes.iter_mut().zip(begins.windows(2)) {
            node.pieces = [pair[0], pair[1]];
        }
        sorted.clear();
        sorted.extend_from_slice(pieces);
        for piece in pieces {
            let place = &mut begins[piece.node as usize];
            sorted[*place as usize] = *piece;
            *place += 1;
        }
    }

    /// Links the nodes of neighbouring tiles.
    fn link_tiles(&mut self) {
        for node in 0..self.nodes.len() {
            let Node { tile, surface, .. } = self.nodes[node];
            if tile > 0
                && let Some(other) = self.node_of(tile - 1, surface)
            {
                self.nodes[node].neighbours[0] = other;
                self.nodes[other as usize].neighbours[1] = node as u32;
            }
        }
    }

    /// The node of a surface in a tile.
    fn node_of(&self, tile: u32, surface: u32) -> Option<u32> {
        find(&self.nodes, self.last[tile as usize], &self.before, surface)
    }
}

impl Node {
    fn new(surface: u32, tile: usize, base: i32) -> Self {
        Self {
            surface,
            tile: tile as u32,
            size_px: 0,
            sampled: 0,
            pieces: [0; 2],
            neighbours: [NONE; 4],
            base,
            continued: NOTHING,
            label: NOTHING,
            lead: 0.0,
            ratio: 0.0,
            noise: 0.0,
            inside: [0; 2],
            outlook: Outlook::default(),
        }
    }
}

/// The node of a surface among those of a tile, `last` being the last one and `before` the one before each.
fn find(nodes: &[Node], last: u32, before: &[u32], surface: u32) -> Option<u32> {
    let mut node = last;
    while node != NONE && nodes[node as usize].surface != surface {
        node = before[node as usize];
    }
    (node != NONE).then_some(node)
}
