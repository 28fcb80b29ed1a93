//! Triangulation: the point of a ray of C1 that comes closest to a ray of C2 (paper, section 2.1).
//!
//! In: a pixel of C1 and its correspondence in C2. Out: a point *on the ray of C1*, so that it projects exactly onto
//! its pixel, and its distance from the ray of C2, which is zero for a correspondence on the epipolar line. Cost: two
//! undistortions and some thirty operations.

use super::{Pixel, Point3, Pose, Rig, Vector3};

/// Smallest sine of the angle between two rays that intersect; below it (0.003°) they count as parallel.
const MIN_SINE: f64 = 5e-5;

/// The intersection of two rays.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Triangulation {
    /// The point on the ray of C1, frame of C1, metres.
    pub point_cam1: Point3,
    /// Distance from there to the ray of C2, metres.
    pub gap_m: f64,
}

/// Triangulates a raw pixel of C1 and a raw point of C2.
///
/// `None` where a distortion has no inverse, or the rays are parallel or intersect behind a camera. Example: [`Rig`].
#[must_use]
pub fn triangulate(rig: &Rig, cam1_px: &Pixel, cam2_px: &Pixel) -> Option<Triangulation> {
    intersect_rays(&rig.cam2_from_cam1, &rig.cam1.ray(cam1_px)?, &rig.cam2.ray(cam2_px)?)
}

/// Intersects two rays, each a direction with `z = 1` in the frame of its own camera.
///
/// In the frame of C1, a is the ray of C1, n the unit direction of C2's ray and c the centre of C2. With v⊥ the
/// component of v perpendicular to n, the depth is a⊥·c⊥ / a⊥². `None` where the rays are parallel or intersect behind
/// a camera.
fn intersect_rays(cam2_from_cam1: &Pose, ray_cam1: &Vector3, ray_cam2: &Vector3) -> Option<Triangulation> {
    let cam1_from_cam2 = cam2_from_cam1.inverse();
    let (centre, direction) = (cam1_from_cam2.translation.vector, (cam1_from_cam2.rotation * ray_cam2).normalize());
    let perpendicular = |v: &Vector3| v - direction * direction.dot(v);
    let (ray, offset) = (perpendicular(ray_cam1), perpendicular(&centre));
    if ray.norm() < MIN_SINE * ray_cam1.norm() {
        return None;
    }
    let depth = ray.dot(&offset) / ray.norm_squared();
    let point = ray_cam1 * depth;
    let before_cam2 = direction.dot(&(point - centre)) > 0.0;
    let gap_m = (ray * depth - offset).norm();
    (depth > 0.0 && before_cam2).then(|| Triangulation { point_cam1: Point3::from(point), gap_m })
}

/// Distance in metres that a point moves along its ray of C1 when its correspondence in C2 moves by one pixel along the
/// epipolar line; `None` where C2 does not see the point.
#[must_use]
pub fn range_per_pixel(rig: &Rig, point_cam1: &Point3) -> Option<f64> {
    let step = 1e-4;
    let near = rig.project_cam2(&(point_cam1 * (1.0 - step)))?;
    let far = rig.project_cam2(&(point_cam1 * (1.0 + step)))?;
    let moved_px = (far - near).norm();
    (moved_px > 0.0).then(|| 2.0 * step * point_cam1.coords.norm() / moved_px)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::rig;
    use proptest::prelude::*;

    fn rig() -> Rig {
        let cam2_from_cam1 = Pose::new(Vector3::new(-0.11, 0.003, 0.02), Vector3::new(0.01, 0.38, -0.02));
        rig::tests::rig(cam2_from_cam1, &[-0.15, 0.2, -0.002, 0.0016])
    }

    proptest! {
        #[test]
        fn triangulation_inverts_projection(u in 0.0..639.0, v in 0.0..511.0, depth in 0.25..0.4) {
            let rig = rig();
            let point = Point3::from(rig.cam1.ray(&Pixel::new(u, v)).unwrap() * depth);
            let seen = rig.project_cam2(&point).unwrap();
            let found = triangulate(&rig, &Pixel::new(u, v), &seen).unwrap();
            prop_assert!((found.point_cam1 - point).norm() < 1e-9);
            prop_assert!(found.gap_m < 1e-9);
        }

        #[test]
        fn a_point_off_the_epipolar_line_stays_on_the_ray_of_cam1(u in 0.0..639.0, v in 0.0..511.0, off in -2.0..2.0) {
            let rig = rig();
            let ray = rig.cam1.ray(&Pixel::new(u, v)).unwrap();
            let seen = rig.project_cam2(&Point3::from(ray * 0.3)).unwrap();
            let found = triangulate(&rig, &Pixel::new(u, v), &(seen + nalgebra::Vector2::new(0.0, off))).unwrap();
            let depth = found.point_cam1.z;
            prop_assert!((found.point_cam1.coords - ray * depth).norm() < 1e-12);
            // A pixel is about 0.16 mm wide there.
            prop_assert!(found.gap_m < 2.0 * 2e-4 && (off.abs() < 0.5 || found.gap_m > 4e-5));
        }
    }

    #[test]
    fn rays_that_do_not_intersect_have_no_point() {
        let pose = Pose::translation(-0.1, 0.0, 0.0);
        let ahead = Vector3::z();
        assert!(intersect_rays(&pose, &ahead, &ahead).is_none());
        // They diverge in front of the cameras and intersect behind them.
        assert!(intersect_rays(&pose, &Vector3::new(-0.2, 0.0, 1.0), &Vector3::new(0.2, 0.0, 1.0)).is_none());
    }

    #[test]
    fn range_per_pixel_is_the_slope_of_triangulation() {
        let rig = rig();
        let point = Point3::from(rig.cam1.ray(&Pixel::new(200.0, 300.0)).unwrap() * 0.3);
        let slope = range_per_pixel(&rig, &point).unwrap();
        let moved = Point3::from(point.coords * (1.0 + slope / point.coords.norm()));
        let pixels = (rig.project_cam2(&moved).unwrap() - rig.project_cam2(&point).unwrap()).norm();
        assert!((pixels - 1.0).abs() < 0.01, "{pixels}");
    }
}
