//! Circles of a grid: dark blobs that are ellipses, joined to a lattice by the crate `projective-grid`.

use nalgebra::Point2;
use projective_grid::{DetectionRequest, Evidence, LatticeKind, PointFeature, detect_grid};

use super::homography::{Homography, Point};
use super::placement::{Unplaced, placed};
use super::{BoardImage, NotDetected, Seed};
use crate::board::{Board, Pattern};

/// Radii over which the local mean is taken, as shares of the image width. A small one suits small circles.
const RADII: [f64; 3] = [0.04, 0.1, 0.25];
/// Least difference of a blob from the local mean, as a share of the contrast of the image.
const LEAST_DEPTH: f64 = 0.08;
/// Range of the area of a blob, pixels, and as a share of the image.
const LEAST_AREA_PX: usize = 20;
const MOST_AREA: f64 = 0.05;
/// Largest deviation of its area from that of the ellipse with the same moments, and smallest ratio of its axes.
const ELLIPSE_TOLERANCE: f64 = 0.12;
const LEAST_AXES: f64 = 0.2;
/// Largest distance of a blob from its point of the lattice, and least share of the circles that must be found as blobs.
const OFF_LATTICE: f64 = 0.25;
const LEAST_SHARE: f64 = 0.8;

/// Centres of the circles. All must be seen.
pub(super) fn circles(board: &Board, image: &BoardImage) -> Result<Vec<Seed>, NotDetected> {
    let (Pattern::Circles { circles: wanted, .. } | Pattern::AsymmetricCircles { circles: wanted, .. }) =
        *board.pattern()
    else {
        return Ok(Vec::new());
    };
    let mut best = NotDetected::Nothing { found: 0, elements: "circles" };
    for radius in RADII {
        let blobs = blobs(image, (radius * image.width_px() as f64) as usize);
        let points = lattice(&blobs);
        match placed(board, image, &points) {
            Ok(placed) if placed.seeds.len() as f64 >= LEAST_SHARE * board.features().len() as f64 => {
                return Ok(placed.seeds);
            }
            Ok(placed) => best = NotDetected::Nothing { found: placed.seeds.len(), elements: "circles" },
            Err(Unplaced::OtherSize { found })
                if matches!(board.pattern(), Pattern::Circles { .. }) && points.len() > 8 =>
            {
                best = NotDetected::OtherSize { found, wanted, elements: "circles" };
            }
            Err(_) => best = NotDetected::Nothing { found: blobs.len(), elements: "circles" },
        }
    }
    Err(best)
}

/// Lattice coordinates of the blobs that lie on one.
fn lattice(blobs: &[Point]) -> Vec<([i32; 2], Point)> {
    let point = |(k, at): (usize, &Point)| PointFeature::new(k, Point2::new(at[0] as f32, at[1] as f32));
    let features: Vec<PointFeature> = blobs.iter().enumerate().map(point).collect();
    let request = DetectionRequest::new(LatticeKind::Square, Evidence::Positions(&features));
    let Ok(found) = detect_grid(request) else { return Vec::new() };
    let entries = found.grid().entries().iter();
    let points = entries.map(|entry| ([entry.coord.u, entry.coord.v], blobs[entry.source_index])).collect();
    completed(points, blobs)
}

/// Adds blobs that lie on the lattice too. The crate leaves out some at the ends of tilted boards.
fn completed(mut points: Vec<([i32; 2], Point)>, blobs: &[Point]) -> Vec<([i32; 2], Point)> {
    let pairs: Vec<(Point, Point)> = points.iter().map(|(cell, at)| (cell.map(f64::from), *at)).collect();
    let Some(map) = Homography::fit(&pairs) else { return points };
    for blob in blobs {
        let place = map.board(*blob);
        let cell = place.map(|c| c.round() as i32);
        let is_near = [0, 1].iter().all(|&k| (place[k] - f64::from(cell[k])).abs() < OFF_LATTICE);
        if is_near && points.iter().all(|(other, at)| *other != cell && at != blob) {
            points.push((cell, *blob));
        }
    }
    points
}

/// Centres of the dark ellipses.
fn blobs(image: &BoardImage, radius: usize) -> Vec<Point> {
    let (w, h) = (image.width_px(), image.height_px());
    let means = image.local_means(radius.max(4));
    let [dark, bright] = image.range();
    let depth = LEAST_DEPTH * (bright - dark);
    let is_dark = |k: usize| image.at(k % w, k / w) < f64::from(means[k]) - depth;
    let mut is_free: Vec<bool> = (0..w * h).map(is_dark).collect();
    let mut centres = Vec::new();
    let mut stack = Vec::new();
    for start in 0..w * h {
        if !std::mem::take(&mut is_free[start]) {
            continue;
        }
        stack.push(start);
        let mut moments = Moments::default();
        while let Some(k) = stack.pop() {
            let (u, v) = (k % w, k / w);
            moments.add(u as f64, v as f64, u == 0 || v == 0 || u + 1 == w || v + 1 == h);
            let neighbours = [
                (u > 0).then(|| k - 1),
                (u + 1 < w).then_some(k + 1),
                (v > 0).then(|| k - w),
                (v + 1 < h).then_some(k + w),
            ];
            for next in neighbours.into_iter().flatten() {
                if std::mem::take(&mut is_free[next]) {
                    stack.push(next);
                }
            }
        }
        centres.extend(moments.centre_of_ellipse(MOST_AREA * (w * h) as f64));
    }
    centres
}

/// Sums over the pixels of a blob.
#[derive(Default)]
struct Moments {
    n: f64,
    x: f64,
    y: f64,
    xx: f64,
    xy: f64,
    yy: f64,
    is_cut: bool,
}

impl Moments {
    fn add(&mut self, x: f64, y: f64, is_at_border: bool) {
        self.n += 1.0;
        self.x += x;
        self.y += y;
        self.xx += x * x;
        self.xy += x * y;
        self.yy += y * y;
        self.is_cut |= is_at_border;
    }

    /// The centre, if the blob is an ellipse.
    fn centre_of_ellipse(&self, most_area: f64) -> Option<Point> {
        if self.is_cut || self.n < LEAST_AREA_PX as f64 || self.n > most_area {
            return None;
        }
        let (x, y) = (self.x / self.n, self.y / self.n);
        // A pixel is a square, which adds a twelfth.
        let (xx, yy) = (self.xx / self.n - x * x + 1.0 / 12.0, self.yy / self.n - y * y + 1.0 / 12.0);
        let xy = self.xy / self.n - x * y;
        let determinant = xx * yy - xy * xy;
        let area = 4.0 * std::f64::consts::PI * determinant.max(0.0).sqrt();
        let root = ((xx - yy).powi(2) / 4.0 + xy * xy).sqrt();
        let axes = ((xx + yy) / 2.0 - root) / ((xx + yy) / 2.0 + root);
        let is_ellipse = (self.n / area - 1.0).abs() < ELLIPSE_TOLERANCE && axes.max(0.0).sqrt() > LEAST_AXES;
        is_ellipse.then_some([x, y])
    }
}
