//! Bundle adjustment: one least-squares estimate of all lenses, the arrangement, the poses and the shape of the board
//! from all corners and phases (Triggs et al. 2000; the projector as an inverse camera: Zhang and Huang 2006).
//!
//! In: a state near the solution, and measurements. Out: the state of the least robust cost, the covariance of every
//! parameter, the noise of each group of measurements, and all residuals. Levenberg-Marquardt on the normal equations
//! with analytic derivatives; their inverse is the covariance. Cost: for 20 views a tenth of a second.

mod equations;
mod residual;
mod state;
#[cfg(test)]
mod tests;

use fringeflow::geometry::Pixel;
use nalgebra::{DMatrix, DVector, Vector2};

use equations::{Cost, Equations};

use crate::median::median;

pub(crate) use equations::{loss, weight};
pub(crate) use residual::by_pose;

pub use residual::{Measured, Measurement};
pub use state::{Device, Layout, POSE, PROJECTOR, State};

/// Norms of normalized residuals up to this one have full weight. Noise exceeds it once in 3000 times.
const FULL_WEIGHT_NORM: f64 = 4.0;
/// Steps of Levenberg-Marquardt in one round.
const MAX_STEPS: usize = 60;
/// Rounds, each with the noise that the last one has found.
const MAX_ROUNDS: usize = 8;
/// Relative decrease of the cost below which a round has converged.
const CONVERGED: f64 = 1e-10;
/// Relative change of the noise below which the rounds have converged.
const SETTLED: f64 = 1e-3;
/// Median of the norm of two standard normal numbers.
const MEDIAN_NORM: f64 = 1.177_410_022_515_474_7;

/// A calibration problem.
#[derive(Clone, Debug)]
pub struct Problem {
    /// Positions of the features of the board in its plane, metres.
    pub features_m: Vec<Vector2<f64>>,
    /// All measurements.
    pub measurements: Vec<Measurement>,
    /// Images of the devices (width, height), pixels.
    pub sizes_px: Vec<[usize; 2]>,
    /// Number of groups of measurements.
    pub groups: usize,
}

/// The noise of a group of measurements.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Group {
    /// Factor from the stated standard deviations to those that the residuals show.
    pub noise: f64,
    /// Measurements with full weight.
    pub used: usize,
    /// Measurements that deviate from all others.
    pub left_out: usize,
    /// Root mean square of the norm of the residuals with full weight, pixels, as OpenCV states it.
    pub rms_px: f64,
}

/// A solution.
#[derive(Clone, Debug)]
pub struct Adjusted {
    /// The estimate.
    pub state: State,
    /// Covariance of all parameters, in the order of [`Layout`].
    pub covariance: DMatrix<f64>,
    /// Noise of the groups.
    pub groups: Vec<Group>,
    /// Residual of each measurement, pixels; `None` if its point came behind a device.
    pub residuals_px: Vec<Option<Vector2<f64>>>,
    /// Weight of each measurement, 0 to 1.
    pub weights: Vec<f64>,
}

/// Adjusts a state to the measurements; `None` if the equations have no solution.
#[must_use]
pub fn adjust(problem: &Problem, start: State) -> Option<Adjusted> {
    let mut state = start;
    let mut noise = vec![f64::INFINITY; problem.groups];
    for _ in 0..MAX_ROUNDS {
        let found = median_noise(problem, &state)?;
        let settled = noise.iter().zip(&found).all(|(old, new)| (old - new).abs() <= SETTLED * new);
        noise = found;
        if settled {
            break;
        }
        state = minimize(problem, state, &noise)?;
    }
    finish(problem, state, noise)
}

/// Levenberg-Marquardt for a given noise of the groups.
fn minimize(problem: &Problem, start: State, noise: &[f64]) -> Option<State> {
    let mut state = start;
    let mut damping = 1e-4;
    let mut equations = Equations::at(problem, &state, noise);
    for _ in 0..MAX_STEPS {
        let Some(step) = equations.step(damping) else {
            damping *= 10.0;
            continue;
        };
        let moved = state.moved(step.as_view());
        let Cost(cost) = Cost::of(problem, &moved, noise);
        let decrease = equations.cost - cost;
        if decrease.is_nan() || decrease < 0.0 {
            damping *= 8.0;
            if damping > 1e12 {
                break;
            }
            continue;
        }
        state = moved;
        if decrease <= CONVERGED * equations.cost {
            break;
        }
        damping = (damping / 6.0).max(1e-12);
        equations = Equations::at(problem, &state, noise);
    }
    state.devices.iter().all(|device| device.lens.0.iter().all(|value| value.is_finite())).then_some(state)
}

