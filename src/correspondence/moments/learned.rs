//! What is learned of the images: the error field of the rig, the noise of δ, and the widths of true and wrong orders.
//!
//! ```text
//! some times: evidence and belief of the largest nodes; then field, noise and widths from those that lead clearly
//! if it is disputed which nodes lie in the volume: again, the other way; the field about which nodes are likelier stays
//! if the means of nodes scatter about that field as wrong orders do: again, with a wide prior of the field
//! ```
//!
//! While a field is learned, an order outside the volume has its handicap in each node: so a large calibration error does
//! not pass for surfaces outside. But to a board close behind the volume that error is there, at wrong orders inside. So
//! where the first round decides otherwise if an order has its handicap once for a whole surface, the field is learned both
//! ways.

use super::Scratch;
use super::decay::decay;
use super::evidence::Evidence;
use super::field::{MIN_NODES, Uncertainty};
use super::likelihood::{Moments, Widths, ln};
use super::model::{Model, Step};
use super::nodes::{NOTHING, Node, Nodes};
use super::noise::Noise;
use crate::correspondence::drift::Drift;
use crate::correspondence::view::View;

/// Widths of wrong slopes until they are measured, rad per half tile.
const WRONG_SLOPES: [f32; 2] = [0.2, 0.1];
/// |x| of Student's t with three degrees of freedom that half of its values exceed.
const STUDENT_MEDIAN: f32 = 0.765;
/// Widths of mean, rad, slopes, rad per half tile, and excess of true orders where they cannot be measured.
const USUAL_WIDTHS: [f32; 4] = [0.015, 0.03, 0.03, 0.15];
/// Least width of the excess of true orders.
const MIN_EXCESS: f32 = 0.1;
/// Fewest values from which a width is measured.
const MIN_VALUES: usize = 50;

/// The prior of the field and the rounds of a search.
struct Attempt {
    /// sd of the coefficient of a mode, pixels of calibration error.
    prior_px: f32,
    /// |δ − field| below which a sample fits about no field, rad.
    first_cap: f32,
    /// Rounds of learning.
    rounds: usize,
}

/// Scratch memory for values of nodes.
pub(super) type Values = Vec<[f32; 4]>;

/// What is learned of the images.
pub(in crate::correspondence) struct Learned {
    pub(in crate::correspondence) field: Drift,
    pub(super) noise: Noise,
    pub(super) widths: Widths,
    pub(super) uncertainty: Uncertainty,
    /// |δ − field| below which a sample fits, rad.
    pub(super) cap: f32,
    /// Whether this is the last round, about the final field.
    pub(super) is_settled: bool,
    /// Handicap of an order outside the volume for a whole surface, nats; infinite: each node has the whole of its own.
    pub(super) outside_nats: f32,
    /// Nodes that the first round put outside the volume until each had the whole handicap of an order there.
    disputed: usize,
    /// Mean log likelihood ratio of a pixel by its node, nats.
    pub(in crate::correspondence) nats: f64,
}

impl Scratch {
    /// Decides the largest nodes while field, noise and widths are learned from them.
    pub(super) fn learn(&mut self, view: View<'_>, known: Option<&Drift>, of_phase: Noise) -> Learned {
        let model = view.model;
        // The small error of a calibrated rig, and one of any size.
        let usual = Attempt { prior_px: model.prior_px, first_cap: model.first_cap_rad, rounds: 3 };
        let any = Attempt { prior_px: model.wide_prior_px, first_cap: model.wide_cap_rad, rounds: 6 };
        let none = Drift::level(0.0, f64::from(model.first_mean_rad));
        let mut best: Option<Learned> = None;
        for (attempt, start) in [(&usual, Some(&none)), (&usual, known), (&any, Some(&none))] {
            let Some(start) = start else { continue };
            let mut learned = self.learn_from(view, attempt, start, of_phase, false);
            // Whether the nodes are decided by what counts.
            let mut decides = true;
            if learned.disputed >= MIN_NODES {
                let other = self.learn_from(view, attempt, start, of_phase, true);
                decides = other.nats > learned.nats;
                if decides {
                    learned = other;
                }
            }
            if !learned.is_scattered(model) || !model.does(Step::WideSearch) {
                return if decides { learned } else { self.decide_again(view, learned) };
            }
            best = Some(match best {
                Some(before) if before.nats >= learned.nats => before,
                _ => learned,
            });
        }
        // Nothing is as it should be: the last attempt decided the nodes, the best one decides them again.
        let best = best.unwrap_or_else(|| Learned::about(&none, &any, of_phase, model));
        self.decide_again(view, best)
    }

