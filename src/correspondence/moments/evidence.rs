//! Evidence: the likelihood of the moments of δ of each node at every order.
//!
//! ```text
//! for each tile row, in parallel; for each node:
//!     a few samples, at all orders in space: which labels can fit?
//!     all samples, at these labels: sums of δ less the field
//!     ratio of each label from its sums; an order outside the volume starts with a handicap
//! ```

use super::field::Uncertainty;
use super::likelihood::{Look, Moments, Sums, Widths};
use super::model::Model;
use super::nodes::{LABELS, NOTHING, Node, Nodes, Outlook, Piece};
use super::noise::Noise;
use super::orders::SearchSpace;
use super::phase_runs::PhaseRuns;
use super::samples::{Grid, Row, Samples};
use crate::correspondence::drift::Drift;
use crate::correspondence::pool::Pool;
use crate::correspondence::view::View;

/// Scores are counted in this many steps a nat.
pub(super) const STEPS_PER_NAT: f32 = 64.0;
/// Pixels of a node from which on it is sampled sparsely.
const MANY_PX: u32 = 64;

/// Scores of the labels of a node.
pub(super) type Scores = [i16; LABELS];

/// How the nodes of a level are sampled and judged.
#[derive(Clone, Copy, Debug)]
pub(super) struct Question<'a> {
    /// Distance of the samples of large nodes, pixels.
    pub(super) stride_px: usize,
    /// Fewest pixels of a node that is judged.
    pub(super) min_px: u32,
    /// |δ − field| below which a sample fits, rad.
    pub(super) cap: f32,
    pub(super) widths: Widths,
    /// Handicap of an order outside the volume for a whole surface, nats.
    pub(super) outside_nats: f32,
    /// Nodes of each surface.
    pub(super) of_surface: &'a [u32],
    pub(super) uncertainty: &'a Uncertainty,
    pub(super) noise: Noise,
    /// Whether the epipolar lines run along the columns of C1.
    pub(super) is_vertical: bool,
}

impl Question<'_> {
    /// Distance of the samples of a node, pixels; `None` if it is not judged.
    fn stride_of(&self, node: &Node) -> Option<usize> {
        let stride_px = if node.size_px < MANY_PX { 1 } else { self.stride_px };
        (node.size_px >= self.min_px).then_some(stride_px)
    }
}

/// The moments of a node at one label.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fit {
    pub(super) label: u8,
    pub(super) ratio: f32,
    pub(super) moments: Moments,
}

/// The evidence of all nodes.
#[derive(Clone, Debug, Default)]
pub(super) struct Evidence {
    /// Scores of each node, in [`STEPS_PER_NAT`].
    pub(super) scores: Vec<Scores>,
    /// The labels of all nodes whose samples fit, and the range of each node's.
    pub(super) fits: Vec<Fit>,
    pub(super) ranges: Vec<[u32; 2]>,
    bands: Vec<Vec<Fit>>,
    pool: Pool<TileRow>,
}

