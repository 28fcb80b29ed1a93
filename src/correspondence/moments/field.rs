//! The error field: δ of true orders that the calibration error of the rig causes, fitted to the means of nodes.
//!
//! ```text
//! for each node whose order leads: the mean of δ less the present field, at its middle
//! repeat: least squares for the mean of the field and the coefficients of its modes, each with its prior;
//!         nodes are weighted by Tukey's function of their distance
//! ```
//!
//! Robust regression by iterated weights (Holland and Welsch 1977).

use std::f64::consts::TAU;

use nalgebra::{SMatrix, SVector};

use super::evidence::Evidence;
use super::learned::Clear;
use super::nodes::{Node, Nodes};
use super::phase_runs::PhaseRuns;
use crate::correspondence::drift::{Drift, FieldTerms};
use crate::correspondence::segment_table::SegmentTable;
use crate::correspondence::view::View;

/// Fewest nodes of a fit, and most used.
const MIN_NODES: usize = 6;
const MAX_NODES: usize = 400;
/// Pixels along each axis, and step of depth in half segments, by which the uncertainty beyond is measured.
const PLACES: usize = 3;
const STEP: f64 = 0.1;
/// Greatest distance from the edge of the volume, half segments.
const FARTHEST: f32 = 30.0;
/// Rounds of weights, and Tukey's constant.
const ROUNDS: usize = 8;

/// Number of terms of the field.
const TERMS: usize = size_of::<FieldTerms>() / size_of::<f64>();
type Covariance = SMatrix<f64, TERMS, TERMS>;
type Coefficients = SVector<f64, TERMS>;

/// How uncertain the field is. Beyond the depths of the volume it is continued along straight lines.
#[derive(Clone, Debug, Default)]
pub(super) struct Uncertainty {
    /// Covariance of the mean, turns, and of the coefficients of the modes, pixels.
    covariance: Covariance,
    /// What is added to the variance of δ beyond the volume, rad²: factors of the distance from the edge, half segments,
    /// and of its square.
    beyond: [f32; 2],
}

impl Uncertainty {
    fn new(table: &SegmentTable, covariance: Covariance) -> Self {
        let mut own = Self { covariance, beyond: [0.0; 2] };
        let Some(modes) = table.drift_modes() else { return own };
        let size = table.size_px();
        let mut sums = [0.0; 2];
        let mut count = 0.0;
        for i in 0..PLACES * PLACES {
            let pixel = [i % PLACES, i / PLACES];
            let pixel: [usize; 2] = std::array::from_fn(|k| size[k] * (2 * pixel[k] + 1) / (2 * PLACES));
            let segment = table.segment(pixel[1] * size[0] + pixel[0]);
            if segment.is_none() {
                continue;
            }
            let half_px = modes.half_segment_px();
            for side in [-1.0, 1.0] {
                let row =
                    |at: f64| terms_at(table, pixel, (f64::from(segment.reference_px) + side * at * half_px) as f32);
                let edge = row(1.0);
                let rise = (edge - row(1.0 - STEP)) / STEP;
                sums[0] += 2.0 * own.product(&edge, &rise);
                sums[1] += own.product(&rise, &rise);
                count += 1.0;
            }
        }
        own.beyond = sums.map(|sum| (sum / f64::max(count, 1.0)) as f32);
        own
    }

    /// Covariance of δ of two rows of terms, rad².
    fn product(&self, a: &Coefficients, b: &Coefficients) -> f64 {
        a.dot(&(self.covariance * b)) * TAU * TAU
    }

    /// Variance of the field at a pixel and a column of the epipolar frame, rad². 0 if the field was not fitted, and
    /// nowhere.
    pub(super) fn variance(&self, table: &SegmentTable, pixel: [usize; 2], column_px: f32) -> f32 {
        if !column_px.is_finite() {
            return 0.0;
        }
        let terms = terms_at(table, pixel, column_px);
        self.product(&terms, &terms) as f32
    }

    /// What is added at a distance from the middle of the segment, half segments, rad².
    pub(super) fn beyond(&self, place: f32) -> f32 {
        let beyond = (place.abs() - 1.0).clamp(0.0, FARTHEST);
        let [linear, square] = self.beyond;
        (beyond * (linear + beyond * square)).max(0.0)
    }
}

/// The terms of the field at a pixel and a column of the epipolar frame.
fn terms_at(table: &SegmentTable, pixel: [usize; 2], column_px: f32) -> Coefficients {
    match table.drift_modes() {
        Some(modes) => modes.terms(pixel, column_px).into(),
        None => Coefficients::ith(0, 1.0),
    }
}

/// The mean of δ of a decided node.
#[derive(Clone, Copy, Debug)]
struct Observation {
    terms: Coefficients,
    /// δ, turns.
    delta_turns: f64,
    weight: f64,
}

