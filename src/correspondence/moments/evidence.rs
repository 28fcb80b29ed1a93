//! Evidence: the likelihood of the moments of δ of each node at every order.
//!
//! ```text
//! for each tile row, in parallel; for each node; for each sampled pixel:
//!     for its orders in all of space, 32 at once, all in one row of C2:
//!         x = the column at which Φ − field is k turns more than the phase φ of the pixel
//!         rest = δ of the crossing near x, less the field
//!         add rest to the sums of label k
//! ratio of each label from its sums; an order outside the volume starts with a handicap
//! ```

use fringeflow_simd::{Kernel, LANES, Lanes, Level};

use super::field::Uncertainty;
use super::likelihood::{Look, Moments, Sums, Widths, radians};
use super::model::Model;
use super::nodes::{LABELS, NOTHING, Node, Nodes};
use super::noise::Noise;
use super::orders::{Orders, PixelOrders, RestsOfOrders, SearchSpace, rests_of_orders};
use super::phase_runs::PhaseRuns;
use crate::correspondence::drift::{DepthRow, Drift};
use crate::correspondence::pool::Pool;
use crate::correspondence::segment::{Segment, SegmentRow};
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
    /// Handicap of orders outside the volume, nats: at most for a node, and for a whole surface.
    pub(super) outside_nats: [f32; 2],
    /// Nodes of each surface.
    pub(super) of_surface: &'a [u32],
    pub(super) uncertainty: &'a Uncertainty,
    pub(super) noise: Noise,
    /// Whether the epipolar lines run along the columns of C1.
    pub(super) is_vertical: bool,
}

