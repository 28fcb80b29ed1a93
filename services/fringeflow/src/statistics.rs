//! The figures behind a reconstruction, as text and JSON.

use std::collections::BTreeMap;
use std::fmt;

use serde::Serialize;

use fringeflow::correspondence::{Outcome, OutcomeCounts};
use fringeflow::phase::Motion;
use fringeflow_telemetry::health::Quantity;

use crate::proposed::Proposed;

/// What a reconstruction rests on.
#[derive(Serialize)]
pub(crate) struct Statistics {
    /// Mean number of fringe periods on a segment: n.
    pub(crate) mean_periods: f64,
    /// Mean of δ, rad.
    pub(crate) delta_mean_rad: f64,
    /// Standard deviation of δ, rad: sd.
    pub(crate) delta_sd_rad: f64,
    /// What noise contributes to sd, rad.
    pub(crate) delta_noise_sd_rad: f64,
    /// Whether sd is beyond what calibrated rigs have.
    pub(crate) delta_suspicious: bool,
    /// Threshold thr = 3·sd, rad.
    pub(crate) threshold_rad: f64,
    /// Expected false candidates per true one by Eq. (1): efc.
    pub(crate) efc_predicted: f64,
    /// The drift that δ was judged about; none by the paper's resolution.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) drift: Option<DriftFigures>,
    /// Candidates beyond the chosen one that passed the test, per point.
    pub(crate) efc_measured: f64,
    /// Share of the points whose pixel had one candidate only, percent.
    pub(crate) unique_percent: f64,
    /// Median fit residual ÷ modulation of C1 and C2; none for three steps.
    pub(crate) fit_residual_share: [Option<f32>; 2],
    /// Noise of C1 and C2, grey levels.
    pub(crate) noise_grey: [f32; 2],
    /// How the scene moved, as C1 and C2 saw it; none where no more images than a cycle tell.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) motion: Option<[MotionFigures; 2]>,
    /// Steps by which the patterns of C1 and C2 were ahead of the declared ones; the phases were corrected.
    pub(crate) slip_steps: [usize; 2],
    /// Pixels of C1 by what became of them.
    pub(crate) pixels: BTreeMap<&'static str, u64>,
}

/// Motion as one camera saw it.
#[derive(Serialize)]
pub(crate) struct MotionFigures {
    /// Median phase moved from image to image, rad.
    pub(crate) median_rad: f32,
    /// What its amount exceeds at one pixel in twenty, rad.
    pub(crate) fast_rad: f32,
    /// Greatest departure of the brightness of an image from the mean, as a share; compensated.
    pub(crate) brightness_share: f32,
    /// Pixels decoded from the images that show one surface.
    pub(crate) one_surface_pixels: u64,
    /// Pixels left out for their motion.
    pub(crate) lost_pixels: u64,
}

impl MotionFigures {
    fn of(motion: &Motion) -> Self {
        let Motion { median_rad, fast_rad, brightness_share, one_surface_pixels, lost_pixels } = *motion;
        Self { median_rad, fast_rad, brightness_share, one_surface_pixels, lost_pixels }
    }
}

/// What the calibration error amounts to, as the images show it.
#[derive(Serialize)]
pub(crate) struct DriftFigures {
    /// Root mean square over the measurement volume of δ that it causes, rad.
    pub(crate) rms_rad: f64,
    /// Errors of the parameters that explain it, pixels at the border of an image, root of the sum of squares.
    pub(crate) error_px: f64,
    /// Standard deviation of δ about it, rad: what is left for noise.
    pub(crate) residual_sd_rad: f64,
    /// Share of pixels with a candidate that agrees with it, in [0, 1].
    pub(crate) share: f64,
    /// Drift, rad rms, beyond which to calibrate again.
    pub(crate) limit_rad: f64,
    /// Whether it is beyond.
    pub(crate) beyond_limit: bool,
    /// efc of Eq. (1) with that sd.
    pub(crate) efc: f64,
    /// Why the cloud cannot be trusted.
    pub(crate) doubts: Vec<Doubt>,
}

/// A quantity beyond its limit.
#[derive(Serialize)]
pub(crate) struct Doubt {
    /// Name of the quantity, as in the health of a running instance.
    quantity: &'static str,
    value: f64,
    limit: f64,
    #[serde(skip)]
    told: Quantity,
}