/// Scratch memory of the fit.
#[derive(Clone, Debug, Default)]
pub(super) struct Fitting {
    seen: Vec<Observation>,
    rests: Vec<f64>,
}

impl Fitting {
    /// Fits the field to the nodes that are clear, starting from the present one. `prior_px` is the sd of the coefficient
    /// of a mode, pixels of calibration error. `None` if the nodes are too few.
    pub(super) fn fit(
        &mut self,
        view: View<'_>,
        (present, prior_px): (&Drift, f32),
        runs: &PhaseRuns,
        nodes: &Nodes,
        evidence: &Evidence,
        clear: &[Clear],
    ) -> Option<(Drift, Uncertainty)> {
        let mut solution = Coefficients::from(*present.coefficients());
        self.observe(view, &solution, runs, nodes, evidence, clear);
        let Self { seen, rests, .. } = self;
        if seen.len() < MIN_NODES {
            return None;
        }
        let mut root = None;
        for _ in 1..ROUNDS {
            let sd = spread(seen, &solution, rests);
            let (mut normal, mut right) = (Covariance::zeros(), Coefficients::zeros());
            let noise = f64::from(view.model.node_mean_rad) / TAU;
            for (own, rest) in seen.iter().zip(&*rests) {
                let z = rest / (f64::from(view.model.tukey_sd) * sd);
                if z.abs() >= 1.0 {
                    continue;
                }
                let weight = own.weight * (1.0 - z * z).powi(2) / (noise * noise);
                for j in 0..TERMS {
                    let term = weight * own.terms[j];
                    right[j] += term * own.delta_turns;
                    for k in 0..=j {
                        normal[(j, k)] += term * own.terms[k];
                    }
                }
            }
            for j in 1..TERMS {
                normal[(j, j)] += 1.0 / f64::from(prior_px * prior_px);
            }
            // The lower triangle is enough.
            let own = normal.cholesky()?;
            solution = own.solve(&right);
            root = Some(own);
        }
        let sd = spread(seen, &solution, rests);
        let uncertainty = Uncertainty::new(view.table, root?.inverse());
        Some((Drift::from_coefficients(view.table, solution.into(), sd * TAU), uncertainty))
    }

    /// Lists what clear nodes show, evenly chosen if they are many.
    fn observe(
        &mut self,
        view: View<'_>,
        present: &Coefficients,
        runs: &PhaseRuns,
        nodes: &Nodes,
        evidence: &Evidence,
        clear: &[Clear],
    ) {
        let seen = &mut self.seen;
        seen.clear();
        let count = clear.len().min(MAX_NODES);
        // Each stands for others.
        let share = clear.len() as f64 / count.max(1) as f64;
        for i in 0..count {
            let (number, label) = clear[i * clear.len() / count];
            let Some(fit) = evidence.fit(number as usize, label) else { continue };
            let (pixel, column_px) = place_of(view, runs, nodes, &Node { label, ..nodes.nodes[number as usize] });
            if column_px.is_finite() {
                let terms = terms_at(view.table, pixel, column_px);
                let delta_turns = f64::from(fit.moments.mean) / TAU + terms.dot(present);
                let weight = share * f64::from(fit.moments.count / (fit.moments.count + 16.0));
                seen.push(Observation { terms, delta_turns, weight });
            }
        }
    }
}

/// The rests of all observations about a field, turns, into `rests`, and their sd by the median of their size.
fn spread(seen: &[Observation], solution: &Coefficients, rests: &mut Vec<f64>) -> f64 {
    let rest = |own: &Observation| own.delta_turns - own.terms.dot(solution);
    rests.clear();
    rests.extend(seen.iter().map(|own| rest(own).abs()));
    let middle = rests.len() / 2;
    let median = *rests.select_nth_unstable_by(middle, f64::total_cmp).1;
    rests.clear();
    rests.extend(seen.iter().map(rest));
    (1.4826 * median).max(0.003 / TAU)
}

/// A pixel in the middle of a node, and its column in the epipolar frame.
pub(super) fn place_of(view: View<'_>, runs: &PhaseRuns, nodes: &Nodes, node: &Node) -> ([usize; 2], f32) {
    let piece = nodes.middle_of(node);
    let [u, v] = piece.middle();
    let pixel = v * view.cam1.width + u;
    let order = node.order(piece.offset + i32::from(runs.relative[pixel]));
    ([u, v], column_of(view.table, pixel, order, view.cam1.phase[pixel]))
}

/// Column at which a pixel has an order.
fn column_of(table: &SegmentTable, pixel: usize, order: i32, phase: u16) -> f32 {
    let turns = order as f32 + f32::from(phase) / 65536.0;
    table.segment(pixel).column_and_columns_per_turn(turns).0
}
