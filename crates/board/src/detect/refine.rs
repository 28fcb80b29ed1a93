//! From seeds to exact image points: every feature of the board is fitted in the image.
//!
//! The window of a feature follows the tilt of the board. Of its pixels those count whose surroundings are, on the
//! board, the two edges or the circle alone: markers and other squares are masked, so the window can be large, and the
//! long edges of a ChArUco board count although a marker stands between them. The mean of the ellipse's rim is not the
//! image of the circle's centre; the difference follows from the map and is added.

use rayon::prelude::*;

use super::fit::{CORNER, Crossing, ELLIPSE, Ellipse, Fitted, PixelLevel, fit};
use super::homography::{Homography, Point};
use super::{BoardImage, LEAST_CONTRAST, Seed};
use crate::board::Board;

/// Half the side of the window: share of a cell, and most pixels.
const WINDOW_CELLS: f64 = 0.6;
const MOST_WINDOW_PX: f64 = 12.0;
/// Blur at first, and range of the distance, in blurs and in pixels, kept from what is not the feature.
const FIRST_BLUR_PX: f64 = 1.0;
const MARGIN_BLURS: f64 = 2.5;
const MARGIN_PX: [f64; 2] = [1.0, 6.0];
/// Largest blur as a share of the window, largest residual as a share of the contrast, largest standard deviation.
const MOST_BLUR: f64 = 0.4;
const MOST_RESIDUAL: f64 = 0.35;
const MOST_SD_PX: f64 = 0.15;
/// Largest way from the seed or the prediction: share of a cell, and pixels.
const MOST_WAY_CELLS: f64 = 0.25;
const LEAST_WAY_PX: f64 = 1.5;
/// Neighbours from which the offset of a feature from the map is interpolated, and their farthest distance in cells.
const NEIGHBOURS: usize = 6;
const FARTHEST_CELLS: f64 = 2.1;
/// Seeds farther than this from the map do not count: pixels, and multiples of the median distance.
const OUTLIER_PX: f64 = 3.0;
const OUTLIER_MEDIANS: f64 = 8.0;
/// Rounds: the second finds features that the seeds lack, with the map of the first.
const ROUNDS: usize = 2;

/// A feature that was fitted.
#[derive(Clone, Copy, Debug)]
pub(super) struct Refined {
    pub(super) feature: usize,
    pub(super) at: Point,
    pub(super) sd_px: f64,
}

/// The fitted features, and the map from the board to the image.
pub(super) struct Refinement {
    pub(super) features: Vec<Refined>,
    pub(super) map: Option<Homography>,
}

/// Fits every feature of the board that may be in the image.
pub(super) fn refine(board: &Board, image: &BoardImage, seeds: &[Seed]) -> Refinement {
    let places: Vec<Point> = board.features().iter().map(|[x, y, _]| [*x, *y]).collect();
    let mut seeds = seeds.to_vec();
    let mut result = Refinement { features: Vec::new(), map: None };
    for _ in 0..ROUNDS {
        let Some(map) = robust_map(&places, &mut seeds) else { break };
        let guesses: Vec<Seed> =
            (0..places.len()).filter_map(|k| guess(&map, &places, &seeds, k, board.cell_mm())).collect();
        let window = Window { board, image, map: &map };
        let refined = guesses.par_iter().map(|guess| window.refined(*guess, places[guess.feature]));
        let features: Vec<Refined> = refined.collect::<Vec<_>>().into_iter().flatten().collect();
        seeds = features.iter().map(|r| Seed { feature: r.feature, at: r.at }).collect();
        result = Refinement { features, map: Some(map) };
    }
    result
}

/// The map of the seeds. Seeds far from it are removed.
fn robust_map(places: &[Point], seeds: &mut Vec<Seed>) -> Option<Homography> {
    let map = |seeds: &[Seed]| Homography::fit(&seeds.iter().map(|s| (places[s.feature], s.at)).collect::<Vec<_>>());
    let first = map(seeds)?;
    let distance = |s: &Seed| {
        let [x, y] = first.image(places[s.feature]);
        (s.at[0] - x).hypot(s.at[1] - y)
    };
    let mut distances: Vec<f64> = seeds.iter().map(distance).collect();
    let middle = distances.len() / 2;
    let median = *distances.select_nth_unstable_by(middle, f64::total_cmp).1;
    seeds.retain(|s| distance(s) <= OUTLIER_PX.max(OUTLIER_MEDIANS * median));
    map(seeds)
}

