//! The drift of one pair of images, from orders that whole surfaces decided.
//!
//! ```text
//! where a drift is known beforehand: nodes decided by δ of few pixels about it
//! else, and where the images do not bear it out: nodes decided by δ of few pixels about 0 within wide limits;
//!     the drift that their candidates show, nodes decided by δ of few pixels about it within narrower limits
//! the drift that these candidates show, and all of pixels whose nodes are not clear; doubtful nodes decided by more pixels about it
//! where few pixels are clear then or few fit, or δ scatters about it by more than noise, or widely and the error is unusual: also
//!     the drifts by expectation maximization over all candidates of some pixels, within the volume and beyond it, which finds
//!     fields beyond the wide limits; nodes decided about each of these, and about that which makes δ of all pixels likeliest
//! ```

use std::f64::consts::TAU;

use super::decided::DecidedFilter;
use super::evidence::{Gate, Sampling, Scratch, View};
use crate::correspondence::delta_statistics::DeltaStatistics;
use crate::correspondence::drift::{Drift, DriftScratch, MODEL_SD_TURNS};

/// Limits of δ where nothing is known of the drift, turns (18°): those of rigs that are off by a pixel.
const WIDE: Gate = Gate { cap_turns: 0.05, beyond_turns: 0.0, most_turns: 0.05 };
/// The same about a first estimate, which is known in the middle of the image and leads away from there, turns.
const MIDDLE_TURNS: f32 = 0.02;
/// The same about a drift that is known: so many sd, no less than so many turns; more beyond the volume.
const NARROW_SD: f64 = 4.5;
const MIN_NARROW_TURNS: f64 = 0.004;
const BEYOND_TURNS: f32 = 0.01;
const MOST_TURNS: f32 = 0.06;
/// Most of a drift that is known beforehand, turns, and of the calibration error behind it, pixels: what may be found from 0. Beyond,
/// a wrong order of a flat board has such a field.
const MOST_KNOWN_TURNS: f64 = 0.05;
const MOST_KNOWN_PX: f64 = 1.5;
/// How far the drift that a window shows may be off the one that was known, turns (4°): over the whole volume, of which it shows a
/// part.
const NEAR_KNOWN_TURNS: f64 = 0.012;
/// sd of δ of true candidates about no drift on rigs that are off by so much, rad.
const WIDE_SD_RAD: f64 = 0.15;
/// sd with which the drift is estimated about a first estimate, in that of this.
const REFINED_START_SD: f64 = 2.0;
/// sd of δ of a part that tells of the drift: about none, turns; about a first estimate, as share of what candidates may be off.
const WIDE_PART_TURNS: f32 = 0.011;
const REFINED_PART_SHARE: f32 = 0.4;
/// Turns over which false candidates spread about a first estimate, in what candidates may be off: few of them are false.
const REFINED_SPREAD: f32 = 8.0;
/// Share of clear pixels below which the drift of surfaces is not believed.
const MIN_CLEAR_SHARE: f64 = 0.5;
/// Share of all pixels that must fit where δ scatters more widely than on calibrated rigs: half do by chance.
const MIN_FITTING_SHARE: f32 = 0.6;
/// Calibration error, pixels, and sd about it, rad, below which nothing else is asked even there: the larger the error, the less may
/// be left.
const USUAL_ERRORS: [[f64; 2]; 2] = [[0.5, 0.03], [1.2, 0.012]];
/// sd about a drift, rad, above which it is not preferred to another: images of another rig agree within wide limits alone.
const MAX_SD_RAD: f64 = 0.05;
/// sd of δ about a drift, in that of noise and of what drifts do not follow, up to which it is not doubted.
const MAX_NOISE: f64 = 1.8;

/// Decides the nodes of all surfaces about the drift that they show themselves; `None` if they show none.
pub(in crate::correspondence) fn explain_by_surfaces(
    view: View<'_>,
    scratch: &mut Scratch,
    drift_scratch: &mut DriftScratch,
) -> Option<Drift> {
    scratch.divide(view);
    scratch.explain_from_none(view, drift_scratch)
}

/// How much more likely than by chance the orders and the drift that surfaces show make δ of a pixel, nats, of pixels whose nodes lead
/// clearly; 0 if they show none.
pub(in crate::correspondence) fn clear_nats(
    view: View<'_>,
    scratch: &mut Scratch,
    drift_scratch: &mut DriftScratch,
) -> f64 {
    explain_by_surfaces(view, scratch, drift_scratch).map_or(0.0, |drift| scratch.clear_share() * fit_nats(&drift))
}

/// Estimates the drift and decides the nodes of all surfaces about it; `delta` is what is known of δ without it, and `known` what an
/// earlier window showed.
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
            let (mut drift, other) = drift_scratch.estimates((view.cam1, view.cam2), view.table, delta);
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

    /// The same where one is known beforehand; `None` where the images do not bear it out.
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
        let is_near = found.distance_turns(known, view.table) < NEAR_KNOWN_TURNS;
        (is_near && self.fitting_share() > MIN_FITTING_SHARE && self.is_confirmed(&found, delta)).then_some(found)
    }

    /// The same about a first estimate.
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

    /// Whether most surfaces lead clearly about a drift that they showed, and δ scatters about it as noise does.
    fn is_confirmed(&self, found: &Drift, delta: &DeltaStatistics) -> bool {
        let fits = !delta.is_suspicious() || self.fitting_share() > MIN_FITTING_SHARE;
        let is_clear = fits && self.clear_share() >= MIN_CLEAR_SHARE;
        // What scattered lies outside the volume.
        is_clear && is_as_noise(found, delta) && (!delta.is_suspicious() || is_usual(found))
    }

    /// How much more likely a drift makes δ of a pixel than chance, by the orders that are decided about it: the logarithm, nats. What
    /// lies beyond the volume must fit as closely as what lies within: where more is allowed there, wrong orders within are ahead.
    fn drift_nats(&mut self, view: View<'_>, drift: &Drift) -> f64 {
        let Gate { cap_turns, .. } = narrow(drift);
        self.decide(view, drift, Gate { cap_turns, beyond_turns: 0.0, most_turns: cap_turns }, Sampling::Few);
        f64::from(self.fitting_share()) * fit_nats(drift)
    }

    /// The drift that decided candidates show, off a known one by no more than a cap; false ones spread over so many turns.
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

/// How much more likely a drift makes δ of a true candidate than chance, nats: a normal distribution has the entropy ln(sd·√(2πe)), a
/// turn that of ln 2π.
fn fit_nats(drift: &Drift) -> f64 {
    (TAU / (drift.residual_sd_rad * (TAU * std::f64::consts::E).sqrt())).ln()
}

/// Whether δ scatters about a drift by little more than noise does.
fn is_as_noise(drift: &Drift, delta: &DeltaStatistics) -> bool {
    drift.residual_sd_rad < MAX_NOISE * delta.noise_sd_rad.hypot(MODEL_SD_TURNS * TAU)
}

/// Whether an error explains decided candidates as calibrated rigs have it.
fn is_usual(drift: &Drift) -> bool {
    let is_below = |[error_px, sd_rad]: [f64; 2]| drift.error_px < error_px && drift.residual_sd_rad < sd_rad;
    USUAL_ERRORS.into_iter().any(is_below)
}

fn narrow(drift: &Drift) -> Gate {
    let cap_turns = (NARROW_SD * drift.residual_sd_rad / TAU).max(MIN_NARROW_TURNS) as f32;
    Gate { cap_turns, beyond_turns: BEYOND_TURNS, most_turns: MOST_TURNS.max(cap_turns) }
}
