//! What is learned of the images: the error field of the rig, the noise of δ, and the widths of true and wrong orders.
//!
//! ```text
//! evidence of the largest nodes about no field: the orders that the largest surface could have, each an explanation
//! for each of them: field, noise and widths from its nodes at that order; then, twice, evidence and belief of all nodes,
//!                   and field, noise and widths from those that lead clearly
//! the explanation stays that is likeliest, by the likelihood of the nodes and the prior of the field
//! if the means of nodes scatter about its field as wrong orders do: again, with a wide prior of the field
//! ```

use super::Scratch;
use super::decay::decay;
use super::evidence::Evidence;
use super::field::Uncertainty;
use super::likelihood::{Moments, Widths, ln};
use super::model::{Model, Step};
use super::noise::Noise;
use super::rivals::fits_clearly;
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
    /// Whether the orders of the largest surface are compared. About a field of any size nearly all would fit.
    has_rivals: bool,
}

/// A node, and its label there, that is clear.
pub(super) type Clear = (u32, u8);

/// Scratch memory for values of nodes.
pub(super) type Values = Vec<[f32; 4]>;

/// What is learned of the images.
#[derive(Clone, Debug)]
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
    /// How likely it is, by the nodes and by the prior of its field, nats.
    pub(in crate::correspondence) nats: f64,
}

impl Scratch {
    /// Decides the largest nodes while field, noise and widths are learned from them.
    pub(super) fn learn(&mut self, view: View<'_>, known: Option<&Drift>, of_phase: Noise) -> Learned {
        let model = view.model;
        // The small error of a calibrated rig, and one of any size.
        let usual = Attempt { prior_px: model.prior_px, first_cap: model.first_cap_rad, rounds: 3, has_rivals: true };
        let any =
            Attempt { prior_px: model.wide_prior_px, first_cap: model.wide_cap_rad, rounds: 6, has_rivals: false };
        let none = Drift::level(0.0, f64::from(model.first_mean_rad));
        let mut best: Option<Learned> = None;
        for (attempt, start) in [(&usual, Some(&none)), (&usual, known), (&any, Some(&none))] {
            let Some(start) = start else { continue };
            let start = Learned::about(start, attempt, of_phase, model);
            let learned = self.explain_best(view, attempt, start);
            if !learned.is_scattered(model) || !model.does(Step::WideSearch) {
                return learned;
            }
            best = Some(match best {
                Some(before) if before.nats >= learned.nats => before,
                _ => learned,
            });
        }
        // Nothing is as it should be: the last attempt decided the nodes, the best one decides them again.
        let best = best.unwrap_or_else(|| Learned::about(&none, &any, of_phase, model));
        self.divide(view, 0, None);
        self.ask(view, 0, &best, None);
        best
    }

    /// Finds the likeliest explanation, and decides the nodes by it.
    fn explain_best(&mut self, view: View<'_>, attempt: &Attempt, start: Learned) -> Learned {
        self.divide(view, 0, None);
        if attempt.has_rivals {
            self.start_from_rivals(view, attempt, &start);
        }
        let mut rivals = std::mem::take(&mut self.explanations);
        let mut best = None::<Learned>;
        for rival in rivals.drain(..) {
            if best.is_some() {
                self.divide(view, 0, None);
            }
            let learned = self.learn_in_rounds(view, attempt, rival, attempt.rounds - 1, true);
            if best.as_ref().is_none_or(|best| learned.nats > best.nats) {
                best = Some(learned);
                self.swap_best();
            }
        }
        self.explanations = rivals;
        if let Some(best) = best {
            self.swap_best();
            return best;
        }
        // Without a large surface, from what is clear about the start.
        self.learn_in_rounds(view, attempt, start, attempt.rounds, false)
    }

    /// Exchanges the nodes and their evidence with those of the best explanation.
    fn swap_best(&mut self) {
        let Self { nodes, evidence, best_nodes, best_evidence, .. } = self;
        std::mem::swap(nodes, best_nodes);
        std::mem::swap(evidence, best_evidence);
    }

    /// Lists what the largest surface teaches at each order that it could have.
    fn start_from_rivals(&mut self, view: View<'_>, attempt: &Attempt, start: &Learned) {
        self.gather(view, 0, start);
        let Self { runs, nodes, evidence, rivals, .. } = self;
        rivals.find(runs.surfaces, nodes, evidence, view.model);
        for rival in 0..self.rivals.labels.len() {
            let Self { nodes, evidence, clear, rivals, .. } = self;
            clear.clear();
            clear.extend(rivals.nodes_of(rivals.labels[rival], nodes, evidence, view.model));
            let mut learned = start.clone();
            if self.teach(view, attempt, &mut learned) {
                self.explanations.push(learned);
            }
        }
    }

