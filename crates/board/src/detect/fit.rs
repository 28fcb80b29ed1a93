//! Least squares of a model of the grey levels around a feature: Gauss–Newton steps with damping.
//!
//! A feature is the crossing of two edges or an ellipse, blurred by a Gaussian, in light that changes linearly:
//! `I = (1 + g·d) · (m + c·E)`, where `d` is the offset from the feature and `E` goes from −1 to 1. The position is the
//! one that explains all pixels of the window best, so it has about the smallest standard deviation that noise allows.

use nalgebra::{SMatrix, SVector};

use super::homography::Point;

/// A pixel of a window: its place and its grey level.
#[derive(Clone, Copy, Debug)]
pub(super) struct PixelLevel {
    pub(super) at: Point,
    pub(super) level: f64,
}

/// `E` at an offset from a feature, and its derivatives.
pub(super) struct EdgeValue<const S: usize> {
    value: f64,
    by_shape: [f64; S],
    by_offset: Point,
    by_blur: f64,
}

/// The edges of a feature, with `S` parameters of their shape.
pub(super) trait Edges<const S: usize> {
    /// `E` at offset `d`.
    fn value(&self, shape: &[f64; S], blur: f64, d: Point) -> EdgeValue<S>;
}

/// What was fitted.
#[derive(Clone, Copy, Debug)]
pub(super) struct Fitted<const S: usize> {
    pub(super) at: Point,
    pub(super) shape: [f64; S],
    /// Standard deviation of the blur, pixels.
    pub(super) blur: f64,
    /// Half the difference between bright and dark, grey levels.
    pub(super) contrast: f64,
    /// Root mean square of the residuals, grey levels.
    pub(super) residual: f64,
    /// Standard deviation of the position that the residuals tell, pixels.
    pub(super) sd_px: f64,
}

/// Steps after which a fit that has not settled is given up, and the step at which it has, pixels.
const MOST_STEPS: usize = 30;
const SETTLED_PX: f64 = 5e-4;
/// Share of a marker's blurred edge that does not count.
const NEGLIGIBLE: f64 = 1e-4;
/// Range of the blur, pixels.
const BLUR_PX: [f64; 2] = [0.25, 8.0];

