//! The motion of every pixel: the slopes of the fits over 5 × 5 pixels, of which edges say little.

use rayon::prelude::*;

use crate::simd::{self, Kernel, Lanes, Level};

use super::fit::MotionFit;
use super::moved::Moved;
use super::planes::{Fitted, TILE};

/// Pixels to either side that are asked.
const REACH: usize = 2;
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
        motion_rad.par_chunks_mut(width.max(1)).enumerate().for_each(|(v, motion)| {
            motion_of_row(fit, &slope, &power, [width, height], v, motion);
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

/// Writes the motion of the pixels of a row.
fn motion_of_row(
    fit: &MotionFit,
    slope: &[f32],
    power: &[f32],
    [width, height]: [usize; 2],
    row: usize,
    motion_rad: &mut [f32],
) {
    let (mut slopes, mut powers) = (vec![0.0_f32; width + 2 * REACH], vec![0.0_f32; width + 2 * REACH]);
    for other in row.saturating_sub(REACH)..(row + REACH + 1).min(height) {
        let pixels = other * width..(other + 1) * width;
        for (sums, plane) in [(&mut slopes, slope), (&mut powers, power)] {
            sums[REACH..].iter_mut().zip(&plane[pixels.clone()]).for_each(|(sum, value)| *sum += value);
        }
    }
    let sum = |values: &[f32], u: usize| values[u..=u + 2 * REACH].iter().sum::<f32>();
    for (u, motion) in motion_rad.iter_mut().enumerate() {
        let power = sum(&powers, u);
        let known = if power > 0.0 { fit.motion_rad(sum(&slopes, u) / power) } else { None };
        *motion = known.unwrap_or(f32::NAN);
    }
}
