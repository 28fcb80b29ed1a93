//! Pixels whose motion is known: z without ripple, and how well the images fit it.

use std::ops::Range;

use crate::phase::Validity;
use crate::phase::arctangent::turn_fraction;
use crate::phase::map::Modulation;
use crate::phase::sample::Sample;

use super::MAX_IMAGES;
use super::fit::{Complex, MotionFit, Response, time};
use super::planes::{Fitted, TILE, Window};

/// Least of what the response to a motion leaves of z compared with its ripple: below it they cannot be told apart.
const MIN_CONTRAST: f32 = 0.05;

/// A tile whose motion is known.
pub(super) struct Moved {
    pixels: Range<usize>,
    /// Whether the motion is known.
    known: [bool; TILE],
    /// `e^(iεt)` of the images behind the centre, from the nearest on; those before it are the conjugates.
    turns: Vec<[[f32; TILE]; 2]>,
    z: [[f32; TILE]; 2],
    /// H and G.
    direct: [[f32; TILE]; 2],
    ripple: [[f32; TILE]; 2],
    offset: [f32; TILE],
    /// Standard deviation of the samples about the moving sinusoid, grey levels.
    pub(super) residual: [f32; TILE],
}

impl Moved {
    /// The pixels of a tile, with z as it was fitted, and the motion of each, rad an image; NaN where it is not known.
    #[inline(always)]
    pub(super) fn of(response: &Response, z: &[Vec<f32>; 2], pixels: Range<usize>, motion_rad: &[f32]) -> Self {
        let images = response.direct.len();
        let mut moved = Self {
            pixels,
            known: [false; TILE],
            turns: Vec::with_capacity(MAX_IMAGES / 2),
            z: [[0.0; TILE]; 2],
            direct: [[0.0; TILE]; 2],
            ripple: [[0.0; TILE]; 2],
            offset: [0.0; TILE],
            residual: [0.0; TILE],
        };
        // The times are 0, 1, 2 … for an odd number of images, 0.5, 1.5, 2.5 … for an even one.
        let start = if images.is_multiple_of(2) { 0.5 } else { 0.0 };
        let [mut turn, mut step] = [[[1.0; TILE], [0.0; TILE]]; 2];
        for (p, &motion) in motion_rad.iter().enumerate() {
            let angle = if motion.is_finite() { motion } else { 0.0 };
            moved.known[p] = motion.is_finite();
            [turn[0][p], turn[1][p]] = cos_sin(start * angle);
            [step[0][p], step[1][p]] = cos_sin(angle);
        }
        for k in 0..images.div_ceil(2) {
            if k > 0 {
                for p in 0..TILE {
                    let [a, b, c, d] = [turn[0][p], turn[1][p], step[0][p], step[1][p]];
                    [turn[0][p], turn[1][p]] = [a * c - b * d, a * d + b * c];
                }
            }
            moved.turns.push(turn);
        }
        for image in 0..images {
            let (turn, sense) = moved.turn(image, images);
            let ([h, g], turn) = ([response.direct[image], response.ripple[image]], *turn);
            add_product(&mut moved.direct, h, &turn, sense);
            add_product(&mut moved.ripple, g, &turn, -sense);
        }
        moved.take_ripple_off(z);
        moved
    }

    /// Weighted `Im(z'·z*)` and `|z|²` of each pixel, without ripple: their quotient over some pixels is the motion.
    #[inline(always)]
    pub(super) fn motion_parts(&self, fit: &MotionFit, fitted: &Fitted, slope: &mut [f32], power: &mut [f32]) {
        let mut ripple = [[0.0; TILE]; 2];
        for (image, &coefficient) in fit.slope_ripple.iter().enumerate() {
            let (turn, sense) = self.turn(image, fit.images());
            add_product(&mut ripple, coefficient, turn, -sense);
        }
        let [re_slope, im_slope] = [&fitted.slope[0][self.pixels.clone()], &fitted.slope[1][self.pixels.clone()]];
        let weight = &fitted.weight[self.pixels.clone()];
        for (p, (slope, power)) in slope.iter_mut().zip(power.iter_mut()).enumerate() {
            let [x, y, a, b] = [self.z[0][p], self.z[1][p], self.direct[0][p], self.direct[1][p]];
            // z' is freed of its own ripple, z is what the fit gives of it: both are then those of a single turning z.
            let (re, im) = (a * x - b * y, a * y + b * x);
            let re_clean = re_slope[p] - (ripple[0][p] * x + ripple[1][p] * y);
            let im_clean = im_slope[p] - (ripple[1][p] * x - ripple[0][p] * y);
            let weight = if self.known[p] { weight[p] } else { 0.0 };
            *power = weight * (re * re + im * im);
            *slope = weight * (im_clean * re - re_clean * im);
        }
    }

