//! One look at a pixel, at one order.
//!
//! ```text
//! x = the column at which Φ − field − offset of the surface is order + phase of the pixel
//! repeat a few times, while C2 has phases in the columns around x:
//!     x = where the line through these phases has the phase of the pixel
//! at a rim, where only one of the columns sees the surface, the last line is continued by up to a pixel; there the
//!     columns beside x are tried too
//! decided: |δ − field − offset| is within the reach of the pixel
//! ```
//!
//! A node's pixels are all looked at, at its order; adoption looks at the pixels beside decided ones.

use std::ops::Range;

use rayon::prelude::*;

use fringeflow_simd::{Kernel, LANES, Lanes, Level, filled};

use super::likelihood::radians;
use super::model::Model;
use super::nodes::{NONE, Nodes};
use super::noise::Noise;
use super::orders::columns_around_each;
use super::phase_runs::PhaseRuns;
use super::{BEYOND, INSIDE, OPEN, Pixels};
use crate::correspondence::drift::{DepthRow, Drift};
use crate::correspondence::epipolar_image::EpipolarImage;
use crate::correspondence::kernels::Segments;
use crate::correspondence::pool::Pool;
use crate::correspondence::segment::SegmentRow;
use crate::correspondence::view::View;
use crate::correspondence::wanted::WantedBlocks;
use crate::phase::Modulation;

/// Most iterations.
const MAX_ITERATIONS: usize = 3;
/// Largest move per iteration, pixels: where phases hardly change, the line leads anywhere.
const MAX_MOVE_PX: f32 = 2.0;
/// The columns that are tried at rims, pixels from the expected one.
const BESIDE_PX: [f32; 5] = [0.0, -1.0, 1.0, -2.0, 2.0];
/// Stands for no order.
pub(super) const NO_ORDER: i16 = i16::MIN;

/// Scratch of a tile row.
#[derive(Clone, Debug, Default)]
pub(super) struct TileRow {
    segments: SegmentRow,
    field: DepthRow,
    /// Order, offset and part of each pixel of the tile row.
    orders: Vec<i16>,
    offsets: Vec<f32>,
    parts: Vec<u32>,
    reach: Vec<f32>,
    wanted: WantedBlocks,
}