    /// Decides the nodes from what was learned before another attempt.
    fn decide_again(&mut self, view: View<'_>, mut learned: Learned) -> Learned {
        self.divide(view, 0, None);
        self.ask(view, 0, &learned, None);
        learned.nats = self.nats();
        learned
    }

    /// Learns in rounds, starting from a field. `by_surfaces` tells whether an order outside the volume has its handicap
    /// for a whole surface in all rounds, not only in the last.
    fn learn_from(
        &mut self,
        view: View<'_>,
        attempt: &Attempt,
        start: &Drift,
        of_phase: Noise,
        by_surfaces: bool,
    ) -> Learned {
        let mut learned = Learned::about(start, attempt, of_phase, view.model);
        self.divide(view, 0, None);
        for round in 0..attempt.rounds {
            learned.is_settled = round + 1 == attempt.rounds;
            let is_of_surface = by_surfaces || learned.is_settled || round == 0;
            learned.outside_nats = if is_of_surface { view.model.outside_nats } else { f32::INFINITY };
            self.ask(view, 0, &learned, None);
            let is_raised = !by_surfaces && round == 0;
            if is_raised {
                self.raise_handicap(view.model);
            }
            self.list_clear(view.model);
            if is_raised {
                learned.disputed = self.count_disputed();
            }
            let Self { runs, nodes, evidence, clear, fitting, values, .. } = self;
            let start = (&learned.field, attempt.prior_px);
            if let Some(found) = fitting.fit(view, start, runs, nodes, evidence, clear) {
                (learned.field, learned.uncertainty) = found;
            }
            if let Some(noise) = Noise::of_nodes(view, nodes, evidence, clear, values) {
                learned.noise = noise;
            }
            let widths = &mut learned.widths;
            if let Some([_, along, across, excess]) = wrong_widths(nodes, evidence, clear, values) {
                (widths.wrong_slopes, widths.wrong_excess) = ([along, across], excess);
            }
            let [mean, along, across, excess] =
                true_widths(view.model, nodes, evidence, clear, values).unwrap_or(USUAL_WIDTHS);
            (widths.mean, widths.slopes, widths.excess) = (mean, [along, across], excess);
            learned.cap = view.model.cap_rad;
        }
        learned.nats = self.nats();
        learned
    }

    /// Lists the nodes from which field, noise and widths are learned.
    fn list_clear(&mut self, model: &Model) {
        let Self { nodes, evidence, clear, .. } = self;
        let is_clear = |i: usize, node: &Node| {
            let fit = evidence.fit(i, node.label);
            node.lead >= model.clear_nats
                && fit.is_some_and(|f| f.ratio >= model.clear_nats && f.moments.share >= model.clear_share)
        };
        clear.clear();
        clear.extend((0_u32..).zip(&nodes.nodes).filter(|(i, node)| is_clear(*i as usize, node)).map(|(i, _)| i));
    }

    /// Raises the handicap of orders outside the volume from that for whole surfaces to that of each node, and decides
    /// the nodes again.
    fn raise_handicap(&mut self, model: &Model) {
        let Self { nodes, evidence, outside, of_surface, .. } = self;
        let is_outside = |node: &Node| node.sampled > 0 && node.label != NOTHING && !node.has_inside(node.label);
        outside.clear();
        outside.extend(nodes.nodes.iter().map(is_outside));
        evidence.raise_handicap(&nodes.nodes, of_surface, model);
        self.decide(model, 0);
    }

    /// Counts the clear nodes that came into the volume when the handicap was raised.
    fn count_disputed(&self) -> usize {
        let Self { nodes, clear, outside, .. } = self;
        let is_inside = |node: &Node| node.has_inside(node.label);
        clear.iter().map(|&i| i as usize).filter(|&i| outside[i] && is_inside(&nodes.nodes[i])).count()
    }

    /// Mean log likelihood ratio of a pixel by its node at its order, nats.
    fn nats(&self) -> f64 {
        let Self { nodes, evidence, .. } = self;
        let (mut pixels, mut nats) = (0.0, 0.0);
        for (i, node) in nodes.nodes.iter().enumerate().filter(|(_, node)| node.sampled > 0) {
            let size_px = f64::from(node.size_px);
            pixels += size_px;
            nats += evidence.fit(i, node.label).map_or(0.0, |fit| size_px * f64::from(fit.ratio.max(0.0)));
        }
        nats / f64::max(pixels, 1.0)
    }
}

