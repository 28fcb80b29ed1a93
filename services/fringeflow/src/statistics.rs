//! Statistics of a reconstruction, as text and JSON.

use std::collections::BTreeMap;
use std::fmt;

use serde::Serialize;

use fringeflow::correspondence::{DeltaStatistics, Drift, Outcome, OutcomeCounts};
use fringeflow::phase::Motion;
use fringeflow_telemetry::HealthFigures;

use crate::proposed::ProposedOutput;

/// Share of the pixels with a phase from which on it is told first that they see what is outside, percent.
const MANY_OUTSIDE_PERCENT: f64 = 50.0;

/// Statistics of a reconstruction.
#[derive(Serialize)]
pub(crate) struct Statistics {
    /// The health quantities of the images and the result, against their limits.
    pub(crate) health: HealthFigures,
    /// What seems to be wrong in calibration, pattern or images.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) likely_cause: Option<String>,
    /// Mean number of fringe periods on a segment: n.
    pub(crate) mean_periods: f64,
    /// Mean of δ, rad.
    pub(crate) delta_mean_rad: f64,
    /// Standard deviation of δ, rad: sd.
    pub(crate) delta_sd_rad: f64,
    /// Contribution of noise to sd, rad.
    pub(crate) delta_noise_sd_rad: f64,
    /// Threshold thr = 3·sd, rad.
    pub(crate) threshold_rad: f64,
    /// Expected false candidates per true one by Eq. (1): efc.
    pub(crate) efc_predicted: f64,
    /// Drift of the calibration, about which δ is tested; `None` with the paper's resolution.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) drift: Option<DriftFigures>,
    /// Candidates per point that passed the test besides the chosen one.
    pub(crate) efc_measured: f64,
    /// Expected percentage of unique correspondences (paper, 2.2.1): puc, from `efc_predicted`.
    pub(crate) puc_predicted: f64,
    /// Percentage of the points whose pixel had a single candidate; `None` without points.
    pub(crate) puc_measured: Option<f64>,
    /// Median fit residual ÷ modulation of C1 and C2; `None` for three steps.
    pub(crate) fit_residual_share: [Option<f32>; 2],
    /// Noise of C1 and C2, grey levels.
    pub(crate) noise_grey: [f32; 2],
    /// Motion of the scene in C1 and C2; `None` if there were no more images than a cycle.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) motion: Option<[MotionFigures; 2]>,
    /// Steps by which the patterns of C1 and C2 were ahead of the declared ones; the phases were corrected.
    pub(crate) slip_steps: [usize; 2],
    /// Share of the pixels with a phase that see surfaces outside the measurement volume, percent.
    pub(crate) outside_percent: f64,
    /// Number of pixels of C1 by outcome.
    pub(crate) pixels: BTreeMap<&'static str, u64>,
}

/// Motion of the scene in the images of one camera.
#[derive(Serialize)]
pub(crate) struct MotionFigures {
    /// Median of the phase motion per image, rad.
    pub(crate) median_rad: f32,
    /// Magnitude that the phase motion exceeds at one pixel in twenty, rad.
    pub(crate) fast_rad: f32,
    /// Largest relative deviation of the brightness of an image from the mean. It is compensated.
    pub(crate) brightness_share: f32,
    /// Pixels decoded from a part of their images, which shows a single surface.
    pub(crate) one_surface_pixels: u64,
    /// Pixels left out because of their motion.
    pub(crate) lost_pixels: u64,
}

impl MotionFigures {
    fn from_motion(motion: &Motion) -> Self {
        let Motion { median_rad, fast_rad, brightness_share, one_surface_pixels, lost_pixels } = *motion;
        Self { median_rad, fast_rad, brightness_share, one_surface_pixels, lost_pixels }
    }
}

/// Drift of the calibration, estimated from the images.
#[derive(Serialize)]
pub(crate) struct DriftFigures {
    /// Root mean square of the δ that it causes over the measurement volume, rad.
    pub(crate) rms_rad: f64,
    /// Errors of the calibration parameters that explain it, pixels at the border of an image; root of the sum of
    /// squares.
    pub(crate) error_px: f64,
    /// Standard deviation of δ about the drift, rad: the part that is noise.
    pub(crate) residual_sd_rad: f64,
    /// Share of the pixels with a candidate that agrees with the drift, in [0, 1].
    pub(crate) share: f64,
    /// efc of Eq. (1) with the residual sd.
    pub(crate) efc: f64,
    /// Expected percentage of unique correspondences for this efc.
    pub(crate) puc: f64,
}

impl DriftFigures {
    fn new(drift: &Drift, delta: &DeltaStatistics) -> Self {
        let residual = drift.residual_statistics(delta);
        Self {
            rms_rad: drift.rms_rad,
            error_px: drift.error_px,
            residual_sd_rad: drift.residual_sd_rad,
            share: drift.share,
            efc: residual.expected_false_candidates(),
            puc: residual.expected_unique_percent(),
        }
    }
}

