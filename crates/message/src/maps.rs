//! Headers of phase maps, correspondences and clouds.

use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;

use crate::Window;

/// Bins of the histogram of δ, from −π to π rad.
pub const DELTA_PARTS: usize = 512;

/// Unit of a payload with typed values, aligned to a cache line.
#[repr(C)]
#[repr(align(64))]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable, ZeroCopySend)]
#[type_name("fringeflow.Block.1")]
pub struct Block(
    /// The bytes.
    pub [u8; 64],
);

/// Fit of the sinusoids to the images of one camera, and motion of the scene. See `fringeflow::phase::FitStatistics`
/// and `fringeflow::phase::Motion`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[type_name("fringeflow.Fit.3")]
pub struct Fit {
    /// Number of valid pixels.
    pub valid_pixels: u64,
    /// Pixels that saw more than one surface and were decoded from a part of their images.
    pub one_surface_pixels: u64,
    /// Pixels left out because of motion.
    pub lost_pixels: u64,
    /// Lit pixels, see `fringeflow::phase::Exposure`.
    pub lit_pixels: u64,
    /// Lit pixels with a saturated sample.
    pub saturated_pixels: u64,
    /// Lit pixels with a low modulation.
    pub dim_pixels: u64,
    /// Median of fit residual ÷ modulation; negative with three steps, which leave no residual.
    pub residual_share: f32,
    /// Standard deviation of the grey levels about the fit.
    pub noise_grey: f32,
    /// Standard deviation of the phase per unit of noise ÷ modulation.
    pub noise_gain: f32,
    /// Median phase motion from image to image, rad; 0 if not measured.
    pub motion_rad: f32,
    /// 95th percentile of the amount of phase motion, rad; negative if not measured.
    pub fast_motion_rad: f32,
    /// Greatest deviation of the brightness of an image from the mean, as a share; 0 if not measured.
    pub brightness_share: f32,
    /// Amplitude of the second harmonic of the fringes ÷ modulation; negative if the phase shifts cannot show it.
    pub second_harmonic_share: f32,
    /// Amplitude of the third harmonic, likewise.
    pub third_harmonic_share: f32,
    /// Share of the pixels without fringes; 0 if not measured.
    pub unlit_share: f32,
    /// Share of the range of grey levels above the brightest one; 0 if not measured.
    pub unused_range_share: f32,
}

/// Number of values of a drift, see `fringeflow::correspondence::KnownDrift`.
pub const DRIFT_NUMBERS: usize = 22;

/// A drift of the calibration; all 0 if unknown.
pub type DriftNumbers = [f32; DRIFT_NUMBERS];

/// Describes the phase maps of both cameras.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[type_name("fringeflow.MapsHeader.7")]
pub struct MapsHeader {
    /// Number of maps published on the channel before this one.
    pub published: u64,
    /// The images.
    pub window: Window,
    /// Fit of camera 1.
    pub cam1: Fit,
    /// Fit of camera 2.
    pub cam2: Fit,
    /// Delay of the images of camera 2 after those of camera 1, mean over the pairs, nanoseconds.
    pub skew_ns: i64,
    /// Drift known from earlier clouds.
    pub known_drift: DriftNumbers,
    /// Number of windows refused so far because their images do not show the declared phase shifts.
    pub refused_windows: u64,
    /// Width of the images of both cameras, pixels.
    pub width_px: u32,
    /// Height, pixels.
    pub height_px: u32,
}

/// Describes the correspondences of all pixels of camera 1.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[type_name("fringeflow.CorrespondenceHeader.7")]
pub struct CorrespondenceHeader {
    /// Number of correspondence maps published on the channel before this one.
    pub published: u64,
    /// The images.
    pub window: Window,
    /// Mean of δ of the true candidates, rad.
    pub delta_mean_rad: f64,
    /// Standard deviation sd of δ behind the threshold, rad.
    pub delta_sd_rad: f64,
    /// Part of sd due to noise, rad.
    pub delta_noise_sd_rad: f64,
    /// Mean number n of fringe periods on a segment.
    pub mean_periods: f64,
    /// Number of reference correspondences behind these statistics.
    pub references: u64,
    /// Mean of δ over the chosen candidates, rad.
    pub chosen_delta_mean_rad: f64,
    /// Standard deviation of δ over the chosen candidates, rad.
    pub chosen_delta_sd_rad: f64,
    /// Histogram of δ of all candidates of some pixels, from −π to π rad.
    pub delta_counts: [u32; DELTA_PARTS],
    /// Standard deviation of the phase × modulation, of C1 and C2, grey levels.
    pub phase_noise_grey: [f32; 2],
    /// The drift found in this window.
    pub drift: DriftNumbers,
    /// Width, pixels.
    pub width_px: u32,
    /// Height, pixels.
    pub height_px: u32,
}

/// Describes a cloud.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[type_name("fringeflow.CloudHeader.5")]
pub struct CloudHeader {
    /// Number of clouds published on the channel before this one.
    pub published: u64,
    /// The images.
    pub window: Window,
    /// Number of points.
    pub points: u64,
    /// Mean of δ over the chosen candidates, rad.
    pub delta_mean_rad: f64,
    /// Standard deviation of δ over the chosen candidates, rad.
    pub delta_sd_rad: f64,
    /// When the cloud was published.
    pub published_ns: u64,
    /// The drift found in its correspondences.
    pub drift: DriftNumbers,
}

impl Default for CorrespondenceHeader {
    fn default() -> Self {
        Self::zeroed()
    }
}
