//! Scratch memory for surfaces, kept from window to window.

use crate::correspondence::candidates::DecidedCandidate;
use crate::correspondence::disjoint_sets::DisjointSets;
use crate::correspondence::drift::{DepthRow, Drift};
use crate::correspondence::segment::SegmentRow;
use crate::correspondence::view::View;

use super::nodes::Nodes;
use super::runs::PhaseRuns;
use super::{LABELS, belief};

/// Scratch memory for surfaces, kept from window to window.
#[derive(Clone, Debug, Default)]
pub(in crate::correspondence) struct Scratch {
    pub(super) runs: PhaseRuns,
    pub(super) nodes: Nodes,
    pub(super) evidence: Vec<[i16; LABELS]>,
    pub(super) messages: belief::Messages,
    /// Scratch for each row of tiles.
    pub(super) rows: Vec<RowScratch>,
    pub(super) decided: DecidedScratch,
    /// Places of C2 that show something outside the volume.
    pub(super) taken: Vec<u8>,
}

/// Scratch for decided candidates.
#[derive(Clone, Debug, Default)]
pub(super) struct DecidedScratch {
    pub(super) candidates: Vec<DecidedCandidate>,
    pub(super) row: RowScratch,
    pub(super) sets: DisjointSets,
    /// Part of each node.
    pub(super) part_of: Vec<u32>,
    pub(super) parts: Vec<Part>,
}

/// Number of candidates of a part, and sums of δ.
#[derive(Clone, Copy, Debug, Default)]
pub(super) struct Part {
    pub(super) count: f32,
    pub(super) sum: f32,
    pub(super) squares: f32,
}

/// Scratch for a row of pixels.
#[derive(Clone, Debug, Default)]
pub(super) struct RowScratch {
    pub(super) segments: SegmentRow,
    pub(super) drift: DepthRow,
    pub(super) bodies: BodyRow,
    pub(super) outside: OutsideRow,
    pub(super) taken: TakenRow,
}

/// Scratch for a row of tiles.
#[derive(Clone, Debug, Default)]
pub(super) struct BodyRow {
    /// The orders of the pixels of a row.
    pub(super) orders: Vec<i16>,
    /// The pixels of each block that fit, and that fit closely, a bit each.
    pub(super) fitting: Vec<[u32; 2]>,
    /// For the pieces of nodes in all rows: node, pixels that fit, and pixels that fit closely.
    pub(super) counts: Vec<(u32, [u32; 2])>,
}

/// Scratch for a row.
#[derive(Clone, Debug, Default)]
pub(super) struct OutsideRow {
    /// The orders of the pixels that may see outside.
    pub(super) orders: Vec<i16>,
    /// Their orders by the label of a neighbour that sees into the volume.
    pub(super) within: Vec<i16>,
    /// These orders of the pixels of nodes that hold a part of a body in the volume.
    pub(super) of_bodies: Vec<i16>,
    /// Marked pixels of all rows that see far, and very far.
    pub(super) far: [u32; 2],
}

/// Scratch for a row of tiles.
#[derive(Clone, Debug, Default)]
pub(super) struct TakenRow {
    /// Orders of the pixels of a row, and their columns in C2.
    pub(super) orders: Vec<i16>,
    pub(super) columns_px: Vec<f32>,
    pub(super) spans: Vec<Span>,
}

/// Columns of a row of the epipolar frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Span {
    pub(super) row: u32,
    pub(super) begin: u32,
    pub(super) end: u32,
}

impl RowScratch {
    /// Loads the segments and the drift of a row.
    pub(super) fn load_row(&mut self, view: View<'_>, drift: &Drift, v: usize) {
        view.table.row(v, &mut self.segments);
        drift.along_row(v, view.cam1.width, &mut self.drift);
    }
}
