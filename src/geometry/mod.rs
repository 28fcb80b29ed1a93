//! Cameras, poses, rays and the measurement volume: everything that needs a calibration but no image.
//!
//! In: calibrated numbers. Out: rays, projections, rectified epipolar coordinates. All in `f64`; the seam to `f32` per
//! pixel is the segment table. Frames are named by the camera they belong to: `cam1`, `cam2`, `projector`, `volume`;
//! a transform `b_from_a` maps a point of frame `a` to frame `b`. Lengths in metres.

mod camera;
mod distortion;
mod epipolar;
mod interpolation;
mod pattern;
mod readout;
mod rig;
mod sights;
mod triangulation;
mod volume;

pub use camera::Camera;
pub use distortion::Distortion;
pub use epipolar::{EpipolarError, EpipolarFrame, EpipolarLine};
pub use interpolation::between;
pub use pattern::FringePattern;
pub use readout::{BINNINGS, Readout, ReadoutError};
pub use rig::Rig;
pub use sights::{Sighted, Sights};
pub use triangulation::{Triangulation, meet, range_per_pixel, triangulate};
pub use volume::{MeasurementVolume, SeenVolume, VolumeError};

/// Rigid transform `b_from_a`: `x_b = R · x_a + T`, lengths in metres.
pub type Pose = nalgebra::Isometry3<f64>;
/// Point in a three-dimensional frame, metres.
pub type Point3 = nalgebra::Point3<f64>;
/// Direction or displacement in a three-dimensional frame.
pub type Vector3 = nalgebra::Vector3<f64>;
/// Point in an image, pixels, pixel centres at integers.
pub type Pixel = nalgebra::Point2<f64>;