/// Where a feature is expected: at its seed, else where the map and the offsets of the nearest seeds say.
fn guess(map: &Homography, places: &[Point], seeds: &[Seed], feature: usize, cell: f64) -> Option<Seed> {
    if let Some(seed) = seeds.iter().find(|seed| seed.feature == feature) {
        return Some(*seed);
    }
    let [x, y] = places[feature];
    let distance = |s: &Seed| (places[s.feature][0] - x).hypot(places[s.feature][1] - y);
    let mut near: Vec<&Seed> = seeds.iter().filter(|s| distance(s) <= FARTHEST_CELLS * cell).collect();
    near.sort_by(|a, b| distance(a).total_cmp(&distance(b)).then(a.feature.cmp(&b.feature)));
    near.truncate(NEIGHBOURS);
    if near.is_empty() || !map.is_before([x, y]) {
        return None;
    }
    let (mut offset, mut weights) = ([0.0; 2], 0.0);
    for seed in near {
        let (weight, expected) = (1.0 / distance(seed), map.image(places[seed.feature]));
        offset = [0, 1].map(|k| offset[k] + weight * (seed.at[k] - expected[k]));
        weights += weight;
    }
    let expected = map.image([x, y]);
    Some(Seed { feature, at: [0, 1].map(|k| expected[k] + offset[k] / weights) })
}

/// Where windows are taken.
struct Window<'a> {
    board: &'a Board,
    image: &'a BoardImage,
    map: &'a Homography,
}

impl Window<'_> {
    fn refined(&self, guess: Seed, place: Point) -> Option<Refined> {
        let axes = self.map.axes(place);
        let lengths = axes.map(|axis| axis[0].hypot(axis[1]));
        let half_mm = lengths.map(|px_per_mm| (WINDOW_CELLS * self.board.cell_mm()).min(MOST_WINDOW_PX / px_per_mm));
        match self.board.circle_radius_mm() {
            None => self.corner(guess, place, axes, half_mm),
            Some(radius) => self.circle(guess, place, radius),
        }
        .filter(|refined| {
            let is_inside = |c: f64, size: usize| (0.0..size as f64 - 1.0).contains(&c);
            is_inside(refined.at[0], self.image.width_px()) && is_inside(refined.at[1], self.image.height_px())
        })
        .filter(|refined| {
            let way = (refined.at[0] - guess.at[0]).hypot(refined.at[1] - guess.at[1]);
            way <= LEAST_WAY_PX.max(MOST_WAY_CELLS * self.board.cell_mm() * lengths[0].min(lengths[1]))
        })
    }

    fn corner(&self, guess: Seed, place: Point, axes: [Point; 2], half_mm: [f64; 2]) -> Option<Refined> {
        let e = self.board.cell_mm() * 1e-3;
        let is_bright = self.board.brightness(place[0] + e, place[1] + e) > 0.5;
        let normal = |along: Point, to: Point| {
            let n = [-along[1], along[0]];
            let sign = (n[0] * to[0] + n[1] * to[1]).signum();
            (sign * n[1]).atan2(sign * n[0])
        };
        let shape = [normal(axes[0], axes[1]), normal(axes[1], axes[0])];
        // Distance of the line at x = 1 mm from the y axis, and of that at y = 1 mm from the x axis.
        let area = (axes[0][0] * axes[1][1] - axes[0][1] * axes[1][0]).abs();
        let px_per_mm = [area / axes[1][0].hypot(axes[1][1]), area / axes[0][0].hypot(axes[0][1])];
        let feature = Corner { is_bright, px_per_mm, inset_mm: self.board.marker_inset_mm() };
        // The first edge is the x axis.
        let markers_px = feature.inset_mm.map(|inset| [inset * px_per_mm[1], inset * px_per_mm[0]]);
        let edges = Crossing { markers_px, bright: if is_bright { 1.0 } else { -1.0 } };
        let first = self.pixels(guess.at, place, half_mm, FIRST_BLUR_PX, &feature);
        let first = fit::<2, CORNER>(&edges, &first, guess.at, shape, FIRST_BLUR_PX)?;
        let pixels = self.pixels(first.at, place, half_mm, first.blur, &feature);
        let fitted = fit::<2, CORNER>(&edges, &pixels, first.at, first.shape, first.blur)?;
        let window_px = [0, 1].map(|k| half_mm[k] * axes[k][0].hypot(axes[k][1]));
        let is_sound = (fitted.contrast > 0.0) == is_bright && is_sound(&fitted, window_px[0].min(window_px[1]));
        is_sound.then_some(Refined { feature: guess.feature, at: fitted.at, sd_px: fitted.sd_px })
    }

    fn circle(&self, guess: Seed, place: Point, radius: f64) -> Option<Refined> {
        let feature = Circle { radius };
        let half_mm = [radius + (self.board.cell_mm() / 2.0 - radius).max(0.3 * radius); 2];
        let (centre, shape) = self.map.ellipse(place, radius)?;
        let expected = self.map.image(place);
        let bias = [expected[0] - centre[0], expected[1] - centre[1]];
        let start = [guess.at[0] - bias[0], guess.at[1] - bias[1]];
        let first = self.pixels(start, place, half_mm, FIRST_BLUR_PX, &feature);
        let first = fit::<3, ELLIPSE>(&Ellipse, &first, start, shape, FIRST_BLUR_PX)?;
        let at = [first.at[0] + bias[0], first.at[1] + bias[1]];
        let pixels = self.pixels(at, place, half_mm, first.blur, &feature);
        let fitted = fit::<3, ELLIPSE>(&Ellipse, &pixels, first.at, first.shape, first.blur)?;
        let least_axis = 1.0 / (shape[0] + shape[2]).sqrt();
        let is_sound = fitted.contrast > 0.0 && is_sound(&fitted, 2.0 * least_axis);
        let at = [fitted.at[0] + bias[0], fitted.at[1] + bias[1]];
        is_sound.then_some(Refined { feature: guess.feature, at, sd_px: fitted.sd_px })
    }

    /// Pixels around a feature at `at` that lie within the window and whose surroundings are as `pattern` says.
    fn pixels(&self, at: Point, place: Point, half_mm: [f64; 2], blur: f64, feature: &impl Feature) -> Vec<PixelLevel> {
        let expected = self.map.image(place);
        let [ax, ay] = self.map.axes(place);
        let reach = [0, 1].map(|k| (ax[k] * half_mm[0]).abs() + (ay[k] * half_mm[1]).abs() + 1.0);
        let margin = (MARGIN_BLURS * blur).clamp(MARGIN_PX[0], MARGIN_PX[1]);
        let board_point = |p: Point| self.map.board([p[0] - at[0] + expected[0], p[1] - at[1] + expected[1]]);
        let is_as_expected = |p: Point| {
            let [x, y] = board_point(p);
            feature.is_bright([x - place[0], y - place[1]]) == (self.board.brightness(x, y) > 0.5)
        };
        let range = |k: usize, size: usize| {
            let first = (at[k] - reach[k]).ceil().max(0.0) as usize;
            first..((at[k] + reach[k]).floor() + 1.0).clamp(0.0, size as f64) as usize
        };
        let mut pixels = Vec::new();
        for v in range(1, self.image.height_px()) {
            for u in range(0, self.image.width_px()) {
                let p = [u as f64, v as f64];
                let [x, y] = board_point(p);
                if (x - place[0]).abs() > half_mm[0] || (y - place[1]).abs() > half_mm[1] {
                    continue;
                }
                if !feature.counts([x - place[0], y - place[1]], blur) {
                    continue;
                }
                let around = [[0.0, 0.0], [margin, 0.0], [-margin, 0.0], [0.0, margin], [0.0, -margin]];
                if around.iter().all(|d| is_as_expected([p[0] + d[0], p[1] + d[1]])) {
                    pixels.push(PixelLevel { at: p, level: self.image.at(u, v) });
                }
            }
        }
        pixels
    }
}

