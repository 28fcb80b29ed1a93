//! What is learned of the images: the error field of the rig, the noise of δ, and the widths of true and wrong orders.
//!
//! ```text
//! three times: evidence and belief of the largest nodes; then field, noise and widths from those that lead clearly
//! ```

use super::evidence::Evidence;
use super::field::Uncertainty;
use super::likelihood::{Moments, Widths};
use super::nodes::Nodes;
use super::noise::Noise;
use super::{Scratch, field};
use crate::correspondence::drift::Drift;
use crate::correspondence::surfaces::order_scores::SearchSpace;
use crate::correspondence::view::View;

/// Rounds of learning.
const ROUNDS: usize = 3;
/// |δ − field| below which a sample fits: about no field, and about the fitted one, rad.
const FIRST_CAP: f32 = 0.3;
const CAP: f32 = 0.2;
/// sd of the mean of δ of a true order about no field, rad.
const FIRST_MEAN_SD: f32 = 0.06;
/// Spread of the mean of a wrong order given that of its neighbours, rad per largest tile.
const WRONG_MEAN: f32 = 0.8;
/// Widths of wrong slopes until they are measured, rad per half tile.
const WRONG_SLOPES: [f32; 2] = [0.2, 0.1];
/// Nats, lead and share of a node from which field and noise are learned.
const CLEAR_NATS: f32 = 3.0;
const CLEAR_SHARE: f32 = 0.7;
/// |x| of Student's t with three degrees of freedom that half of its values exceed.
const STUDENT_MEDIAN: f32 = 0.765;
/// Widths of mean, rad, and slopes, rad per half tile, of true orders where they cannot be measured, and their limits.
const USUAL_WIDTHS: [f32; 3] = [0.015, 0.03, 0.03];
const TRUE_WIDTHS: [f32; 2] = [0.01, 0.04];
/// Fewest values from which a width is measured.
const MIN_VALUES: usize = 50;

/// What is learned of the images.
pub(super) struct Learned {
    pub(super) field: Drift,
    pub(super) noise: Noise,
    pub(super) widths: Widths,
    pub(super) uncertainty: Uncertainty,
    /// |δ − field| below which a sample fits, rad.
    pub(super) cap: f32,
    /// Whether this is the last round, about the final field.
    pub(super) is_settled: bool,
}

impl Scratch {
    /// Decides the largest nodes while field, noise and widths are learned from them.
    pub(super) fn learn(
        &mut self,
        view: View<'_>,
        space: &SearchSpace,
        tile_px: usize,
        known: Option<&Drift>,
    ) -> Learned {
        let field = known.cloned().unwrap_or_else(|| Drift::level(0.0, f64::from(FIRST_MEAN_SD)));
        let widths = Widths {
            mean: FIRST_MEAN_SD,
            slopes: [USUAL_WIDTHS[1], USUAL_WIDTHS[2]],
            wrong_slopes: WRONG_SLOPES,
            wrong_mean: None,
        };
        let mut learned = Learned {
            field,
            noise: Noise::default(),
            widths,
            uncertainty: Uncertainty::default(),
            cap: FIRST_CAP,
            is_settled: false,
        };
        for round in 0..ROUNDS {
            learned.is_settled = round + 1 == ROUNDS;
            self.ask(view, space, tile_px, 0, &learned, &[]);
            let Self { nodes, evidence, .. } = self;
            let is_clear = |i: usize| {
                let node = &nodes.nodes[i];
                let fit = evidence.fit(i, node.label);
                node.lead >= CLEAR_NATS && fit.is_some_and(|f| f.ratio >= CLEAR_NATS && f.moments.share >= CLEAR_SHARE)
            };
            if let Some(found) = field::fit(view, &learned.field, &self.runs, nodes, evidence, is_clear) {
                (learned.field, learned.uncertainty) = found;
            }
            learned.noise = learned.noise.learn(view, nodes, evidence, is_clear);
            learned.widths.wrong_slopes =
                wrong_slopes(nodes, evidence, is_clear).unwrap_or(learned.widths.wrong_slopes);
            let [mean, along, across] = true_widths(nodes, evidence, is_clear).unwrap_or(USUAL_WIDTHS);
            (learned.widths.mean, learned.widths.slopes) = (mean, [along, across]);
            learned.cap = CAP;
        }
        learned
    }
}

impl Learned {
    /// Widths for the tiles of a level. A node of the largest tiles is asked without regard to its neighbours.
    pub(super) fn widths_at(&self, level: u8) -> Widths {
        let beside = self.widths_beside(level);
        if level == 0 { Widths { wrong_mean: None, ..beside } } else { beside }
    }

    /// Widths for a node of a level beside another one of its order: slopes are counted per half tile.
    pub(super) fn widths_beside(&self, level: u8) -> Widths {
        let share = 1.0 / f32::from(1_u16 << level);
        let Widths { mean, slopes, wrong_slopes, .. } = self.widths;
        let [slopes, wrong_slopes] = [slopes, wrong_slopes].map(|widths| widths.map(|width| width * share));
        Widths { mean, slopes, wrong_slopes, wrong_mean: Some(WRONG_MEAN * share) }
    }
}

/// The widths of slopes of wrong orders: of the labels of clear nodes other than the decided one.
fn wrong_slopes(nodes: &Nodes, evidence: &Evidence, is_clear: impl Fn(usize) -> bool) -> Option<[f32; 2]> {
    let mut slopes = [Vec::new(), Vec::new()];
    for (i, node) in nodes.nodes.iter().enumerate().filter(|(i, _)| is_clear(*i)) {
        for fit in evidence.fits_of(i).iter().filter(|fit| fit.label != node.label) {
            (0..2).for_each(|axis| slopes[axis].push(fit.moments.slopes[axis].abs()));
        }
    }
    widths(slopes)
}

/// The widths of mean and slopes of true orders: of the decided labels of clear nodes.
fn true_widths(nodes: &Nodes, evidence: &Evidence, is_clear: impl Fn(usize) -> bool) -> Option<[f32; 3]> {
    let mut seen = [Vec::new(), Vec::new(), Vec::new()];
    for (i, node) in nodes.nodes.iter().enumerate().filter(|(i, _)| is_clear(*i)) {
        let Some(fit) = evidence.fit(i, node.label) else { continue };
        let Moments { mean, slopes: [along, across], .. } = fit.moments;
        seen.iter_mut().zip([mean, along, across]).for_each(|(seen, value)| seen.push(value.abs()));
    }
    widths(seen).map(|widths| widths.map(|width| width.clamp(TRUE_WIDTHS[0], TRUE_WIDTHS[1])))
}

/// Width of the density of Student's t of each list of amounts, by their median. `None` if they are too few.
fn widths<const N: usize>(amounts: [Vec<f32>; N]) -> Option<[f32; N]> {
    let width = |mut amounts: Vec<f32>| {
        amounts.sort_by(f32::total_cmp);
        amounts[amounts.len() / 2] / STUDENT_MEDIAN
    };
    amounts.iter().all(|amounts| amounts.len() >= MIN_VALUES).then(|| amounts.map(width))
}
