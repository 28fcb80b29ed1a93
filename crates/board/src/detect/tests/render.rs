//! Images of a board with exact truth: a pinhole camera, or any map from the board, with blur, noise, uneven light and
//! a gamma.

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use crate::{Board, BoardImage};

/// How an image is taken.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Taken {
    pub(crate) size_px: [usize; 2],
    pub(crate) focal_px: f64,
    /// Distance of the middle of the board, and where it is seen.
    pub(crate) distance_mm: f64,
    pub(crate) middle_px: [f64; 2],
    /// Rotations about x, y and z of the board.
    pub(crate) turned_deg: [f64; 3],
    /// Standard deviation of the blur.
    pub(crate) blur_px: f64,
    pub(crate) noise: f64,
    pub(crate) black: f64,
    pub(crate) white: f64,
    /// Share by which the light changes from the left border to the right one.
    pub(crate) gradient: f64,
    pub(crate) gamma: f64,
    pub(crate) seed: u64,
}

impl Taken {
    pub(crate) fn usual() -> Self {
        Self {
            size_px: [640, 512],
            focal_px: 900.0,
            distance_mm: 300.0,
            middle_px: [322.3, 251.8],
            turned_deg: [12.0, -18.0, 4.0],
            blur_px: 0.8,
            noise: 2.0,
            black: 30.0,
            white: 200.0,
            gradient: 0.0,
            gamma: 1.0,
            seed: 1,
        }
    }

    /// Image point of a point of the board.
    pub(crate) fn pixel(&self, [x, y]: [f64; 2]) -> [f64; 2] {
        let [rx, ry] = self.axes();
        let p = [0, 1, 2].map(|k| rx[k] * x + ry[k] * y + if k == 2 { self.distance_mm } else { 0.0 });
        [0, 1].map(|k| self.focal_px * p[k] / p[2] + self.middle_px[k])
    }

    /// The x and y axes of the board in the frame of the camera.
    fn axes(&self) -> [[f64; 3]; 2] {
        let [a, b, c] = self.turned_deg.map(f64::to_radians);
        let turn = |[x, y, z]: [f64; 3]| {
            let [x, y] = [c.cos() * x - c.sin() * y, c.sin() * x + c.cos() * y];
            let [y, z] = [a.cos() * y - a.sin() * z, a.sin() * y + a.cos() * z];
            [b.cos() * x + b.sin() * z, y, -b.sin() * x + b.cos() * z]
        };
        [turn([1.0, 0.0, 0.0]), turn([0.0, 1.0, 0.0])]
    }

    /// Point of the board that an image point shows.
    fn board_point(&self, [u, v]: [f64; 2]) -> Option<[f64; 2]> {
        let [rx, ry] = self.axes();
        let d = [(u - self.middle_px[0]) / self.focal_px, (v - self.middle_px[1]) / self.focal_px];
        // (rx − d·rx.z) x + (ry − d·ry.z) y = d · distance, for both coordinates.
        let m = [0, 1].map(|k| [rx[k] - d[k] * rx[2], ry[k] - d[k] * ry[2], d[k] * self.distance_mm]);
        let determinant = m[0][0] * m[1][1] - m[0][1] * m[1][0];
        let x = (m[0][2] * m[1][1] - m[0][1] * m[1][2]) / determinant;
        let y = (m[0][0] * m[1][2] - m[0][2] * m[1][0]) / determinant;
        (rx[2] * x + ry[2] * y + self.distance_mm > 0.0).then_some([x, y])
    }

    /// Grey levels of the image, rounded to 8 bits.
    pub(crate) fn levels(&self, brightness: impl Fn(f64, f64) -> f64) -> Vec<u8> {
        const K: usize = 5;
        let [w, h] = self.size_px;
        let (fine_w, fine_h) = (w * K, h * K);
        let at = |k: usize| (k as f64 + 0.5) / K as f64 - 0.5;
        let mut fine: Vec<f32> = (0..fine_w * fine_h)
            .map(|k| {
                let point = self.board_point([at(k % fine_w), at(k / fine_w)]);
                point.map_or(0.5, |[x, y]| brightness(x, y)) as f32
            })
            .collect();
        let sd = self.blur_px * K as f64;
        let reach = (3.5 * sd).ceil() as usize;
        let weights: Vec<f32> = (0..=reach).map(|k| (-0.5 * (k as f64 / sd.max(1e-9)).powi(2)).exp() as f32).collect();
        if reach > 0 {
            blur(&mut fine, fine_w, 1, &weights);
            blur(&mut fine, fine_h, fine_w, &weights);
        }
        let mut rng = ChaCha8Rng::seed_from_u64(self.seed);
        let mut levels = Vec::new();
        for k in 0..w * h {
            let (u, v) = (k % w, k / w);
            let sum: f32 = (0..K * K).map(|s| fine[(v * K + s / K) * fine_w + u * K + s % K]).sum();
            let light = 1.0 + self.gradient * (u as f64 / w as f64 - 0.5);
            let linear = (f64::from(sum) / (K * K) as f64 * (self.white - self.black) + self.black) * light;
            let shown = 255.0 * (linear / 255.0).max(0.0).powf(self.gamma);
            let normal: f64 = (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0;
            levels.push((shown + self.noise * normal).round().clamp(0.0, 255.0) as u8);
        }
        levels
    }

    pub(crate) fn image(&self, board: &Board) -> BoardImage {
        let levels = self.levels(|x, y| board.brightness(x, y));
        BoardImage::new(self.size_px, fringeflow_base::grey::GreyLevels::eight_bit(&levels)).unwrap()
    }
}

/// Blurs along rows (stride 1) or columns.
fn blur(fine: &mut [f32], length: usize, stride: usize, weights: &[f32]) {
    let total: f32 = weights[0] + 2.0 * weights[1..].iter().sum::<f32>();
    let lines = fine.len() / length;
    let mut line = vec![0.0_f32; length];
    for k in 0..lines {
        let first = if stride == 1 { k * length } else { k };
        for i in 0..length {
            line[i] = fine[first + i * stride];
        }
        for i in 0..length {
            let mut sum = weights[0] * line[i];
            for (d, weight) in weights.iter().enumerate().skip(1) {
                sum += weight * (line[i.saturating_sub(d)] + line[(i + d).min(length - 1)]);
            }
            fine[first + i * stride] = sum / total;
        }
    }
}