impl Statistics {
    /// The figures of a reconstruction.
    pub(crate) fn of(Proposed { reconstruction: made, limits, .. }: &Proposed) -> Self {
        let drift_limit_rad = limits.limits_of(Quantity::Drift).warn;
        let matches = &made.matches;
        let points = made.cloud.points.len().max(1) as f64;
        let passing: u64 = made.cloud.points.iter().map(|p| u64::from(p.candidates.saturating_sub(1))).sum();
        let unique = made.cloud.points.iter().filter(|p| p.candidates == 1).count();
        Self {
            mean_periods: matches.delta.mean_periods,
            delta_mean_rad: matches.delta.mean_rad,
            delta_sd_rad: matches.delta.sd_rad,
            delta_noise_sd_rad: matches.delta.noise_sd_rad,
            delta_suspicious: matches.delta.is_suspicious(),
            threshold_rad: matches.delta.threshold_rad(),
            efc_predicted: matches.delta.expected_false_candidates(),
            drift: matches.drift.as_ref().map(|drift| DriftFigures {
                rms_rad: drift.rms_rad,
                error_px: drift.error_px,
                residual_sd_rad: drift.residual_sd_rad,
                share: drift.share,
                limit_rad: drift_limit_rad,
                beyond_limit: drift.explains_most_pixels() && drift.rms_rad > drift_limit_rad,
                efc: drift.residual_statistics(&matches.delta).expected_false_candidates(),
                doubts: [
                    (Quantity::DeltaNoise, drift.residual_sd_rad),
                    (Quantity::Unexplained, 1.0 - drift.share),
                    (Quantity::FalseCandidates, drift.residual_statistics(&matches.delta).expected_false_candidates()),
                ]
                .into_iter()
                .map(|(told, value)| Doubt { quantity: told.name(), value, limit: limits.limits_of(told).warn, told })
                .filter(|doubt| doubt.value > doubt.limit)
                .collect(),
            }),
            efc_measured: passing as f64 / points,
            unique_percent: 100.0 * unique as f64 / points,
            fit_residual_share: [made.cam1.fit.residual_share, made.cam2.fit.residual_share],
            noise_grey: [made.cam1.fit.noise_grey, made.cam2.fit.noise_grey],
            motion: made
                .cam1
                .motion
                .zip(made.cam2.motion)
                .map(|(a, b)| [a, b].map(|motion| MotionFigures::of(&motion))),
            slip_steps: matches.slip_steps,
            pixels: OutcomeCounts::from_outcomes(&matches.outcomes)
                .iter()
                .filter(|&(outcome, _)| outcome != Outcome::GrayCode)
                .map(|(outcome, count)| (outcome.name(), count))
                .collect(),
        }
    }
}

impl fmt::Display for Statistics {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "n {:.2} periods on a segment, sd of δ {:.4} rad (mean {:+.4}, noise {:.4}), thr {:.4} rad",
            self.mean_periods, self.delta_sd_rad, self.delta_mean_rad, self.delta_noise_sd_rad, self.threshold_rad
        )?;
        if self.delta_suspicious {
            writeln!(
                f,
                "warning: δ scatters more than three times as widely as on calibrated rigs; check whether the calibration \
                 is that of these images and up to date"
            )?;
        }
        if let Some(drift) = &self.drift {
            writeln!(
                f,
                "drift of the calibration {:.4} rad rms (errors of {:.2} px); about it sd {:.4} rad, efc {:.3}",
                drift.rms_rad, drift.error_px, drift.residual_sd_rad, drift.efc
            )?;
            for Doubt { value, limit, told, .. } in &drift.doubts {
                writeln!(
                    f,
                    "warning: the cloud may hold false points: {} {value:.3}, beyond {limit} ({}); {}",
                    told.title(),
                    told.key(),
                    told.remedy()
                )?;
            }
            if drift.beyond_limit {
                writeln!(
                    f,
                    "warning: the drift is beyond {} rad (health.drift_rad); calibrate again; \
                     `fringeflow rig CALIBRATION --images` shows the drift",
                    drift.limit_rad
                )?;
            }
        }
        if let Some([cam1, cam2]) = &self.motion {
            writeln!(
                f,
                "motion {:+.3} and {:+.3} rad an image (1 in 20 pixels beyond {:.3} and {:.3}), brightness within {:.2} %; \
                 {} and {} pixels decoded from part of their images, {} and {} left out",
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
                "warning: the patterns of C1 and C2 were {cam1} and {cam2} steps ahead of the declared phase shifts; the \
                 phases were corrected"
            )?;
        }
        writeln!(
            f,
            "efc {:.3} predicted by Eq. (1), {:.3} measured; {:.2} % of the points had one candidate",
            self.efc_predicted, self.efc_measured, self.unique_percent
        )?;
        for outcome in Outcome::ALL {
            if let Some(count) = self.pixels.get(outcome.name()) {
                writeln!(f, "{:>10} pixels  {}", count, outcome.name())?;
            }
        }
        Ok(())
    }
}
