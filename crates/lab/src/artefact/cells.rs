//! Residuals in square cells of the picture of an artefact: what is noise, and what is form.
//!
//! In each cell a small plane is fitted to the residuals. What scatters about it is noise; the mean of the cell is form.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Vector3};

use super::region::pitch;
use super::statistics::quantile;

/// Mean number of points of a cell, and the fewest with which it counts.
pub(super) const CELL_POINTS: f64 = 64.0;
const MIN_POINTS: usize = 20;

/// A cell with enough points.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Cell {
    /// Column and row, which count cells of this width from the origin of the picture.
    pub at: [i64; 2],
    /// Points in it.
    pub points: usize,
    /// Mean distance from the fitted surface, positive towards the scanner, metres.
    pub mean_m: f64,
    /// Standard deviation about a small plane, metres.
    pub sd_m: f64,
}

/// The cells of a picture.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Cells {
    /// Width of a cell, in the unit of the picture.
    pub width: f64,
    /// Those with enough points, by column and row.
    pub cells: Vec<Cell>,
}

/// Sums of a cell: of points, and of the products of (1, x, y) and the residual.
#[derive(Clone, Copy, Default)]
struct Sums {
    points: usize,
    normal: Matrix3<f64>,
    right: Vector3<f64>,
    squares: f64,
}

impl Cells {
    /// Sorts residuals into cells. Their width depends on the density of the points.
    pub(super) fn new(places: &[[f64; 2]], residuals_m: &[f64]) -> Self {
        Self::of_width(pitch(places.iter().copied(), CELL_POINTS), places, residuals_m)
    }

    /// Sorts residuals into cells of a width.
    pub(super) fn of_width(width: f64, places: &[[f64; 2]], residuals_m: &[f64]) -> Self {
        let mut sums: BTreeMap<[i64; 2], Sums> = BTreeMap::new();
        for (place, residual_m) in places.iter().zip(residuals_m) {
            let at = place.map(|value| (value / width).floor());
            let [x, y] = [0, 1].map(|i| place[i] / width - at[i] - 0.5);
            let sum = sums.entry(at.map(|value| value as i64)).or_default();
            let row = Vector3::new(1.0, x, y);
            sum.points += 1;
            sum.normal += row * row.transpose();
            sum.right += row * *residual_m;
            sum.squares += residual_m * residual_m;
        }
        let cells = sums.into_iter().filter_map(|(at, sums)| sums.cell(at)).collect();
        Self { width, cells }
    }

    /// Quantile of the standard deviations of the cells, metres: the noise of a point.
    pub(super) fn noise_m(&self, share: f64) -> f64 {
        let mut sds: Vec<f64> = self.cells.iter().map(|cell| cell.sd_m).collect();
        quantile(&mut sds, share).unwrap_or_default()
    }

    /// Root mean square of the means of the cells without what the noise of their points explains, metres.
    pub(super) fn form_rms_m(&self) -> f64 {
        let count = self.cells.len().max(1) as f64;
        let mean = self.cells.iter().map(|cell| cell.mean_m).sum::<f64>() / count;
        let square = |cell: &Cell| (cell.mean_m - mean).powi(2) - cell.sd_m.powi(2) / cell.points as f64;
        (self.cells.iter().map(square).sum::<f64>() / count).max(0.0).sqrt()
    }
}

impl Sums {
    fn cell(&self, at: [i64; 2]) -> Option<Cell> {
        if self.points < MIN_POINTS {
            return None;
        }
        let fitted = self.normal.try_inverse()? * self.right;
        let squares = (self.squares - fitted.dot(&self.right)).max(0.0);
        let sd_m = (squares / (self.points - 3) as f64).sqrt();
        Some(Cell { at, points: self.points, mean_m: self.right[0] / self.points as f64, sd_m })
    }
}

/// The cells of several windows with the same width, each the mean of all of its points.
#[must_use]
pub fn merged<'a>(windows: impl Iterator<Item = &'a [Cell]>) -> Vec<Cell> {
    let mut sums: BTreeMap<[i64; 2], (usize, f64, f64)> = BTreeMap::new();
    for cell in windows.flatten() {
        let (points, mean, variance) = sums.entry(cell.at).or_default();
        let weight = cell.points as f64;
        *points += cell.points;
        *mean += weight * cell.mean_m;
        *variance += weight * cell.sd_m.powi(2);
    }
    let cell = |(at, (points, mean, variance)): ([i64; 2], (usize, f64, f64))| {
        let weight = points as f64;
        Cell { at, points, mean_m: mean / weight, sd_m: (variance / weight).sqrt() }
    };
    sums.into_iter().map(cell).collect()
}
