//! The motion of every pixel: the slopes of the fits over 5 × 5 pixels, of which edges say little.

use rayon::prelude::*;

use crate::simd::{self, Kernel, Lanes, Level};

use super::fit::MotionFit;
use super::moved::Moved;
use super::planes::{Fitted, TILE};

/// Pixels to either side that are asked.
const REACH: usize = 2;
const _: () = assert!(REACH == 2, "`around` adds five");
/// Rounds: the first takes what the fit gives, ripple and all, the next take off the ripple of the motion found before.
const ROUNDS: usize = 3;

/// The motion of every pixel, rad an image; NaN where nothing tells it, or where it is too fast.
pub(super) fn motion(fit: &MotionFit, fitted: &Fitted, [width, height]: [usize; 2]) -> Vec<f32> {
    let pixels = width * height;
    let mut motion_rad = vec![0.0; pixels];
    let (mut slope, mut power) = (vec![0.0; pixels], vec![0.0; pixels]);
    for _ in 0..ROUNDS {
        let tiles = slope.par_chunks_mut(TILE).zip(power.par_chunks_mut(TILE)).zip(motion_rad.par_chunks(TILE));
        tiles.enumerate().for_each(|(tile, ((slope, power), motion))| {
            let tile = PartsTile { fit, fitted, first: tile * TILE, motion_rad: motion, slope, power };
            simd::run(Level::in_use(), tile);
        });
        let rows = motion_rad.par_chunks_mut(width.max(1)).enumerate();
        rows.for_each_init(<[Vec<f32>; 2]>::default, |sums, (row, motion_rad)| {
            let (slope, power, size) = (&slope, &power, [width, height]);
            simd::run(Level::in_use(), MotionOfRow { fit, slope, power, size, row, sums, motion_rad });
        });
    }
    motion_rad
}

/// Finds the parts of the motion of the pixels of a tile, from `first` on.
struct PartsTile<'a> {
    fit: &'a MotionFit,
    fitted: &'a Fitted,
    first: usize,
    motion_rad: &'a [f32],
    slope: &'a mut [f32],
    power: &'a mut [f32],
}

impl Kernel for PartsTile<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let pixels = self.first..self.first + self.motion_rad.len();
        let moved = Moved::of(&self.fit.rough, &self.fitted.z, pixels, self.motion_rad);
        moved.motion_parts(self.fit, self.fitted, self.slope, self.power);
    }
}

/// Finds the motion of the pixels of a row.
struct MotionOfRow<'a> {
    fit: &'a MotionFit,
    slope: &'a [f32],
    power: &'a [f32],
    size: [usize; 2],
    row: usize,
    /// Sums over the rows around, with room on either side.
    sums: &'a mut [Vec<f32>; 2],
    motion_rad: &'a mut [f32],
}

impl Kernel for MotionOfRow<'_> {
    type Output = ();

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) {
        let [width, height] = self.size;
        let [slopes, powers] = self.sums;
        for sums in [&mut *slopes, &mut *powers] {
            sums.clear();
            sums.resize(width + 2 * REACH, 0.0);
        }
        for other in self.row.saturating_sub(REACH)..(self.row + REACH + 1).min(height) {
            let pixels = other * width..(other + 1) * width;
            add_row(&mut slopes[REACH..][..width], &self.slope[pixels.clone()]);
            add_row(&mut powers[REACH..][..width], &self.power[pixels]);
        }
        let motion_rad = &mut self.motion_rad[..width];
        for u in 0..width {
            let (slope, power) = (around(slopes, width, u), around(powers, width, u));
            let motion = self.fit.motion_rad(slope / power);
            motion_rad[u] = if power > 0.0 { motion } else { f32::NAN };
        }
    }
}

#[inline(always)]
fn add_row(sums: &mut [f32], row: &[f32]) {
    let row = &row[..sums.len()];
    for u in 0..sums.len() {
        sums[u] += row[u];
    }
}

/// Sum over the pixels of a row around one.
#[inline(always)]
fn around(values: &[f32], width: usize, u: usize) -> f32 {
    let of = |offset: usize| values[offset..][..width][u];
    of(0) + of(1) + of(2) + of(3) + of(4)
}
