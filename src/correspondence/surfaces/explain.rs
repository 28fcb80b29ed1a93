//! Estimates the drift of one pair of images from orders that whole surfaces decide.
//!
//! ```text
//! if a drift is known: decide nodes by δ of few pixels about it
//! else, or if the images do not confirm it:
//!     decide nodes by δ of few pixels about 0, within wide limits; estimate the drift from their candidates
//!     decide nodes by δ of few pixels about that drift, within narrower limits
//! estimate the drift from these candidates, and from all candidates of the other nodes
//! decide doubtful nodes by more pixels about that drift
//! if few pixels are clear or fit, or δ scatters about the drift by more than noise, or widely with an unusual error:
//!     also estimate drifts by expectation maximization over all candidates of some pixels, in the volume and beyond,
//!         which finds fields beyond the wide limits
//!     decide nodes about each of these drifts; take the one that makes δ of all pixels most likely
//! ```

use std::f64::consts::TAU;

use super::decided::DecidedFilter;
use super::evidence::Sampling;
use super::order_scores::Gate;
use super::scratch::Scratch;
use crate::correspondence::delta_statistics::DeltaStatistics;
use crate::correspondence::drift::{Drift, DriftScratch, MODEL_SD_TURNS};
use crate::correspondence::view::View;

/// Limits of δ if the drift is unknown, turns (18°): those of rigs that are off by a pixel.
const WIDE: Gate = Gate { cap_turns: 0.05, beyond_turns: 0.0, most_turns: 0.05 };
/// Limit of δ about a first estimate, turns. The estimate is good in the middle of the image and worse away from it.
const MIDDLE_TURNS: f32 = 0.02;
/// Limit of δ about a known drift: this many sd, at least this many turns; more beyond the volume.
const NARROW_SD: f64 = 4.5;
const MIN_NARROW_TURNS: f64 = 0.004;
const BEYOND_TURNS: f32 = 0.01;
const MOST_TURNS: f32 = 0.06;
/// Largest known drift that is used, turns, and the largest calibration error behind it, pixels. Such a drift could
/// also be found from 0; a larger one may be the field of a wrong order of a flat board.
const MOST_KNOWN_TURNS: f64 = 0.05;
const MOST_KNOWN_PX: f64 = 1.5;
/// Largest distance between the drift of a window and the known one, turns (4°). It is taken over the whole volume; a
/// window shows only a part.
const NEAR_KNOWN_TURNS: f64 = 0.012;
/// sd of δ of true candidates without drift on such rigs, rad.
const WIDE_SD_RAD: f64 = 0.15;
/// Factor on the sd of a first estimate at which its refinement starts.
const REFINED_START_SD: f64 = 2.0;
/// Largest sd of δ of a part: without drift, turns; about a first estimate, as share of the limit on candidates.
const WIDE_PART_TURNS: f32 = 0.011;
const REFINED_PART_SHARE: f32 = 0.4;
/// Range over which false candidates spread about a first estimate, in limits on candidates: few of them are false.
const REFINED_SPREAD: f32 = 8.0;
/// Least share of clear pixels at which the drift of surfaces is accepted.
const MIN_CLEAR_SHARE: f64 = 0.5;
/// Least share of fitting pixels if δ scatters more widely than on calibrated rigs: half fit by chance.
const MIN_FITTING_SHARE: f32 = 0.6;
/// Calibration error, pixels, and sd about it, rad, below which a drift is accepted even then: the larger the error,
/// the smaller the rest must be.
const USUAL_ERRORS: [[f64; 2]; 2] = [[0.5, 0.03], [1.2, 0.012]];
/// Largest sd about a drift, rad, that is preferred to another: images of another rig agree within wide limits alone.
const MAX_SD_RAD: f64 = 0.05;
/// Largest sd of δ about a drift, relative to that of noise and of the model, that is not doubted.
const MAX_NOISE: f64 = 1.8;

/// Decides the nodes of all surfaces about the drift that they show. `None` if they show none.
pub(in crate::correspondence) fn explain_by_surfaces(
    view: View<'_>,
    scratch: &mut Scratch,
    drift_scratch: &mut DriftScratch,
) -> Option<Drift> {
    scratch.divide(view);
    scratch.explain_from_none(view, drift_scratch)
}

/// Mean log likelihood of δ of a pixel under the orders and the drift of surfaces, relative to chance, nats, over the
/// pixels of clear nodes; 0 if surfaces show no drift.
pub(in crate::correspondence) fn clear_nats(
    view: View<'_>,
    scratch: &mut Scratch,
    drift_scratch: &mut DriftScratch,
) -> f64 {
    explain_by_surfaces(view, scratch, drift_scratch).map_or(0.0, |drift| scratch.clear_share() * fit_nats(&drift))
}

/// Estimates the drift and decides the nodes of all surfaces about it. `delta` is the statistics of δ without drift,
/// and `known` the drift of an earlier window.
pub(in crate::correspondence) fn explain(
    view: View<'_>,
    delta: &DeltaStatistics,
    known: Option<&Drift>,
    scratch: &mut Scratch,
    drift_scratch: &mut DriftScratch,
) -> Drift {
    scratch.divide(view);
    if let Some(found) = known.and_then(|known| scratch.explain_from(view, known, delta, drift_scratch)) {
        return found;
    }
    match scratch.explain_from_none(view, drift_scratch) {
        Some(found) if scratch.is_confirmed(&found, delta) => found,
        found => {
            // The drift of the surfaces is missing or not confirmed: compare it with those from all candidates.
            let (mut drift, other) = drift_scratch.estimates(view, delta);
            let mut most = scratch.drift_nats(view, &drift);
            for other in [other, found].into_iter().flatten().filter(|other| other.residual_sd_rad < MAX_SD_RAD) {
                let nats = scratch.drift_nats(view, &other);
                if nats > most && scratch.fitting_share() > MIN_FITTING_SHARE {
                    (most, drift) = (nats, other);
                }
            }
            scratch.decide(view, &drift, narrow(&drift), Sampling::Many);
            drift
        }
    }
}

