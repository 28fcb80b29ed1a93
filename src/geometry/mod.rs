//! Cameras, poses, rays and the measurement volume (paper, section 2.1).
//!
//! In: a calibration. Out: rays, projections, rectified epipolar coordinates, triangulated points. No image is needed.
//! Cost: some ten to a hundred floating-point operations per point. All in `f64`; the segment table and
//! [`ImageTriangulation`] are the seam to `f32` per pixel.
//!
//! Frames are named after their camera: `cam1`, `cam2`, `projector`, `volume`. A transform `b_from_a` maps a point of
//! frame `a` to frame `b`. Lengths are in metres.

mod camera;
mod distortion;
mod epipolar;
mod image_triangulation;
mod interpolation;
mod pattern;
mod readout;
mod rig;
mod triangulation;
mod volume;

pub use camera::Camera;
pub use distortion::Distortion;
pub use epipolar::{EpipolarError, EpipolarFrame, EpipolarLine};
pub use image_triangulation::{ImageTriangulation, TriangulatedPixel};
pub use interpolation::interpolate_pose;
pub use pattern::FringePattern;
pub use readout::{BINNINGS, Readout, ReadoutError};
pub use rig::Rig;
pub use triangulation::{Triangulation, range_per_pixel, triangulate};
pub use volume::{MeasurementVolume, RayClipper, VolumeError};

/// Rigid transform `b_from_a`: `x_b = R · x_a + T`, lengths in metres.
pub type Pose = nalgebra::Isometry3<f64>;
/// Point in a three-dimensional frame, metres.
pub type Point3 = nalgebra::Point3<f64>;
/// Direction or displacement in a three-dimensional frame.
pub type Vector3 = nalgebra::Vector3<f64>;
/// Point in an image, pixels, pixel centres at integers.
pub type Pixel = nalgebra::Point2<f64>;
