//! Calibration of the whole sensor: both cameras and the projector, from images of a board.
//!
//! ```text
//! images ──► corners of the board, and the phase around them (observations)
//!                │
//!                ▼
//!         each device alone (initial) ──► arrangement ──► joint bundle adjustment (adjustment) ──► rig, covariance
//! ```
//!
//! The projector sees nothing. The phase of both directions of fringes tells which of its pixels lights a point of the
//! board (Zhang and Huang 2006; Moreno and Taubin 2012), so it is a third camera whose image is measured through the
//! others.
//!
//! Frames: `first` is the frame of C1, `board` has its origin in the middle of the board, x right and y down as printed,
//! z into the board. Lengths are metres, pixel centres are at integers.

pub mod adjustment;
mod assessment;
pub mod comparison;
mod file;
pub mod findings;
pub mod folder;
pub mod images;
pub mod initial;
mod lens;
mod median;
pub mod observations;
mod observed;
mod pose_words;
pub mod quality;
pub mod refinement;
mod rig;
mod shape;

pub use assessment::{Assessment, Quality};
pub use file::{cameras_file_text, file_text, read_cameras_covariance};
pub use lens::{INTRINSIC_NAMES, INTRINSICS, Lens};
pub use observed::{Observed, ObservedPose};
pub use pose_words::PoseWords;
pub use rig::{Bend, CalibratedRig, DeviceName, GROUPS, NoCalibration, OtherPose, RigViews, calibrate};
pub use shape::BoardShape;