    /// Learns in rounds. `by_surfaces` tells whether an order outside the volume has its handicap for a whole surface in all
    /// rounds, not only in the last. Otherwise a large calibration error would pass for surfaces outside.
    fn learn_in_rounds(
        &mut self,
        view: View<'_>,
        attempt: &Attempt,
        mut learned: Learned,
        rounds: usize,
        by_surfaces: bool,
    ) -> Learned {
        for round in 0..rounds {
            learned.is_settled = round + 1 == rounds;
            let is_of_surface = by_surfaces || learned.is_settled;
            learned.outside_nats = if is_of_surface { view.model.outside_nats } else { f32::INFINITY };
            self.ask(view, 0, &learned, None);
            self.list_clear(view.model);
            self.teach(view, attempt, &mut learned);
        }
        let nats = f64::from(view.model.independent_nodes) * self.nats_a_pixel(&learned.widths_at(0), view.model);
        learned.nats = nats - prior_cost(&learned.field, attempt, view.model);
        learned
    }

    /// Learns field, noise and widths from the nodes that are clear. Tells whether they are enough for a field.
    fn teach(&mut self, view: View<'_>, attempt: &Attempt, learned: &mut Learned) -> bool {
        let Self { runs, nodes, evidence, clear, fitting, values, .. } = self;
        let start = (&learned.field, attempt.prior_px);
        let found = fitting.fit(view, start, runs, nodes, evidence, clear);
        let is_fitted = found.is_some();
        if let Some(found) = found {
            (learned.field, learned.uncertainty) = found;
        }
        if let Some(noise) = Noise::of_nodes(view, nodes, evidence, clear, values) {
            learned.noise = noise;
        }
        let widths = &mut learned.widths;
        if let Some([_, along, across, excess]) = wrong_widths(evidence, clear, values) {
            (widths.wrong_slopes, widths.wrong_excess) = ([along, across], excess);
        }
        let [mean, along, across, excess] = true_widths(view.model, evidence, clear, values).unwrap_or(USUAL_WIDTHS);
        (widths.mean, widths.slopes, widths.excess) = (mean, [along, across], excess);
        learned.cap = view.model.cap_rad;
        is_fitted
    }

    /// Lists the nodes from which field, noise and widths are learned.
    fn list_clear(&mut self, model: &Model) {
        let Self { nodes, evidence, clear, .. } = self;
        let leads = nodes.sampled().filter(|(_, node)| node.lead >= model.clear_nats);
        clear.clear();
        clear
            .extend(leads.map(|(i, node)| (i as u32, node.label)).filter(|clear| fits_clearly(evidence, clear, model)));
    }

    /// Mean log likelihood ratio of a pixel by its node at its order, nats: beyond the volume too as if the field were
    /// certain, since what is uncertain there is the same for all nodes.
    fn nats_a_pixel(&self, widths: &Widths, model: &Model) -> f64 {
        let Self { nodes, evidence, .. } = self;
        let (mut pixels, mut nats) = (0.0, 0.0);
        for (i, node) in nodes.sampled() {
            let size_px = f64::from(node.size_px);
            pixels += size_px;
            let ratio = evidence.fit(i, node.label).map_or(0.0, |fit| fit.moments.ratio(0.0, widths, model));
            nats += size_px * f64::from(ratio.max(0.0));
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

/// What the coefficients of a field have against them by the prior of an attempt, nats.
fn prior_cost(field: &Drift, attempt: &Attempt, model: &Model) -> f64 {
    let mean_rad = f64::from(model.first_mean_rad * attempt.prior_px / model.prior_px);
    let mean = field.mean_rad / mean_rad;
    let modes = field.error_px / f64::from(attempt.prior_px);
    0.5 * (mean * mean + modes * modes)
}

/// The excess in a tile whose side is this share of another's. Its variance in units of noise grows with the fourth power.
fn excess_in(excess: f32, share: f32) -> f32 {
    let ratio = 1.0 / (decay(f64::from(2.0 * excess)) as f32);
    0.5 * ln(1.0 + (ratio - 1.0) * share * share * share * share)
}

/// The widths of wrong orders: of the labels of clear nodes other than the decided one.
fn wrong_widths(evidence: &Evidence, clear: &[Clear], values: &mut Values) -> Option<[f32; 4]> {
    values.clear();
    for &(i, label) in clear {
        let wrong = evidence.fits_of(i as usize).iter().filter(|fit| fit.label != label);
        values.extend(wrong.map(|fit| amounts(&fit.moments)));
    }
    widths(values)
}

/// The widths of true orders: of the decided labels of clear nodes.
fn true_widths(model: &Model, evidence: &Evidence, clear: &[Clear], values: &mut Values) -> Option<[f32; 4]> {
    values.clear();
    let decided = clear.iter().filter_map(|&(i, label)| evidence.fit(i as usize, label));
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
