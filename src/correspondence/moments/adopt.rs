//! Open pixels that continue a decided neighbour.
//!
//! ```text
//! while there are new ones, rows in parallel, from the decisions of the time before:
//!     for each open pixel beside a new one, for each of its eight neighbours that is decided and whose phase may continue:
//!         look for the neighbour's absolute phase at the pixel, rims included; a few pixels deep, δ may be off as rims are
//!     the order whose δ fits best is adopted, with the part of its neighbour
//! ```

use rayon::prelude::*;

use super::likelihood::radians;
use super::look::{Seen, nearest};
use super::noise::Noise;
use super::pixel_search::PixelSearch;
use super::{BEYOND, INSIDE, OPEN, Part, Pixels};
use crate::correspondence::drift::Drift;
use crate::correspondence::view::View;

/// How many pixels deep a rim is.
const RIM_ROUNDS: usize = 3;

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
    /// Columns of the open pixels of each row that are asked.
    asked: Vec<Vec<u32>>,
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
        let Self { rows, asked } = self;
        let (width, height) = (view.cam1.width, view.cam1.height);
        rows.resize_with(height, Vec::new);
        asked.resize_with(height, Vec::new);
        let is_open = |pixels: &Pixels<'_>, pixel: usize| pixels.state[pixel] == OPEN && view.cam1.valid[pixel];
        let before = &*pixels;
        asked.par_iter_mut().enumerate().for_each(|(v, asked)| {
            asked.clear();
            asked.extend((0..width as u32).filter(|&u| is_open(before, v * width + u as usize)));
        });
        for round in 0.. {
            let before = &*pixels;
            let least_reach = if round < RIM_ROUNDS { view.model.rim_rad } else { 0.0 };
            rows.par_iter_mut().zip(&mut *asked).enumerate().for_each(|(v, (adopted, asked))| {
                adopted.clear();
                asked.sort_unstable();
                asked.dedup();
                if !asked.is_empty() {
                    let of_fit = (field, parts, noise, least_reach);
                    adopt_row(view, of_fit, before, v, asked, adopted);
                }
                asked.clear();
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
            for Adopted { pixel, .. } in rows.iter().flatten() {
                for (u, v) in around(*pixel, width, height) {
                    if is_open(pixels, v * width + u) {
                        asked[v].push(u as u32);
                    }
                }
            }
            if asked.iter().all(Vec::is_empty) {
                break;
            }
        }
    }
}

fn adopt_row(
    view: View<'_>,
    (field, parts, noise, least_reach): (&Drift, &[Part], Noise, f32),
    pixels: &Pixels<'_>,
    v: usize,
    asked: &[u32],
    adopted: &mut Vec<Adopted>,
) {
    let (width, height) = (view.cam1.width, view.cam1.height);
    let along = field.in_row(v);
    for u in asked.iter().map(|&u| u as usize) {
        let pixel = v * width + u;
        let phase = view.cam1.phase[pixel];
        let mut tried: [(i32, u32); 8] = [(i32::MIN, 0); 8];
        let mut count = 0;
        for (nu, nv) in around(pixel, width, height) {
            let other = nv * width + nu;
            if pixels.state[other] == OPEN {
                continue;
            }
            let Some(order) = pixels.continued(view, pixel, other) else { continue };
            if tried[..count].iter().all(|(tried, _)| *tried != order) {
                tried[count] = (order, pixels.owner[other]);
                count += 1;
            }
        }
        if count == 0 {
            continue;
        }
        let segment = view.table.segment(pixel);
        if segment.row_px < 0.0 {
            continue;
        }
        let limits_px = [0.0, (view.cam2.width - 1) as f32];
        let search = PixelSearch::within(view.cam2, segment, along.segment(u), phase, limits_px);
        let sd = noise.variance(view.cam1.modulation[pixel].grey()).sqrt();
        let mut best: Option<(f32, Adopted)> = None;
        for &(order, part) in &tried[..count] {
            let offset = parts[part as usize].offset / radians(1.0);
            let reach = (view.model.max_sd * sd).max(least_reach) / radians(1.0);
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

/// Columns and rows of the eight pixels around one, within the image.
fn around(pixel: usize, width: usize, height: usize) -> impl Iterator<Item = (usize, usize)> {
    const AROUND: [(isize, isize); 8] = [(0, -1), (0, 1), (-1, 0), (1, 0), (-1, -1), (-1, 1), (1, -1), (1, 1)];
    let (u, v) = (pixel % width, pixel / width);
    let places =
        AROUND.into_iter().filter_map(move |(dv, du)| Some((u.checked_add_signed(du)?, v.checked_add_signed(dv)?)));
    places.filter(move |&(u, v)| u < width && v < height)
}