/// What a fit takes for the pattern around a feature. Offsets from the feature are in millimetres.
trait Feature {
    /// Whether the pattern is bright there.
    fn is_bright(&self, offset: Point) -> bool;
    /// Whether a pixel there counts.
    fn counts(&self, offset: Point, blur: f64) -> bool;
}

/// Four quarters, with markers in the bright ones of a ChArUco board.
struct Corner {
    /// Whether the quarter towards positive x and y is bright.
    is_bright: bool,
    px_per_mm: [f64; 2],
    inset_mm: Option<f64>,
}

impl Feature for Corner {
    fn is_bright(&self, [x, y]: Point) -> bool {
        (x * y > 0.0) == self.is_bright && self.inset_mm.is_none_or(|inset| x.abs().min(y.abs()) < inset)
    }

    /// Of the markers only the outer half of the blurred edge counts: their place depends on the tilt, which is known
    /// less well.
    fn counts(&self, [x, y]: Point, blur: f64) -> bool {
        let is_marker = self.inset_mm.is_some_and(|inset| {
            let limit = self.px_per_mm.map(|scale| inset - blur / scale);
            x.abs() > limit[0] && y.abs() > limit[1]
        });
        (x * y > 0.0) != self.is_bright || !is_marker
    }
}

/// A dark circle.
struct Circle {
    radius: f64,
}

impl Feature for Circle {
    fn is_bright(&self, [x, y]: Point) -> bool {
        x.hypot(y) > self.radius
    }

    fn counts(&self, _: Point, _: f64) -> bool {
        true
    }
}

fn is_sound<const S: usize>(fitted: &Fitted<S>, window_px: f64) -> bool {
    fitted.blur <= MOST_BLUR * window_px
        && 2.0 * fitted.contrast.abs() >= LEAST_CONTRAST
        && fitted.residual <= MOST_RESIDUAL * fitted.contrast.abs()
        && fitted.sd_px <= MOST_SD_PX
}
