//! The wrapped phase of C2, resampled into the epipolar frame. There every epipolar segment is part of a row.
//!
//! ```text
//! copy the raw phase, with NO_PHASE for invalid pixels
//! for each row of the frame, in parallel; for each block of pixels:
//!     place in the raw image, from the source map
//!     load the four pixels around each place
//!     if all are valid, and opposite sides show nearly the same step: interpolate bilinearly
//!     else continue the surface of the nearest pixel up to the place
//! ```

use rayon::prelude::*;

use fringeflow_simd::{Kernel, Lanes, Level, store_first};

use crate::phase::PhaseMap;

use super::neighbourhood::phase_step;
use super::patches::{Columns, PATCH_PX, POWERS};
use super::pool::Pool;
use super::segment_table::SegmentTable;
use super::source_map::{PLACE_BITS, SourceRow};

/// Largest phase difference between neighbours on one surface, turns · 65536: three eighths of a turn, as in
/// fringes of 2.7 pixels.
pub(super) const MAX_NEIGHBOUR_STEP: i32 = 24576;
/// Largest difference of the steps along opposite sides of four pixels on one surface (33°). Where surfaces meet, the
/// wrapped phase jumps by any amount, and the jumps on both sides are seldom alike.
const MAX_TWIST: i32 = 6000;
/// Steps per pixel in which places are counted.
const PARTS: i32 = 1 << PLACE_BITS;

/// Wrapped phase of C2 in the epipolar frame, row by row.
#[derive(Clone, Debug, Default)]
pub struct EpipolarImage {
    /// Width, pixels.
    pub width: usize,
    /// Wrapped phase, turns · 65536; [`Self::NO_PHASE`] where there is none.
    pub phase: Vec<u16>,
    /// Scratch: the phase of the raw image, with [`Self::NO_PHASE`] for invalid pixels.
    pub(super) marked: Vec<u16>,
    /// Scratch for the coefficients along rows.
    pub(super) coefficients: Pool<Vec<[[f32; POWERS]; 2]>>,
}

impl EpipolarImage {
    /// Stands for no phase. A phase that happens to equal it is lowered by one step, 1e-4 rad.
    pub const NO_PHASE: u16 = u16::MAX;

    /// Resamples a phase map of C2. `None` if its size is not the one that the table was built for.
    #[must_use]
    pub fn resample(map: &PhaseMap, table: &SegmentTable) -> Option<Self> {
        let mut image = Self::default();
        image.resample_into(map, table).then_some(image)
    }

    /// Resamples a phase map of C2 into the memory of this image. Returns false, and leaves the image as it is, if the
    /// size of the map is not the one that the table was built for.
    ///
    /// Four neighbours that are valid and on one surface are interpolated bilinearly. Interpolation across a jump would
    /// invent phases that no surface has. There the surface of the nearest pixel is continued with its slope: the pixel
    /// alone would err by up to half a step.
    #[must_use]
    pub fn resample_into(&mut self, map: &PhaseMap, table: &SegmentTable) -> bool {
        if [map.width, map.height] != table.cam2_size_px {
            return false;
        }
        self.mark(map);
        let [width, height] = table.epipolar_size_px;
        self.width = width;
        self.phase.resize(width * height, Self::NO_PHASE);
        let image = Marked { phase: &self.marked, width: map.width };
        let coefficients = &self.coefficients;
        self.phase.par_chunks_mut(width).enumerate().for_each_init(
            || coefficients.take(),
            |along_row, (row, out)| {
                fringeflow_simd::run(
                    Level::in_use(),
                    RowKernel { image, sources: table.sources.row(row), along_row, out },
                );
            },
        );
        true
    }

    /// Marks the phases of a map.
    fn mark(&mut self, map: &PhaseMap) {
        self.marked.resize(map.phase.len(), Self::NO_PHASE);
        let rows = self.marked.par_chunks_mut(map.width).zip(map.phase.par_chunks(map.width));
        rows.zip(map.valid.par_chunks(map.width)).for_each(|((out, phase), valid)| {
            fringeflow_simd::run(Level::in_use(), MarkKernel { phase, valid, out });
        });
    }

