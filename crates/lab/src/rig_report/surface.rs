//! Flat surfaces in place of an object.

use nalgebra::{Rotation3, Unit};

use fringeflow::geometry::{Point3, Vector3};

use super::RigSetup;

/// A plane in the frame of C1.
#[derive(Clone, Copy, Debug)]
pub(super) struct Surface {
    pub(super) point: Point3,
    pub(super) normal: Vector3,
}

impl Surface {
    /// Returns the plane through `point` perpendicular to the mean viewing direction of the rig.
    pub(super) fn facing(setup: &RigSetup, point: Point3) -> Self {
        Self { point, normal: setup.viewing_direction() }
    }

    /// Returns the normals of planes rotated by `tilts_rad` about the axis perpendicular to base and viewing direction.
    pub(super) fn tilted_normals(setup: &RigSetup, tilts_rad: &[f64]) -> Vec<Vector3> {
        let view = setup.viewing_direction();
        let axis = Unit::try_new(view.cross(&setup.rig.centre_of_cam2().coords), 1e-12).unwrap_or_else(Vector3::y_axis);
        tilts_rad.iter().map(|&tilt| Rotation3::from_axis_angle(&axis, tilt) * view).collect()
    }

    /// Intersects the line from `eye` through `target` with the plane. Returns `None` if there is no intersection or it
    /// lies behind the eye.
    pub(super) fn intersection(&self, eye: &Point3, target: &Point3) -> Option<Point3> {
        let direction = target - eye;
        let along = self.normal.dot(&direction);
        let distance = self.normal.dot(&(self.point - eye)) / along;
        (along.abs() > 1e-9 * direction.norm() && distance > 0.0).then(|| eye + direction * distance)
    }

    /// Whether all eyes are on the same side of the plane.
    pub(super) fn has_all_on_one_side(&self, eyes: &[Point3]) -> bool {
        let mut sides = eyes.iter().map(|eye| self.normal.dot(&(self.point - eye)));
        sides.all(|side| side > 0.0)
    }
}
