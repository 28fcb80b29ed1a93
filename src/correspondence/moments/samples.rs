//! The samples of a node: some of its pixels, with what is needed to compute their δ at any order.
//!
//! ```text
//! a few samples, 32 orders of one at once: how often is each label seen, and how often does it fit?
//! all samples, 32 of them at once, at one label: the sums of its moments
//! ```
//!
//! At most labels nearly nothing fits. A few samples tell so, at a fraction of the cost of all.

use fringeflow_simd::{Kernel, LANES, Lanes, Level, filled, total};

use super::evidence::{Question, pieces_at};
use super::likelihood::{Sums, radians};
use super::model::Model;
use super::nodes::{LABELS, NOTHING, Node, Outlook, Piece};
use super::orders::{Line, Lines, SearchSpace, columns_around_each, rests, rests_of_orders};
use super::phase_runs::PhaseRuns;
use crate::correspondence::drift::DepthRow;
use crate::correspondence::epipolar_image::EpipolarImage;
use crate::correspondence::kernels::{Segments, load};
use crate::correspondence::segment::{Segment, SegmentRow};
use crate::correspondence::view::View;
use crate::correspondence::wanted::WantedBlocks;

/// Most samples of a node.
const MOST: usize = 2 * LANES;
/// Samples that are asked at all orders.
const SCREENED: usize = 8;
/// Room for labels, and for the lanes of the last vector behind them.
const ROOM: usize = LABELS + LANES;
/// Sums kept; their order is that of [`Sums`].
const SUMS: usize = 11;

/// One number of each sample.
type Numbers = [f32; MOST];

/// The samples of a node, one array per number.
#[derive(Clone, Debug)]
pub(super) struct Samples {
    /// All samples.
    pub(super) sampled: u32,
    /// First and last label that any sample has.
    pub(super) labels: [i32; 2],
    /// The same of labels in the volume.
    inside: [f32; 2],
    /// Sum of the variances of noise, rad².
    noise: f32,
    /// A segment of the node with the absolute phase of label 0 there, turns, and half a segment, pixels.
    middle: Option<(Segment, f32)>,
    half_px: f32,
    /// Samples whose phase has orders; only these stand in the arrays.
    count: usize,
    /// Place, half tiles from the middle of the tile: along and across the epipolar lines.
    place: [Numbers; 2],
    phase: [u16; MOST],
    /// Absolute phase at label 0, turns.
    zero_turns: Numbers,
    /// First and last label.
    ends: [Numbers; 2],
    segments: SegmentRow,
    field: DepthRow,
    /// Least and greatest Φ searched, turns.
    phase_turns: [Numbers; 2],
    /// Screened samples that C2 sees at each label, and those that fit.
    seen: [u16; ROOM],
    fitting: [u16; ROOM],
}

/// A node, and the grid of its samples.
pub(super) struct Grid<'a> {
    pub(super) runs: &'a PhaseRuns,
    pub(super) node: &'a Node,
    pub(super) pieces: &'a [Piece],
    /// Distance of samples, side of the tile, and its first row, pixels.
    pub(super) stride: usize,
    pub(super) tile_px: usize,
    pub(super) first_row: usize,
    /// Segments and field of the rows of the tile that have samples.
    pub(super) rows: &'a [Row],
}

/// Segments and field of a row of pixels.
#[derive(Clone, Debug, Default)]
pub(super) struct Row {
    pub(super) wanted: WantedBlocks,
    pub(super) segments: SegmentRow,
    pub(super) field: DepthRow,
}

impl Default for Samples {
    fn default() -> Self {
        Self {
            sampled: 0,
            labels: [0; 2],
            inside: [0.0; 2],
            noise: 0.0,
            middle: None,
            half_px: 1.0,
            count: 0,
            place: [[0.0; MOST]; 2],
            phase: [0; MOST],
            zero_turns: [0.0; MOST],
            ends: [[0.0; MOST]; 2],
            segments: SegmentRow::default(),
            field: DepthRow::default(),
            phase_turns: [[0.0; MOST]; 2],
            seen: [0; ROOM],
            fitting: [0; ROOM],
        }
    }
}

