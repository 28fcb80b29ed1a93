//! Two cameras and a projector in a fixed arrangement.

use super::{Camera, Pixel, Point3, Pose};

/// The calibrated sensor (paper, section 2.1): cameras C1 and C2, projector P, lengths in metres.
#[derive(Clone, Debug, PartialEq)]
pub struct Rig {
    /// Camera 1, whose frame is the frame of all points.
    pub cam1: Camera,
    /// Camera 2.
    pub cam2: Camera,
    /// The projector, an inverse camera.
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

    /// Projector pixel that lights a point in the frame of C1.
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

    /// Place of the projector along the base: 0 at C1, 1 at C2, beyond or before outside of it.
    ///
    /// It rules which wrong fringe orders survive the back-projection test on a flat surface (see
    /// [`crate::correspondence`]).
    #[must_use]
    pub fn projector_place_on_base(&self) -> f64 {
        let base = self.centre_of_cam2().coords;
        self.centre_of_projector().coords.dot(&base) / base.norm_squared()
    }
}
