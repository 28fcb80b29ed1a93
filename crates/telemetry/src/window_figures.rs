//! Figures of a window for people and programs.

use std::f64::consts::PI;

use serde::Serialize;

use fringeflow_base::false_candidates::expected_unique_percent;
use fringeflow_base::outcome::{Outcome, OutcomeCounts};
use fringeflow_message::{DELTA_PARTS, DriftReport, Fit, WindowReport};

use super::HealthFigures;

/// Quality of the measurement of a window. Shares are percent of the pixels of camera 1 with a valid phase.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct WindowFigures {
    /// Standard deviation sd of δ.
    pub sd_rad: f64,
    /// The part of it that noise causes.
    pub noise_sd_rad: f64,
    /// Threshold thr of δ about its mean.
    pub thr_rad: f64,
    /// Mean number n of fringe periods on a segment.
    pub n: f64,
    /// Expected false candidates for each true one (paper, Eq. 1).
    pub efc: f64,
    /// Percentage of unique correspondences to expect from efc (paper, 2.2.1).
    pub puc_predicted: f64,
    /// Percentage of the points whose pixel had a single candidate; `None` without points.
    pub puc: Option<f64>,
    /// Drift of the calibration; `None` if the resolution does not measure it.
    pub drift: Option<DriftFigures>,
    /// Outcomes of the pixels.
    pub outcomes: Shares,
    /// Mean of δ.
    pub delta_mean_rad: f64,
    /// Median of δ over the chosen candidates.
    pub delta_median_rad: f64,
    /// Fit residual ÷ modulation of both cameras; `None` with three phase shifts, which leave no residual.
    pub residual: [Option<f32>; 2],
    /// Percent of the pixels of each camera with a valid phase.
    pub valid: [f64; 2],
    /// Light, fringes and motion in each camera.
    pub cameras: [CameraFigures; 2],
    /// Start of the images of camera 2 relative to camera 1, mean over the pairs, milliseconds.
    pub skew_ms: f64,
    /// Phase steps by which the images of each camera were ahead of the declared phase shifts.
    pub slip_steps: [i32; 2],
    /// Health of the scanner; `None` in older recordings.
    pub health: Option<HealthFigures>,
    /// Pixels with a correspondence.
    pub points: u64,
    /// Histogram of δ of all candidates of a sample of pixels.
    pub delta_histogram: DeltaCounts,
}

/// Light, fringes and motion in one camera.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct CameraFigures {
    /// Percent of the lit pixels with saturated samples; `None` if no pixel is lit.
    pub saturated: Option<f64>,
    /// Percent of the lit pixels that are barely lit.
    pub dim: Option<f64>,
    /// Amplitude of the second harmonic of the fringes ÷ modulation; `None` if the phase shifts cannot reveal it.
    pub second_harmonic: Option<f32>,
    /// The same for the third harmonic.
    pub third_harmonic: Option<f32>,
    /// Motion of the scene; `None` if only one cycle was decoded.
    pub motion: Option<MotionFigures>,
}

/// Motion of the scene during a window.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct MotionFigures {
    /// Median phase motion from image to image.
    pub median_rad: f32,
    /// Absolute phase motion that 5 % of the pixels exceed.
    pub fast_rad: f32,
    /// Largest deviation of the brightness of an image from the mean, percent.
    pub brightness: f32,
    /// Pixels decoded from part of their images.
    pub one_surface_pixels: u64,
    /// Pixels dropped because of motion.
    pub lost_pixels: u64,
}

/// Size of the calibration error.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct DriftFigures {
    /// Root mean square of the resulting δ over the measurement volume.
    pub rms_rad: f64,
    /// Errors of the parameters that explain the drift, in pixels at the border of an image; root of the sum of
    /// squares.
    pub error_px: f64,
    /// Percent of the pixels with a candidate that agrees with the drift.
    pub agreeing: f64,
    /// Standard deviation of δ about the drift: the part due to noise.
    pub residual_sd_rad: f64,
}

/// Outcomes, in percent of the pixels with a valid phase.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Shares {
    /// One candidate, confirmed by its neighbours.
    pub unique: f64,
    /// Decided between several candidates.
    pub decided: f64,
    /// Several candidates that nothing decides between.
    pub undecided: f64,
    /// All candidates fail the back-projection test, or contradict others.
    pub rejected: f64,
    /// Outside the volume, or no candidate at all.
    pub nothing: f64,
}

/// Histogram of δ with bins of equal width.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct DeltaCounts {
    /// Lower bound of the first bin.
    pub first_rad: f64,
    /// Upper bound of the last bin.
    pub last_rad: f64,
    /// Counts by bin.
    pub counts: Vec<u32>,
}