impl Samples {
    /// Takes the samples of a node.
    pub(super) fn take(&mut self, view: View<'_>, space: &SearchSpace, grid: &Grid<'_>, question: &Question<'_>) {
        let Grid { runs, node, pieces, stride, tile_px, first_row, rows } = *grid;
        self.segments.make_room(MOST);
        self.field.make_room(MOST);
        (self.sampled, self.count, self.noise) = (0, 0, 0.0);
        (self.middle, self.half_px) = (None, space.half_px);
        (self.labels, self.inside) = ([i32::MAX, i32::MIN], [f32::INFINITY, f32::NEG_INFINITY]);
        let (half, width) = (0.5 * tile_px as f32, view.cam1.width);
        let middle = |tile: usize| (tile * tile_px) as f32 + half - 0.5;
        let (middle_u, middle_v) = (middle(node.tile as usize), middle(first_row / tile_px));
        for piece in pieces_at(pieces, stride) {
            let v = piece.v as usize;
            let row = &rows[v - first_row];
            let begin = piece.begin as usize;
            let first = begin + (stride / 2 + stride - begin % stride) % stride;
            for u in (first..piece.end as usize).step_by(stride) {
                let pixel = v * width + u;
                let segment = row.segments.segment(u);
                self.sampled += 1;
                self.noise += question.noise.variance(view.cam1.modulation[pixel].grey());
                let limits_px = space.limits_px(&segment, [u, v]);
                let phase = view.cam1.phase[pixel];
                let Some(line) = Line::within(segment, row.field.segment(u), phase, limits_px) else { continue };
                let mut place = [(u as f32 - middle_u) / half, (v as f32 - middle_v) / half];
                if question.is_vertical {
                    place.swap(0, 1);
                }
                self.add(&line, node.base + piece.offset + i32::from(runs.relative[pixel]), place);
            }
        }
        for i in self.count..MOST {
            // No label lies behind the last one.
            (self.ends[0][i], self.ends[1][i]) = (f32::INFINITY, f32::NEG_INFINITY);
        }
    }

    /// Adds a pixel whose order at label 0 is `zero`.
    fn add(&mut self, line: &Line, zero: i32, place: [f32; 2]) {
        let (i, segment) = (self.count, &line.segment);
        let zero_turns = zero as f32 + f32::from(line.phase) / 65536.0;
        self.middle = Some((*segment, zero_turns));
        let ends = segment.limits_px().map(|px| segment.phase_turns(px) - zero_turns);
        self.inside[0] = self.inside[0].min(ends[0].min(ends[1]) - 0.5);
        self.inside[1] = self.inside[1].max(ends[0].max(ends[1]) + 0.5);
        let [first, last] = line.orders().map(|order| order - zero);
        let labels = [first.max(0), last.min(i32::from(NOTHING) - 1)];
        self.labels = [self.labels[0].min(labels[0]), self.labels[1].max(labels[1])];
        for axis in 0..2 {
            self.place[axis][i] = place[axis];
            self.phase_turns[axis][i] = line.phase_turns[axis];
            self.ends[axis][i] = labels[axis] as f32;
        }
        (self.phase[i], self.zero_turns[i]) = (line.phase, zero_turns);
        self.segments.set(i, segment);
        self.field.set(i, &line.field);
        self.count += 1;
    }

    fn line(&self, i: usize) -> Line {
        Line {
            segment: self.segments.segment(i),
            field: self.field.segment(i),
            phase: self.phase[i],
            phase_turns: self.phase_turns.map(|turns| turns[i]),
        }
    }

    /// Asks a few samples at all orders.
    pub(super) fn screen(&mut self, image: &EpipolarImage, cap: f32, model: &Model) -> Outlook {
        self.seen.fill(0);
        self.fitting.fill(0);
        let screened = screened(self.count).count() as f32;
        fringeflow_simd::run(Level::in_use(), Screen { samples: self, image, cap });
        let mut outlook = Outlook { field_turns: self.field_turns(), cap, ..Outlook::default() };
        let [first, last] = self.labels;
        for label in first..=last {
            let [seen, fitting] = [self.seen[label as usize], self.fitting[label as usize]].map(f32::from);
            if seen < model.min_seen * screened || seen == 0.0 {
                continue;
            } else if fitting == 0.0 || fitting < 0.5 * model.min_share * seen {
                outlook.unfit |= 1 << label;
            } else {
                outlook.open |= 1 << label;
            }
        }
        outlook
    }

    /// The field in the middle of the volume, at one of the samples, turns.
    pub(super) fn field_turns(&self) -> f32 {
        self.field.segment(0).at(self.segments.segment(0).reference_px)
    }

    /// Sums over all samples at some labels.
    pub(super) fn sum(&self, image: &EpipolarImage, cap: f32, labels: &[u8], sums: &mut Vec<Sums>) {
        sums.clear();
        fringeflow_simd::run(Level::in_use(), AllSums { samples: self, image, cap, labels, sums });
    }

    /// Mean variance of noise, rad².
    pub(super) fn mean_noise(&self) -> f32 {
        self.noise / self.sampled.max(1) as f32
    }

    /// First and last label in the volume; the first exceeds the last if there is none.
    pub(super) fn inside(&self) -> [u8; 2] {
        let [first, last] = self.inside;
        let end = f32::from(NOTHING);
        if last < 0.0 || first >= end { [1, 0] } else { [first.max(0.0).ceil() as u8, last.min(end).floor() as u8] }
    }

    /// Distance of a label from the middle of the segment, half segments.
    pub(super) fn place_of(&self, label: u8) -> f32 {
        self.middle.map_or(0.0, |(segment, zero)| {
            let column_px = segment.column_and_columns_per_turn(zero + f32::from(label)).0;
            (column_px - segment.reference_px) / self.half_px
        })
    }
}

/// The screened samples of so many: a few, in different rows and columns of the grid.
fn screened(count: usize) -> impl Iterator<Item = usize> {
    let step = count.div_ceil(SCREENED).max(1);
    (0..SCREENED).map(move |j| j * step + (3 * j) % step).filter(move |i| *i < count)
}

