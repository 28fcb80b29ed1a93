//! The image of a pattern from the light that the pixels receive.
//!
//! Fringes are a series of cosines, one for a linear projector and more with a gamma; the blur damps each. The edges of
//! Gray code are blurred steps. Cost: a few operations a pixel, and the noise.

use std::f64::consts::TAU;

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;

use fringeflow::geometry::FringePattern;
use fringeflow_patterns::{Direction, Pattern};

use super::light::Light;
use crate::simulation::sensor::{Sensitivity, Sensor};

/// Terms of the series of fringes.
const TERMS: usize = 6;
/// Samples of a period that give the series.
const SAMPLES: usize = 256;

/// The electronics of a camera.
pub(super) struct Exposure<'a> {
    pub(super) sensor: &'a Sensor,
    pub(super) sensitivity: &'a Sensitivity,
    /// Brightness of the projector in this image; 1 without beat.
    pub(super) lamp: f64,
    /// Seed of the noise of this image.
    pub(super) seed: [u64; 2],
}

impl Exposure<'_> {
    /// Grey levels of an image of 8 bits.
    pub(super) fn image(&self, light: &[Light], width: usize, pattern: &Pattern) -> Vec<u8> {
        let shown = Shown::new(pattern, self.sensor.gamma);
        let mut pixels = vec![0; light.len()];
        pixels.par_chunks_mut(width.max(1)).enumerate().for_each(|(v, row)| {
            let mut noise = Normals::new(self.seed, v as u64);
            for (u, pixel) in row.iter_mut().enumerate() {
                let k = v * width + u;
                let grey = self.grey(&light[k], &shown);
                let noisy = self
                    .sensor
                    .noise
                    .map_or(grey, |level| level.applied(grey, self.sensitivity.deviation(k), noise.next()));
                *pixel = noisy.round().clamp(0.0, 255.0) as u8;
            }
        });
        pixels
    }

    fn grey(&self, light: &Light, shown: &Shown) -> f64 {
        let s = self.sensor;
        let projector = s.leak + (1.0 - s.leak) * shown.brightness(light);
        s.black_level + s.gain * (f64::from(light.albedo) * s.ambient + f64::from(light.lit) * self.lamp * projector)
    }
}

/// A pattern, prepared.
enum Shown {
    Even(f64),
    Fringes { direction: usize, pattern: FringePattern, shift_rad: f64, series: [f64; TERMS] },
    Gray { direction: usize, pattern: Pattern, half_period_px: f64, bit: u32 },
    Other(Pattern, f64),
}

impl Shown {
    fn new(pattern: &Pattern, gamma: f64) -> Self {
        let index = |direction: Direction| usize::from(direction == Direction::Rows);
        match *pattern {
            Pattern::White => Self::Even(1.0),
            Pattern::Black => Self::Even(0.0),
            Pattern::Fringes { direction, pattern, shift_rad } => {
                Self::Fringes { direction: index(direction), pattern, shift_rad, series: series(gamma) }
            }
            Pattern::Gray { direction, period_px, bit } => {
                Self::Gray { direction: index(direction), pattern: *pattern, half_period_px: period_px / 2.0, bit }
            }
            Pattern::Chart { .. } => Self::Other(*pattern, gamma),
        }
    }

    fn brightness(&self, light: &Light) -> f64 {
        let at = light.at_px.map(f64::from);
        match self {
            Self::Even(brightness) => *brightness,
            Self::Fringes { direction, pattern, shift_rad, series } => {
                let phase = TAU * pattern.phase_turns(at[*direction]) + shift_rad;
                let variance = f64::from(light.variance_px2[*direction]) * (TAU / pattern.period_px).powi(2);
                sum_of(series, phase.cos(), (-0.5 * variance).exp())
            }
            Self::Gray { direction, pattern, half_period_px, bit } => {
                let middle = pattern.brightness(at[0], at[1]);
                // Bit b changes at every odd multiple of 2^b half periods, counted from the border of pixel 0.
                let step_px = half_period_px * f64::from(1_u32 << bit);
                let steps = (at[*direction] + 0.5) / step_px;
                let edge = 2.0 * ((steps - 1.0) / 2.0).round() + 1.0;
                let distance = (steps - edge).abs() * step_px / f64::from(light.variance_px2[*direction]).sqrt();
                middle + (1.0 - 2.0 * middle) * tail(distance)
            }
            Self::Other(pattern, gamma) => pattern.brightness(at[0], at[1]).powf(*gamma),
        }
    }
}

/// Coefficients of `((1 + cos φ) / 2)^gamma = Σ a_k cos kφ`.
fn series(gamma: f64) -> [f64; TERMS] {
    let mut series = [0.0; TERMS];
    for k in 0..SAMPLES {
        let phase = TAU * k as f64 / SAMPLES as f64;
        let light = (0.5 + 0.5 * phase.cos()).powf(gamma);
        for (term, sum) in series.iter_mut().enumerate() {
            *sum += light * (term as f64 * phase).cos() * if term == 0 { 1.0 } else { 2.0 } / SAMPLES as f64;
        }
    }
    series
}

/// Sum of the series where the first cosine is damped by `damping`, and term k by its k²-th power.
fn sum_of(series: &[f64; TERMS], cos: f64, damping: f64) -> f64 {
    let mut sum = series[0] + series[1] * damping * cos;
    if series[2] == 0.0 && series[3].abs() < 1e-12 {
        return sum;
    }
    let (mut before, mut now) = (1.0, cos);
    let (mut factor, mut damped) = (damping, damping);
    for coefficient in &series[2..] {
        (before, now) = (now, 2.0 * cos * now - before);
        factor *= damping * damping;
        damped *= factor;
        sum += coefficient * damped * now;
    }
    sum
}

/// Share of a normal distribution beyond `t` standard deviations (Abramowitz and Stegun, 26.2.17; within 1e-7).
fn tail(t: f64) -> f64 {
    if t > 6.0 {
        return 0.0;
    }
    let k = 1.0 / (1.0 + 0.231_641_9 * t);
    let poly =
        k * (0.319_381_530 + k * (-0.356_563_782 + k * (1.781_477_937 + k * (-1.821_255_978 + k * 1.330_274_429))));
    (-0.5 * t * t).exp() / TAU.sqrt() * poly
}

/// Normally distributed numbers, two at a time (Box and Muller 1958).
struct Normals {
    rng: ChaCha8Rng,
    second: Option<f32>,
}

impl Normals {
    fn new([image, set]: [u64; 2], row: u64) -> Self {
        let mut key = [0; 32];
        for (part, number) in key.chunks_exact_mut(8).zip([set, image, row]) {
            part.copy_from_slice(&number.to_le_bytes());
        }
        Self { rng: ChaCha8Rng::from_seed(key), second: None }
    }

    fn next(&mut self) -> f64 {
        if let Some(second) = self.second.take() {
            return f64::from(second);
        }
        let (a, b): (f32, f32) = (self.rng.random(), self.rng.random());
        // 1 − a is never zero.
        let radius = (-2.0 * (1.0 - a).ln()).sqrt();
        let (sin, cos) = (std::f32::consts::TAU * b).sin_cos();
        self.second = Some(radius * sin);
        f64::from(radius * cos)
    }
}