    /// Subtracts a phase everywhere, turns · 65536.
    pub(super) fn subtract_phase(&mut self, offset: u16) {
        for phase in self.phase.iter_mut().filter(|phase| **phase != Self::NO_PHASE) {
            *phase = marked(phase.wrapping_sub(offset));
        }
    }
}

/// A phase that cannot be mistaken for [`EpipolarImage::NO_PHASE`].
#[inline(always)]
fn marked(phase: u16) -> u16 {
    phase.min(EpipolarImage::NO_PHASE - 1)
}

/// Marks the phases of a row.
struct MarkKernel<'a> {
    phase: &'a [u16],
    valid: &'a [bool],
    out: &'a mut [u16],
}

impl Kernel for MarkKernel<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        for ((out, &phase), &valid) in self.out.iter_mut().zip(self.phase).zip(self.valid) {
            *out = if valid { marked(phase) } else { EpipolarImage::NO_PHASE };
        }
    }
}

/// The marked raw image of C2.
#[derive(Clone, Copy)]
struct Marked<'a> {
    phase: &'a [u16],
    width: usize,
}

/// Resamples a row, a block of patches at a time.
struct RowKernel<'a> {
    image: Marked<'a>,
    sources: SourceRow<'a>,
    /// Scratch for coefficients.
    along_row: &'a mut Vec<[[f32; POWERS]; 2]>,
    out: &'a mut [u16],
}

impl Kernel for RowKernel<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let Self { image, sources, along_row, out } = self;
        along_row.resize(out.len().div_ceil(PATCH_PX), [[0.0; POWERS]; 2]);
        sources.along_row(along_row);
        let (mut block, patch_columns) = (Block::default(), Columns::new());
        for (out, coefficients) in out.chunks_mut(BLOCK_PX).zip(along_row.chunks(BLOCK_PATCHES)) {
            let places = block.columns.as_chunks_mut().0.iter_mut().zip(block.rows.as_chunks_mut().0);
            for (coefficients, (columns, rows)) in coefficients.iter().zip(places) {
                let [column, row] = coefficients;
                *columns = sources.places(&patch_columns, column);
                *rows = sources.places(&patch_columns, row);
            }
            block.resample(image);
            store_first(&block.phase, out);
        }
    }
}

/// Patches per block: enough for loops over many pixels, few enough to stay in the cache.
const BLOCK_PATCHES: usize = 8;
const BLOCK_PX: usize = BLOCK_PATCHES * PATCH_PX;

/// Scratch for a block.
struct Block {
    /// Places in the raw image, 1/2048 pixel.
    columns: [i32; BLOCK_PX],
    rows: [i32; BLOCK_PX],
    /// Index of the upper left of the four pixels around each place.
    first: [u32; BLOCK_PX],
    /// All bits set where there are four pixels.
    inside: [u16; BLOCK_PX],
    /// The upper and the lower two pixels, the left one in the lower half of the bits.
    upper: [u32; BLOCK_PX],
    lower: [u32; BLOCK_PX],
    phase: [u16; BLOCK_PX],
    /// Not 0 where the phase is that of the nearest pixel.
    is_nearest: [u16; BLOCK_PX],
}

impl Default for Block {
    #[inline(always)]
    fn default() -> Self {
        let (places, pairs) = ([0; BLOCK_PX], [0; BLOCK_PX]);
        let words = [0; BLOCK_PX];
        let (inside, phase, is_nearest) = (words, words, words);
        Self { columns: places, rows: places, first: pairs, inside, upper: pairs, lower: pairs, phase, is_nearest }
    }
}