/// The noise of the groups from the medians of their residuals, at least a ten-thousandth of a pixel.
fn median_noise(problem: &Problem, state: &State) -> Option<Vec<f64>> {
    let layout = Layout::of(state);
    let mut norms = vec![Vec::new(); problem.groups];
    let mut derivatives = residual::Derivatives::default();
    for measurement in &problem.measurements {
        let position_m = problem.features_m[measurement.feature];
        if let Some(r) = residual::residual(state, &layout, measurement, position_m, &mut derivatives) {
            norms[measurement.group].push(r.component_div(&measurement.relative_sd()).norm());
        }
    }
    let noise = |norms: Vec<f64>| {
        let Some(norm) = median(norms) else { return Some(1.0) };
        norm.is_finite().then(|| (norm / MEDIAN_NORM).max(1e-4))
    };
    norms.into_iter().map(noise).collect()
}

/// Computes noise, covariance and residuals of a solution.
fn finish(problem: &Problem, state: State, median_noise: Vec<f64>) -> Option<Adjusted> {
    let layout = Layout::of(&state);
    let mut derivatives = residual::Derivatives::default();
    let mut groups = vec![Group::default(); problem.groups];
    let (mut residuals_px, mut weights) = (Vec::new(), Vec::new());
    let mut squares = vec![0.0; problem.groups];
    for measurement in &problem.measurements {
        let position_m = problem.features_m[measurement.feature];
        let r = residual::residual(&state, &layout, measurement, position_m, &mut derivatives);
        let normalized = r.map(|r| r.component_div(&measurement.relative_sd()) / median_noise[measurement.group]);
        let norm = normalized.map_or(f64::INFINITY, |n| n.norm());
        let group = &mut groups[measurement.group];
        if norm <= FULL_WEIGHT_NORM {
            group.used += 1;
            group.rms_px += r.map_or(0.0, |r| r.norm_squared());
            squares[measurement.group] += norm * norm;
        } else {
            group.left_out += 1;
        }
        residuals_px.push(r);
        weights.push(weight(norm));
    }
    let used: usize = groups.iter().map(|group| group.used).sum();
    // Each parameter takes a part of the noise; all groups bear it alike.
    let values = 2.0 * used as f64;
    let freedom = values - layout.len() as f64;
    if freedom <= 0.0 {
        return None;
    }
    for (group, (square, median)) in groups.iter_mut().zip(squares.into_iter().zip(median_noise)) {
        let count = group.used.max(1) as f64;
        group.rms_px = (group.rms_px / count).sqrt();
        group.noise = median * (square / (2.0 * count) * values / freedom).sqrt();
    }
    let noise: Vec<f64> = groups.iter().map(|group| group.noise.max(1e-6)).collect();
    let covariance = Equations::at(problem, &state, &noise).covariance()?;
    Some(Adjusted { state, covariance, groups, residuals_px, weights })
}

/// Derivatives of the pixel at which a device images a point of the board in view 0: each parameter that it depends on, with
/// those of column and row. `None` behind the device.
pub(crate) fn derivatives_of_pixel(
    state: &State,
    device: usize,
    position_m: Vector2<f64>,
    pixel: Pixel,
) -> Option<Vec<(usize, Vector2<f64>)>> {
    let mut derivatives = residual::Derivatives::default();
    let measurement = Measurement { view: 0, feature: 0, device, group: 0, measured: Measured::Pixel(pixel, 1.0) };
    residual::residual(state, &Layout::of(state), &measurement, position_m, &mut derivatives)?;
    Some(derivatives.columns)
}

impl Adjusted {
    /// Standard deviation of a parameter.
    #[must_use]
    pub fn sd(&self, parameter: usize) -> f64 {
        self.covariance[(parameter, parameter)].sqrt()
    }

    /// Standard deviations of all parameters.
    #[must_use]
    pub fn sds(&self) -> DVector<f64> {
        self.covariance.diagonal().map(f64::sqrt)
    }
}
