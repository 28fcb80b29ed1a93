//! The normal equations of a step, and the covariance of the pose.
//!
//! Residuals are weighted by their predicted noise and by Tukey's biweight (Beaton and Tukey 1974), whose scale is the
//! median of the residuals. Calibration errors and motion move neighbouring points together, so residuals are not
//! independent. Treating them as independent would give too small a covariance. The covariance is therefore the
//! sandwich estimator `A⁻¹ B A⁻¹` for clustered data (Liang and Zeger 1986, "Longitudinal data analysis using
//! generalized linear models"): B is the sum of the outer products of the gradients of whole tiles. Smooth errors of
//! the surfaces, which several tiles share, are added to B by [`super::smooth_error`].

use nalgebra::{Matrix6, Vector6};

use super::association::Pair;

/// Tukey's constant, in standard deviations: 95 % efficiency for normal errors (Huber 1981, "Robust Statistics").
const TUKEY_CONSTANT: f64 = 4.685;
/// Median absolute value of a standard normal number.
const NORMAL_MEDIAN: f64 = 0.6745;
/// Minimum scale of the residuals, in standard deviations. It avoids a division by zero if they vanish.
const MIN_SCALE: f64 = 1e-3;

/// Returns the standard deviation of the normalized residuals, from their median: 1 for noise alone.
pub(super) fn scale(pairs: &[Vec<Pair>]) -> f64 {
    let mut magnitudes: Vec<f64> = pairs.iter().flatten().map(|pair| pair.normalized().abs()).collect();
    let middle = magnitudes.len() / 2;
    if magnitudes.is_empty() {
        return MIN_SCALE;
    }
    let (_, median, _) = magnitudes.select_nth_unstable_by(middle, f64::total_cmp);
    (*median / NORMAL_MEDIAN).max(MIN_SCALE)
}

/// Square of a residual in units of the outlier limit. A pair with 1 or more has no weight.
fn outlier_share(pair: &Pair, scale: f64) -> f64 {
    (pair.normalized() / (TUKEY_CONSTANT * scale)).powi(2)
}

/// Weight of a pair, 1/m².
pub(super) fn weight(pair: &Pair, scale: f64) -> f64 {
    (1.0 - outlier_share(pair, scale)).max(0.0).powi(2) / (pair.sd_m * pair.sd_m)
}

/// Minimum number of tiles for estimating the scatter of their gradients. The fit of six unknowns reduces the scatter;
/// with about six tiles none would be left.
const MIN_TILES: usize = 12;

/// Least curvature along a direction, as a share of the information. A direction with less is as good as unknown.
const LEAST_CURVATURE: f64 = 1e-3;

/// Sums over the pairs of all tiles.
pub(super) struct Equations {
    /// `Σ w J Jᵀ`.
    information: Matrix6<f64>,
    /// `Σ w r J`.
    gradient: Vector6<f64>,
    /// `Σ w`.
    weight: f64,
    /// `Σ ψ' J Jᵀ`: the curvature of the robust sum. It may be negative along a direction that outliers determine.
    curvature: Matrix6<f64>,
    /// `Σ g gᵀ` over the gradients of the tiles.
    scatter: Matrix6<f64>,
    tiles: usize,
    /// `Σ w r²`.
    squares: f64,
}