/// Fits a feature from a first guess; `None` if the window does not determine it.
///
/// The `N` parameters are those of the shape, then x, y, blur, m, c, and the slope of the light along x and y.
pub(super) fn fit<const S: usize, const N: usize>(
    edges: &impl Edges<S>,
    pixels: &[PixelLevel],
    at: Point,
    shape: [f64; S],
    blur: f64,
) -> Option<Fitted<S>> {
    const { assert!(N == S + 7) };
    if pixels.len() < 3 * N {
        return None;
    }
    let mut p = SVector::<f64, N>::zeros();
    p.as_mut_slice()[..S].copy_from_slice(&shape);
    p[S] = at[0];
    p[S + 1] = at[1];
    p[S + 2] = blur;
    let (m, c) = first_levels(edges, pixels, at, &shape, blur)?;
    p[S + 3] = m;
    p[S + 4] = c;
    let normal = |p: &SVector<f64, N>| {
        let mut matrix = SMatrix::<f64, N, N>::zeros();
        let mut vector = SVector::<f64, N>::zeros();
        let mut square = 0.0;
        let mut shape = [0.0; S];
        shape.copy_from_slice(&p.as_slice()[..S]);
        for pixel in pixels {
            let d = [pixel.at[0] - p[S], pixel.at[1] - p[S + 1]];
            let e = edges.value(&shape, p[S + 2], d);
            let light = 1.0 + p[S + 5] * d[0] + p[S + 6] * d[1];
            let reflected = p[S + 3] + p[S + 4] * e.value;
            let mut j = SVector::<f64, N>::zeros();
            for k in 0..S {
                j[k] = light * p[S + 4] * e.by_shape[k];
            }
            j[S] = -light * p[S + 4] * e.by_offset[0] - p[S + 5] * reflected;
            j[S + 1] = -light * p[S + 4] * e.by_offset[1] - p[S + 6] * reflected;
            j[S + 2] = light * p[S + 4] * e.by_blur;
            j[S + 3] = light;
            j[S + 4] = light * e.value;
            j[S + 5] = reflected * d[0];
            j[S + 6] = reflected * d[1];
            let residual = pixel.level - light * reflected;
            matrix.ger(1.0, &j, &j, 1.0);
            vector.axpy(residual, &j, 1.0);
            square += residual * residual;
        }
        (matrix, vector, square)
    };
    let (mut matrix, mut vector, mut square) = normal(&p);
    let mut damping = 1e-4;
    let mut is_settled = false;
    for _ in 0..MOST_STEPS {
        let mut damped = matrix;
        for k in 0..N {
            damped[(k, k)] *= 1.0 + damping;
        }
        let step = damped.cholesky()?.solve(&vector);
        let mut next = p + step;
        next[S + 2] = next[S + 2].clamp(BLUR_PX[0], BLUR_PX[1]);
        let (next_matrix, next_vector, next_square) = normal(&next);
        if next_square.is_nan() || next_square > square * (1.0 + 1e-12) {
            damping *= 10.0;
            if damping > 1e6 {
                break;
            }
            continue;
        }
        damping = (damping / 10.0).max(1e-9);
        let moved = step[S].hypot(step[S + 1]);
        (p, matrix, vector, square) = (next, next_matrix, next_vector, next_square);
        if moved < SETTLED_PX {
            is_settled = true;
            break;
        }
    }
    let variance = square / (pixels.len() - N) as f64;
    let inverse = matrix.cholesky()?.inverse();
    let sd_px = (variance * (inverse[(S, S)] + inverse[(S + 1, S + 1)]) / 2.0).sqrt();
    let mut shape = [0.0; S];
    shape.copy_from_slice(&p.as_slice()[..S]);
    let (at, blur, contrast) = ([p[S], p[S + 1]], p[S + 2], p[S + 4]);
    let is_sound = is_settled && p.iter().all(|v| v.is_finite()) && sd_px.is_finite();
    is_sound.then_some(Fitted { at, shape, blur, contrast, residual: variance.sqrt(), sd_px })
}

/// Parameters of a corner and of an ellipse.
pub(super) const CORNER: usize = 9;
pub(super) const ELLIPSE: usize = 10;

/// Mean level and half the difference of bright and dark that explain the pixels best.
fn first_levels<const S: usize>(
    edges: &impl Edges<S>,
    pixels: &[PixelLevel],
    at: Point,
    shape: &[f64; S],
    blur: f64,
) -> Option<(f64, f64)> {
    let n = pixels.len() as f64;
    let [mut e1, mut e2, mut l1, mut le] = [0.0; 4];
    for pixel in pixels {
        let e = edges.value(shape, blur, [pixel.at[0] - at[0], pixel.at[1] - at[1]]).value;
        e1 += e / n;
        e2 += e * e / n;
        l1 += pixel.level / n;
        le += pixel.level * e / n;
    }
    let spread = e2 - e1 * e1;
    let contrast = (le - l1 * e1) / spread;
    (spread > 1e-3).then_some((l1 - contrast * e1, contrast))
}

/// Two straight edges that cross: `E = erf(a) · erf(b)` with the distances a and b from them in units of the blur.
/// Shape: the angles of the normals of both edges.
///
/// In the bright quarters of a ChArUco board stand markers, black squares again at some distance from both edges.
pub(super) struct Crossing {
    /// Distances of the markers from the edges, pixels; `None` without markers.
    pub(super) markers_px: Option<Point>,
    /// Sign of `E` in the bright quarters.
    pub(super) bright: f64,
}

