//! What is learned of the images: the error field of the rig, the noise of δ, and the slopes of wrong orders.
//!
//! ```text
//! three times: evidence and belief of the largest nodes; then field, noise and slopes from those that lead clearly
//! ```

use super::evidence::Evidence;
use super::likelihood::Widths;
use super::nodes::Nodes;
use super::noise::Noise;
use super::{Scratch, field};
use crate::correspondence::drift::Drift;
use crate::correspondence::surfaces::order_scores::SearchSpace;
use crate::correspondence::view::View;

/// |δ − field| below which a sample fits: about no field, and about the fitted one, rad.
const FIRST_CAP: f32 = 0.3;
pub(super) const CAP: f32 = 0.2;
/// sd of the mean of δ of a true order about the field, rad: at first, and finally.
const FIRST_MEAN_SD: f32 = 0.06;
const MEAN_SD: f32 = 0.015;
/// Spread of the mean of a wrong order given that of its neighbours, rad per largest tile.
const WRONG_MEAN: f32 = 0.8;
/// sd of the slopes of a true order, rad per half tile.
const SLOPE_SD: f32 = 0.03;
/// Widths of wrong slopes until they are measured, rad per half tile.
const WRONG_SLOPES: [f32; 2] = [0.2, 0.1];
/// Nats, lead and share of a node from which field and noise are learned.
const CLEAR_NATS: f32 = 3.0;
const CLEAR_SHARE: f32 = 0.7;
/// |x| of Student's t with three degrees of freedom that half of its values exceed.
const STUDENT_MEDIAN: f32 = 0.765;
/// Fewest wrong slopes that are measured.
const MIN_SLOPES: usize = 50;

/// What is learned of the images.
pub(super) struct Learned {
    pub(super) field: Drift,
    pub(super) noise: Noise,
    pub(super) widths: Widths,
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
        let widths = Widths { mean: FIRST_MEAN_SD, slope: SLOPE_SD, wrong_slopes: WRONG_SLOPES, wrong_mean: None };
        let mut learned = Learned { field, noise: Noise::default(), widths };
        for (cap, mean) in [(FIRST_CAP, FIRST_MEAN_SD), (CAP, 2.0 * MEAN_SD), (CAP, MEAN_SD)] {
            learned.widths.mean = mean;
            self.ask(view, space, tile_px, 0, &learned, cap, &[]);
            let Self { nodes, evidence, .. } = self;
            let is_clear = |i: usize| {
                let node = &nodes.nodes[i];
                let fit = evidence.fit(i, node.label);
                node.lead >= CLEAR_NATS && fit.is_some_and(|f| f.ratio >= CLEAR_NATS && f.moments.share >= CLEAR_SHARE)
            };
            if let Some(found) = field::fit(view, &learned.field, &self.runs, nodes, evidence, is_clear) {
                learned.field = found;
            }
            learned.noise = learned.noise.learn(view, nodes, evidence, is_clear);
            learned.widths.wrong_slopes =
                wrong_slopes(nodes, evidence, is_clear).unwrap_or(learned.widths.wrong_slopes);
        }
        learned
    }
}

impl Learned {
    /// Widths for the tiles of a level: slopes are counted per half tile.
    pub(super) fn widths_at(&self, level: u8) -> Widths {
        let share = 1.0 / f32::from(1_u16 << level);
        let Widths { mean, slope, wrong_slopes, .. } = self.widths;
        let wrong_mean = (level > 0).then(|| wrong_mean(level));
        Widths { mean, slope: slope * share, wrong_slopes: wrong_slopes.map(|width| width * share), wrong_mean }
    }
}

/// Spread of the mean of a wrong order given that of its neighbours, in the tiles of a level, rad.
pub(super) fn wrong_mean(level: u8) -> f32 {
    WRONG_MEAN / f32::from(1_u16 << level)
}

/// The widths of slopes of wrong orders: of the labels of clear nodes other than the decided one.
fn wrong_slopes(nodes: &Nodes, evidence: &Evidence, is_clear: impl Fn(usize) -> bool) -> Option<[f32; 2]> {
    let mut slopes = [Vec::new(), Vec::new()];
    for (i, node) in nodes.nodes.iter().enumerate().filter(|(i, _)| is_clear(*i)) {
        for fit in evidence.fits_of(i).iter().filter(|fit| fit.label != node.label) {
            (0..2).for_each(|axis| slopes[axis].push(fit.moments.slopes[axis].abs()));
        }
    }
    (slopes[0].len() >= MIN_SLOPES).then(|| {
        slopes.map(|mut slopes| {
            slopes.sort_by(f32::total_cmp);
            slopes[slopes.len() / 2] / STUDENT_MEDIAN
        })
    })
}
