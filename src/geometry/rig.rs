//! Two cameras and a projector in a fixed arrangement (paper, section 2.1). In: their calibration. Out: where each
//! sees a point. Cost: one projection.

use super::{Camera, Pixel, Point3, Pose};

/// The calibrated sensor: cameras C1 and C2, projector P, lengths in metres.
///
/// ```
/// use fringeflow::geometry::{Camera, Distortion, Pixel, Point3, Pose, Rig, triangulate};
///
/// let camera = Camera::new([1850.0, 1850.0], [320.0, 256.0], Distortion::default(), [640, 512]);
/// let rig = Rig {
///     cam1: camera.clone(),
///     cam2: camera.clone(),
///     projector: camera,
///     cam2_from_cam1: Pose::translation(-0.1, 0.0, 0.0),
///     projector_from_cam1: Pose::translation(-0.04, 0.0, 0.0),
/// };
/// let point_m = Point3::new(0.05, 0.01, 0.4);
/// let seen1 = rig.cam1.project(&point_m).ok_or("C1 does not see it")?;
/// let seen2 = rig.project_cam2(&point_m).ok_or("C2 does not see it")?;
/// let found = triangulate(&rig, &seen1, &seen2).ok_or("the rays do not meet")?;
/// assert!((found.point_cam1 - point_m).norm() < 1e-9);
/// # Ok::<(), &str>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Rig {
    /// Camera 1, whose frame is the frame of all points.
    pub cam1: Camera,
    /// Camera 2.
    pub cam2: Camera,
    /// The projector: a camera whose light travels the other way.
    pub projector: Camera,
    /// `x_cam2 = R2 · x_cam1 + T2`.
    pub cam2_from_cam1: Pose,
    /// `x_projector = Rp · x_cam1 + Tp`.
    pub projector_from_cam1: Pose,
}

impl Rig {
    /// Raw image point in C2 of a point in the frame of C1.
    #[must_use]
    pub fn project_cam2(&self, point_cam1: &Point3) -> Option<Pixel> {
        self.cam2.project(&(self.cam2_from_cam1 * point_cam1))
    }

    /// Projector pixel that illuminates a point in the frame of C1.
    #[must_use]
    pub fn project_projector(&self, point_cam1: &Point3) -> Option<Pixel> {
        self.projector.project(&(self.projector_from_cam1 * point_cam1))
    }

    /// Centre of C2 in the frame of C1, metres.
    #[must_use]
    pub fn centre_of_cam2(&self) -> Point3 {
        self.cam2_from_cam1.inverse() * Point3::origin()
    }

    /// Centre of the projector in the frame of C1, metres.
    #[must_use]
    pub fn centre_of_projector(&self) -> Point3 {
        self.projector_from_cam1.inverse() * Point3::origin()
    }

    /// Position of the projector along the base: 0 at C1, 1 at C2; outside the base less than 0 or more than 1.
    ///
    /// It decides which wrong fringe orders pass the back-projection test on a flat surface (see
    /// [`crate::correspondence`]).
    #[must_use]
    pub fn projector_place_on_base(&self) -> f64 {
        let base = self.centre_of_cam2().coords;
        self.centre_of_projector().coords.dot(&base) / base.norm_squared()
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use crate::geometry::Distortion;

    /// A rig of three equal cameras with these OpenCV coefficients of distortion.
    pub(in crate::geometry) fn rig(cam2_from_cam1: Pose, distortion: &[f64]) -> Rig {
        let camera = Camera::new([1850.0, 1852.0], [320.0, 250.0], Distortion::from_opencv(distortion), [640, 512]);
        Rig { cam1: camera, cam2: camera, projector: camera, cam2_from_cam1, projector_from_cam1: Pose::identity() }
    }
}
