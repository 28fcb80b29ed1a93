//! Regions of continuous absolute phase, and whether δ is level over them.

use super::super::TURN;
use super::Image;
use super::neighbours::MAX_STEP;

/// Least share of a region that passes the test; largest share over which δ is steep.
const MIN_PASSING_SHARE: f64 = 0.7;
const MAX_STEEP_SHARE: f64 = 0.7;
/// Largest distance of the mean δ of a region from that of all, in sd, and largest variance in sd² that a plane explains
/// which rises faster than by so many sd over the image.
const MAX_MEAN_SD: f64 = 2.0;
const MAX_RAMP_VARIANCE: f64 = 0.5;
const MAX_CHANGE_OVER_IMAGE_SD: f64 = 20.0;
/// Of regions up to so many pixels, and beyond, one pixel in so many along either axis is asked for its slope.
const MANY_PX: u32 = 10_000;
const STEEP_STRIDES: [usize; 2] = [2, 8];
/// Pixels on either side that a slope is measured over.
const SLOPE_REACH_PX: isize = 3;

/// Division of the decided pixels.
pub(super) struct Regions {
    labels: Vec<Option<u32>>,
    pub(super) sizes: Vec<u32>,
}

/// Sums over the pixels of a region that pass the test.
#[derive(Clone, Default)]
struct Sums {
    count: f64,
    delta: f64,
    place: [f64; 2],
    place_delta: [f64; 2],
    /// Column², column · row, row².
    place_place: [f64; 3],
    sampled: f64,
    steep: f64,
}

impl Regions {
    /// Neighbours belong together where absolute phase and δ run on.
    pub(super) fn of(image: &Image<'_>, tolerance: i32) -> Self {
        let mut all = Self { labels: vec![None; image.chosen.len()], sizes: Vec::new() };
        let mut frontier = Vec::new();
        for seed in 0..image.chosen.len() {
            if image.chosen[seed].is_none() || all.labels[seed].is_some() {
                continue;
            }
            let (label, mut size) = (Some(all.sizes.len() as u32), 0);
            all.labels[seed] = label;
            frontier.push(seed);
            while let Some(pixel) = frontier.pop() {
                size += 1;
                let (u, v) = (pixel % image.width, pixel / image.width);
                let neighbours = [
                    (u > 0).then(|| pixel - 1),
                    (u + 1 < image.width).then(|| pixel + 1),
                    (v > 0).then(|| pixel - image.width),
                    (v + 1 < image.height).then(|| pixel + image.width),
                ];
                for next in neighbours.into_iter().flatten() {
                    let runs_on = image.chosen[next].is_some()
                        && (image.absolute[next] - image.absolute[pixel]).abs() <= MAX_STEP
                        && (image.delta(next) - image.delta(pixel)).abs() <= tolerance;
                    if runs_on && all.labels[next].is_none() {
                        all.labels[next] = label;
                        frontier.push(next);
                    }
                }
            }
            all.sizes.push(size);
        }
        all
    }

    pub(super) fn of_pixel(&self, pixel: usize) -> Option<usize> {
        self.labels[pixel].map(|label| label as usize)
    }

    /// Of each region whether its δ is level, as over a right one; small ones are not asked.
    pub(super) fn level(&self, image: &Image<'_>) -> Vec<bool> {
        let mut all = vec![Sums::default(); self.sizes.len()];
        for pixel in 0..self.labels.len() {
            let Some(region) = self.of_pixel(pixel) else { continue };
            if image.limits.passes(image.delta(pixel)) {
                let (u, v) = (pixel % image.width, pixel / image.width);
                let sums = &mut all[region];
                sums.add([u as f64, v as f64], f64::from(image.delta(pixel)));
                let stride = STEEP_STRIDES[usize::from(self.sizes[region] > MANY_PX)];
                if u.is_multiple_of(stride) && v.is_multiple_of(stride) {
                    sums.sampled += 1.0;
                    sums.steep += f64::from(u8::from(self.is_steep(image, pixel)));
                }
            }
        }
        let sd = f64::from(image.limits.threshold) * f64::from(TURN) / 3.0;
        let mean = f64::from(image.limits.mean) * f64::from(TURN);
        let fastest = MAX_CHANGE_OVER_IMAGE_SD * sd / image.width as f64;
        let is_level = |(sums, &size): (&Sums, &u32)| {
            let (slope, explained) = sums.ramp();
            size < image.settings.min_region_px
                || (sums.count >= MIN_PASSING_SHARE * f64::from(size)
                    && sums.steep <= MAX_STEEP_SHARE * sums.sampled
                    && (sums.mean() - mean).abs() <= MAX_MEAN_SD * sd
                    && (slope <= fastest || explained <= MAX_RAMP_VARIANCE * sd * sd))
        };
        all.iter().zip(&self.sizes).map(is_level).collect()
    }

    /// Whether δ changes steadily along the row or the column of a pixel.
    pub(super) fn is_steep(&self, image: &Image<'_>, pixel: usize) -> bool {
        [1, image.width as isize].into_iter().any(|stride| {
            let same = |k: isize| {
                let next = pixel.checked_add_signed(k * stride).and_then(|next| self.labels.get(next));
                next.is_some_and(|label| *label == self.labels[pixel])
            };
            let before = (1..=SLOPE_REACH_PX).take_while(|k| same(-k)).count() as isize;
            let after = (1..=SLOPE_REACH_PX).take_while(|k| same(*k)).count() as isize;
            if before + after < SLOPE_REACH_PX {
                return false;
            }
            let centre = 0.5 * (after - before) as f64;
            let (mut moment, mut spread) = (0.0, 0.0);
            for k in -before..=after {
                let offset = k as f64 - centre;
                moment += offset * f64::from(image.delta(pixel.wrapping_add_signed(k * stride)));
                spread += offset * offset;
            }
            (moment / spread).abs() > image.limits.steep
        })
    }
}

impl Sums {
    fn add(&mut self, [u, v]: [f64; 2], delta: f64) {
        self.count += 1.0;
        self.delta += delta;
        self.place = [self.place[0] + u, self.place[1] + v];
        self.place_delta = [self.place_delta[0] + u * delta, self.place_delta[1] + v * delta];
        let [uu, uv, vv] = self.place_place;
        self.place_place = [uu + u * u, uv + u * v, vv + v * v];
    }

    fn mean(&self) -> f64 {
        self.delta / self.count.max(1.0)
    }

    /// Rise of the plane through δ, and the variance that it explains.
    fn ramp(&self) -> (f64, f64) {
        let mean_of = |sum: f64| sum / self.count.max(1.0);
        let ([u, v], [ud, vd], [uu, uv, vv]) =
            (self.place.map(mean_of), self.place_delta.map(mean_of), self.place_place.map(mean_of));
        let (uu, uv, vv) = (uu - u * u, uv - u * v, vv - v * v);
        let (ud, vd) = (ud - u * self.mean(), vd - v * self.mean());
        let determinant = uu * vv - uv * uv;
        if determinant < 1e-6 {
            return (0.0, 0.0);
        }
        let (rise_u, rise_v) = ((vv * ud - uv * vd) / determinant, (uu * vd - uv * ud) / determinant);
        (rise_u.hypot(rise_v), rise_u * ud + rise_v * vd)
    }
}
