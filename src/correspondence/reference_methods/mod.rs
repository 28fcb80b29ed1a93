//! The methods of the paper, as references for ours.
//!
//! - With Gray code (Table 2): CGC with two fringe directions, EGC with epipolar lines. In: absolute phase of both
//!   cameras. Out: one match per pixel of C1.
//! - Without Gray code (section 2.2, the proposed algorithm PA): *paper*.

mod cgc;
mod egc;
pub(super) mod paper;
#[cfg(test)]
pub(crate) mod test_scene;

use crate::geometry::{MeasurementVolume, Pixel, Rig, Vector3};
use crate::phase::AbsolutePhase;

pub use cgc::match_both_directions;
pub use egc::match_along_epipolar_lines;

/// The correspondence of a pixel of C1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReferenceMatch {
    /// Raw sub-pixel point in C2.
    pub cam2_px: Pixel,
    /// Depth (z in the frame of C1) on the ray of the pixel, metres.
    pub depth_m: f64,
    /// Fringe order: whole periods in the absolute phase.
    pub order: i16,
}

/// Why absolute phases cannot be matched.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum MatchError {
    /// A phase does not have the size of its camera's image.
    #[error(
        "the absolute phase of camera {camera} is {width} × {height} pixels, its calibration {expected_width} × \
         {expected_height}; decode images of the calibrated camera"
    )]
    Size {
        /// 1 or 2.
        camera: u8,
        /// Width found, pixels.
        width: usize,
        /// Height found, pixels.
        height: usize,
        /// Width of the calibrated camera, pixels.
        expected_width: usize,
        /// Height of the calibrated camera, pixels.
        expected_height: usize,
    },
    /// The rig has no epipolar frame.
    #[error(transparent)]
    Epipolar(#[from] crate::geometry::EpipolarError),
}

/// Range of depths (z, metres) searched on the ray of a pixel of C1: the volume, or everything before C1.
fn depths_of(ray_cam1: &Vector3, volume: Option<&MeasurementVolume>) -> Option<(f64, f64)> {
    match volume {
        Some(volume) => volume.clip(ray_cam1),
        None => Some((f64::MIN_POSITIVE, f64::INFINITY)),
    }
}

/// Checks that absolute phases have the sizes of their cameras.
fn check_sizes(rig: &Rig, cam1: &AbsolutePhase, cam2: &AbsolutePhase) -> Result<(), MatchError> {
    for (camera, phase, calibrated) in [(1, cam1, &rig.cam1), (2, cam2, &rig.cam2)] {
        let (expected_width, expected_height) = (calibrated.width_px(), calibrated.height_px());
        let (width, height) = (phase.width, phase.height);
        if [width, height] != [expected_width, expected_height] {
            return Err(MatchError::Size { camera, width, height, expected_width, expected_height });
        }
    }
    Ok(())
}

/// Fringe order of an absolute phase.
fn order_of(turns: f32) -> i16 {
    turns.floor().clamp(f32::from(i16::MIN), f32::from(i16::MAX)) as i16
}
