//! The projector's coordinates around a corner, as a quadratic of the camera's pixel.
//!
//! All pixels of a window of about one square of the board take part, weighted by the square of their modulation, which is
//! the inverse of the variance of their phase. Pixels across a black-white edge see mostly its white side, so their phase
//! belongs to a place up to a quarter of a pixel towards it. Around a corner white lies opposite white, so these shifts
//! cancel in the value at the corner.

use fringeflow::geometry::Pixel;
use nalgebra::{Matrix2x6, Matrix6, Vector6};

use super::coordinates::Coordinates;
use crate::observations::PhasePatch;

/// Number of coefficients of a quadratic.
const COEFFICIENTS: usize = 6;
/// Least pixels of a window, as many for each coefficient as keep noise apart from shape.
const LEAST_PIXELS: usize = 5 * COEFFICIENTS;
/// Rounds in which pixels with a wrong fringe order are found and left out.
const ROUNDS: usize = 4;
/// Residuals beyond this multiple of their root mean square are left out.
const OUTLIER_SDS: f64 = 4.0;

/// Fits the coordinates of both directions around a pixel of an image `size_px` wide and high; `None` if too few pixels
/// have a phase, or the window is not inside the image.
pub(super) fn fit(
    directions: &[Coordinates; 2],
    size_px: [usize; 2],
    feature: usize,
    centre: Pixel,
    radius_px: f64,
) -> Option<PhasePatch> {
    let mut coefficients = Matrix2x6::zeros();
    let mut sd_px = [0.0; 2];
    for (k, direction) in directions.iter().enumerate() {
        let (row, sd) = fit_direction(direction, size_px, centre, radius_px)?;
        coefficients.set_row(k, &row.transpose());
        sd_px[k] = sd;
    }
    Some(PhasePatch { feature, centre, radius_px, coefficients, sd_px })
}

/// A pixel of a window: terms of the quadratic, coordinate and weight.
struct WindowPixel {
    terms: Vector6<f64>,
    position_px: f64,
    weight: f64,
}

fn fit_direction(
    coordinates: &Coordinates,
    size_px: [usize; 2],
    centre: Pixel,
    radius_px: f64,
) -> Option<(Vector6<f64>, f64)> {
    let mut pixels = window(coordinates, size_px, centre, radius_px)?;
    for round in 0..ROUNDS {
        if pixels.len() < LEAST_PIXELS {
            return None;
        }
        let (mut normal, mut right) = (Matrix6::zeros(), Vector6::zeros());
        for pixel in &pixels {
            normal += pixel.terms * pixel.terms.transpose() * pixel.weight;
            right += pixel.terms * (pixel.position_px * pixel.weight);
        }
        let inverse = normal.try_inverse()?;
        let solution = inverse * right;
        let residual = |pixel: &WindowPixel| pixel.position_px - solution.dot(&pixel.terms);
        let square: f64 = pixels.iter().map(|pixel| pixel.weight * residual(pixel).powi(2)).sum();
        let variance = square / (pixels.len() - COEFFICIENTS) as f64;
        let before = pixels.len();
        let limit = OUTLIER_SDS * OUTLIER_SDS * variance;
        pixels.retain(|pixel| pixel.weight * residual(pixel).powi(2) <= limit);
        if pixels.len() == before || round + 1 == ROUNDS {
            let sd = (variance * inverse[(0, 0)]).sqrt();
            return (sd.is_finite() && sd > 0.0).then_some((solution, sd));
        }
    }
    None
}

/// The pixels of the window that have a coordinate; `None` if the window reaches over the border of the image, where it
/// would not be symmetric.
fn window(coordinates: &Coordinates, size_px: [usize; 2], centre: Pixel, radius_px: f64) -> Option<Vec<WindowPixel>> {
    let [width, height] = size_px;
    let range = |c: f64, size: usize| {
        let (low, high) = ((c - radius_px).ceil(), (c + radius_px).floor());
        (low >= 0.0 && high <= size as f64 - 1.0).then_some(low as usize..=high as usize)
    };
    let (columns, rows) = (range(centre.x, width)?, range(centre.y, height)?);
    let mut pixels = Vec::new();
    for v in rows {
        for u in columns.clone() {
            let Some((position_px, modulation)) = coordinates.at(v * width + u) else { continue };
            let (x, y) = ((u as f64 - centre.x) / radius_px, (v as f64 - centre.y) / radius_px);
            if x * x + y * y <= 1.0 {
                let terms = Vector6::new(1.0, x, y, x * x, x * y, y * y);
                pixels.push(WindowPixel { terms, position_px, weight: modulation * modulation });
            }
        }
    }
    Some(pixels)
}
