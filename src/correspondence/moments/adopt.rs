//! Open pixels that continue a decided neighbour.
//!
//! ```text
//! while there are new ones, bands of rows in parallel, from the decisions of the time before:
//!     for each open pixel beside a new one, for each of its eight neighbours that is decided and whose phase may continue:
//!         look for the neighbour's absolute phase at the pixel, rims included; a few pixels deep, δ may be off as rims are
//!     the order whose δ fits best is adopted, with the part of its neighbour
//! ```

use rayon::prelude::*;

use super::likelihood::radians;
use super::look::{self, Looks, NO_ORDER, Seen};
use super::noise::Noise;
use super::{BEYOND, INSIDE, OPEN, Part, Pixels};
use crate::correspondence::bands::{self, BAND_ROWS};
use crate::correspondence::drift::{DepthRow, Drift, RowPolynomial};
use crate::correspondence::pool::Pool;
use crate::correspondence::segment::SegmentRow;
use crate::correspondence::view::View;

/// How many pixels deep a rim is.
const RIM_ROUNDS: usize = 3;

/// What a pixel adopted.
#[derive(Clone, Copy, Debug)]
struct Adopted {
    pixel: usize,
    order: i16,
    part: u32,
    /// Distance of δ from what the part shows, turns.
    off: f32,
    seen: Seen,
}

/// Scratch memory of the adoption.
#[derive(Clone, Debug, Default)]
pub(super) struct Adoption {
    /// What each band adopted.
    bands: Vec<Vec<Adopted>>,
    /// The open pixels of each band that are asked.
    asked: Vec<Vec<u32>>,
    /// The field in each row.
    fields: Vec<RowPolynomial>,
    /// The last order at which each pixel was asked in vain, [`NO_ORDER`] if there is none.
    refused: Vec<i16>,
    /// In which round each pixel was adopted, from 1 on; 0 if it was not.
    pub(super) depths: Vec<u8>,
    pool: Pool<Asked>,
}

impl Adoption {
    /// Forgets what the pixels of an earlier image adopted.
    pub(super) fn forget(&mut self, count: usize) {
        self.depths.clear();
        self.depths.resize(count, 0);
    }

    /// Adopts open pixels with a phase.
    pub(super) fn adopt(
        &mut self,
        view: View<'_>,
        field: &Drift,
        parts: &[Part],
        noise: Noise,
        pixels: &mut Pixels<'_>,
    ) {
        let Self { bands, asked, fields, refused, depths, pool } = self;
        let (width, height) = (view.cam1.width, view.cam1.height);
        let band_px = BAND_ROWS * width;
        bands::resize(bands, height);
        bands::resize(asked, height);
        let is_open = |pixels: &Pixels<'_>, pixel: usize| pixels.state[pixel] == OPEN && view.cam1.valid[pixel];
        let before = &*pixels;
        asked.par_iter_mut().enumerate().with_max_len(1).for_each(|(i, asked)| {
            let own = i * band_px..((i + 1) * band_px).min(width * height);
            asked.clear();
            asked.extend(own.filter(|&pixel| is_open(before, pixel)).map(|pixel| pixel as u32));
        });
        fields.clear();
        fields.extend((0..height).map(|v| field.in_row(v)));
        refused.clear();
        refused.resize(width * height, NO_ORDER);
        for round in 0.. {
            let before = &*pixels;
            let least_reach = if round < RIM_ROUNDS { view.model.rim_rad / radians(1.0) } else { 0.0 };
            let of_bands = bands.par_iter_mut().zip(&mut *asked).zip(refused.par_chunks_mut(band_px));
            of_bands.enumerate().with_max_len(1).for_each(|(i, ((adopted, asked), refused))| {
                adopted.clear();
                asked.sort_unstable();
                asked.dedup();
                if !asked.is_empty() {
                    let of_fit = (&fields[..], parts, noise, least_reach);
                    adopt_band(view, of_fit, before, (i * band_px, asked), &mut pool.take(), (adopted, refused));
                }
                asked.clear();
            });
            for Adopted { pixel, order, part, seen, .. } in bands.iter().flatten() {
                let pixel = *pixel;
                pixels.chosen.column_px[pixel] = seen.column_px;
                pixels.chosen.order[pixel] = *order;
                pixels.chosen.delta[pixel] = seen.delta;
                pixels.chosen.slope[pixel] = seen.slope;
                pixels.rest[pixel] = seen.rest;
                pixels.state[pixel] = if seen.in_volume { INSIDE } else { BEYOND };
                pixels.owner[pixel] = *part;
                depths[pixel] = (round + 1).min(usize::from(u8::MAX)) as u8;
            }
            for Adopted { pixel, .. } in bands.iter().flatten() {
                for (u, v) in around([*pixel % width, *pixel / width], width, height) {
                    if is_open(pixels, v * width + u) {
                        asked[v / BAND_ROWS].push((v * width + u) as u32);
                    }
                }
            }
            if asked.iter().all(Vec::is_empty) {
                break;
            }
        }
    }
}

