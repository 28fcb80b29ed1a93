//! The measurement volume: a box in a frame of its own (paper, section 2.1). In: a ray of C1. Out: the part of it
//! inside the box. Cost: a rotation and six divisions per ray.

use nalgebra::Rotation3;

use super::{Point3, Pose, Vector3};

/// The box in which the measured object lies.
///
/// ```
/// use fringeflow::geometry::{MeasurementVolume, Point3, Pose, Vector3};
///
/// // A box of 100 × 80 × 50 mm, its centre 0.3 m in front of camera 1.
/// let (min, max) = (Point3::new(-0.05, -0.04, -0.025), Point3::new(0.05, 0.04, 0.025));
/// let volume = MeasurementVolume::new(Pose::translation(0.0, 0.0, 0.3), min, max)?;
/// // A ray with z = 1 is inside between these two depths.
/// let (near_m, far_m) = volume.clip(&Vector3::new(0.1, 0.05, 1.0)).ok_or("the ray misses the volume")?;
/// assert!((near_m - 0.275).abs() < 1e-12 && (far_m - 0.325).abs() < 1e-12);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MeasurementVolume {
    cam1_from_volume: Pose,
    min: Point3,
    max: Point3,
}

/// Why a box is no measurement volume.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum VolumeError {
    /// A bound is NaN or infinite.
    #[error("axis {axis} of the volume runs from {min} m to {max} m; both bounds must be finite numbers")]
    NotFinite {
        /// x, y or z.
        axis: char,
        /// Lower bound, metres.
        min: f64,
        /// Upper bound, metres.
        max: f64,
    },
    /// The lower bound of an axis is not below its upper bound.
    #[error("axis {axis} of the volume is empty: it runs from {min} m to {max} m; min must be below max")]
    Empty {
        /// x, y or z.
        axis: char,
        /// Lower bound, metres.
        min: f64,
        /// Upper bound, metres.
        max: f64,
    },
    /// Every corner lies behind camera 1.
    #[error("the volume is behind camera 1: its farthest corner is at z = {farthest_m} m; check R_v, T_v and the unit")]
    BehindCamera {
        /// Largest depth of a corner, metres.
        farthest_m: f64,
    },
}

impl MeasurementVolume {
    /// The box from `min` to `max` (metres, own frame) at the pose `cam1_from_volume`.
    ///
    /// # Errors
    /// The box is empty, not finite, or completely behind camera 1.
    pub fn new(cam1_from_volume: Pose, min: Point3, max: Point3) -> Result<Self, VolumeError> {
        for (i, axis) in ['x', 'y', 'z'].into_iter().enumerate() {
            let (min, max) = (min[i], max[i]);
            if !(min.is_finite() && max.is_finite()) {
                return Err(VolumeError::NotFinite { axis, min, max });
            }
            if min >= max {
                return Err(VolumeError::Empty { axis, min, max });
            }
        }
        let volume = Self { cam1_from_volume, min, max };
        let farthest_m = volume.corners_cam1().iter().map(|c| c.z).fold(f64::NEG_INFINITY, f64::max);
        if farthest_m <= 0.0 {
            return Err(VolumeError::BehindCamera { farthest_m });
        }
        Ok(volume)
    }

    /// The box with `share` of its extent added on every side.
    #[must_use]
    pub fn enlarged(&self, share: f64) -> Self {
        let margin = (self.max - self.min) * share;
        Self { cam1_from_volume: self.cam1_from_volume, min: self.min - margin, max: self.max + margin }
    }

    /// Pose of the box in the frame of C1.
    #[must_use]
    pub fn cam1_from_volume(&self) -> &Pose {
        &self.cam1_from_volume
    }

    /// Lower corner, own frame, metres.
    #[must_use]
    pub fn min(&self) -> &Point3 {
        &self.min
    }

    /// Upper corner, own frame, metres.
    #[must_use]
    pub fn max(&self) -> &Point3 {
        &self.max
    }