impl Equations {
    /// Sums over the tiles in order.
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
                // Beyond Tukey's limit a pair has neither weight nor curvature.
                if share < 1.0 {
                    let precision = 1.0 / (pair.sd_m * pair.sd_m);
                    let weight = (1.0 - share) * (1.0 - share) * precision;
                    let bend = (1.0 - share) * (1.0 - 5.0 * share) * precision;
                    // Both matrices are symmetric: the lower half is enough.
                    for column in 0..6 {
                        for row in column..6 {
                            let product = pair.row[row] * pair.row[column];
                            sums.information[(row, column)] += product * weight;
                            sums.curvature[(row, column)] += product * bend;
                        }
                    }
                    gradient += pair.row * (weight * pair.residual_m);
                    sums.weight += weight;
                    sums.squares += weight * pair.residual_m * pair.residual_m;
                }
            }
            sums.gradient += gradient;
            sums.scatter += gradient * gradient.transpose();
            sums.tiles += 1;
        }
        sums.information.fill_upper_triangle_with_lower_triangle();
        sums.curvature.fill_upper_triangle_with_lower_triangle();
        sums
    }

    /// Returns the step that minimizes the residuals, or `None` if it is undetermined.
    pub(super) fn step(&self) -> Option<Vector6<f64>> {
        Some(-self.information.cholesky()?.solve(&self.gradient))
    }

    /// Covariance that a step has in addition along directions that the surface leaves open. There the information
    /// comes from the noise of normals, and the steps follow noise: the less information, the less of it is true. At
    /// most, a standard deviation is `limit_m`.
    pub(super) fn doubt(&self, covariance: &Matrix6<f64>, min_eigenvalue: f64, limit_m: f64) -> Matrix6<f64> {
        let doubt = |(eigenvalue, v): &(f64, Vector6<f64>)| {
            let excess = (min_eigenvalue / eigenvalue).powi(2) - 1.0;
            v * v.transpose() * (v.dot(&(covariance * v)) * excess).min(limit_m * limit_m)
        };
        self.directions().iter().filter(|(eigenvalue, _)| *eigenvalue < min_eigenvalue).map(doubt).sum()
    }

    /// Eigenvalues and eigenvectors of the information per unit of weight.
    fn directions(&self) -> [(f64, Vector6<f64>); 6] {
        let eigen = (self.information / self.weight.max(f64::MIN_POSITIVE)).symmetric_eigen();
        std::array::from_fn(|k| (eigen.eigenvalues[k], eigen.eigenvectors.column(k).into_owned()))
    }

    /// Mean length of a step over its six parameters, in standard deviations, for independent residuals of this scale.
    pub(super) fn step_sd(&self, step: &Vector6<f64>, scale: f64) -> f64 {
        (step.dot(&(self.information * step)).max(0.0) / 6.0).sqrt() / scale
    }

    /// Smallest eigenvalue of the information per unit of weight.
    pub(super) fn least_eigenvalue(&self) -> f64 {
        self.directions().iter().map(|(eigenvalue, _)| *eigenvalue).fold(f64::INFINITY, f64::min)
    }

    /// Weighted root mean square of the residuals, metres.
    pub(super) fn rms_m(&self) -> f64 {
        if self.weight > 0.0 { (self.squares / self.weight).sqrt() } else { 0.0 }
    }

    /// Inverse of the curvature, with at least [`LEAST_CURVATURE`] along every direction; `None` if the step is
    /// undetermined.
    fn inverse_curvature(&self) -> Option<Matrix6<f64>> {
        // The curvature in a basis in which the information is the identity.
        let to_basis = self.information.cholesky()?.l().try_inverse()?;
        let mut shares = (to_basis * self.curvature * to_basis.transpose()).symmetric_eigen();
        shares.eigenvalues.apply(|share| *share = share.max(LEAST_CURVATURE).recip());
        Some(to_basis.transpose() * shares.recompose() * to_basis)
    }

    /// Whether there are enough tiles for [`Self::covariance`].
    pub(super) fn shows_scatter(&self) -> bool {
        self.tiles >= MIN_TILES
    }

    /// Returns the covariance of the step, or `None` if it is undetermined.
    ///
    /// `smooth` is the covariance of the gradient caused by errors that tiles share.
    pub(super) fn covariance(&self, smooth: &Matrix6<f64>) -> Option<Matrix6<f64>> {
        let inverse = self.inverse_curvature()?;
        let tiles = self.tiles as f64;
        let covariance = inverse * (self.scatter * (tiles / (tiles - 6.0)) + smooth) * inverse;
        Some((covariance + covariance.transpose()) / 2.0)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_direction_that_outliers_alone_determine_is_as_good_as_unknown() {
        // Pairs that determine one parameter each. Beyond 1/√5 of Tukey's limit the robust sum bends the other way.
        let pair = |parameter: usize, i: u16| {
            let residual_m = if parameter == 5 { 0.77 * TUKEY_CONSTANT } else { 0.5 };
            let sign = if i.is_multiple_of(2) { 1.0 } else { -1.0 };
            let row = Vector6::from_fn(|axis, _| if axis == parameter { 1.0 } else { 0.0 });
            Pair { residual_m: sign * residual_m, sd_m: 1.0, row, cam1_px: [i, 0] }
        };
        let tile = |i: u16| (0..6).flat_map(|parameter| [pair(parameter, i), pair(parameter, i + 1)]).collect();
        let equations = Equations::new(&(0..20).map(tile).collect::<Vec<_>>(), 1.0);
        assert!(equations.shows_scatter() && equations.curvature[(5, 5)] < 0.0);
        let covariance = equations.covariance(&Matrix6::identity()).unwrap();
        assert!(covariance[(5, 5)] > 1e4 * covariance[(0, 0)], "{covariance}");
        assert!(covariance.iter().all(|value| value.is_finite()) && covariance[(0, 0)] > 0.0);
    }
}