/// Pixels of a band that are asked, each at an order, one array per number.
#[derive(Clone, Debug, Default)]
struct Asked {
    segments: SegmentRow,
    field: DepthRow,
    phase: Vec<u16>,
    orders: Vec<i16>,
    offsets: Vec<f32>,
    reach: Vec<f32>,
    /// Pixel, and part of the neighbour.
    of: Vec<(usize, u32)>,
}

impl Asked {
    fn clear(&mut self) {
        let Self { phase, orders, offsets, reach, of, .. } = self;
        phase.clear();
        [offsets, reach].into_iter().for_each(Vec::clear);
        orders.clear();
        of.clear();
    }
}

/// Asks pixels of a band, at the orders with which they continue their neighbours. `first` is the first pixel of the band.
fn adopt_band(
    view: View<'_>,
    (fields, parts, noise, least_reach): (&[RowPolynomial], &[Part], Noise, f32),
    pixels: &Pixels<'_>,
    (first, open): (usize, &[u32]),
    asked: &mut Asked,
    (adopted, refused): (&mut Vec<Adopted>, &mut [i16]),
) {
    let (width, height) = (view.cam1.width, view.cam1.height);
    asked.clear();
    for pixel in open.iter().map(|&pixel| pixel as usize) {
        let refused = &mut refused[pixel - first];
        let before = asked.orders.len();
        for (u, v) in around([pixel % width, pixel / width], width, height) {
            let other = v * width + u;
            if pixels.state[other] == OPEN {
                continue;
            }
            let Some(order) = pixels.continued(view, pixel, other).map(|order| order as i16) else { continue };
            if order != *refused && !asked.orders[before..].contains(&order) {
                let part = pixels.owner[other];
                asked.orders.push(order);
                asked.of.push((pixel, part));
                asked.offsets.push(parts[part as usize].offset);
            }
        }
        // A larger reach did not help, so a smaller one will not.
        if let Some(&order) = asked.orders.get(before) {
            *refused = order;
        }
    }
    let Asked { segments, field, phase, orders, offsets, reach, of } = asked;
    segments.make_room(of.len());
    field.make_room(of.len());
    for same in of.chunk_by(|a, b| a.0 == b.0) {
        let pixel = same[0].0;
        let (segment, along) = (view.table.segment(pixel), fields[pixel / width].segment(pixel % width));
        let own_reach = look::reach_turns(view.model, noise, view.cam1.modulation[pixel]).max(least_reach);
        for _ in same {
            segments.set(phase.len(), &segment);
            field.set(phase.len(), &along);
            phase.push(view.cam1.phase[pixel]);
            reach.push(own_reach);
        }
    }
    let looks =
        Looks { model: view.model, image: view.cam2, segments, field, phase, orders, offsets, reach, at_rims: true };
    looks.for_each(|i, seen| {
        let (pixel, part) = of[i];
        let off = (f32::from(seen.rest) / 65536.0 - offsets[i] / radians(1.0)).abs();
        let own = Adopted { pixel, order: orders[i], part, off, seen: *seen };
        match adopted.last_mut().filter(|last| last.pixel == own.pixel) {
            Some(last) if last.off <= off => {}
            Some(last) => *last = own,
            None => adopted.push(own),
        }
    });
}

/// Columns and rows of the eight pixels around one, within the image.
fn around([u, v]: [usize; 2], width: usize, height: usize) -> impl Iterator<Item = (usize, usize)> {
    const AROUND: [(isize, isize); 8] = [(0, -1), (0, 1), (-1, 0), (1, 0), (-1, -1), (-1, 1), (1, -1), (1, 1)];
    let places =
        AROUND.into_iter().filter_map(move |(dv, du)| Some((u.checked_add_signed(du)?, v.checked_add_signed(dv)?)));
    places.filter(move |&(u, v)| u < width && v < height)
}
