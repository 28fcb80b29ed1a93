//! Quality of the measurement of one window.

use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;

use super::{DELTA_PARTS, Fit, HealthReport, Window};

/// Maximum number of outcomes in a report.
pub const OUTCOMES: usize = 32;

/// Error of the calibration in one window.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[type_name("fringeflow.DriftReport.2")]
pub struct DriftReport {
    /// δ caused by the drift, root mean square over the measurement volume, rad.
    pub rms_rad: f64,
    /// Errors of the calibration parameters that explain the drift, root of the sum of squares, pixels at the image
    /// border.
    pub error_px: f64,
    /// Share of pixels with a candidate that agrees with the drift, in [0, 1].
    pub share: f64,
    /// Standard deviation of δ about the drift, rad.
    pub residual_sd_rad: f64,
    /// 1 if the drift was measured; otherwise all fields are 0.
    pub is_measured: u64,
}

impl DriftReport {
    /// The drift, if it was measured.
    #[must_use]
    pub fn measured(&self) -> Option<&Self> {
        (self.is_measured != 0).then_some(self)
    }
}

/// Results for one window: fringes, δ, and the outcomes of the pixels of camera 1.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[type_name("fringeflow.WindowReport.6")]
pub struct WindowReport {
    /// Number of the correspondences in their channel; that of the ones before if the window has none.
    pub published: u64,
    /// The images.
    pub window: Window,
    /// Fit of camera 1.
    pub cam1: Fit,
    /// Fit of camera 2.
    pub cam2: Fit,
    /// Mean of δ of the true candidates, rad.
    pub delta_mean_rad: f64,
    /// Standard deviation sd of δ, rad.
    pub delta_sd_rad: f64,
    /// Part of sd due to noise, rad.
    pub delta_noise_sd_rad: f64,
    /// Threshold thr of δ about its mean, rad.
    pub delta_threshold_rad: f64,
    /// Median of δ over the chosen candidates, rad; 0 without any. A slip of the pattern shifts it.
    pub delta_median_rad: f64,
    /// Mean number n of fringe periods on a segment.
    pub mean_periods: f64,
    /// Expected false candidates per true one, efc (paper, Eq. 1).
    pub expected_false_candidates: f64,
    /// Number of steps by which the images of C1 and C2 were ahead of the declared phase shifts. The phases were
    /// corrected.
    pub slip_steps: [i32; 2],
    /// Drift of the calibration. The paper's resolution does not measure it.
    pub drift: DriftReport,
    /// Delay of the images of camera 2 after those of camera 1, mean over the pairs, nanoseconds.
    pub skew_ns: i64,
    /// Health of the scanner, including this window.
    pub health: HealthReport,
    /// Pixels of camera 1 by the code of their outcome.
    pub outcomes: [u64; OUTCOMES],
    /// Histogram of δ of all candidates of some pixels, from −π to π rad.
    pub delta_counts: [u32; DELTA_PARTS],
}

impl Default for WindowReport {
    fn default() -> Self {
        Self::zeroed()
    }
}
