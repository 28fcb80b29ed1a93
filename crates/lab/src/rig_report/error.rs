//! Errors of a rig report.

use std::fmt;

use fringeflow::calibration::LikelyMistake;

/// One of the three devices of a rig.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Device {
    /// Camera 1.
    Cam1,
    /// Camera 2.
    Cam2,
    /// The projector.
    Projector,
}

impl fmt::Display for Device {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Cam1 => "camera 1",
            Self::Cam2 => "camera 2",
            Self::Projector => "the projector",
        })
    }
}

/// Why a rig cannot be evaluated.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum RigReportError {
    /// An assumed number is out of range.
    #[error("{name} is {value}; it must be {range}")]
    OutOfRange {
        /// Name of the number.
        name: &'static str,
        /// Its value.
        value: f64,
        /// Its valid range.
        range: &'static str,
    },
    /// The cameras are at the same place.
    #[error(
        "cameras 1 and 2 are only {base_m:e} m apart: without a base there are no epipolar segments; check T2 and the \
         unit"
    )]
    NoBase {
        /// Distance of the centres, metres.
        base_m: f64,
    },
    /// The devices see little of the volume, and a mistake in the calibration explains it.
    #[error("the calibration does not fit the measurement volume: {0}")]
    Mistake(LikelyMistake),
    /// A device does not see the volume.
    #[error(
        "{device} never sees the measurement volume, whose centre is at ({x_m:.4}, {y_m:.4}, {z_m:.4}) m in the frame \
         of camera 1; check the volume, its frame and unit, and the pose of {device}"
    )]
    NeverSeen {
        /// The device.
        device: Device,
        /// Centre of the volume in the frame of C1, metres.
        x_m: f64,
        /// Its y, metres.
        y_m: f64,
        /// Its z, metres.
        z_m: f64,
    },
    /// Each device sees a part of the volume, but all three see no common part.
    #[error(
        "no point of the measurement volume is seen by both cameras and the projector (camera 1 sees {cam1:.1} % of \
         it, camera 2 {cam2:.1} %, the projector {projector:.1} %); move the volume to where their views overlap"
    )]
    NoOverlap {
        /// Share that C1 sees, percent.
        cam1: f64,
        /// Share that C2 sees, percent.
        cam2: f64,
        /// Share that P lights, percent.
        projector: f64,
    },
    /// No pixel of the grid gives a result.
    #[error(
        "no pixel of camera 1, in a grid of {grid_step_px} px, has an epipolar segment with fringes; \
         use a finer grid or a larger volume"
    )]
    NoSegments {
        /// Spacing of the grid, pixels.
        grid_step_px: usize,
    },
}