/// Looks at all open pixels of the nodes that have a part. `parts` is the part of each node, [`NONE`] for none, and
/// `offsets` the mean of δ less the field of each node, rad.
pub(super) fn look(
    view: View<'_>,
    field: &Drift,
    runs: &PhaseRuns,
    nodes: &Nodes,
    (parts, offsets): (&[u32], &[f32]),
    noise: Noise,
    pixels: &mut Pixels<'_>,
    pool: &Pool<TileRow>,
) {
    let width = view.cam1.width;
    let padded = width.next_multiple_of(LANES);
    let rows_px = nodes.tile_px * width;
    let Pixels { chosen, state, owner, rest } = pixels;
    let planes = (
        chosen.column_px.par_chunks_mut(rows_px),
        chosen.order.par_chunks_mut(rows_px),
        chosen.delta.par_chunks_mut(rows_px),
        chosen.slope.par_chunks_mut(rows_px),
        state.par_chunks_mut(rows_px),
        owner.par_chunks_mut(rows_px),
        rest.par_chunks_mut(rows_px),
    );
    let rows_of_planes = planes.into_par_iter().enumerate().with_max_len(1);
    rows_of_planes.for_each(|(i, (column_px, order, delta, slope, state, owner, rest))| {
        let of_row = nodes.of_tile_row(i);
        if parts[of_row.clone()].iter().all(|part| *part == NONE) {
            return;
        }
        let mut scratch = pool.take();
        let TileRow { segments, field: along, orders, offsets: of_pixels, parts: part_of, reach, wanted } =
            &mut *scratch;
        let first = i * nodes.tile_px;
        let rows = column_px.len() / width;
        orders.clear();
        orders.resize(rows * padded, NO_ORDER);
        of_pixels.resize(rows * padded, 0.0);
        part_of.resize(rows * padded, NONE);
        for n in of_row.filter(|&n| parts[n] != NONE) {
            let node = &nodes.nodes[n];
            for piece in nodes.pieces_of(node) {
                let v = piece.v as usize;
                for u in piece.columns() {
                    let (at, pixel) = ((v - first) * padded + u, v * width + u);
                    if state[pixel - first * width] != OPEN {
                        continue;
                    }
                    orders[at] = node.order(piece.offset + i32::from(runs.relative[pixel])) as i16;
                    (of_pixels[at], part_of[at]) = (offsets[n], parts[n]);
                }
            }
        }
        reach.resize(padded, 0.0);
        for row in 0..rows {
            let orders = &orders[row * padded..][..padded];
            wanted.reset(width);
            for (block, orders) in orders[..width].chunks(LANES).enumerate() {
                if orders.iter().fold(false, |any, order| any | (*order != NO_ORDER)) {
                    wanted.want(block * LANES..(block * LANES + orders.len()));
                }
            }
            if !wanted.any() {
                continue;
            }
            let v = first + row;
            view.table.row_where(v, wanted, segments);
            field.along_row_where(v, width, wanted, along);
            let own = v * width..(v + 1) * width;
            for (reach, modulation) in reach.iter_mut().zip(&view.cam1.modulation[own.clone()]) {
                *reach = reach_turns(view.model, noise, *modulation);
            }
            let looks = Looks {
                model: view.model,
                image: view.cam2,
                segments,
                field: along,
                phase: &view.cam1.phase[own],
                orders,
                offsets: &of_pixels[row * padded..][..padded],
                reach,
                at_rims: false,
            };
            let here = row * width..(row + 1) * width;
            let mut planes = RowOfPlanes {
                column_px: &mut column_px[here.clone()],
                order: &mut order[here.clone()],
                delta: &mut delta[here.clone()],
                slope: &mut slope[here.clone()],
                state: &mut state[here.clone()],
                owner: &mut owner[here.clone()],
                rest: &mut rest[here],
            };
            let part_of = &part_of[row * padded..];
            looks.for_each_block(|first, seen| planes.write(first, seen, &orders[first..], &part_of[first..]));
        }
    });
}

/// A row of the planes of decisions.
struct RowOfPlanes<'a> {
    column_px: &'a mut [f32],
    order: &'a mut [i16],
    delta: &'a mut [i16],
    slope: &'a mut [i16],
    state: &'a mut [u8],
    owner: &'a mut [u32],
    rest: &'a mut [i16],
}

impl RowOfPlanes<'_> {
    /// Writes the decided pixels of a block, with their orders and parts.
    fn write(&mut self, first: usize, seen: &BlockSeen, orders: &[i16], parts: &[u32]) {
        let mut write = |lanes: Range<usize>| {
            let pixels = first + lanes.start..first + lanes.end;
            self.column_px[pixels.clone()].copy_from_slice(&seen.column_px[lanes.clone()]);
            self.order[pixels.clone()].copy_from_slice(&orders[lanes.clone()]);
            self.delta[pixels.clone()].copy_from_slice(&seen.delta[lanes.clone()]);
            self.slope[pixels.clone()].copy_from_slice(&seen.slope[lanes.clone()]);
            self.rest[pixels.clone()].copy_from_slice(&seen.rest[lanes.clone()]);
            self.owner[pixels.clone()].copy_from_slice(&parts[lanes.clone()]);
            for (state, lane) in self.state[pixels].iter_mut().zip(lanes) {
                *state = if seen.in_volume >> lane & 1 == 1 { INSIDE } else { BEYOND };
            }
        };
        // Mostly all pixels of a block are decided.
        if seen.decided == u32::MAX {
            write(0..LANES);
        } else {
            seen.for_each_lane(|lane| write(lane..lane + 1));
        }
    }
}

/// How far δ of a pixel may be off, turns.
#[inline]
pub(super) fn reach_turns(model: &Model, noise: Noise, modulation: Modulation) -> f32 {
    model.max_sd / radians(1.0) * noise.variance(modulation.grey()).sqrt()
}

