//! Estimates the effect of a smooth error of the surfaces on the pose: calibration errors, or motion within a window.
//!
//! Such an error is far below the noise of a point. But noise averages out over thousands of points, and a smooth error
//! does not: it has only as many independent values as areas over which it changes. Residuals are therefore averaged
//! over cells of the image, and modelled as a Gaussian field plus noise (Cressie 1993, "Statistics for Spatial Data"):
//! covariance `σ²·exp(−d²/2ℓ²)` between cells at a distance d, and noise according to the weights of their points. A
//! grid search finds σ and ℓ with the highest restricted likelihood (Patterson and Thompson 1971, "Recovery of
//! inter-block information when block sizes are unequal"). The likelihood is restricted because the fitted pose has
//! removed six degrees of freedom.

use nalgebra::{Cholesky, DMatrix, DVector, Dyn, Matrix6, Vector6};

use super::association::Pair;
use super::equations::weight;

/// Cells along the longer side of the visible surface.
const CELLS_ACROSS: usize = 8;
/// Minimum number of pairs in a cell.
const MIN_PAIRS: usize = 8;
/// Minimum number of cells: well more than the six parameters of a pose.
const MIN_CELLS: usize = 16;
/// Lengths ℓ of the grid, cells. Longer ones resemble a change of the pose, so residuals cannot show them.
const LENGTHS: [f64; 4] = [1.0, 1.5, 2.25, 3.4];
/// Variances σ² of the grid, in units of the median noise variance of a cell.
const VARIANCES: [f64; 8] = [0.0625, 0.25, 1.0, 4.0, 16.0, 64.0, 256.0, 1024.0];
/// Minimum improvement of the misfit by a smooth error: twice its two parameters (Akaike 1974, "A new look at the
/// statistical model identification").
const MIN_GAIN: f64 = 4.0;

/// Sums over the pairs of a cell.
#[derive(Clone, Copy, Default)]
struct Cell {
    pairs: usize,
    /// `Σ w`.
    weight: f64,
    /// `Σ w r`.
    residual: f64,
    /// `Σ w J`: change of the gradient by an error that all points of the cell share.
    row: Vector6<f64>,
    /// Position in the image, cells.
    position: [f64; 2],
}

/// Returns the covariance of the gradient `Σ w r J` caused by a smooth error; zero if there is none.
pub(super) fn gradient_covariance(pairs: &[Vec<Pair>], scale: f64) -> Matrix6<f64> {
    let cells = cells(pairs, scale);
    if cells.len() < MIN_CELLS {
        return Matrix6::zeros();
    }
    let field = Field::new(&cells, scale);
    // Start without a smooth error. Its two parameters must reduce the misfit by more than MIN_GAIN.
    let mut best = (field.misfit(&DMatrix::zeros(cells.len(), cells.len())) - MIN_GAIN, None);
    for length in LENGTHS {
        let correlation = correlation(&cells, length);
        for variance in VARIANCES.map(|times| times * field.median_noise) {
            let covariance = &correlation * variance;
            let misfit = field.misfit(&covariance);
            if misfit < best.0 {
                best = (misfit, Some(covariance));
            }
        }
    }
    // Transfer the covariance of the cells to the gradient.
    let rows = DMatrix::from_fn(6, cells.len(), |axis, cell| cells[cell].row[axis]);
    best.1.map_or_else(Matrix6::zeros, |covariance| {
        let sum = &rows * covariance * rows.transpose();
        Matrix6::from_fn(|i, j| sum[(i, j)])
    })
}

/// Returns the cells with enough pairs.
fn cells(pairs: &[Vec<Pair>], scale: f64) -> Vec<Cell> {
    let all = || pairs.iter().flatten();
    let [columns, rows] = [0, 1].map(|axis| {
        let range = all().map(|pair| usize::from(pair.cam1_px[axis]));
        let (first, last) = range.fold((usize::MAX, 0), |(first, last), c| (first.min(c), last.max(c)));
        first.min(last)..last + 1
    });
    let side = columns.len().max(rows.len()).div_ceil(CELLS_ACROSS).max(1);
    let mut cells = vec![Cell::default(); CELLS_ACROSS * CELLS_ACROSS];
    for pair in all() {
        let [u, v] = pair.cam1_px.map(usize::from);
        let [column, row] = [(u - columns.start) / side, (v - rows.start) / side];
        let weight = weight(pair, scale);
        let cell = &mut cells[row * CELLS_ACROSS + column];
        cell.pairs += 1;
        cell.weight += weight;
        cell.residual += weight * pair.residual_m;
        cell.row += pair.row * weight;
        cell.position = [column as f64, row as f64];
    }
    cells.retain(|cell| cell.pairs >= MIN_PAIRS && cell.weight > 0.0);
    cells
}

