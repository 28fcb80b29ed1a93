//! The normal equations of a state: cost, gradient and curvature, with the robust loss and the priors.

use nalgebra::{DMatrix, DVector};

use super::residual::{Derivatives, residual};
use super::{FULL_WEIGHT_NORM, Layout, Problem, State};
use crate::lens::INTRINSICS;

/// Standard deviations of the coefficients of distortion over all lenses of scanners: k1, k2, p1, p2, k3. They keep
/// coefficients that the images do not show near zero.
const LENS_SD: [f64; 5] = [1.0, 3.0, 0.03, 0.03, 10.0];
/// Standard deviation of the focal lengths about the first guess and of the principal point about the middle, in sizes
/// of the image. So weak that they only keep the equations solvable.
const WEAK_SD: f64 = 100.0;
/// Standard deviation of the heights of a board, metres.
const SHAPE_SD_M: f64 = 5e-3;
/// Standard deviation of turns (rad) and shifts (metres) of any pose. As weak.
const POSE_SD: f64 = 100.0;

/// Robust cost of a state.
pub(super) struct Cost(pub(super) f64);

/// Normal equations at a state.
pub(super) struct Equations {
    pub(super) cost: f64,
    /// Gradient of the cost.
    gradient: DVector<f64>,
    /// Gauss-Newton curvature; the lower triangle is filled.
    curvature: DMatrix<f64>,
}

/// Weight of a residual with this normalized norm: 1 up to a limit, and beyond it the fourth power of limit over norm, so
/// that an outlier has no influence.
pub(crate) fn weight(norm: f64) -> f64 {
    if norm <= FULL_WEIGHT_NORM { 1.0 } else { (FULL_WEIGHT_NORM / norm).powi(4) }
}

/// The loss whose derivative is weight times norm.
pub(crate) fn loss(norm: f64) -> f64 {
    let limit2 = FULL_WEIGHT_NORM * FULL_WEIGHT_NORM;
    let norm2 = norm * norm;
    if norm2 <= limit2 { 0.5 * norm2 } else { limit2 - 0.5 * limit2 * limit2 / norm2 }
}

impl Cost {
    pub(super) fn of(problem: &Problem, state: &State, noise: &[f64]) -> Self {
        let layout = Layout::of(state);
        let mut derivatives = Derivatives::default();
        let mut cost = priors(state, &layout, problem).map(|prior| 0.5 * (prior.value / prior.sd).powi(2)).sum();
        for measurement in &problem.measurements {
            let position_m = problem.features_m[measurement.feature];
            let residual = residual(state, &layout, measurement, position_m, &mut derivatives);
            let sd = measurement.relative_sd() * noise[measurement.group];
            // A point behind a device costs as much as any outlier can.
            cost += residual.map_or(loss(f64::INFINITY), |r| loss(r.component_div(&sd).norm()));
        }
        Self(cost)
    }
}

impl Equations {
    pub(super) fn at(problem: &Problem, state: &State, noise: &[f64]) -> Self {
        let layout = Layout::of(state);
        let mut equations = Self {
            cost: 0.0,
            gradient: DVector::zeros(layout.len()),
            curvature: DMatrix::zeros(layout.len(), layout.len()),
        };
        let mut derivatives = Derivatives::default();
        for measurement in &problem.measurements {
            let position_m = problem.features_m[measurement.feature];
            let sd = measurement.relative_sd() * noise[measurement.group];
            let Some(r) = residual(state, &layout, measurement, position_m, &mut derivatives) else {
                equations.cost += loss(f64::INFINITY);
                continue;
            };
            let normalized = r.component_div(&sd);
            let weight = weight(normalized.norm());
            equations.cost += loss(normalized.norm());
            for (_, column) in &mut derivatives.columns {
                column.component_div_assign(&sd);
            }
            // Columns of one parameter never come twice, so that each pair is added once.
            for (i, (at, column)) in derivatives.columns.iter().enumerate() {
                let weighted = column * weight;
                equations.gradient[*at] += weighted.dot(&normalized);
                for (other, other_column) in &derivatives.columns[..=i] {
                    equations.curvature[(*at.max(other), *at.min(other))] += weighted.dot(other_column);
                }
            }
        }
        for Prior { parameter, value, sd } in priors(state, &layout, problem) {
            equations.cost += 0.5 * (value / sd).powi(2);
            equations.gradient[parameter] += value / (sd * sd);
            equations.curvature[(parameter, parameter)] += 1.0 / (sd * sd);
        }
        equations
    }

    /// The step of Levenberg-Marquardt, with the damping relative to the diagonal.
    pub(super) fn step(&self, damping: f64) -> Option<DVector<f64>> {
        let scale = self.scale();
        let mut scaled = self.scaled(&scale);
        for i in 0..scaled.nrows() {
            scaled[(i, i)] += damping;
        }
        let gradient = self.gradient.component_mul(&scale);
        let step = -scaled.cholesky()?.solve(&gradient).component_mul(&scale);
        step.iter().all(|value| value.is_finite()).then_some(step)
    }

    /// The inverse of the curvature.
    pub(super) fn covariance(&self) -> Option<DMatrix<f64>> {
        let scale = self.scale();
        let mut inverse = self.scaled(&scale).cholesky()?.inverse();
        for j in 0..inverse.ncols() {
            for i in 0..inverse.nrows() {
                inverse[(i, j)] *= scale[i] * scale[j];
            }
        }
        inverse.iter().all(|value| value.is_finite()).then_some(inverse)
    }

    /// Factors that bring the diagonal to one: parameters in pixels and in metres become comparable.
    fn scale(&self) -> DVector<f64> {
        self.curvature.diagonal().map(|value| 1.0 / value.sqrt())
    }

    fn scaled(&self, scale: &DVector<f64>) -> DMatrix<f64> {
        let n = self.curvature.nrows();
        DMatrix::from_fn(n, n, |i, j| self.curvature[(i.max(j), i.min(j))] * scale[i] * scale[j])
    }
}

/// What is known of a parameter beforehand: how far it is from its expected value.
struct Prior {
    parameter: usize,
    value: f64,
    sd: f64,
}

fn priors<'a>(state: &'a State, layout: &'a Layout, problem: &'a Problem) -> impl Iterator<Item = Prior> + 'a {
    let lenses = state.devices.iter().enumerate().flat_map(move |(d, device)| {
        let [width, height] = problem.sizes_px[d].map(|side| side as f64);
        (0..INTRINSICS).map(move |k| {
            let expected = [width, width, width / 2.0, height / 2.0].get(k).copied().unwrap_or_default();
            let sd = if k < 4 { WEAK_SD * width } else { LENS_SD[k - 4] };
            Prior { parameter: layout.lens(d) + k, value: device.lens.0[k] - expected, sd }
        })
    });
    let shape = state.shape.modes().iter().enumerate();
    let shape = shape.map(move |(k, &value)| Prior { parameter: layout.shape() + k, value, sd: SHAPE_SD_M });
    // The curvature of poses that nothing sees must not vanish; their value is free.
    let arrangement = layout.arrangement(1).unwrap_or(layout.rig())..layout.rig();
    let poses = arrangement.chain(layout.board(0)..layout.len());
    lenses.chain(shape).chain(poses.map(|parameter| Prior { parameter, value: 0.0, sd: POSE_SD }))
}