    /// The eight corners in the frame of C1.
    #[must_use]
    pub fn corners_cam1(&self) -> [Point3; 8] {
        std::array::from_fn(|i| {
            let pick = |axis: usize| if i >> axis & 1 == 0 { self.min[axis] } else { self.max[axis] };
            self.cam1_from_volume * Point3::new(pick(0), pick(1), pick(2))
        })
    }

    /// Whether a point of the frame of C1 lies in the box.
    #[must_use]
    pub fn contains(&self, point_cam1: &Point3) -> bool {
        let p = self.cam1_from_volume.inverse() * point_cam1;
        (0..3).all(|i| p[i] >= self.min[i] && p[i] <= self.max[i])
    }

    /// Part of a ray of C1 inside the box: depths (z, metres) of `Q_min` and `Q_max` of the paper.
    ///
    /// `ray` is a direction with `z = 1`, so its parameter is the depth. `None` where the ray misses the box or enters
    /// it only behind the camera.
    #[must_use]
    pub fn clip(&self, ray: &Vector3) -> Option<(f64, f64)> {
        self.ray_clipper().clip(ray)
    }

    /// [`Self::clip`] prepared for many rays.
    #[must_use]
    pub fn ray_clipper(&self) -> RayClipper {
        let volume_from_cam1 = self.cam1_from_volume.inverse();
        RayClipper {
            volume_from_cam1: volume_from_cam1.rotation.to_rotation_matrix(),
            origin: volume_from_cam1 * Point3::origin(),
            min: self.min,
            max: self.max,
        }
    }
}

/// Clips rays of C1 against a measurement volume.
#[derive(Clone, Debug, PartialEq)]
pub struct RayClipper {
    volume_from_cam1: Rotation3<f64>,
    /// Centre of C1 in the frame of the box.
    origin: Point3,
    min: Point3,
    max: Point3,
}

impl RayClipper {
    /// See [`MeasurementVolume::clip`].
    #[must_use]
    #[inline]
    pub fn clip(&self, ray: &Vector3) -> Option<(f64, f64)> {
        let (origin, direction) = (&self.origin, self.volume_from_cam1 * ray);
        let (mut near, mut far) = (f64::MIN_POSITIVE, f64::INFINITY);
        // Slab method: the ray is inside the box where it is between all three pairs of parallel faces.
        for i in 0..3 {
            // Parallel to the faces: inside or outside all along.
            if direction[i].abs() < 1e-12 {
                if origin[i] < self.min[i] || origin[i] > self.max[i] {
                    return None;
                }
                continue;
            }
            let (a, b) = ((self.min[i] - origin[i]) / direction[i], (self.max[i] - origin[i]) / direction[i]);
            near = near.max(a.min(b));
            far = far.min(a.max(b));
        }
        (near < far).then_some((near, far))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn volume() -> MeasurementVolume {
        let pose = Pose::new(Vector3::new(0.01, -0.02, 0.3), Vector3::new(0.1, -0.2, 0.05));
        MeasurementVolume::new(pose, Point3::new(-0.05, -0.04, -0.02), Point3::new(0.05, 0.04, 0.03)).unwrap()
    }

    proptest! {
        #[test]
        fn clip_agrees_with_contains(x in -0.3..0.3, y in -0.3..0.3, z in 0.2..0.4) {
            let (volume, ray) = (volume(), Vector3::new(x, y, 1.0));
            let inside = volume.contains(&Point3::from(ray * z));
            let clipped = volume.clip(&ray).is_some_and(|(near, far)| near <= z && z <= far);
            prop_assert_eq!(inside, clipped);
        }
    }

    #[test]
    fn a_volume_behind_the_camera_is_refused() {
        let pose = Pose::translation(0.0, 0.0, -0.3);
        let made = MeasurementVolume::new(pose, Point3::new(-0.1, -0.1, -0.1), Point3::new(0.1, 0.1, 0.1));
        assert!(matches!(made, Err(VolumeError::BehindCamera { .. })));
    }

    #[test]
    fn an_empty_volume_is_refused() {
        let made = MeasurementVolume::new(Pose::identity(), Point3::new(0.1, 0.0, 0.1), Point3::new(0.1, 0.1, 0.2));
        assert!(matches!(made, Err(VolumeError::Empty { axis: 'x', .. })));
    }
}
