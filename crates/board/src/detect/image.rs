//! A grey image, and what the detectors take from it. Pixel centres are at integers.

use fringeflow_base::grey::GreyLevels;

/// A grey image in which a board is looked for.
#[derive(Clone, Debug, PartialEq)]
pub struct BoardImage {
    width_px: usize,
    height_px: usize,
    levels: Vec<f32>,
}

/// Shares of the pixels that are left out at both ends when an image is stretched to 8 bits.
const TAIL: f64 = 0.005;

impl BoardImage {
    /// An image from its grey levels, row by row; `None` if their number is not `width · height`.
    #[must_use]
    pub fn new(size_px: [usize; 2], levels: GreyLevels<'_>) -> Option<Self> {
        let levels = (0..levels.pixels()).map(|k| levels.grey(k)).collect();
        Self::of_levels(size_px, levels)
    }

    /// An image from grey levels that were computed, such as the mean of several images.
    #[must_use]
    pub fn of_levels([width_px, height_px]: [usize; 2], levels: Vec<f32>) -> Option<Self> {
        let is_whole = levels.len() == width_px * height_px && levels.iter().all(|level| level.is_finite());
        is_whole.then_some(Self { width_px, height_px, levels })
    }

    /// Width, pixels.
    #[must_use]
    pub fn width_px(&self) -> usize {
        self.width_px
    }

    /// Height, pixels.
    #[must_use]
    pub fn height_px(&self) -> usize {
        self.height_px
    }

    /// Grey level of a pixel inside the image.
    pub(super) fn at(&self, u: usize, v: usize) -> f64 {
        f64::from(self.levels[v * self.width_px + u])
    }

    /// Grey level between pixels, by bilinear interpolation; `None` outside.
    pub(super) fn level(&self, [x, y]: [f64; 2]) -> Option<f64> {
        let (u, v) = (x.floor(), y.floor());
        if !(u >= 0.0 && v >= 0.0 && u + 1.0 < self.width_px as f64 && v + 1.0 < self.height_px as f64) {
            return None;
        }
        let (du, dv, u, v) = (x - u, y - v, u as usize, v as usize);
        let row = |v: usize| self.at(u, v) * (1.0 - du) + self.at(u + 1, v) * du;
        Some(row(v) * (1.0 - dv) + row(v + 1) * dv)
    }

    /// The grey levels below which lie a half, and all but a half, percent of the pixels.
    pub(super) fn range(&self) -> [f64; 2] {
        let mut sorted = self.levels.clone();
        if sorted.is_empty() {
            return [0.0; 2];
        }
        let last = sorted.len() - 1;
        [TAIL, 1.0 - TAIL].map(|share| {
            let k = (share * last as f64) as usize;
            f64::from(*sorted.select_nth_unstable_by(k, f32::total_cmp).1)
        })
    }

    /// Share of the pixels at or above a grey level.
    pub(super) fn share_above(&self, level: f32) -> f64 {
        self.levels.iter().filter(|&&l| l >= level).count() as f64 / self.levels.len().max(1) as f64
    }

    /// The image with 8 bits, stretched so that dark images have contrast too.
    pub(super) fn stretched(&self) -> Vec<u8> {
        let [low, high] = self.range();
        let scale = 255.0 / (high - low).max(1.0);
        self.levels.iter().map(|&level| ((f64::from(level) - low) * scale).round().clamp(0.0, 255.0) as u8).collect()
    }

    /// Means of 2 × 2 pixels. Pixel `u` of the result is at `2u + 0.5` of this image.
    pub(super) fn halved(&self) -> Self {
        let (width_px, height_px) = (self.width_px / 2, self.height_px / 2);
        let mean = |k: usize| {
            let (u, v) = (2 * (k % width_px.max(1)), 2 * (k / width_px.max(1)));
            (self.at(u, v) + self.at(u + 1, v) + self.at(u, v + 1) + self.at(u + 1, v + 1)) / 4.0
        };
        Self { width_px, height_px, levels: (0..width_px * height_px).map(|k| mean(k) as f32).collect() }
    }

    /// The image at twice the size. Pixel `u` of the result is at `u / 2 − 0.25` of this image.
    pub(super) fn doubled(&self) -> Self {
        let (width_px, height_px) = (2 * self.width_px, 2 * self.height_px);
        let at = |k: usize, size: usize| (k as f64 / 2.0 - 0.25).clamp(0.0, size as f64 - 1.001);
        let level = |k: usize| self.level([at(k % width_px, self.width_px), at(k / width_px, self.height_px)]);
        let levels = (0..width_px * height_px).map(|k| level(k).unwrap_or_default() as f32).collect();
        Self { width_px, height_px, levels }
    }

    /// The image in a mirror.
    pub(super) fn mirrored(&self) -> Self {
        let mut levels = self.levels.clone();
        levels.chunks_exact_mut(self.width_px.max(1)).for_each(<[f32]>::reverse);
        Self { levels, ..*self }
    }

    /// Means over squares of `2 · radius + 1` pixels, cut at the border.
    pub(super) fn local_means(&self, radius: usize) -> Vec<f32> {
        let (w, h) = (self.width_px, self.height_px);
        let mut sums = vec![0.0_f64; (w + 1) * (h + 1)];
        for v in 0..h {
            let mut row = 0.0;
            for u in 0..w {
                row += self.at(u, v);
                sums[(v + 1) * (w + 1) + u + 1] = sums[v * (w + 1) + u + 1] + row;
            }
        }
        let mean = |k: usize| {
            let (u, v) = (k % w, k / w);
            let (left, top) = (u.saturating_sub(radius), v.saturating_sub(radius));
            let (right, bottom) = ((u + radius + 1).min(w), (v + radius + 1).min(h));
            let at = |u: usize, v: usize| sums[v * (w + 1) + u];
            let sum = at(right, bottom) - at(left, bottom) - at(right, top) + at(left, top);
            (sum / ((right - left) * (bottom - top)) as f64) as f32
        };
        (0..w * h).map(mean).collect()
    }
}