/// Pixels that are looked at, each at one order.
pub(super) struct Looks<'a> {
    pub(super) model: &'a Model,
    pub(super) image: &'a EpipolarImage,
    pub(super) segments: &'a SegmentRow,
    pub(super) field: &'a DepthRow,
    pub(super) phase: &'a [u16],
    /// [`NO_ORDER`] where a pixel is not looked at.
    pub(super) orders: &'a [i16],
    /// Offset of the surface, rad.
    pub(super) offsets: &'a [f32],
    /// How far δ may be off, turns.
    pub(super) reach: &'a [f32],
    /// Whether the columns beside the expected one are tried too.
    pub(super) at_rims: bool,
}

impl Looks<'_> {
    /// Calls `visit` with the number of each pixel that is decided, and what it saw.
    pub(super) fn for_each(&self, mut visit: impl FnMut(usize, &Seen)) {
        self.for_each_block(|first, block| block.for_each_lane(|lane| visit(first + lane, &block.at(lane))));
    }

    /// Calls `visit` with the number of the first pixel of each block, and what its pixels saw.
    fn for_each_block(&self, mut visit: impl FnMut(usize, &BlockSeen)) {
        for first in (0..self.orders.len()).step_by(LANES) {
            let end = self.orders.len().min(first + LANES);
            if self.orders[first..end].iter().any(|order| *order != NO_ORDER) {
                visit(first, &fringeflow_simd::run(Level::in_use(), BlockLook { row: self, first }));
            }
        }
    }
}

/// What a pixel saw.
#[derive(Clone, Copy, Debug)]
pub(super) struct Seen {
    pub(super) column_px: f32,
    /// δ, δ less the field, and the rise of C2's phase over a column, turns · 65536.
    pub(super) delta: i16,
    pub(super) rest: i16,
    pub(super) slope: i16,
    pub(super) in_volume: bool,
}

/// What 32 pixels saw.
struct BlockSeen {
    decided: u32,
    in_volume: u32,
    column_px: [f32; LANES],
    /// As in [`Seen`].
    delta: [i16; LANES],
    rest: [i16; LANES],
    slope: [i16; LANES],
}

impl BlockSeen {
    fn at(&self, lane: usize) -> Seen {
        Seen {
            column_px: self.column_px[lane],
            delta: self.delta[lane],
            rest: self.rest[lane],
            slope: self.slope[lane],
            in_volume: self.in_volume >> lane & 1 == 1,
        }
    }

    /// Calls `visit` with each lane that is decided.
    fn for_each_lane(&self, mut visit: impl FnMut(usize)) {
        let mut bits = self.decided;
        while bits != 0 {
            visit(bits.trailing_zeros() as usize);
            bits &= bits - 1;
        }
    }
}

struct BlockLook<'a> {
    row: &'a Looks<'a>,
    first: usize,
}