impl Block {
    /// Computes the phases at the places.
    #[inline(always)]
    fn resample(&mut self, image: Marked<'_>) {
        let width = image.width as i32;
        let height = (image.phase.len() / image.width.max(1)) as i32;
        for i in 0..BLOCK_PX {
            let (u, v) = (self.columns[i] >> PLACE_BITS, self.rows[i] >> PLACE_BITS);
            let is_inside = (u >= 0) & (v >= 0) & (u < width - 1) & (v < height - 1);
            self.inside[i] = if is_inside { u16::MAX } else { 0 };
            self.first[i] = if is_inside { v.wrapping_mul(width).wrapping_add(u) as u32 } else { 0 };
        }
        // Gathering is the only step that does not vectorize, so it has a loop of its own.
        for i in 0..BLOCK_PX {
            let first = self.first[i] as usize;
            self.upper[i] = pair(image.phase, first);
            self.lower[i] = pair(image.phase, first + image.width);
        }
        for i in 0..BLOCK_PX {
            let (upper, lower) = (self.upper[i], self.lower[i]);
            let corners = [upper as u16, (upper >> 16) as u16, lower as u16, (lower >> 16) as u16];
            let shares = [self.columns[i] & (PARTS - 1), self.rows[i] & (PARTS - 1)];
            let (phase, is_nearest) = interpolate(corners, shares);
            self.phase[i] = phase | !self.inside[i];
            self.is_nearest[i] = is_nearest & self.inside[i];
        }
        for i in 0..BLOCK_PX {
            if self.is_nearest[i] != 0 && self.phase[i] != EpipolarImage::NO_PHASE {
                self.phase[i] = image.continued([self.columns[i], self.rows[i]]);
            }
        }
    }
}

impl Marked<'_> {
    /// Phase at a place inside the image, from the surface of the nearest pixel, which has a phase.
    fn continued(&self, place: [i32; 2]) -> u16 {
        let nearest = place.map(|parts| (parts + PARTS / 2) >> PLACE_BITS);
        let size = [self.width, self.phase.len() / self.width].map(|side| side as i32);
        let index = nearest[1] as usize * self.width + nearest[0] as usize;
        let strides = [1, self.width as isize];
        let rise: i64 = (0..2)
            .map(|axis| {
                let offset = place[axis] - (nearest[axis] << PLACE_BITS);
                let outwards = if offset < 0 { -1 } else { 1 };
                let at = |pixels: i32| {
                    let inside = (0..size[axis]).contains(&(nearest[axis] + outwards * pixels));
                    let neighbour = index as isize + strides[axis] * (outwards * pixels) as isize;
                    let phase = if inside { self.phase[neighbour as usize] } else { EpipolarImage::NO_PHASE };
                    (phase != EpipolarImage::NO_PHASE).then_some(phase)
                };
                i64::from(slope([at(-2), at(-1), at(0), at(1), at(2)])) * i64::from(offset.abs())
            })
            .sum();
        marked(self.phase[index].wrapping_add(((rise + i64::from(PARTS / 2)) >> PLACE_BITS) as u16))
    }
}

/// Slope of the phase behind the third of five pixels in a row: the step to the fourth if it continues the step before,
/// else the step before if it continues the first one, else the step to the fourth if the last one continues it, else 0:
/// a pixel that continues nothing mixes surfaces.
fn slope(phases: [Option<u16>; 5]) -> i32 {
    let step = |from: usize| {
        let step = phase_step(phases[from]?, phases[from + 1]?);
        (step.abs() <= MAX_NEIGHBOUR_STEP).then_some(step)
    };
    let steps = [0, 1, 2, 3].map(step);
    let continues = |a: usize, b: usize| steps[a].zip(steps[b]).is_some_and(|(a, b)| (a - b).abs() <= MAX_TWIST);
    let chosen = [(2, 1), (1, 0), (2, 3)].into_iter().find(|&(step, beside)| continues(step, beside));
    chosen.and_then(|(step, _)| steps[step]).unwrap_or(0)
}

/// Two neighbours of a row, the left one in the lower half of the bits.
#[inline(always)]
fn pair(phase: &[u16], first: usize) -> u32 {
    let pair = &phase[first..first + 2];
    u32::from(pair[0]) | u32::from(pair[1]) << 16
}

