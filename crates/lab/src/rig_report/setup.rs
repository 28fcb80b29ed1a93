//! Rig, volume and pattern, and the changes that the advice tries.

use nalgebra::UnitQuaternion;

use fringeflow::geometry::{FringePattern, MeasurementVolume, Pixel, Point3, Pose, Rig, Vector3, VolumeError};

use super::RigReportError;

/// Shortest plausible base, metres.
const MIN_BASE_M: f64 = 1e-6;

/// A rig with its measurement volume and fringe pattern.
#[derive(Clone, Debug, PartialEq)]
pub struct RigSetup {
    /// Cameras and projector.
    pub rig: Rig,
    /// The measurement volume.
    pub volume: MeasurementVolume,
    /// The fringes.
    pub pattern: FringePattern,
}

impl RigSetup {
    pub(super) fn check(&self) -> Result<(), RigReportError> {
        let base_m = self.rig.centre_of_cam2().coords.norm();
        if base_m.is_nan() || base_m < MIN_BASE_M {
            return Err(RigReportError::NoBase { base_m });
        }
        let value = self.pattern.period_px;
        if !(value.is_finite() && value >= 2.0) {
            let range = "2 or more: a fringe has at least 2 projector pixels";
            return Err(RigReportError::OutOfRange { name: "the period, projector px,", value, range });
        }
        Ok(())
    }

    /// Centre of the volume in the frame of C1.
    pub(super) fn centre_cam1(&self) -> Point3 {
        self.volume.cam1_from_volume() * nalgebra::center(self.volume.min(), self.volume.max())
    }

    /// Mean viewing direction of C1, C2 and P to the centre of the volume: a unit vector in the frame of C1.
    pub(super) fn viewing_direction(&self) -> Vector3 {
        let centre = self.centre_cam1();
        let eyes = [Point3::origin(), self.rig.centre_of_cam2(), self.rig.centre_of_projector()];
        let sum: Vector3 = eyes.iter().filter_map(|eye| (centre - eye).try_normalize(0.0)).sum();
        sum.try_normalize(1e-9).unwrap_or_else(Vector3::z)
    }

    /// Whether C2 sees a point on its sensor.
    pub(super) fn cam2_sees(&self, point_cam1: &Point3) -> bool {
        self.rig.project_cam2(point_cam1).is_some_and(|pixel| self.rig.cam2.sees(&pixel))
    }

    /// Absolute phase at a point, periods; `None` if the point is behind the projector.
    pub(super) fn phase_turns(&self, point_cam1: &Point3) -> Option<f64> {
        self.rig.project_projector(point_cam1).map(|pixel: Pixel| self.pattern.phase_turns(pixel.x))
    }

    /// Absolute phase at a point, periods; `None` if the projector does not light it.
    pub(super) fn lit_phase_turns(&self, point_cam1: &Point3) -> Option<f64> {
        let pixel = self.rig.project_projector(point_cam1)?;
        self.rig.projector.sees(&pixel).then(|| self.pattern.phase_turns(pixel.x))
    }

    /// Moves the projector along the base to place `r` (0 at C1, 1 at C2), and rotates it so that it stays aimed at the
    /// volume.
    #[must_use]
    pub fn with_projector_place(&self, r: f64) -> Self {
        let base = self.rig.centre_of_cam2().coords;
        let before = self.rig.centre_of_projector();
        let after = before + base * (r - self.rig.projector_place_on_base());
        let centre = self.centre_cam1();
        // `None` occurs only for opposite directions, which no move along a base in front of a volume causes.
        let turn = UnitQuaternion::rotation_between(&(centre - after), &(centre - before)).unwrap_or_default();
        let rotation = self.rig.projector_from_cam1.rotation * turn;
        let mut changed = self.clone();
        changed.rig.projector_from_cam1 = Pose::from_parts((-(rotation * after.coords)).into(), rotation);
        changed
    }

    /// Multiplies the period by `factor`.
    #[must_use]
    pub fn with_period_scaled(&self, factor: f64) -> Self {
        let mut changed = self.clone();
        changed.pattern.period_px *= factor;
        changed
    }

    /// Depth axis of the volume: its axis (0 to 2, in its own frame) closest to the viewing direction.
    #[must_use]
    pub fn depth_axis(&self) -> usize {
        let view = self.volume.cam1_from_volume().rotation.inverse() * self.viewing_direction();
        view.iamax()
    }

    /// Extent of the volume along its depth axis, metres.
    #[must_use]
    pub fn depth_m(&self) -> f64 {
        let axis = self.depth_axis();
        self.volume.max()[axis] - self.volume.min()[axis]
    }

    /// Multiplies the depth of the volume by `factor`, about its centre.
    ///
    /// # Errors
    /// The factor leaves no volume.
    pub fn with_depth_scaled(&self, factor: f64) -> Result<Self, VolumeError> {
        let axis = self.depth_axis();
        let (mut min, mut max) = (*self.volume.min(), *self.volume.max());
        let (middle, half) = ((min[axis] + max[axis]) / 2.0, (max[axis] - min[axis]) / 2.0 * factor);
        (min[axis], max[axis]) = (middle - half, middle + half);
        let volume = MeasurementVolume::new(*self.volume.cam1_from_volume(), min, max)?;
        Ok(Self { volume, ..self.clone() })
    }
}