fn correlation(cells: &[Cell], length: f64) -> DMatrix<f64> {
    DMatrix::from_fn(cells.len(), cells.len(), |a, b| {
        let [x, y] = [0, 1].map(|axis| cells[a].position[axis] - cells[b].position[axis]);
        (-(x * x + y * y) / (2.0 * length * length)).exp()
    })
}

/// Mean residuals of the cells, and their derivatives.
struct Field {
    residuals: DVector<f64>,
    /// Mean derivatives of the residuals with respect to translation and rotation, one row per cell.
    design: DMatrix<f64>,
    /// Variance of each mean by the noise of its points.
    noise: DVector<f64>,
    median_noise: f64,
}

impl Field {
    fn new(cells: &[Cell], scale: f64) -> Self {
        let noise = DVector::from_iterator(cells.len(), cells.iter().map(|cell| scale * scale / cell.weight));
        let mut sorted: Vec<f64> = noise.iter().copied().collect();
        sorted.sort_unstable_by(f64::total_cmp);
        Self {
            residuals: DVector::from_iterator(cells.len(), cells.iter().map(|cell| cell.residual / cell.weight)),
            design: DMatrix::from_fn(cells.len(), 6, |cell, axis| cells[cell].row[axis] / cells[cell].weight),
            noise,
            median_noise: sorted[sorted.len() / 2],
        }
    }

    /// Misfit of the residuals for a covariance of the smooth error: −2 times the restricted log-likelihood.
    fn misfit(&self, smooth: &DMatrix<f64>) -> f64 {
        let all = smooth + DMatrix::from_diagonal(&self.noise);
        let Some(all) = Cholesky::new(all) else { return f64::INFINITY };
        let [design, residuals] =
            [&self.design, &DMatrix::from_column_slice(self.residuals.len(), 1, self.residuals.as_slice())]
                .map(|right| all.solve(right));
        let Some(information) = Cholesky::new(self.design.transpose() * &design) else { return f64::INFINITY };
        let gradient = design.transpose() * &self.residuals;
        let explained = gradient.dot(&information.solve(&gradient));
        let rest = self.residuals.dot(&residuals.column(0)) - explained;
        log_determinant(&all) + log_determinant(&information) + rest
    }
}

fn log_determinant(cholesky: &Cholesky<f64, Dyn>) -> f64 {
    2.0 * cholesky.l_dirty().diagonal().iter().map(|x| x.ln()).sum::<f64>()
}

#[cfg(test)]
mod tests {
    use rand::{RngExt as _, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    use super::*;

    const SD_M: f64 = 1e-5;

    /// 32 × 32 pairs on a bowl, with noise and the waves of a smooth error.
    fn pairs(smooth_m: f64, seed: u64) -> Vec<Vec<Pair>> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut normal = || (0..12).map(|_| random.random::<f64>()).sum::<f64>() - 6.0;
        let (a, b) = (normal(), normal());
        let mut pair = |u: u16, v: u16| {
            let [x, y] = [u, v].map(|c| f64::from(c) / 160.0 - 1.0);
            let wave = (5.0 * x + a).sin() * (4.0 * y + b).cos();
            let residual_m = SD_M * normal() + smooth_m * wave;
            Pair { residual_m, sd_m: SD_M, row: Vector6::new(x, y, 1.0, x * x, y * y, x * y), cam1_px: [u, v] }
        };
        vec![(0..32).flat_map(|v| (0..32).map(move |u| (10 * u, 10 * v))).map(|(u, v)| pair(u, v)).collect()]
    }

    #[test]
    fn noise_is_not_taken_for_a_smooth_error_and_a_smooth_error_is_found() {
        let shift_variance = |smooth_m: f64| {
            let of_seed = |seed| gradient_covariance(&pairs(smooth_m, seed), 1.0)[(2, 2)];
            let mut variances: Vec<f64> = (0..9).map(of_seed).collect();
            variances.sort_unstable_by(f64::total_cmp);
            variances[4]
        };
        // The variance of the gradient by noise alone: 1024 pairs of weight 1/σ².
        let by_noise = 1024.0 / (SD_M * SD_M);
        assert!(shift_variance(0.0) < by_noise, "{}", shift_variance(0.0) / by_noise);
        assert!(shift_variance(SD_M) > 20.0 * by_noise, "{}", shift_variance(SD_M) / by_noise);
    }
}