impl Scratch {
    /// Decides the nodes about the drift that they show.
    fn explain_from_none(&mut self, view: View<'_>, drift_scratch: &mut DriftScratch) -> Option<Drift> {
        let level = Drift::level(0.0, WIDE_SD_RAD);
        self.decide(view, &level, WIDE, Sampling::Few);
        let wide = [WIDE.cap_turns, WIDE_PART_TURNS, 2.0 * WIDE.cap_turns];
        let first = self.refined(view, &level, wide, WIDE_SD_RAD, drift_scratch)?;
        Some(self.explain_about(view, first, drift_scratch))
    }

    /// Decides the nodes from a known drift. `None` if the images do not confirm it.
    fn explain_from(
        &mut self,
        view: View<'_>,
        known: &Drift,
        delta: &DeltaStatistics,
        drift_scratch: &mut DriftScratch,
    ) -> Option<Drift> {
        let most_turns = (known.mean_rad.abs() + 2.0 * known.rms_rad) / TAU;
        if most_turns > MOST_KNOWN_TURNS || known.error_px > MOST_KNOWN_PX || known.residual_sd_rad > MAX_SD_RAD {
            return None;
        }
        let found = self.explain_about(view, known.clone(), drift_scratch);
        // A wrong known drift would lead to a different one.
        let is_near = found.distance_turns(known, view.table) < NEAR_KNOWN_TURNS;
        (is_near && self.fitting_share() > MIN_FITTING_SHARE && self.is_confirmed(&found, delta)).then_some(found)
    }

    /// Decides the nodes from a first estimate of the drift, and refines it.
    fn explain_about(&mut self, view: View<'_>, first: Drift, drift_scratch: &mut DriftScratch) -> Drift {
        let gate = Gate { cap_turns: narrow(&first).cap_turns.max(MIDDLE_TURNS), ..narrow(&first) };
        self.decide(view, &first, gate, Sampling::Few);
        let Gate { cap_turns, .. } = gate;
        let limits = [cap_turns, REFINED_PART_SHARE * cap_turns, REFINED_SPREAD * cap_turns];
        let sd_rad = first.residual_sd_rad;
        let found = self.refined(view, &first, limits, REFINED_START_SD * sd_rad, drift_scratch).unwrap_or(first);
        self.decide(view, &found, narrow(&found), Sampling::ManyOfDoubtful);
        found
    }

    /// Whether most surfaces are clear about the drift that they showed, and δ scatters about it like noise.
    fn is_confirmed(&self, found: &Drift, delta: &DeltaStatistics) -> bool {
        let fits = !delta.is_suspicious() || self.fitting_share() > MIN_FITTING_SHARE;
        let is_clear = fits && self.clear_share() >= MIN_CLEAR_SHARE;
        // If δ scattered widely without drift, the scene must lie outside the volume, and the error must be usual.
        is_clear && is_as_noise(found, delta) && (!delta.is_suspicious() || is_usual(found))
    }

    /// Decides the nodes about a drift. Returns the mean log likelihood of δ of a pixel relative to chance, nats.
    /// Beyond the volume the limits are the same as within: wider ones there would favour wrong orders.
    fn drift_nats(&mut self, view: View<'_>, drift: &Drift) -> f64 {
        let Gate { cap_turns, .. } = narrow(drift);
        self.decide(view, drift, Gate { cap_turns, beyond_turns: 0.0, most_turns: cap_turns }, Sampling::Few);
        f64::from(self.fitting_share()) * fit_nats(drift)
    }

    /// Refines a drift from decided candidates with |δ − drift| up to `cap_turns`. False ones spread over
    /// `spread_turns`.
    fn refined(
        &mut self,
        view: View<'_>,
        known: &Drift,
        [cap_turns, part_turns, spread_turns]: [f32; 3],
        sd_rad: f64,
        drift_scratch: &mut DriftScratch,
    ) -> Option<Drift> {
        let wanted = DecidedFilter { cap_turns, max_sd_turns: part_turns, with_unclear: known.error_px > 0.0 };
        let share = self.find_decided(view, known, wanted);
        drift_scratch.estimate_from_decided(view.table, &self.decided.candidates, share, spread_turns, (known, sd_rad))
    }
}

/// Log likelihood of δ of a true candidate relative to chance, nats: a normal distribution has the entropy
/// ln(sd·√(2πe)), a uniform one ln 2π.
fn fit_nats(drift: &Drift) -> f64 {
    (TAU / (drift.residual_sd_rad * (TAU * std::f64::consts::E).sqrt())).ln()
}

/// Whether δ scatters about a drift by little more than noise.
fn is_as_noise(drift: &Drift, delta: &DeltaStatistics) -> bool {
    drift.residual_sd_rad < MAX_NOISE * delta.noise_sd_rad.hypot(MODEL_SD_TURNS * TAU)
}

/// Whether error and sd are those of calibrated rigs.
fn is_usual(drift: &Drift) -> bool {
    let is_below = |[error_px, sd_rad]: [f64; 2]| drift.error_px < error_px && drift.residual_sd_rad < sd_rad;
    USUAL_ERRORS.into_iter().any(is_below)
}

fn narrow(drift: &Drift) -> Gate {
    let cap_turns = (NARROW_SD * drift.residual_sd_rad / TAU).max(MIN_NARROW_TURNS) as f32;
    Gate { cap_turns, beyond_turns: BEYOND_TURNS, most_turns: MOST_TURNS.max(cap_turns) }
}