impl Edges<2> for Crossing {
    fn value(&self, shape: &[f64; 2], blur: f64, d: Point) -> EdgeValue<2> {
        let normals = shape.map(f64::sin_cos).map(|(sin, cos)| [cos, sin]);
        let distances = normals.map(|n| n[0] * d[0] + n[1] * d[1]);
        let [a, b] = distances.map(|distance| blurred_step(distance, blur));
        let mut sum =
            Products { value: a.0 * b.0, by_distance: [a.1 * b.0, a.0 * b.1], by_blur: a.2 * b.0 + a.0 * b.2 };
        if let Some(inset) = self.markers_px {
            for side in [1.0, -1.0] {
                let sides = [side, side * self.bright];
                let [a, b] = [0, 1].map(|k| {
                    let (value, slope, by_blur) = blurred_step(sides[k] * distances[k] - inset[k], blur);
                    (0.5 + 0.5 * value, 0.5 * sides[k] * slope, 0.5 * by_blur)
                });
                if a.0 * b.0 < NEGLIGIBLE {
                    continue;
                }
                let black = -2.0 * self.bright;
                sum.value += black * a.0 * b.0;
                sum.by_distance[0] += black * a.1 * b.0;
                sum.by_distance[1] += black * a.0 * b.1;
                sum.by_blur += black * (a.2 * b.0 + a.0 * b.2);
            }
        }
        let by_distance = sum.by_distance;
        EdgeValue {
            value: sum.value,
            by_shape: [0, 1].map(|k| by_distance[k] * (normals[k][0] * d[1] - normals[k][1] * d[0])),
            by_offset: [0, 1].map(|i| by_distance[0] * normals[0][i] + by_distance[1] * normals[1][i]),
            by_blur: sum.by_blur,
        }
    }
}

/// A sum of products of two steps, and its derivatives.
struct Products {
    value: f64,
    by_distance: [f64; 2],
    by_blur: f64,
}

/// An ellipse, bright outside: shape is the upper triangle of A in `dᵀ A d = 1`.
pub(super) struct Ellipse;

impl Edges<3> for Ellipse {
    fn value(&self, shape: &[f64; 3], blur: f64, d: Point) -> EdgeValue<3> {
        let [a, b, c] = *shape;
        let g = [a * d[0] + b * d[1], b * d[0] + c * d[1]];
        let q = (d[0] * g[0] + d[1] * g[1]).max(1e-9);
        let (r, slope_of_q) = (q.sqrt(), g[0].hypot(g[1]).max(1e-9));
        // Distance from the ellipse to first order: (r − 1) over the slope of r, with r² = q.
        let distance = (q - r) / slope_of_q;
        let (value, slope, by_blur) = blurred_step(distance, blur);
        // Of a change of q and of g.
        let by = |dq: f64, dg: Point| {
            let change_of_slope = (g[0] * dg[0] + g[1] * dg[1]) / slope_of_q;
            slope * (dq * (1.0 - 0.5 / r) - distance * change_of_slope) / slope_of_q
        };
        EdgeValue {
            value,
            by_shape: [by(d[0] * d[0], [d[0], 0.0]), by(2.0 * d[0] * d[1], [d[1], d[0]]), by(d[1] * d[1], [0.0, d[1]])],
            by_offset: [by(2.0 * g[0], [a, b]), by(2.0 * g[1], [b, c])],
            by_blur,
        }
    }
}

/// A step from −1 to 1 with a Gaussian blur, and its derivatives with respect to distance and blur.
fn blurred_step(distance: f64, blur: f64) -> (f64, f64, f64) {
    let t = distance / blur;
    let slope = (2.0 / std::f64::consts::PI).sqrt() * (-0.5 * t * t).exp() / blur;
    (erf(t * std::f64::consts::FRAC_1_SQRT_2), slope, -slope * t)
}

/// The error function, within 1.5e-7 (Abramowitz and Stegun, 7.1.26).
fn erf(x: f64) -> f64 {
    let t = 1.0 / (1.0 + 0.327_591_1 * x.abs());
    let poly =
        t * (0.254_829_592 + t * (-0.284_496_736 + t * (1.421_413_741 + t * (-1.453_152_027 + t * 1.061_405_429))));
    (1.0 - poly * (-x * x).exp()).copysign(x)
}
