//! How well a window was measured.

use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;

use super::{Fit, Window};

/// Parts of −π to π rad in which δ is counted.
pub const DELTA_PARTS: usize = 512;
/// Outcomes that a report has room for.
pub const OUTCOMES: usize = 32;

/// Figures of one window: fringes, δ, and what became of the pixels of camera 1.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[type_name("fringeflow.WindowReport.1")]
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
