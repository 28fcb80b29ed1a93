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

use nalgebra::{DMatrix, DVector};

use super::evidence::Evidence;
use super::nodes::{NOTHING, Node, Nodes};
use crate::correspondence::drift::Drift;
use crate::correspondence::segment_table::SegmentTable;
use crate::correspondence::surfaces::runs::PhaseRuns;
use crate::correspondence::view::View;

/// sd of the coefficient of a mode, pixels of calibration error.
const PRIOR_PX: f64 = 0.15;
/// sd of the mean of δ of a surface about the field, rad: a surface's nodes are not independent of each other.
const SURFACE_SD: f64 = 0.02;
/// Nodes that weigh as one independent observation.
const NODES_PER_OBSERVATION: f64 = 4.0;
/// Fewest nodes of a fit, and most used.
const MIN_NODES: usize = 6;
const MAX_NODES: usize = 1200;
/// Pixels along each axis, and step of depth in half segments, by which the uncertainty beyond is measured.
const PLACES: usize = 3;
const STEP: f64 = 0.1;
/// Greatest distance from the edge of the volume, half segments.
const FARTHEST: f32 = 30.0;
/// Rounds of weights, and Tukey's constant.
const ROUNDS: usize = 8;
const TUKEY: f64 = 4.7;

/// How uncertain the field is. Beyond the depths of the volume it is continued along straight lines.
#[derive(Clone, Debug, Default)]
pub(super) struct Uncertainty {
    /// Covariance of the mean, turns, and of the coefficients of the modes, pixels, row by row.
    covariance: Vec<f64>,
    /// What is added to the variance of δ beyond the volume, rad²: factors of the distance from the edge, half segments,
    /// and of its square.
    beyond: [f32; 2],
}

impl Uncertainty {
    fn new(table: &SegmentTable, covariance: &DMatrix<f64>) -> Self {
        // The matrix is symmetric: its columns are its rows.
        let mut own = Self { covariance: covariance.as_slice().to_vec(), beyond: [0.0; 2] };
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
                let rise: Vec<f64> = edge.iter().zip(row(1.0 - STEP)).map(|(a, b)| (a - b) / STEP).collect();
                sums[0] += 2.0 * own.product(&edge, &rise);
                sums[1] += own.product(&rise, &rise);
                count += 1.0;
            }
        }
        own.beyond = sums.map(|sum| (sum / f64::max(count, 1.0)) as f32);
        own
    }

    /// Covariance of δ of two rows of terms, rad².
    fn product(&self, a: &[f64], b: &[f64]) -> f64 {
        let rows = self.covariance.chunks_exact(b.len());
        let times = |row: &[f64]| row.iter().zip(b).map(|(c, b)| c * b).sum::<f64>();
        a.iter().zip(rows).map(|(a, row)| a * times(row)).sum::<f64>() * TAU * TAU
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

/// The terms of the field at a pixel and a column of the epipolar frame: 1, and δ of each mode.
fn terms_at(table: &SegmentTable, pixel: [usize; 2], column_px: f32) -> Vec<f64> {
    let mut terms = vec![1.0];
    if let Some(modes) = table.drift_modes() {
        modes.append_deltas(pixel, column_px, &mut terms);
    }
    terms
}

/// The mean of δ of a decided node.
#[derive(Clone, Copy, Debug)]
struct Observation {
    pixel: [usize; 2],
    column_px: f32,
    /// δ less the present field, turns.
    rest_turns: f64,
    weight: f64,
}

/// Fits the field to the nodes that are clear, starting from the present one. `None` if they are too few.
pub(super) fn fit(
    view: View<'_>,
    present: &Drift,
    runs: &PhaseRuns,
    nodes: &Nodes,
    evidence: &Evidence,
    is_clear: impl Fn(usize) -> bool,
) -> Option<(Drift, Uncertainty)> {
    let mut seen = observations(view, runs, nodes, evidence, is_clear);
    if seen.len() < MIN_NODES {
        return None;
    }
    if seen.len() > MAX_NODES {
        let count = seen.len();
        seen = (0..MAX_NODES).map(|i| seen[i * count / MAX_NODES]).collect();
    }
    let terms: Vec<f64> = seen.iter().flat_map(|own| terms_at(view.table, own.pixel, own.column_px)).collect();
    let count = terms.len() / seen.len();
    let rows = DMatrix::from_row_slice(seen.len(), count, &terms);
    let present_coefficients = present.coefficients_of(count);
    // δ itself, as the modes see it.
    let delta =
        DVector::from_iterator(seen.len(), seen.iter().map(|own| own.rest_turns)) + &rows * &present_coefficients;
    let mut solution = present_coefficients;
    let mut sd = 0.0;
    let mut root = None;
    for round in 0..ROUNDS {
        let rest = &delta - &rows * &solution;
        let mut sizes: Vec<f64> = rest.iter().map(|r| r.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        sd = (1.4826 * sizes[sizes.len() / 2]).max(0.003 / TAU);
        if round + 1 == ROUNDS {
            break;
        }
        let (mut normal, mut right) = (DMatrix::zeros(count, count), DVector::zeros(count));
        let noise = SURFACE_SD / TAU;
        for (i, own) in seen.iter().enumerate() {
            let z = rest[i] / (TUKEY * sd);
            if z.abs() >= 1.0 {
                continue;
            }
            let weight = own.weight * (1.0 - z * z).powi(2) / (noise * noise * NODES_PER_OBSERVATION);
            for j in 0..count {
                let own = weight * rows[(i, j)];
                right[j] += own * delta[i];
                for k in 0..=j {
                    normal[(j, k)] += own * rows[(i, k)];
                }
            }
        }
        for j in 1..count {
            normal[(j, j)] += 1.0 / (PRIOR_PX * PRIOR_PX);
        }
        for j in 0..count {
            for k in 0..j {
                normal[(k, j)] = normal[(j, k)];
            }
        }
        let own = normal.cholesky()?;
        solution = own.solve(&right);
        root = Some(own);
    }
    let uncertainty = Uncertainty::new(view.table, &root?.inverse());
    Some((Drift::from_coefficients(view.table, solution.as_slice(), sd * TAU), uncertainty))
}

fn observations(
    view: View<'_>,
    runs: &PhaseRuns,
    nodes: &Nodes,
    evidence: &Evidence,
    is_clear: impl Fn(usize) -> bool,
) -> Vec<Observation> {
    let mut seen = Vec::new();
    for (i, node) in nodes.nodes.iter().enumerate().filter(|(i, node)| node.label != NOTHING && is_clear(*i)) {
        let Some(fit) = evidence.fit(i, node.label) else { continue };
        let (pixel, column_px) = place_of(view, runs, nodes, node);
        if column_px.is_finite() {
            let rest_turns = f64::from(fit.moments.mean) / TAU;
            let weight = f64::from(fit.moments.count / (fit.moments.count + 16.0));
            seen.push(Observation { pixel, column_px, rest_turns, weight });
        }
    }
    seen
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