impl Learned {
    /// What is known before anything is learned.
    fn about(field: &Drift, attempt: &Attempt, of_phase: Noise, model: &Model) -> Self {
        let widths = Widths {
            mean: model.first_mean_rad,
            slopes: [USUAL_WIDTHS[1], USUAL_WIDTHS[2]],
            wrong_slopes: WRONG_SLOPES,
            wrong_mean: Some(model.wrong_mean_rad),
            excess: USUAL_WIDTHS[3],
            wrong_excess: USUAL_WIDTHS[3],
        };
        Self {
            field: field.clone(),
            noise: of_phase.before_nodes(),
            widths,
            uncertainty: Uncertainty::default(),
            cap: attempt.first_cap,
            is_settled: false,
            outside_nats: f32::INFINITY,
            disputed: 0,
            nats: 0.0,
        }
    }

    /// Whether the means of nodes lie about the field as those of wrong orders do.
    pub(in crate::correspondence) fn is_scattered(&self, model: &Model) -> bool {
        self.field.residual_sd_rad.is_nan() || self.field.residual_sd_rad > f64::from(model.scattered_rad)
    }

    /// Widths for the tiles of a level. A node of the largest tiles is asked without regard to its neighbours.
    pub(super) fn widths_at(&self, level: u8) -> Widths {
        let beside = self.widths_beside(level);
        if level == 0 { Widths { wrong_mean: None, ..beside } } else { beside }
    }

    /// Widths for a node of a level beside another one of its order: slopes are counted per half tile, and what bends
    /// grows with the square of the side.
    pub(super) fn widths_beside(&self, level: u8) -> Widths {
        let share = 1.0 / f32::from(1_u16 << level);
        let Widths { mean, slopes, wrong_slopes, wrong_mean, excess, wrong_excess } = self.widths;
        let [slopes, wrong_slopes] = [slopes, wrong_slopes].map(|widths| widths.map(|width| width * share));
        let [excess, wrong_excess] = [excess, wrong_excess].map(|width| excess_in(width, share));
        let wrong_mean = wrong_mean.map(|width| width * share);
        Widths { mean, slopes, wrong_slopes, wrong_mean, excess, wrong_excess }
    }
}

/// The excess in a tile whose side is this share of another's. Its variance in units of noise grows with the fourth power.
fn excess_in(excess: f32, share: f32) -> f32 {
    let ratio = 1.0 / (decay(f64::from(2.0 * excess)) as f32);
    0.5 * ln(1.0 + (ratio - 1.0) * share * share * share * share)
}

/// The widths of wrong orders: of the labels of clear nodes other than the decided one.
fn wrong_widths(nodes: &Nodes, evidence: &Evidence, clear: &[u32], values: &mut Values) -> Option<[f32; 4]> {
    values.clear();
    for i in clear.iter().map(|&i| i as usize) {
        let wrong = evidence.fits_of(i).iter().filter(|fit| fit.label != nodes.nodes[i].label);
        values.extend(wrong.map(|fit| amounts(&fit.moments)));
    }
    widths(values)
}

/// The widths of true orders: of the decided labels of clear nodes.
fn true_widths(
    model: &Model,
    nodes: &Nodes,
    evidence: &Evidence,
    clear: &[u32],
    values: &mut Values,
) -> Option<[f32; 4]> {
    values.clear();
    let decided = clear.iter().map(|&i| i as usize).filter_map(|i| evidence.fit(i, nodes.nodes[i].label));
    values.extend(decided.map(|fit| amounts(&fit.moments)));
    let [mean, along, across, excess] = widths(values)?;
    let [mean, along, across] =
        [mean, along, across].map(|width| width.clamp(model.min_width_rad, model.max_width_rad));
    Some([mean, along, across, excess.max(MIN_EXCESS)])
}

/// Amounts of mean, slopes and excess.
fn amounts(moments: &Moments) -> [f32; 4] {
    let [along, across] = moments.slopes;
    [moments.mean, along, across, moments.excess()].map(f32::abs)
}

/// Width of the density of Student's t of each column of amounts, by its median. `None` if they are too few.
fn widths(values: &mut Values) -> Option<[f32; 4]> {
    (values.len() / 2 >= MIN_VALUES / 2).then(|| [0, 1, 2, 3].map(|column| median(values, column) / STUDENT_MEDIAN))
}

/// Median of a column of values, which are put into another order.
pub(super) fn median(values: &mut [[f32; 4]], column: usize) -> f32 {
    let middle = values.len() / 2;
    values.select_nth_unstable_by(middle, |a, b| a[column].total_cmp(&b[column])).1[column]
}