impl Evidence {
    /// Computes the evidence of all nodes about a field of δ.
    pub(super) fn gather(
        &mut self,
        view: View<'_>,
        field: &Drift,
        space: &SearchSpace,
        runs: &PhaseRuns,
        nodes: &mut Nodes,
        question: &Question<'_>,
    ) {
        let Self { scores, fits, ranges, bands, pool } = self;
        scores.resize(nodes.nodes.len(), [0; LABELS]);
        ranges.resize(nodes.nodes.len(), [0; 2]);
        let Nodes { nodes, pieces, tile_rows, tile_px, .. } = nodes;
        let (tile_px, pieces) = (*tile_px, &*pieces);
        // Rows of smaller tiles are more: their memory is kept for the next image.
        bands.resize(bands.len().max(tile_rows.len() - 1), Vec::new());
        let bands = &mut bands[..tile_rows.len() - 1];
        let all = TileRows { first: 0, begins: tile_rows, nodes, scores, ranges, bands };
        all.for_each(&|row, nodes, scores, ranges, fits| {
            let mut tile_row = pool.take();
            let first = row * tile_px;
            let strides = nodes.iter().filter_map(|node| Some((node, question.stride_of(node)?)));
            let sampled = strides.flat_map(|(node, stride)| pieces_at(&pieces[node.piece_range()], stride));
            tile_row.load(view, field, [first, tile_px], sampled);
            fits.clear();
            for ((node, scores), range) in nodes.iter_mut().zip(scores).zip(ranges) {
                let begin = fits.len() as u32;
                node.sampled = 0;
                if let Some(stride) = question.stride_of(node) {
                    let TileRow { rows, samples, listed, sums } = &mut *tile_row;
                    let pieces = &pieces[node.piece_range()];
                    let grid = Grid { runs, node, pieces, stride, tile_px, first_row: first, rows };
                    samples.take(view, space, &grid, question);
                    (node.sampled, node.noise, node.inside) = (samples.sampled, samples.mean_noise(), samples.inside());
                    judge(view, (samples, listed, sums), question, &mut node.outlook, scores, fits);
                    let handicap = handicap(view.model, question.outside_nats, question.of_surface, node);
                    lower_outside(scores, node, handicap, view.model);
                } else {
                    *scores = [0; LABELS];
                }
                *range = [begin, fits.len() as u32];
            }
        });
        fits.clear();
        for (row, of_row) in bands.iter().enumerate() {
            let before = fits.len() as u32;
            fits.extend_from_slice(of_row);
            for range in &mut ranges[tile_rows[row]..tile_rows[row + 1]] {
                *range = range.map(|place| place + before);
            }
        }
    }

    /// The moments of a node at a label, if its samples fit there.
    pub(super) fn fit(&self, node: usize, label: u8) -> Option<&Fit> {
        let [begin, end] = self.ranges[node].map(|place| place as usize);
        self.fits[begin..end].iter().find(|fit| fit.label == label)
    }

    /// All fits of a node.
    pub(super) fn fits_of(&self, node: usize) -> &[Fit] {
        let [begin, end] = self.ranges[node].map(|place| place as usize);
        &self.fits[begin..end]
    }
}

/// The nodes, scores, ranges and fits of some tile rows.
struct TileRows<'a> {
    /// Number of the first of them.
    first: usize,
    /// Index of the first node of each tile row, and the end of the last one.
    begins: &'a [usize],
    nodes: &'a mut [Node],
    scores: &'a mut [Scores],
    ranges: &'a mut [[u32; 2]],
    bands: &'a mut [Vec<Fit>],
}

impl TileRows<'_> {
    /// Calls `visit` with the number of each tile row and what belongs to it, in parallel.
    fn for_each(self, visit: &(impl Fn(usize, &mut [Node], &mut [Scores], &mut [[u32; 2]], &mut Vec<Fit>) + Sync)) {
        let Self { first, begins, nodes, scores, ranges, bands } = self;
        match bands {
            [] => {}
            [band] => visit(first, nodes, scores, ranges, band),
            _ => {
                let half = bands.len() / 2;
                let at = begins[half] - begins[0];
                let (nodes, scores, ranges) =
                    (nodes.split_at_mut(at), scores.split_at_mut(at), ranges.split_at_mut(at));
                let bands = bands.split_at_mut(half);
                let upper = TileRows {
                    first,
                    begins: &begins[..=half],
                    nodes: nodes.0,
                    scores: scores.0,
                    ranges: ranges.0,
                    bands: bands.0,
                };
                let lower = TileRows {
                    first: first + half,
                    begins: &begins[half..],
                    nodes: nodes.1,
                    scores: scores.1,
                    ranges: ranges.1,
                    bands: bands.1,
                };
                rayon::join(|| upper.for_each(visit), || lower.for_each(visit));
            }
        }
    }
}