/// Counts the fitting samples of all labels, for a few samples.
struct Screen<'a> {
    samples: &'a mut Samples,
    image: &'a EpipolarImage,
    cap: f32,
}

impl Kernel for Screen<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let Self { samples, image, cap } = self;
        let (cap_turns, one, zero) = (lanes.float(cap / radians(1.0)), lanes.word(1), lanes.word(0));
        for i in screened(samples.count) {
            let line = samples.line(i);
            let [first, last] = samples.ends.map(|ends| ends[i] as usize);
            for label in (first..=last).step_by(LANES) {
                let (turns, count) = (samples.zero_turns[i] + label as f32, LANES.min(last + 1 - label));
                let rests = rests_of_orders(lanes, image, &line, turns, count);
                let fits = lanes.mask_of(lanes.exceeds(cap_turns, lanes.abs_float(rests.rest_turns)));
                let fits = lanes.and(fits, rests.known);
                // Written out: a closure would not be compiled for the SIMD level.
                if let Some(seen) = samples.seen[label..].first_chunk_mut() {
                    lanes.store(lanes.add(lanes.load(seen), lanes.select(rests.known, one, zero)), seen);
                }
                if let Some(fitting) = samples.fitting[label..].first_chunk_mut() {
                    lanes.store(lanes.add(lanes.load(fitting), lanes.select(fits, one, zero)), fitting);
                }
            }
        }
    }
}

/// Sums over all samples at some labels.
struct AllSums<'a> {
    samples: &'a Samples,
    image: &'a EpipolarImage,
    cap: f32,
    labels: &'a [u8],
    sums: &'a mut Vec<Sums>,
}

impl Kernel for AllSums<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let Self { samples, image, cap, labels, sums } = self;
        let (zero, one, cap) = (lanes.float(0.0), lanes.float(1.0), lanes.float(cap));
        for &label in labels {
            let label = lanes.float(f32::from(label));
            let mut all = [zero; SUMS];
            for first in (0..samples.count).step_by(LANES) {
                let segments = Segments::new(lanes, &samples.segments, first);
                let lines = Lines {
                    phase: [segments.a, segments.b, segments.d],
                    reference_px: segments.reference,
                    field: samples.field.block(lanes, first),
                    phase_turns: [
                        load(lanes, &samples.phase_turns[0], first),
                        load(lanes, &samples.phase_turns[1], first),
                    ],
                };
                let turns = lanes.add_float(load(lanes, &samples.zero_turns, first), label);
                let is_behind_first = lanes.reaches(label, load(lanes, &samples.ends[0], first));
                let is_before_last = lanes.reaches(load(lanes, &samples.ends[1], first), label);
                let asked = lanes.mask_of(lanes.both(is_behind_first, is_before_last));
                let places = lines.places(lanes, image, turns);
                let phases = lanes.load(&filled(&samples.phase[first..], 0));
                let around = columns_around_each(lanes, image, segments.row, phases, places.column_px);
                let rests = rests(lanes, &places, &around, asked);
                let e = lanes.times_float(rests.rest_turns, lanes.float(radians(1.0)));
                let fits = lanes.exceeds(cap, lanes.abs_float(e));
                let fits = lanes.both(fits, lanes.truths(rests.known));
                let u = lanes.select_float(fits, load(lanes, &samples.place[0], first), zero);
                let v = lanes.select_float(fits, load(lanes, &samples.place[1], first), zero);
                let e = lanes.select_float(fits, e, zero);
                let values = [
                    lanes.select_float(lanes.truths(rests.known), one, zero),
                    lanes.select_float(fits, one, zero),
                    u,
                    v,
                    e,
                    lanes.times_float(u, u),
                    lanes.times_float(u, v),
                    lanes.times_float(v, v),
                    lanes.times_float(u, e),
                    lanes.times_float(v, e),
                    lanes.times_float(e, e),
                ];
                for (sum, value) in all.iter_mut().zip(values) {
                    *sum = lanes.add_float(*sum, value);
                }
            }
            let mut totals = [0.0; SUMS];
            for (all_lanes, sum) in totals.iter_mut().zip(all) {
                let mut of_lanes = [0.0; LANES];
                lanes.store_floats(sum, &mut of_lanes);
                *all_lanes = total(of_lanes);
            }
            let [seen, fitting, u, v, e, uu, uv, vv, ue, ve, ee] = totals;
            sums.push(Sums { seen, fitting, u, v, e, uu, uv, vv, ue, ve, ee });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn few_samples_are_all_screened() {
        for count in 0..=SCREENED {
            assert!(screened(count).eq(0..count));
        }
    }

    #[test]
    fn screened_samples_of_a_full_tile_are_spread_over_its_rows_and_columns() {
        let side = MOST.isqrt();
        for axis in 0..2 {
            let on_line = |line: usize| screened(MOST).filter(|i| [i / side, i % side][axis] == line).count();
            assert!((0..side).all(|line| on_line(line) <= SCREENED / 4));
        }
    }
}
