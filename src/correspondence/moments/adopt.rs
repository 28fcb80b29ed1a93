//! Open pixels that continue a decided neighbour.
//!
//! ```text
//! a few times, rows in parallel, from the decisions of the time before:
//!     for each open pixel, for each of its eight neighbours that is decided and whose phase may continue:
//!         look for the neighbour's absolute phase at the pixel, rims included
//!     the order whose δ fits best is adopted, with the part of its neighbour
//! ```

use rayon::prelude::*;

use super::likelihood::radians;
use super::look::{Seen, nearest};
use super::noise::Noise;
use super::pixel_search::PixelSearch;
use super::{BEYOND, INSIDE, OPEN, Part, Pixels};
use crate::correspondence::drift::{DepthRow, Drift};
use crate::correspondence::neighbourhood::MAX_STEP;
use crate::correspondence::pool::Pool;
use crate::correspondence::segment::SegmentRow;
use crate::correspondence::view::View;

/// Rounds: how many pixels deep a rim is.
const ROUNDS: usize = 3;

/// What a pixel adopted.
#[derive(Clone, Copy, Debug)]
struct Adopted {
    pixel: usize,
    order: i16,
    part: u32,
    seen: Seen,
}

/// Scratch memory of the adoption.
#[derive(Clone, Debug, Default)]
pub(super) struct Adoption {
    /// What each row adopted.
    rows: Vec<Vec<Adopted>>,
    pool: Pool<(SegmentRow, DepthRow)>,
}

impl Adoption {
    /// Adopts open pixels with a phase.
    pub(super) fn adopt(
        &mut self,
        view: View<'_>,
        field: &Drift,
        parts: &[Part],
        noise: Noise,
        pixels: &mut Pixels<'_>,
    ) {
        let Self { rows, pool } = self;
        rows.resize_with(view.cam1.height, Vec::new);
        for _ in 0..ROUNDS {
            let before = &*pixels;
            rows.par_iter_mut().enumerate().for_each(|(v, adopted)| {
                adopted.clear();
                adopt_row(view, field, parts, noise, before, &mut pool.take(), v, adopted);
            });
            for Adopted { pixel, order, part, seen } in rows.iter().flatten() {
                let pixel = *pixel;
                pixels.chosen.column_px[pixel] = seen.column_px;
                pixels.chosen.order[pixel] = *order;
                pixels.chosen.delta[pixel] = seen.delta;
                pixels.chosen.slope[pixel] = seen.slope;
                pixels.rest[pixel] = seen.rest;
                pixels.state[pixel] = if seen.in_volume { INSIDE } else { BEYOND };
                pixels.owner[pixel] = *part;
            }
            if rows.iter().all(Vec::is_empty) {
                break;
            }
        }
    }
}

fn adopt_row(
    view: View<'_>,
    field: &Drift,
    parts: &[Part],
    noise: Noise,
    pixels: &Pixels<'_>,
    (segments, along): &mut (SegmentRow, DepthRow),
    v: usize,
    adopted: &mut Vec<Adopted>,
) {
    let (width, height) = (view.cam1.width, view.cam1.height);
    let mut is_loaded = false;
    for u in 0..width {
        let pixel = v * width + u;
        if pixels.state[pixel] != OPEN || !view.cam1.valid[pixel] {
            continue;
        }
        let phase = view.cam1.phase[pixel];
        let mut tried: [(i32, u32); 8] = [(i32::MIN, 0); 8];
        let mut count = 0;
        for (dv, du) in NEIGHBOURS {
            let (Some(nu), Some(nv)) = (u.checked_add_signed(du), v.checked_add_signed(dv)) else { continue };
            if nu >= width || nv >= height || pixels.state[nv * width + nu] == OPEN {
                continue;
            }
            let other = nv * width + nu;
            let step = i32::from(phase.wrapping_sub(view.cam1.phase[other]) as i16);
            if step.abs() > MAX_STEP {
                continue;
            }
            let order = (pixels.absolute(view, other) + step) >> 16;
            if tried[..count].iter().all(|(tried, _)| *tried != order) {
                tried[count] = (order, pixels.owner[other]);
                count += 1;
            }
        }
        if count == 0 {
            continue;
        }
        if !is_loaded {
            is_loaded = true;
            view.table.row(v, segments);
            field.along_row(v, width, along);
        }
        let segment = segments.segment(u);
        if segment.row_px < 0.0 {
            continue;
        }
        let limits_px = [0.0, (view.cam2.width - 1) as f32];
        let search = PixelSearch::within(view.cam2, segment, along.segment(u), phase, limits_px);
        let sd = noise.variance(view.cam1.modulation[pixel].grey()).sqrt();
        let mut best: Option<(f32, Adopted)> = None;
        for &(order, part) in &tried[..count] {
            let offset = parts[part as usize].offset / radians(1.0);
            let reach = (view.model.max_sd * sd).max(view.model.rim_rad) / radians(1.0);
            let Some([begin, end]) = search.columns_of(order, reach + offset.abs()) else { continue };
            let mut consider = |column_px: f32, slope: i32| {
                let (found, rest) = search.order_and_residual(column_px);
                let off = (rest - offset).abs();
                if found == order && off < best.as_ref().map_or(reach, |(least, _)| *least) {
                    let drift = search.drift.at(column_px);
                    let seen = Seen {
                        column_px,
                        delta: nearest(65536.0 * (rest + drift)),
                        rest: nearest(65536.0 * rest),
                        slope: slope as i16,
                        in_volume: search.is_in_volume(column_px),
                    };
                    best = Some((off, Adopted { pixel, order: order as i16, part, seen }));
                }
            };
            search.crossings([begin, end], &mut consider);
            let columns = (begin.max(0.0) as usize).saturating_sub(1)..=end.max(0.0).ceil() as usize + 1;
            search.row.rims(phase, columns, &mut consider);
        }
        adopted.extend(best.map(|(_, adopted)| adopted));
    }
}

const NEIGHBOURS: [(isize, isize); 8] = [(0, -1), (0, 1), (-1, 0), (1, 0), (-1, -1), (-1, 1), (1, -1), (1, 1)];