/// Scratch of a tile row.
#[derive(Clone, Debug, Default)]
struct TileRow {
    rows: Vec<Row>,
    samples: Samples,
    /// The labels of a node that can fit, and their sums.
    listed: Vec<u8>,
    sums: Vec<Sums>,
}

impl TileRow {
    /// Loads segments and field at the sampled pieces of a tile row.
    fn load<'a>(
        &mut self,
        view: View<'_>,
        field: &Drift,
        [first, tile_px]: [usize; 2],
        sampled: impl Iterator<Item = &'a Piece>,
    ) {
        let (rows, width) = (&mut self.rows, view.cam1.width);
        rows.resize(rows.len().max(tile_px), Row::default());
        rows.iter_mut().for_each(|row| row.wanted.reset(width));
        for piece in sampled {
            rows[piece.v as usize - first].wanted.want(piece.columns());
        }
        for (i, Row { wanted, segments, field: along }) in rows.iter_mut().enumerate() {
            if wanted.any() {
                view.table.row_where(first + i, wanted, segments);
                field.along_row_where(first + i, width, wanted, along);
            }
        }
    }
}

/// The pieces of a node with samples, in rows at a distance.
pub(super) fn pieces_at(pieces: &[Piece], stride_px: usize) -> impl Iterator<Item = &Piece> {
    pieces.iter().filter(move |piece| piece.v as usize % stride_px == stride_px / 2)
}

/// Scores of all labels of a node, and the fits.
fn judge(
    view: View<'_>,
    (samples, listed, sums): (&mut Samples, &mut Vec<u8>, &mut Vec<Sums>),
    question: &Question<'_>,
    outlook: &mut Outlook,
    scores: &mut Scores,
    fits: &mut Vec<Fit>,
) {
    let model = view.model;
    *scores = [score(model.unseen_nats); LABELS];
    scores[usize::from(NOTHING)] = score(model.nothing_nats);
    if !outlook.holds_about(samples.field_turns(), question.cap) {
        *outlook = samples.screen(view.cam2, question.cap, model);
    }
    listed.clear();
    Outlook::labels(outlook.unfit).for_each(|label| scores[usize::from(label)] = score(model.floor_nats));
    listed.extend(Outlook::labels(outlook.open));
    samples.sum(view.cam2, question.cap, listed, sums);
    let widest = question.widths.wrong_slopes[0].max(question.widths.slopes[0]);
    for (&label, sums) in listed.iter().zip(&*sums) {
        let nats = match sums.look(samples.sampled as f32, samples.mean_noise(), widest, model) {
            Look::Unseen => model.unseen_nats,
            Look::Unfit => model.floor_nats,
            Look::Fits(moments) => {
                let mean = question.widths.mean;
                let mean = (mean * mean + question.uncertainty.beyond(samples.place_of(label))).sqrt();
                let ratio = moments.ratio(0.0, &Widths { mean, ..question.widths }, model);
                fits.push(Fit { label, ratio, moments });
                ratio
            }
        };
        scores[usize::from(label)] = score(nats);
    }
}

fn score(nats: f32) -> i16 {
    (nats * STEPS_PER_NAT) as i16
}

/// What an order outside the volume has against it in a node, nats, if it has so much against it for a whole surface.
fn handicap(model: &Model, surface_nats: f32, of_surface: &[u32], node: &Node) -> f32 {
    model.outside_node_nats.min(surface_nats / of_surface[node.surface as usize] as f32)
}

/// Lowers the scores of the labels outside the volume.
fn lower_outside(scores: &mut Scores, node: &Node, nats: f32, model: &Model) {
    let (by, floor) = (score(nats), score(model.floor_nats));
    for label in (0..NOTHING).filter(|label| !node.has_inside(*label)) {
        let score = &mut scores[usize::from(label)];
        *score = (*score - by).max(floor);
    }
}