/// Phase between four pixels, `right` and `below` the upper left one by shares in 1/2048; and all bits set if it is that
/// of the nearest pixel. Free of branches, so that the compiler vectorizes it.
#[inline(always)]
fn interpolate([upper_left, upper_right, lower_left, lower_right]: [u16; 4], [right, below]: [i32; 2]) -> (u16, u16) {
    let is_phase = |phase: u16| phase != EpipolarImage::NO_PHASE;
    let (top, bottom) = (phase_step(upper_left, upper_right), phase_step(lower_left, lower_right));
    let (at_left, at_right) = (phase_step(upper_left, lower_left), phase_step(upper_right, lower_right));
    let is_small = |step: i32| step.abs() <= MAX_NEIGHBOUR_STEP;
    let is_flat = |twist: i32| twist.abs() <= MAX_TWIST;
    let smooth = is_phase(upper_left)
        & is_phase(upper_right)
        & is_phase(lower_left)
        & is_phase(lower_right)
        & is_small(top)
        & is_small(bottom)
        & is_small(at_left)
        & is_small(at_right)
        & is_flat(top - bottom)
        & is_flat(at_left - at_right);
    // The phases of all four are unwrapped from the upper left corner. Within the limits above the sum fits 32 bits if
    // five of the 22 bits after the point are dropped first; beyond them it is not used.
    let down = at_left * PARTS + (bottom - top) * right;
    let rise = top * right + ((down >> 6).wrapping_mul(below) >> 5);
    let interpolated = marked(upper_left.wrapping_add(((rise + PARTS / 2) >> PLACE_BITS) as u16));
    let upper = if right >= PARTS / 2 { upper_right } else { upper_left };
    let lower = if right >= PARTS / 2 { lower_right } else { lower_left };
    let nearest = if below >= PARTS / 2 { lower } else { upper };
    if smooth { (interpolated, 0) } else { (nearest, u16::MAX) }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::correspondence::test_random::random;

    const NONE: u16 = EpipolarImage::NO_PHASE;

    /// Interpolation in `f64`, pixel by pixel: the oracle.
    fn plain(image: Marked<'_>, place: [i32; 2]) -> u16 {
        let size = [image.width, image.phase.len() / image.width].map(|side| side as i64);
        let [u, v] = place.map(|parts| i64::from(parts >> PLACE_BITS));
        if !((0..size[0] - 1).contains(&u) && (0..size[1] - 1).contains(&v)) {
            return NONE;
        }
        let at = |u: i64, v: i64| {
            let inside = (0..size[0]).contains(&u) && (0..size[1]).contains(&v);
            if inside { image.phase[(v * size[0] + u) as usize] } else { NONE }
        };
        // Step between two pixels, if both have a phase and it is small.
        let step = |from: [i64; 2], to: [i64; 2]| {
            let [from, to] = [from, to].map(|[u, v]| at(u, v));
            let step = f64::from(to.wrapping_sub(from) as i16);
            (from != NONE && to != NONE && step.abs() <= f64::from(MAX_NEIGHBOUR_STEP)).then_some(step)
        };
        let is_like =
            |a: Option<f64>, b: Option<f64>| a.zip(b).is_some_and(|(a, b)| (a - b).abs() <= f64::from(MAX_TWIST));
        let [right, below] = place.map(|parts| f64::from(parts & (PARTS - 1)) / f64::from(PARTS));
        let (top, bottom) = (step([u, v], [u + 1, v]), step([u, v + 1], [u + 1, v + 1]));
        let (at_left, at_right) = (step([u, v], [u, v + 1]), step([u + 1, v], [u + 1, v + 1]));
        let (origin, rise) = if is_like(top, bottom) && is_like(at_left, at_right) {
            let along = (1.0 - below) * top.unwrap() + below * bottom.unwrap();
            (at(u, v), along * right + at_left.unwrap() * below)
        } else {
            let near = [u + i64::from(right >= 0.5), v + i64::from(below >= 0.5)];
            let continued = |axis: usize, offset: f64| {
                let place = |pixels: i64| {
                    let mut place = near;
                    place[axis] += if offset < 0.0 { -pixels } else { pixels };
                    place
                };
                let steps = [-2, -1, 0, 1].map(|pixels| step(place(pixels), place(pixels + 1)));
                let chosen = [(2, 1), (1, 0), (2, 3)].into_iter().find(|&(a, b)| is_like(steps[a], steps[b]));
                chosen.and_then(|(step, _)| steps[step]).unwrap_or(0.0) * offset.abs()
            };
            let [u_offset, v_offset] = [right - f64::from(right >= 0.5), below - f64::from(below >= 0.5)];
            (at(near[0], near[1]), continued(0, u_offset) + continued(1, v_offset))
        };
        if origin == NONE { NONE } else { marked(origin.wrapping_add((rise + 0.5).floor() as i64 as u16)) }
    }

    fn interpolated(corners: [u16; 4], place: [i32; 2]) -> u16 {
        let mut block = Block { columns: [place[0]; BLOCK_PX], rows: [place[1]; BLOCK_PX], ..Block::default() };
        block.resample(Marked { phase: &corners, width: 2 });
        block.phase[7]
    }

    #[test]
    fn phases_are_interpolated_across_the_wrap() {
        assert_eq!(interpolated([65000, 536, 65000, 536], [1024, 0]), 0);
    }

    #[test]
    fn short_fringes_of_a_steep_surface_are_interpolated() {
        // 0.31 and 0.15 turns from pixel to pixel: the far corners are half a turn apart.
        assert_eq!(interpolated([0, 20000, 10000, 30000], [1024, 1024]), 15000);
        assert_eq!(interpolated([0, 20000, 10000, 40000], [1024, 1024]), 40000);
    }

    #[test]
    fn jumps_and_invalid_neighbours_leave_the_nearest() {
        assert_eq!(interpolated([100, 30000, 100, 30000], [312, 0]), 100);
        assert_eq!(interpolated([100, NONE, 100, 200], [312, 0]), 100);
        assert_eq!(interpolated([NONE, 200, 100, 200], [312, 0]), NONE);
    }

    #[test]
    fn beside_a_jump_the_surface_of_the_nearest_pixel_continues() {
        // Two surfaces, with a pixel of both between them.
        let row = [0, 4000, 8000, 12_000, 25_000, 50_000, 49_000, 48_000];
        let image = Marked { phase: &[row, row, row].concat(), width: 8 };
        let at = |column: f64| image.continued([column, 1.0].map(|px| (px * f64::from(PARTS)) as i32));
        assert_eq!([at(2.75), at(3.25), at(4.25), at(4.75), at(5.25)], [11_000, 13_000, 25_000, 50_250, 49_750]);
    }

    #[test]
    fn a_place_outside_the_image_has_no_phase() {
        for outside in [[-1, 0], [0, -1], [2048, 0], [0, 2048], [i32::MAX, 0], [0, i32::MIN]] {
            assert_eq!(interpolated([100; 4], outside), NONE);
        }
        assert_eq!(interpolated([100; 4], [2047, 2047]), 100);
    }

    #[test]
    fn a_block_is_resampled_as_its_pixels_one_by_one() {
        let mut random = random(5);
        let (width, height) = (37, 29);
        let (mut smooth, mut other) = (0, 0);
        for _ in 0..100 {
            let [du, dv, noise] = [random(26_000), random(26_000), 1 + random(9000)];
            let pixel = |i: usize, noise: u64| (i % width) as u64 * du + (i / width) as u64 * dv + noise;
            let phase: Vec<u16> = (0..width * height)
                .map(|i| if random(20) == 0 { NONE } else { marked(pixel(i, random(noise)) as u16) })
                .collect();
            let image = Marked { phase: &phase, width };
            let mut block = Block {
                columns: std::array::from_fn(|_| random(40 << PLACE_BITS) as i32 - 2000),
                rows: std::array::from_fn(|_| random(32 << PLACE_BITS) as i32 - 2000),
                ..Block::default()
            };
            block.resample(image);
            for (i, &phase) in block.phase.iter().enumerate() {
                let wanted = plain(image, [block.columns[i], block.rows[i]]);
                let off = i32::from(phase.wrapping_sub(wanted) as i16);
                // The dropped bits can change the rounding.
                assert!(off.abs() <= 1 && (phase == NONE) == (wanted == NONE), "{phase} for {wanted}");
                smooth += usize::from(!image.phase.contains(&phase));
                other += usize::from(phase == NONE);
            }
        }
        assert!(smooth > 1000 && other > 500, "{smooth} interpolated, {other} without a phase");
    }

    #[test]
    fn a_phase_is_never_taken_for_none() {
        let mut image = EpipolarImage { width: 3, phase: vec![7, NONE, 10], ..EpipolarImage::default() };
        image.subtract_phase(8);
        assert_eq!(image.phase, [NONE - 1, NONE, 2]);
    }
}
