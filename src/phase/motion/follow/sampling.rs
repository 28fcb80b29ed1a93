//! Interpolates images between their pixels: cubic along rows, which cross the fringes, and linear between rows. In: an
//! image and a path. Out: samples. Cost: six multiply-adds per sample.
//!
//! ```text
//! for each tile of the row of tiles:  (x, y) = its velocity times the time of the image
//!     for each row of the tile, 32 pixels at once:
//!         sample = cubic in u + x between four columns, linear in v + y between two rows
//!         saturated, if a saturated sample contributes or the place lies outside the image
//! ```

use fringeflow_simd::{Kernel, LANES, Lanes, store_first};

use crate::phase::motion::flow::FLOW_TILE_PX;
use crate::phase::motion::image_times::time;
use crate::phase::motion::images::Images;
use crate::phase::sample::Sample;

use super::path::Path;

/// Pixels of a row that contribute to a sample.
const TAPS: usize = 4;
/// A result is saturated if a saturated sample of at least this weight contributes. Saturated samples of less weight
/// change the result by less than the noise.
const SATURATING_WEIGHT: f32 = 0.1;

/// Samples a row of tiles of one image: either the followed tiles along their paths, or the others unchanged.
pub(super) struct Sampling<'a, 'b, S> {
    pub(super) images: &'a Images<'b, S>,
    pub(super) paths: &'a [Path],
    pub(super) image: usize,
    pub(super) tile_row: usize,
    pub(super) followed: bool,
    pub(super) to: &'a mut [S],
}

impl<S: Sample> Kernel for Sampling<'_, '_, S> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, lanes: L) {
        let Self { images, paths, image, tile_row, followed, to } = self;
        let first = tile_row * FLOW_TILE_PX;
        let rows = first..(first + FLOW_TILE_PX).min(images.height);
        let t = time(image, images.count) as f32;
        for (block, path) in paths.iter().enumerate() {
            if path.bin.is_some() != followed {
                continue;
            }
            let (begin, count) = (block * LANES, (images.width - block * LANES).min(LANES));
            let [x, y] = path.velocity_px.map(|v| v * t);
            let [left, above] = [x.floor(), y.floor()];
            let across = cubic(x - left);
            let down = [1.0 - (y - above), y - above];
            let is_still = x == 0.0 && y == 0.0;
            // The lower of the two source rows of a row is the upper one of the next row.
            let mut lower = None;
            for row in rows.clone() {
                let to = &mut to[(row - first) * images.width + begin..][..count];
                if is_still {
                    to.copy_from_slice(&images.samples_from(image, row * images.width + begin)[..count]);
                    continue;
                }
                let last = images.height as isize - 1;
                let source = |below: isize| (row as isize + above as isize + below).clamp(0, last) as usize;
                let column = begin as isize + left as isize - 1;
                let upper = match lower {
                    Some(lower) => lower,
                    None => SourceRow::new(lanes, images.row(image, source(0)), column, across, down),
                };
                let below = SourceRow::new(lanes, images.row(image, source(1)), column, across, down);
                let mut sampled = interpolate(lanes, images, [&upper, &below], down);
                lower = Some(below);
                let place = [(begin as f32 + x, count), (row as f32 + y, 1)];
                if !images.contains(place) {
                    // Outside the image nothing is known. Saturated samples are ignored, so mark these as saturated.
                    let is_outside = |k: usize| !images.contains([((begin + k) as f32 + x, 1), (row as f32 + y, 1)]);
                    let saturated = images.saturation();
                    (0..count).filter(|&k| is_outside(k)).for_each(|k| sampled[k] = saturated);
                }
                store_first(&sampled, to);
            }
        }
    }
}

/// Samples that contribute to 32 neighbours.
type Taps<S> = [S; LANES + TAPS - 1];

/// Samples of a row from a column on. Beyond its ends the samples at the ends are repeated, in `padded`.
///
/// Not copied without need: the taps overlap, and a processor waits for loads that overlap two fresh stores.
#[inline(always)]
fn taps<'a, S: Sample>(row: &'a [S], column: isize, padded: &'a mut Taps<S>) -> &'a Taps<S> {
    if let Some(all) = usize::try_from(column).ok().and_then(|column| row.get(column..)?.first_chunk()) {
        return all;
    }
    let last = row.len() as isize - 1;
    *padded = std::array::from_fn(|k| row[(column + k as isize).clamp(0, last) as usize]);
    padded
}

/// Weights of four samples at a point between the middle two, at `share` of their distance (Catmull and Rom).
fn cubic(share: f32) -> [f32; TAPS] {
    let [x, x2, x3] = [share, share * share, share * share * share];
    [0.5 * (2.0 * x2 - x - x3), 0.5 * (2.0 - 5.0 * x2 + 3.0 * x3), 0.5 * (x + 4.0 * x2 - 3.0 * x3), 0.5 * (x3 - x2)]
}

/// A row of an image, interpolated between its samples.
#[derive(Clone, Copy)]
struct SourceRow<L: Lanes> {
    values: L::Reals,
    /// The largest samples that may saturate a result, with the weight of the row as the upper and as the lower one.
    greatest: [L::Words; 2],
}

impl<L: Lanes> SourceRow<L> {
    #[inline(always)]
    fn new<S: Sample>(lanes: L, row: &[S], column: isize, across: [f32; TAPS], down: [f32; 2]) -> Self {
        let l = lanes;
        let mut padded = [S::default(); LANES + TAPS - 1];
        let taps = taps(row, column, &mut padded);
        let (mut values, mut greatest) = (l.real(0.0), [l.word(0); 2]);
        let mut k = 0;
        while k < TAPS {
            if let Some(samples) = taps[k..].first_chunk() {
                let words = S::unsigned(l, S::words(l, samples));
                let mut place = 0;
                while place < down.len() {
                    if across[k] * down[place] >= SATURATING_WEIGHT {
                        greatest[place] = l.max_unsigned(greatest[place], words);
                    }
                    place += 1;
                }
                values = l.add_real(values, l.times_real(l.real(across[k]), S::reals(l, samples)));
            }
            k += 1;
        }
        Self { values, greatest }
    }
}

/// Interpolates between two rows, the upper and the lower one.
#[inline(always)]
fn interpolate<L: Lanes, S: Sample>(
    lanes: L,
    images: &Images<'_, S>,
    [upper, lower]: [&SourceRow<L>; 2],
    down: [f32; 2],
) -> [S; LANES] {
    let l = lanes;
    let sum = l.add_real(l.times_real(l.real(down[0]), upper.values), l.times_real(l.real(down[1]), lower.values));
    let greatest = l.max_unsigned(upper.greatest[0], lower.greatest[1]);
    // Unsaturated results stay below saturation, even where cubic interpolation overshoots.
    let saturation = f32::from(images.saturation().value());
    let rounded = l.max_real(l.add_real(sum, l.real(0.5)), l.real(0.0));
    let unsaturated = l.min_real(rounded, l.real(saturation - 1.0));
    S::from_reals(l, l.select_real(images.saturates(l, greatest), l.real(saturation), unsaturated))
}