impl Statistics {
    /// Statistics of a result of the proposed method.
    pub(crate) fn new(ProposedOutput { reconstruction, health, likely_cause, .. }: &ProposedOutput) -> Self {
        let matches = &reconstruction.matches;
        let counts = OutcomeCounts::from_outcomes(&matches.outcomes);
        let lit = matches.outcomes.len() as u64 - counts.get(Outcome::Invalid);
        Self {
            health: health.clone(),
            likely_cause: likely_cause.clone(),
            mean_periods: matches.delta.mean_periods,
            delta_mean_rad: matches.delta.mean_rad,
            delta_sd_rad: matches.delta.sd_rad,
            delta_noise_sd_rad: matches.delta.noise_sd_rad,
            threshold_rad: matches.delta.threshold_rad(),
            efc_predicted: matches.delta.expected_false_candidates(),
            drift: matches.drift.as_ref().map(|drift| DriftFigures::new(drift, &matches.delta)),
            efc_measured: reconstruction.cloud.false_candidates_per_point(),
            puc_predicted: matches.delta.expected_unique_percent(),
            puc_measured: counts.unique_percent(),
            fit_residual_share: [reconstruction.cam1.fit.residual_share, reconstruction.cam2.fit.residual_share],
            noise_grey: [reconstruction.cam1.fit.noise_grey, reconstruction.cam2.fit.noise_grey],
            motion: reconstruction
                .cam1
                .motion
                .zip(reconstruction.cam2.motion)
                .map(|(a, b)| [a, b].map(|motion| MotionFigures::from_motion(&motion))),
            slip_steps: matches.slip_steps,
            outside_percent: 100.0 * counts.get(Outcome::OutsideVolume) as f64 / lit.max(1) as f64,
            pixels: counts
                .iter()
                .filter(|&(outcome, _)| outcome != Outcome::GrayCode)
                .map(|(outcome, count)| (outcome.name(), count))
                .collect(),
        }
    }

    /// What a person reads first, a line each: what seems to be wrong, and every quantity beyond its limits.
    pub(crate) fn warnings(&self) -> Vec<String> {
        faults(&self.health, self.likely_cause.as_deref()).iter().map(|fault| format!("warning: {fault}")).collect()
    }

    /// What the first line of a result adds where most of the image shows other things than the object.
    pub(crate) fn outside_note(&self) -> Option<String> {
        let share = self.outside_percent;
        (share > MANY_OUTSIDE_PERCENT)
            .then(|| format!("; {share:.0} % of the pixels with a phase see surfaces outside the measurement volume"))
    }
}

/// What seems to be wrong, and every quantity beyond its limits, a line each.
pub(crate) fn faults(health: &HealthFigures, likely_cause: Option<&str>) -> Vec<String> {
    let causes = likely_cause.into_iter().map(str::to_owned);
    causes.chain(health.beyond_limits().iter().map(ToString::to_string)).collect()
}

impl fmt::Display for Statistics {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "n {:.2} periods on a segment, sd of δ {:.4} rad (mean {:+.4}, noise {:.4}), thr {:.4} rad",
            self.mean_periods, self.delta_sd_rad, self.delta_mean_rad, self.delta_noise_sd_rad, self.threshold_rad
        )?;
        if let Some(drift) = &self.drift {
            writeln!(
                f,
                "drift of the calibration {:.4} rad rms (errors of {:.2} px); about it sd {:.4} rad, efc {:.3}, puc {:.2} %",
                drift.rms_rad, drift.error_px, drift.residual_sd_rad, drift.efc, drift.puc
            )?;
        }
        if let Some([cam1, cam2]) = &self.motion {
            writeln!(
                f,
                "motion {:+.3} and {:+.3} rad per image (1 in 20 pixels beyond {:.3} and {:.3}), brightness within \
                 {:.2} %; {} and {} pixels decoded from part of their images, {} and {} left out",
                cam1.median_rad,
                cam2.median_rad,
                cam1.fast_rad,
                cam2.fast_rad,
                100.0 * cam1.brightness_share.max(cam2.brightness_share),
                cam1.one_surface_pixels,
                cam2.one_surface_pixels,
                cam1.lost_pixels,
                cam2.lost_pixels
            )?;
        }
        if self.slip_steps != [0; 2] {
            let [cam1, cam2] = self.slip_steps;
            writeln!(
                f,
                "warning: the patterns of C1 and C2 were {cam1} and {cam2} steps ahead of the declared phase shifts; \
                 the phases were corrected"
            )?;
        }
        writeln!(
            f,
            "efc {:.3} predicted by Eq. (1), {:.3} measured; puc {:.2} % predicted, {:.2} % of the points had a single \
             candidate",
            self.efc_predicted,
            self.efc_measured,
            self.puc_predicted,
            self.puc_measured.unwrap_or_default()
        )?;
        for outcome in Outcome::ALL {
            if let Some(count) = self.pixels.get(outcome.name()) {
                writeln!(f, "{:>10} pixels  {}", count, outcome.name())?;
            }
        }
        Ok(())
    }
}