/// The moments of a node at one label.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fit {
    pub(super) label: u8,
    pub(super) is_inside: bool,
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
            tile_row.rows.iter_mut().for_each(|row| row.is_loaded = false);
            if tile_row.rows.len() < tile_px {
                tile_row.rows.resize(tile_px, Row::default());
            }
            fits.clear();
            for ((node, scores), range) in nodes.iter_mut().zip(scores).zip(ranges) {
                let begin = fits.len() as u32;
                node.sampled = 0;
                if node.size_px >= question.min_px {
                    let stride = if node.size_px < MANY_PX { 1 } else { question.stride_px };
                    for piece in &pieces[node.piece_range()] {
                        let v = piece.v as usize;
                        if v % stride == stride / 2 {
                            tile_row.load(view, field, first, v);
                        }
                    }
                    let kernel = NodeKernel {
                        view,
                        space,
                        runs,
                        node,
                        pieces: &pieces[node.piece_range()],
                        stride,
                        first_row: first,
                        tile_px,
                        question,
                        rows: &tile_row.rows,
                    };
                    let sums = fringeflow_simd::run(Level::in_use(), kernel);
                    node.sampled = sums.sampled;
                    node.noise = sums.noise / (sums.sampled.max(1)) as f32;
                    let [most, whole] = question.outside_nats;
                    let handicap = most.min(whole / question.of_surface[node.surface as usize] as f32);
                    sums.judge(view.model, node.noise, question, handicap, scores, fits);
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

/// Segments and field of the rows of a tile row.
#[derive(Clone, Debug, Default)]
struct TileRow {
    rows: Vec<Row>,
}

/// Segments and field of a row.
#[derive(Clone, Debug, Default)]
struct Row {
    is_loaded: bool,
    segments: SegmentRow,
    field: DepthRow,
}

impl TileRow {
    fn load(&mut self, view: View<'_>, field: &Drift, first: usize, v: usize) {
        let row = &mut self.rows[v - first];
        if !row.is_loaded {
            row.is_loaded = true;
            view.table.row(v, &mut row.segments);
            field.along_row(v, view.cam1.width, &mut row.field);
        }
    }
}

/// Room for labels, and for the lanes of the last vector behind them.
const ROOM: usize = LABELS + LANES;
/// Sums kept per label; their order is that of [`Sums`].
const SUMS: usize = 11;

/// The sums of all labels of a node.
struct NodeSums {
    sums: [[f32; ROOM]; SUMS],
    sampled: u32,
    noise: f32,
    /// A segment of the node with the absolute phase of label 0 there, turns, and half a segment, pixels.
    middle: Option<(Segment, f32)>,
    half_px: f32,
    /// First and last label any sample had, and those in the volume.
    labels: [i32; 2],
    inside: [f32; 2],
}

impl NodeSums {
    /// Distance of a label from the middle of the segment, half segments.
    fn place(&self, label: f32) -> f32 {
        self.middle.map_or(0.0, |(segment, zero)| {
            (segment.column_and_columns_per_turn(zero + label).0 - segment.reference_px) / self.half_px
        })
    }

    /// Scores of all labels, and the fits.
    fn judge(
        &self,
        model: &Model,
        noise: f32,
        question: &Question<'_>,
        outside_nats: f32,
        scores: &mut Scores,
        fits: &mut Vec<Fit>,
    ) {
        let score = |nats: f32| (nats * STEPS_PER_NAT) as i16;
        *scores = [score(model.unseen_nats); LABELS];
        scores[usize::from(NOTHING)] = score(model.nothing_nats);
        let [first, last] = self.labels;
        let widest = question.widths.wrong_slopes[0].max(question.widths.slopes[0]);
        for label in first.max(0)..=last.min(i32::from(NOTHING) - 1) {
            let at = label as usize;
            let [seen, fitting, u, v, e, uu, uv, vv, ue, ve, ee] = std::array::from_fn(|k| self.sums[k][at]);
            let sums = Sums { seen, fitting, u, v, e, uu, uv, vv, ue, ve, ee };
            let is_inside = label as f32 >= self.inside[0] && label as f32 <= self.inside[1];
            let handicap = if is_inside { 0.0 } else { outside_nats };
            let nats = match sums.look(self.sampled as f32, noise, widest, model) {
                Look::Unseen => model.unseen_nats,
                Look::Unfit => model.floor_nats,
                Look::Fits(moments) => {
                    let place = self.place(label as f32);
                    let mean = question.widths.mean;
                    let mean = (mean * mean + question.uncertainty.beyond(place)).sqrt();
                    let ratio = moments.ratio(0.0, &Widths { mean, ..question.widths }, model);
                    fits.push(Fit { label: label as u8, is_inside, ratio, moments });
                    ratio
                }
            };
            scores[at] = score((nats - handicap).max(model.floor_nats));
        }
    }
}

/// Sums the samples of a node.
struct NodeKernel<'a> {
    view: View<'a>,
    space: &'a SearchSpace,
    runs: &'a PhaseRuns,
    node: &'a Node,
    pieces: &'a [super::nodes::Piece],
    stride: usize,
    first_row: usize,
    tile_px: usize,
    question: &'a Question<'a>,
    rows: &'a [Row],
}

impl Kernel for NodeKernel<'_> {
    type Output = NodeSums;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> NodeSums {
        let Self { view, space, runs, node, pieces, stride, first_row, tile_px, question, rows } = self;
        let mut all = NodeSums {
            sums: [[0.0; ROOM]; SUMS],
            sampled: 0,
            noise: 0.0,
            middle: None,
            half_px: space.half_px,
            labels: [i32::MAX, i32::MIN],
            inside: [f32::INFINITY, f32::NEG_INFINITY],
        };
        let (half, width) = (0.5 * tile_px as f32, view.cam1.width);
        let middle = |tile: usize| (tile * tile_px) as f32 + half - 0.5;
        let (middle_u, middle_v) = (middle(node.tile as usize), middle(first_row / tile_px));
        for piece in pieces {
            let v = piece.v as usize;
            if v % stride != stride / 2 {
                continue;
            }
            let row = &rows[v - first_row];
            let begin = piece.begin as usize;
            let first = begin + (stride / 2 + stride - begin % stride) % stride;
            for u in (first..piece.end as usize).step_by(stride) {
                let pixel = v * width + u;
                let phase = view.cam1.phase[pixel];
                let segment = row.segments.segment(u);
                all.sampled += 1;
                all.noise += question.noise.variance(view.cam1.modulation[pixel].grey());
                let limits_px = space.limits_px(&segment, [u, v]);
                let of_pixel = PixelOrders { segment, drift: row.field.segment(u), phase, limits_px };
                let Some(orders) = of_pixel.orders() else { continue };
                let relative = piece.offset + i32::from(runs.relative[pixel]);
                let zero = relative + node.base;
                all.middle = Some((segment, zero as f32 + f32::from(phase) / 65536.0));
                let ends = segment.limits_px().map(|px| segment.phase_turns(px) - f32::from(phase) / 65536.0);
                all.inside[0] = all.inside[0].min(ends[0].min(ends[1]) - zero as f32 - 0.5);
                all.inside[1] = all.inside[1].max(ends[0].max(ends[1]) - zero as f32 + 0.5);
                let first_order = orders.first.max(zero);
                let last_order = orders.last.min(zero + i32::from(NOTHING) - 1);
                all.labels[0] = all.labels[0].min(first_order - zero);
                all.labels[1] = all.labels[1].max(last_order - zero);
                let mut place = [(u as f32 - middle_u) / half, (v as f32 - middle_v) / half];
                if question.is_vertical {
                    place.swap(0, 1);
                }
                let own = Orders { last: last_order, ..orders };
                let mut order = first_order;
                while order <= last_order {
                    let rests = rests_of_orders(lanes, view.cam2, &of_pixel, &own, order);
                    add(lanes, &mut all.sums, (order - zero) as usize, place, &rests, question.cap);
                    order += LANES as i32;
                }
            }
        }
        all
    }
}

/// Adds the rests of consecutive labels from `label` on.
#[inline(always)]
fn add<L: Lanes>(
    lanes: L,
    sums: &mut [[f32; ROOM]; SUMS],
    label: usize,
    [u, v]: [f32; 2],
    rests: &RestsOfOrders<L>,
    cap: f32,
) {
    let (zero, one) = (lanes.float(0.0), lanes.float(1.0));
    let e = lanes.times_float(rests.rest_turns, lanes.float(radians(1.0)));
    let fits = lanes.exceeds(lanes.float(cap), lanes.abs_float(e));
    let fits = lanes.both(fits, lanes.truths(rests.known));
    let own = |value: f32| lanes.select_float(fits, lanes.float(value), zero);
    let e = lanes.select_float(fits, e, zero);
    let (us, vs) = (lanes.float(u), lanes.float(v));
    let values = [
        lanes.select_float(lanes.truths(rests.known), one, zero),
        own(1.0),
        own(u),
        own(v),
        e,
        own(u * u),
        own(u * v),
        own(v * v),
        lanes.times_float(us, e),
        lanes.times_float(vs, e),
        lanes.times_float(e, e),
    ];
    for (sums, value) in sums.iter_mut().zip(values) {
        if let Some(place) = sums.get_mut(label..).and_then(|rest| rest.first_chunk_mut::<LANES>()) {
            let sum = lanes.add_float(lanes.load_floats(place), value);
            lanes.store_floats(sum, place);
        }
    }
}