impl WindowFigures {
    /// Creates the figures of a report.
    #[must_use]
    pub fn from_report(report: &WindowReport) -> Self {
        let pixels: u64 = report.outcomes.iter().sum();
        let points = Outcome::ALL.into_iter().filter(|o| o.is_found()).map(|o| report.outcomes[o as usize]).sum();
        let valid = |fit: &Fit| percent(fit.valid_pixels, pixels);
        let residual = |fit: &Fit| (fit.residual_share >= 0.0).then_some(fit.residual_share);
        Self {
            sd_rad: report.delta_sd_rad,
            noise_sd_rad: report.delta_noise_sd_rad,
            thr_rad: report.delta_threshold_rad,
            n: report.mean_periods,
            efc: report.expected_false_candidates,
            puc_predicted: expected_unique_percent(report.expected_false_candidates),
            puc: OutcomeCounts::from_codes(&report.outcomes).unique_percent(),
            drift: report.drift.measured().map(DriftFigures::from_drift),
            outcomes: Shares::from_report(report),
            delta_mean_rad: report.delta_mean_rad,
            delta_median_rad: report.delta_median_rad,
            residual: [&report.cam1, &report.cam2].map(residual),
            valid: [&report.cam1, &report.cam2].map(valid),
            cameras: [&report.cam1, &report.cam2].map(CameraFigures::from_fit),
            skew_ms: report.skew_ns as f64 * 1e-6,
            slip_steps: report.slip_steps,
            health: HealthFigures::from_report(report),
            points,
            delta_histogram: DeltaCounts::from_counts(&report.delta_counts),
        }
    }
}

impl CameraFigures {
    fn from_fit(fit: &Fit) -> Self {
        let of_lit = |pixels: u64| (fit.lit_pixels > 0).then(|| percent(pixels, fit.lit_pixels));
        let known = |share: f32| (share >= 0.0).then_some(share);
        let motion = MotionFigures {
            median_rad: fit.motion_rad,
            fast_rad: fit.fast_motion_rad,
            brightness: 100.0 * fit.brightness_share,
            one_surface_pixels: fit.one_surface_pixels,
            lost_pixels: fit.lost_pixels,
        };
        Self {
            saturated: of_lit(fit.saturated_pixels),
            dim: of_lit(fit.dim_pixels),
            second_harmonic: known(fit.second_harmonic_share),
            third_harmonic: known(fit.third_harmonic_share),
            motion: (fit.fast_motion_rad >= 0.0).then_some(motion),
        }
    }
}

impl DriftFigures {
    /// Creates the figures of a report whose drift was measured.
    #[must_use]
    pub fn from_drift(drift: &DriftReport) -> Self {
        Self {
            rms_rad: drift.rms_rad,
            error_px: drift.error_px,
            agreeing: 100.0 * drift.share,
            residual_sd_rad: drift.residual_sd_rad,
        }
    }
}

impl Shares {
    /// Shares before the first window.
    pub const NOT_A_NUMBER: Self =
        Self { unique: f64::NAN, decided: f64::NAN, undecided: f64::NAN, rejected: f64::NAN, nothing: f64::NAN };

    /// The shares with their names.
    #[must_use]
    pub fn with_names(&self) -> [(&'static str, f64); 5] {
        [
            ("unique", self.unique),
            ("decided", self.decided),
            ("undecided", self.undecided),
            ("rejected", self.rejected),
            ("nothing", self.nothing),
        ]
    }

    fn from_report(report: &WindowReport) -> Self {
        let count = |outcome: Outcome| report.outcomes[outcome as usize];
        let valid = report.outcomes.iter().sum::<u64>() - count(Outcome::Invalid);
        let mut shares = Self::default();
        for outcome in Outcome::ALL {
            let share = match outcome {
                Outcome::GrayCode | Outcome::Reference | Outcome::Unique => &mut shares.unique,
                Outcome::AlongEpipolar | Outcome::AcrossEpipolar => &mut shares.decided,
                Outcome::Ambiguous => &mut shares.undecided,
                Outcome::RejectedByDelta | Outcome::Contradicted => &mut shares.rejected,
                Outcome::OutsideVolume | Outcome::NoCandidate => &mut shares.nothing,
                Outcome::Invalid => continue,
            };
            *share += percent(count(outcome), valid);
        }
        shares
    }
}

impl DeltaCounts {
    fn from_counts(counts: &[u32; DELTA_PARTS]) -> Self {
        Self { first_rad: -PI, last_rad: PI, counts: counts.to_vec() }
    }
}

fn percent(part: u64, whole: u64) -> f64 {
    100.0 * part as f64 / whole.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_are_of_the_pixels_with_a_phase_and_add_up() {
        let mut report = WindowReport::default();
        for (outcome, count) in [
            (Outcome::Invalid, 1000),
            (Outcome::Reference, 50),
            (Outcome::Unique, 10),
            (Outcome::AcrossEpipolar, 20),
            (Outcome::Ambiguous, 5),
            (Outcome::Contradicted, 5),
            (Outcome::NoCandidate, 10),
        ] {
            report.outcomes[outcome as usize] = count;
        }
        report.cam1.valid_pixels = 100;
        report.cam2.residual_share = -1.0;
        let figures = WindowFigures::from_report(&report);
        let Shares { unique, decided, undecided, rejected, nothing } = figures.outcomes;
        assert_eq!([unique, decided, undecided, rejected, nothing], [60.0, 20.0, 5.0, 5.0, 10.0]);
        assert_eq!((figures.points, figures.residual), (80, [Some(0.0), None]));
        assert_eq!((figures.puc, figures.puc_predicted), (Some(75.0), 100.0));
        assert!((figures.valid[0] - 100.0 * 100.0 / 1100.0).abs() < 1e-9);
    }

    #[test]
    fn an_empty_report_has_finite_figures() {
        let figures = WindowFigures::from_report(&WindowReport::default());
        assert_eq!(figures.outcomes, Shares::default());
        assert_eq!((figures.valid, figures.puc), ([0.0; 2], None));
    }
}
