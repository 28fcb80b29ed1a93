//! Headers of phase maps, correspondences and clouds.

use bytemuck::{Pod, Zeroable};
use iceoryx2::prelude::ZeroCopySend;

use super::{DELTA_PARTS, Window};

/// Unit of a payload that is read as more than bytes: aligned to a cache line.
#[repr(C)]
#[repr(align(64))]
#[derive(Clone, Copy, Debug, PartialEq, Eq, Pod, Zeroable, ZeroCopySend)]
#[type_name("fringeflow.Block.1")]
pub struct Block(
    /// The bytes.
    pub [u8; 64],
);

/// How well sinusoids fit the images of a camera, and how the scene moved: see `fringeflow::phase::FitStatistics` and
/// `fringeflow::phase::Motion`.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[type_name("fringeflow.Fit.3")]
pub struct Fit {
    /// Number of valid pixels.
    pub valid_pixels: u64,
    /// Pixels decoded from part of their images, since these show more than one surface.
    pub one_surface_pixels: u64,
    /// Pixels left out for their motion.
    pub lost_pixels: u64,
    /// Lit pixels, see `fringeflow::phase::Exposure`.
    pub lit_pixels: u64,
    /// Of these, pixels with a saturated sample.
    pub saturated_pixels: u64,
    /// Of these, pixels that are barely lit.
    pub dim_pixels: u64,
    /// Median of fit residual ÷ modulation; negative where three steps leave no residual.
    pub residual_share: f32,
    /// Standard deviation of the grey levels about the fit.
    pub noise_grey: f32,
    /// Standard deviation of the phase per unit of noise ÷ modulation.
    pub noise_gain: f32,
    /// Median phase moved from image to image, rad; 0 where it was not measured.
    pub motion_rad: f32,
    /// What its amount exceeds at one pixel in twenty, rad; negative where it was not measured.
    pub fast_motion_rad: f32,
    /// Greatest departure of the brightness of an image from the mean, as a share; 0 where it was not measured.
    pub brightness_share: f32,
    /// Amplitude of the second harmonic of the fringes ÷ modulation; negative where the shifts do not tell.
    pub second_harmonic_share: f32,
    /// Of the third.
    pub third_harmonic_share: f32,
}

/// Numbers of a drift of the calibration, see `fringeflow::correspondence::KnownDrift`.
pub const DRIFT_NUMBERS: usize = 22;

/// A drift of the calibration; all 0 where none is known.
pub type DriftNumbers = [f32; DRIFT_NUMBERS];

/// Describes the phase maps of both cameras.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[type_name("fringeflow.MapsHeader.6")]
pub struct MapsHeader {
    /// Maps this channel has carried before.
    pub published: u64,
    /// The images.
    pub window: Window,
    /// Fit of camera 1.
    pub cam1: Fit,
    /// Fit of camera 2.
    pub cam2: Fit,
    /// By how much images of camera 2 begin later than those of camera 1, mean over the pairs, nanoseconds.
    pub skew_ns: i64,
    /// What is known of the drift beforehand.
    pub known_drift: DriftNumbers,
    /// Windows that were refused before, since their images do not show the steps that are said of them.
    pub refused_windows: u64,
    /// Width of the images of either camera, pixels.
    pub width_px: u32,
    /// Height, pixels.
    pub height_px: u32,
}

/// Describes the correspondences of all pixels of camera 1.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable, ZeroCopySend)]
#[type_name("fringeflow.CorrespondenceHeader.7")]
pub struct CorrespondenceHeader {
    /// Maps this channel has carried before.
    pub published: u64,
    /// The images.
    pub window: Window,
    /// Mean of δ of the true candidates, rad.
    pub delta_mean_rad: f64,
    /// Standard deviation of δ that the threshold came from, rad.
    pub delta_sd_rad: f64,
    /// Part of it that noise makes, rad.
    pub delta_noise_sd_rad: f64,
    /// Mean number n of fringe periods on a segment.
    pub mean_periods: f64,
    /// Reference correspondences behind these.
    pub references: u64,
    /// Mean of δ over the chosen candidates, rad.
    pub chosen_delta_mean_rad: f64,
    /// Standard deviation of δ over the chosen candidates, rad.
    pub chosen_delta_sd_rad: f64,
    /// δ of all candidates of some pixels: their numbers in equal parts of −π to π rad.
    pub delta_counts: [u32; DELTA_PARTS],
    /// Standard deviation of the phase of C1 and C2, times the modulation, grey levels.
    pub phase_noise_grey: [f32; 2],
    /// The drift that was found.
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
    /// Clouds this channel has carried before.
    pub published: u64,
    /// The images.
    pub window: Window,
    /// Number of points.
    pub points: u64,
    /// Mean of δ over the chosen candidates, rad.
    pub delta_mean_rad: f64,
    /// Standard deviation of δ over the chosen candidates, rad.
    pub delta_sd_rad: f64,
    /// When it was published.
    pub published_ns: u64,
    /// The drift that its correspondences showed.
    pub drift: DriftNumbers,
}

impl Default for CorrespondenceHeader {
    fn default() -> Self {
        Self::zeroed()
    }
}
