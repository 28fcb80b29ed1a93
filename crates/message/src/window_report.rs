//! How well a window was measured.

use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;

use super::{Fit, HealthReport, Window};

/// Parts of −π to π rad in which δ is counted.
pub const DELTA_PARTS: usize = 512;
/// Outcomes that a report has room for.
pub const OUTCOMES: usize = 32;

/// What the error of the calibration amounts to in one window.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[type_name("fringeflow.DriftReport.2")]
pub struct DriftReport {
    /// Root mean square over the measurement volume of δ that it causes, rad.
    pub rms_rad: f64,
    /// Errors of the parameters that explain it, pixels at the border of an image, root of the sum of their squares.
    pub error_px: f64,
    /// Share of pixels with a candidate that agrees with it, in [0, 1].
    pub share: f64,
    /// Standard deviation of δ about it, rad: what is left for noise.
    pub residual_sd_rad: f64,
    /// 1 where the drift was measured; else all of this is 0.
    pub is_measured: u64,
}

impl DriftReport {
    /// This, where the drift was measured.
    #[must_use]
    pub fn measured(&self) -> Option<&Self> {
        (self.is_measured != 0).then_some(self)
    }
}

/// Figures of one window: fringes, δ, and what became of the pixels of camera 1.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[type_name("fringeflow.WindowReport.5")]
pub struct WindowReport {
    /// Number of the correspondences in their channel.
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
    /// Part of it that noise makes, rad.
    pub delta_noise_sd_rad: f64,
    /// Threshold thr of δ about its mean, rad.
    pub delta_threshold_rad: f64,
    /// Median of δ over the chosen candidates, rad; 0 without any. A slip of the pattern moves it.
    pub delta_median_rad: f64,
    /// Mean number n of fringe periods on a segment.
    pub mean_periods: f64,
    /// Expected false candidates a true one, efc (paper, Eq. 1).
    pub expected_false_candidates: f64,
    /// Steps by which the pattern of the images of C1 and C2 was ahead of what was said of them; the phases were corrected.
    pub slip_steps: [i32; 2],
    /// Drift of the calibration; not measured with the paper's resolution.
    pub drift: DriftReport,
    /// By how much images of camera 2 begin later than those of camera 1, mean over the pairs, nanoseconds.
    pub skew_ns: i64,
    /// Health of the scanner, this window included.
    pub health: HealthReport,
    /// Pixels of camera 1 by the code of what became of them.
    pub outcomes: [u64; OUTCOMES],
    /// δ of all candidates of some pixels: their numbers in equal parts of −π to π rad.
    pub delta_counts: [u32; DELTA_PARTS],
}

impl Default for WindowReport {
    fn default() -> Self {
        Self::zeroed()
    }
}
