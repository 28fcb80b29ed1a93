//! The normal equations of a step, and what they say about the pose.
//!
//! Residuals are weighed by their predicted noise and by Tukey's biweight (Beaton and Tukey 1974), whose scale is the median of
//! the residuals themselves. Neighbouring points err alike where calibration or motion moved them together, so counting
//! them as independent would promise too much. The covariance is therefore the sandwich `A⁻¹ B A⁻¹` for clustered data
//! (Liang and Zeger 1986, "Longitudinal data analysis using generalized linear models"): B adds up the gradients of whole
//! tiles, and is as large as these really scatter. What tiles have in common, a smooth error of the surfaces, is added to B
//! by [`super::smooth_error`].

use nalgebra::{Matrix6, Vector6};

use super::association::Pair;

/// Tukey's constant, in standard deviations: 95 % efficient for normal errors (Huber 1981, "Robust Statistics").
const TUKEY: f64 = 4.685;
/// Median of the magnitude of a standard normal number.
const NORMAL_MEDIAN: f64 = 0.6745;
/// Smallest scale of the residuals, in standard deviations: where they vanish, any scale would do.
const LEAST_SCALE: f64 = 1e-3;

/// Standard deviation of the normalized residuals, by their median: 1 where noise is all there is.
pub(super) fn scale(pairs: &[Vec<Pair>]) -> f64 {
    let mut magnitudes: Vec<f64> = pairs.iter().flatten().map(|pair| pair.normalized().abs()).collect();
    let middle = magnitudes.len() / 2;
    if magnitudes.is_empty() {
        return LEAST_SCALE;
    }
    let (_, median, _) = magnitudes.select_nth_unstable_by(middle, f64::total_cmp);
    (*median / NORMAL_MEDIAN).max(LEAST_SCALE)
}

/// How far a residual is out, squared; 1 and more does not count.
fn outlier_share(pair: &Pair, scale: f64) -> f64 {
    (pair.normalized() / (TUKEY * scale)).powi(2)
}

/// Weight of a pair, 1/m².
pub(super) fn weight(pair: &Pair, scale: f64) -> f64 {
    (1.0 - outlier_share(pair, scale)).max(0.0).powi(2) / (pair.sd_m * pair.sd_m)
}

/// Fewest tiles whose gradients tell how much they scatter.
const MIN_TILES: usize = 12;

/// Sums over the pairs of all tiles.
pub(super) struct Equations {
    /// `Σ w J Jᵀ`.
    information: Matrix6<f64>,
    /// `Σ w r J`.
    gradient: Vector6<f64>,
    /// `Σ w`.
    weight: f64,
    /// `Σ ψ' J Jᵀ`: the curvature of the robust sum.
    curvature: Matrix6<f64>,
    /// `Σ g gᵀ` over the gradients of the tiles.
    scatter: Matrix6<f64>,
    tiles: usize,
    /// `Σ w r²`.
    squares: f64,
}

impl Equations {
    /// Sums tile after tile, in their order.
    pub(super) fn new(pairs: &[Vec<Pair>], scale: f64) -> Self {
        let mut sums = Self {
            information: Matrix6::zeros(),
            gradient: Vector6::zeros(),
            weight: 0.0,
            curvature: Matrix6::zeros(),
            scatter: Matrix6::zeros(),
            tiles: 0,
            squares: 0.0,
        };
        for tile in pairs.iter().filter(|tile| !tile.is_empty()) {
            let mut gradient = Vector6::zeros();
            for pair in tile {
                let share = outlier_share(pair, scale);
                if share < 1.0 {
                    let precision = 1.0 / (pair.sd_m * pair.sd_m);
                    let weight = (1.0 - share) * (1.0 - share) * precision;
                    let product = pair.row * pair.row.transpose();
                    sums.information += product * weight;
                    sums.curvature += product * ((1.0 - share) * (1.0 - 5.0 * share) * precision);
                    gradient += pair.row * (weight * pair.residual_m);
                    sums.weight += weight;
                    sums.squares += weight * pair.residual_m * pair.residual_m;
                }
            }
            sums.gradient += gradient;
            sums.scatter += gradient * gradient.transpose();
            sums.tiles += 1;
        }
        sums
    }

    /// The step that makes the residuals smallest; `None` where it is not determined.
    pub(super) fn step(&self) -> Option<Vector6<f64>> {
        Some(-self.information.cholesky()?.solve(&self.gradient))
    }

    /// Length of a step in standard deviations, each of the six alike, if residuals are independent and scale so.
    pub(super) fn step_sd(&self, step: &Vector6<f64>, scale: f64) -> f64 {
        (step.dot(&(self.information * step)).max(0.0) / 6.0).sqrt() / scale
    }

    /// Least eigenvalue of the information, for the mean pair.
    pub(super) fn least_eigenvalue(&self) -> f64 {
        if self.weight <= 0.0 {
            return 0.0;
        }
        (self.information / self.weight).symmetric_eigenvalues().min()
    }

    /// Root mean square of the residuals, weighed, metres.
    pub(super) fn rms_m(&self) -> f64 {
        if self.weight > 0.0 { (self.squares / self.weight).sqrt() } else { 0.0 }
    }

    /// Covariance of the step; `None` where it is not determined.
    ///
    /// `smooth` is the covariance of the gradient by errors that tiles have in common.
    pub(super) fn covariance(&self, smooth: &Matrix6<f64>) -> Option<Matrix6<f64>> {
        let inverse = self.curvature.cholesky()?.inverse();
        // Six unknowns were fitted to the gradients, which makes them scatter less; with few more than six tiles nothing
        // would be left.
        if self.tiles < MIN_TILES {
            return None;
        }
        let tiles = self.tiles as f64;
        let covariance = inverse * (self.scatter * (tiles / (tiles - 6.0)) + smooth) * inverse;
        Some((covariance + covariance.transpose()) / 2.0)
    }
}