    /// `e^(iεt)` of an image, or its conjugate where the second is −1.
    #[inline(always)]
    fn turn(&self, image: usize, images: usize) -> (&[[f32; TILE]; 2], f32) {
        let (middle, is_before) = (images / 2, image < images / 2);
        let place = match (is_before, images.is_multiple_of(2)) {
            (true, true) => middle - 1 - image,
            (true, false) => middle - image,
            (false, _) => image - middle,
        };
        (&self.turns[place], if is_before { -1.0 } else { 1.0 })
    }

    /// z from `H·z + G·z*`, which is what the fit gives.
    #[inline(always)]
    fn take_ripple_off(&mut self, z: &[Vec<f32>; 2]) {
        let [re, im] = [&z[0][self.pixels.clone()], &z[1][self.pixels.clone()]];
        let ([h_re, h_im], [g_re, g_im]) = (&self.direct, &self.ripple);
        for p in 0..self.pixels.len() {
            let [x, y, a, b, c, d] = [re[p], im[p], h_re[p], h_im[p], g_re[p], g_im[p]];
            let contrast = a * a + b * b - c * c - d * d;
            self.known[p] &= contrast >= MIN_CONTRAST;
            let scale = 1.0 / contrast.max(MIN_CONTRAST);
            // (H*·w − G·w*) / (|H|² − |G|²)
            self.z[0][p] = (a * x + b * y - c * x - d * y) * scale;
            self.z[1][p] = (a * y - b * x + c * y - d * x) * scale;
        }
    }

    /// Offset and residual of the images about the moving sinusoid.
    #[inline(always)]
    pub(super) fn fit_images<S: Sample>(&mut self, window: &Window<'_, S>, fit: &MotionFit, fitted: &Fitted) {
        let images = window.images.len();
        let offset = &fitted.offset[self.pixels.clone()];
        let (mut sum, mut trend, mut squares) = ([0.0; TILE], [0.0; TILE], [0.0; TILE]);
        let mut times = 0.0;
        for (i, image) in window.images.iter().enumerate() {
            let (samples, grey_per_value) = (&image[self.pixels.clone()], window.grey_per_value[i]);
            let (turn, sense) = self.turn(i, images);
            let ([cos, sin], t) = (fit.turns[i], time(i, images) as f32);
            for (p, sample) in samples.iter().enumerate() {
                let [c, d] = [turn[0][p], sense * turn[1][p]];
                let model = self.z[0][p] * (cos * c - sin * d) - self.z[1][p] * (cos * d + sin * c);
                let off = sample.grey(grey_per_value) - offset[p] - model;
                sum[p] += off;
                trend[p] += t * off;
                squares[p] += off * off;
            }
            times += t * t;
        }
        let count = images as f32;
        let (freedom, per_time) = (fit.freedom() as f32, if fit.has_trend { 1.0 / times } else { 0.0 });
        for p in 0..self.pixels.len() {
            self.offset[p] = offset[p] + sum[p] / count;
            let left = squares[p] - sum[p] * sum[p] / count - trend[p] * trend[p] * per_time;
            self.residual[p] = (left.max(0.0) / freedom).sqrt();
        }
    }

    /// Phase, modulation, mean and validity of the pixels.
    #[inline(always)]
    pub(super) fn finish(
        &self,
        validity: &Validity,
        phase: &mut [u16],
        modulation: &mut [Modulation],
        mean: &mut [u8],
        valid: &mut [bool],
    ) {
        for p in 0..self.pixels.len() {
            let [re, im] = [self.z[0][p], self.z[1][p]];
            phase[p] = turn_fraction(im, re);
            let modulation_grey = (re * re + im * im).sqrt();
            modulation[p] = Modulation::of_grey(modulation_grey);
            mean[p] = (self.offset[p] + 0.5) as u8;
            let fits = self.residual[p] <= validity.max_residual_share * modulation_grey;
            valid[p] = self.known[p] && modulation_grey >= validity.min_modulation_grey && fits;
        }
    }
}

/// Adds `factor · turn`, or the product with the conjugate of the turn where the sense is −1.
#[inline(always)]
fn add_product(sum: &mut [[f32; TILE]; 2], [a, b]: Complex, turn: &[[f32; TILE]; 2], sense: f32) {
    let [sum_re, sum_im] = sum;
    for p in 0..TILE {
        let [c, d] = [turn[0][p], sense * turn[1][p]];
        sum_re[p] += a * c - b * d;
        sum_im[p] += a * d + b * c;
    }
}

/// Cosine and sine of an angle up to 1.5 rad, to 2e-6 (Taylor); additions and multiplications alone, the same bits everywhere.
#[inline(always)]
fn cos_sin(angle: f32) -> Complex {
    let x = angle * angle;
    let cos = 1.0 - x * (0.5 - x * (1.0 / 24.0 - x * (1.0 / 720.0 - x * (1.0 / 40_320.0 - x / 3_628_800.0))));
    let sin = angle * (1.0 - x * (1.0 / 6.0 - x * (1.0 / 120.0 - x * (1.0 / 5040.0 - x / 362_880.0))));
    [cos, sin]
}
