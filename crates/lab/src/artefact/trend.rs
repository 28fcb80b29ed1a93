//! The smooth bend of a plate: the polynomial of third degree that is nearest to the means of its cells.

use nalgebra::{SMatrix, SVector};

use super::cells::{Cell, Cells};
use super::statistics::{range, robust_sd};

/// Number of terms of third degree in two variables.
const TERMS: usize = 10;
/// Cells farther from the polynomial than this many robust standard deviations do not take part in it.
const FAR_SDS: f64 = 5.0;
/// Rounds of fitting and leaving cells out.
const ROUNDS: usize = 4;

/// How a surface that should be flat is bent.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Bend {
    /// Highest minus lowest value of the polynomial on the plate, metres.
    pub range_m: f64,
    /// Share of the variance of the form that it explains.
    pub share: f64,
    /// Range that the noise of the points alone would give, metres.
    pub noise_m: f64,
}

/// A polynomial of third degree over a picture.
#[derive(Clone, Debug)]
pub(super) struct Trend {
    centre: [f64; 2],
    half: f64,
    terms: SVector<f64, TERMS>,
}

impl Trend {
    /// The polynomial nearest to the means of the cells; `None` for too few cells.
    pub(super) fn new(cells: &Cells) -> Option<Self> {
        let places: Vec<[f64; 2]> = cells.cells.iter().map(|cell| place(cell, cells.width)).collect();
        let bounds = [0, 1].map(|axis| {
            let values = || places.iter().map(|place| place[axis]);
            (values().fold(f64::INFINITY, f64::min), values().fold(f64::NEG_INFINITY, f64::max))
        });
        let centre = bounds.map(|(low, high)| f64::midpoint(low, high));
        let half = bounds.iter().map(|(low, high)| (high - low) / 2.0).fold(0.0, f64::max);
        let mut trend = Self { centre, half: half.max(f64::MIN_POSITIVE), terms: SVector::zeros() };
        let mut kept: Vec<usize> = (0..places.len()).collect();
        for _ in 0..ROUNDS {
            trend.terms = trend.fitted(&cells.cells, &places, &kept)?;
            let misfit = |i: usize| cells.cells[i].mean_m - trend.at(&places[i]);
            let sd = robust_sd((0..places.len()).map(misfit));
            kept = (0..places.len()).filter(|&i| misfit(i).abs() <= FAR_SDS * sd).collect();
        }
        Some(trend)
    }

    fn fitted(&self, cells: &[Cell], places: &[[f64; 2]], kept: &[usize]) -> Option<SVector<f64, TERMS>> {
        if kept.len() < 2 * TERMS {
            return None;
        }
        let (mut normal, mut right) = (SMatrix::<f64, TERMS, TERMS>::zeros(), SVector::<f64, TERMS>::zeros());
        for &i in kept {
            let row = self.row(&places[i]);
            normal += row * row.transpose();
            right += row * cells[i].mean_m;
        }
        normal.try_inverse().map(|inverse| inverse * right)
    }

    fn row(&self, place: &[f64; 2]) -> SVector<f64, TERMS> {
        let [x, y] = [0, 1].map(|i| (place[i] - self.centre[i]) / self.half);
        SVector::from([1.0, x, y, x * x, x * y, y * y, x * x * x, x * x * y, x * y * y, y * y * y])
    }

    /// Its value at a place, metres.
    pub(super) fn at(&self, place: &[f64; 2]) -> f64 {
        self.row(place).dot(&self.terms)
    }

    /// How large it is on the cells.
    pub(super) fn bend(&self, cells: &Cells) -> Bend {
        let value = |cell: &Cell| self.at(&place(cell, cells.width));
        let square = |of: &dyn Fn(&Cell) -> f64| cells.cells.iter().map(|cell| of(cell).powi(2)).sum::<f64>();
        let (all, left) = (square(&|cell| cell.mean_m), square(&|cell| cell.mean_m - value(cell)));
        let variance = |cell: &Cell| cell.sd_m.powi(2) / cell.points as f64;
        let mean_variance = cells.cells.iter().map(variance).sum::<f64>() / cells.cells.len().max(1) as f64;
        // The variance of a fitted value is that of a cell times terms per cell; its range on a plate is about four sd.
        let noise_m = 4.0 * (mean_variance * TERMS as f64 / cells.cells.len().max(1) as f64).sqrt();
        let share = if all > 0.0 { (1.0 - left / all).max(0.0) } else { 0.0 };
        Bend { range_m: range(cells.cells.iter().map(value)), share, noise_m }
    }
}

/// The middle of a cell.
fn place(cell: &Cell, width: f64) -> [f64; 2] {
    cell.at.map(|index| (index as f64 + 0.5) * width)
}