impl Kernel for BlockLook<'_> {
    type Output = BlockSeen;

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) -> BlockSeen {
        let Self { row, first } = self;
        let float = |value: f32| lanes.float(value);
        let segments = Segments::new(lanes, row.segments, first);
        let phases = lanes.load(&filled(&row.phase[first..], 0));
        let order = lanes.load_signed(&filled(&row.orders[first..], NO_ORDER));
        let fraction = lanes.times_float(lanes.floats(lanes.widen_unsigned(phases)), float(1.0 / 65536.0));
        let target = lanes.add_float(lanes.floats(lanes.widen(order)), fraction);
        let ([column_px, per_turn], is_sound) = segments.columns_of(target);
        let is_sound = lanes.both(is_sound, lanes.reaches(segments.row, float(0.0)));
        // Field and offset are constant over such small moves.
        let field = row.field.block(lanes, first).at(lanes, column_px);
        let offset = lanes.load_floats(&filled(&row.offsets[first..], 0.0));
        let offset = lanes.times_float(offset, float(1.0 / radians(1.0)));
        let off = lanes.add_float(field, offset);
        let column_px = lanes.add_float(column_px, lanes.times_float(off, per_turn));
        let has_order = lanes.and_not(lanes.mask_of(is_sound), lanes.is_equal(order, lanes.word(NO_ORDER)));
        let reach = lanes.load_floats(&filled(&row.reach[first..], 0.0));
        let (expected_px, mut decided) = (column_px, lanes.mask(0));
        let (mut at_px, mut rests, mut slopes) = (float(0.0), float(0.0), lanes.long(0));
        let mut nearest = reach;
        let last_px = float((row.image.width - 2) as f32);
        for beside_px in if row.at_rims { &BESIDE_PX[..] } else { &BESIDE_PX[..1] } {
            let mut todo = has_order;
            let (mut found, mut found_px, mut found_slope) = (lanes.mask(0), float(0.0), lanes.long(0));
            let mut column_px = lanes.add_float(expected_px, float(*beside_px));
            // A line that is continued beyond a rim must not move on to the surface there.
            let iterations = if *beside_px == 0.0 { MAX_ITERATIONS } else { 1 };
            for _ in 0..iterations {
                if !lanes.any(todo) {
                    break;
                }
                column_px = lanes.min_float(lanes.max_float(column_px, float(0.0)), last_px);
                let around = columns_around_each(lanes, row.image, segments.row, phases, column_px);
                let slope = lanes.widen(around.slope);
                let is_flat = lanes.is_equal(around.slope, lanes.word(0));
                // Flat pairs are masked below; 1 avoids a division by zero.
                let slope_or_one = lanes.select_float(lanes.truths(is_flat), float(1.0), lanes.floats(slope));
                let value = lanes.floats(lanes.widen(around.value));
                let share = lanes.over(lanes.sub_float(float(0.0), value), slope_or_one);
                let before_px = lanes.sub_float(column_px, around.share);
                let known = lanes.and_not(lanes.and(todo, around.known), is_flat);
                let is_between = lanes.both(lanes.reaches(share, float(0.0)), lanes.reaches(float(1.0), share));
                // Until the crossing lies between the columns, the nearest continuation stands for it.
                let is_near = lanes.mask_of(lanes.both(
                    lanes.reaches(share, float(-row.model.rim_px)),
                    lanes.reaches(float(1.0 + row.model.rim_px), share),
                ));
                let here = lanes.and(known, is_near);
                let is_here = lanes.truths(here);
                found_px = lanes.select_float(is_here, lanes.add_float(before_px, share), found_px);
                found_slope = lanes.select_long(is_here, slope, found_slope);
                found = lanes.or(found, here);
                todo = lanes.and_not(known, lanes.and(known, lanes.mask_of(is_between)));
                let most = float(1.0 + MAX_MOVE_PX);
                let step = lanes.min_float(lanes.max_float(share, float(-MAX_MOVE_PX)), most);
                column_px = lanes.add_float(before_px, step);
            }
            let rest = lanes.sub_float(lanes.sub_float(segments.phase_turns(found_px), target), field);
            let away = lanes.abs_float(lanes.sub_float(rest, offset));
            let own = lanes.and(found, lanes.mask_of(lanes.reaches(nearest, away)));
            let is_own = lanes.truths(own);
            nearest = lanes.select_float(is_own, away, nearest);
            at_px = lanes.select_float(is_own, found_px, at_px);
            rests = lanes.select_float(is_own, rest, rests);
            slopes = lanes.select_long(is_own, found_slope, slopes);
            decided = lanes.or(decided, own);
        }
        let in_volume = lanes.and(decided, lanes.mask_of(segments.have(at_px)));
        let mut seen = BlockSeen {
            decided: lanes.bits(decided),
            in_volume: lanes.bits(in_volume),
            column_px: [0.0; LANES],
            delta: [0; LANES],
            rest: [0; LANES],
            slope: [0; LANES],
        };
        lanes.store_floats(at_px, &mut seen.column_px);
        let (rest, field) = (lanes.times_float(rests, float(65536.0)), lanes.times_float(field, float(65536.0)));
        lanes.store_signed(nearest_words(lanes, rest), &mut seen.rest);
        lanes.store_signed(nearest_words(lanes, lanes.add_float(rest, field)), &mut seen.delta);
        lanes.store_signed(lanes.narrow_signed(slopes), &mut seen.slope);
        seen
    }
}

/// The nearest whole numbers in the range of words.
#[inline(always)]
fn nearest_words<L: Lanes>(lanes: L, values: L::Floats) -> L::Words {
    let is_positive = lanes.reaches(values, lanes.float(0.0));
    let half = lanes.select_float(is_positive, lanes.float(0.5), lanes.float(-0.5));
    lanes.narrow_signed(lanes.longs(lanes.add_float(values, half)))
}
