//! The sphere with the smallest sum of squared distances, its radius free.

use nalgebra::{Matrix4, Vector4};

use fringeflow::geometry::{Point3, Vector3};

/// A sphere.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// Its centre.
    pub centre: Point3,
    /// Its radius, metres.
    pub radius_m: f64,
}

/// A fitted sphere, and how well the points determine it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SphereFit {
    /// The sphere.
    pub sphere: Sphere,
    /// Covariance of centre and radius per unit variance of the points.
    pub cofactors: Matrix4<f64>,
}

/// Most steps of the iteration. From a start within a tenth of the radius it takes about five.
const MAX_STEPS: usize = 50;
/// Relative change of the radius at which the iteration ends.
const TOLERANCE: f64 = 1e-13;

impl Sphere {
    /// Distance of a point from the surface, positive outside, metres.
    #[must_use]
    pub fn distance_m(&self, point: &Point3) -> f64 {
        (point - self.centre).norm() - self.radius_m
    }
}

impl SphereFit {
    /// The sphere with the smallest sum of squared distances from the points, by Gauss-Newton from a start. `None` if
    /// the points do not determine one.
    pub fn new(points: &[Point3], start: Sphere) -> Option<Self> {
        let mut sphere = start;
        for _ in 0..MAX_STEPS {
            let (mut normal, mut right) = (Matrix4::zeros(), Vector4::zeros());
            for point in points {
                let away = point - sphere.centre;
                let Some(direction) = away.try_normalize(0.0) else { continue };
                let row = Vector4::new(-direction.x, -direction.y, -direction.z, -1.0);
                normal += row * row.transpose();
                right -= row * (away.norm() - sphere.radius_m);
            }
            let cofactors = normal.try_inverse()?;
            let step = cofactors * right;
            if !step.iter().all(|value| value.is_finite()) {
                return None;
            }
            sphere.centre += step.xyz();
            sphere.radius_m += step.w;
            if step.norm() < TOLERANCE * start.radius_m {
                return (sphere.radius_m > 0.0).then_some(Self { sphere, cofactors });
            }
        }
        None
    }
}

/// The two spheres of a radius through three points; none if they lie on a line or too far apart.
pub(super) fn through_three([a, b, c]: [&Point3; 3], radius_m: f64) -> Option<[Point3; 2]> {
    let (ab, ac): (Vector3, Vector3) = (b - a, c - a);
    let across = ab.cross(&ac);
    let square = across.norm_squared();
    if square <= 1e-6 * ab.norm_squared() * ac.norm_squared() {
        return None;
    }
    let to_middle = (across.cross(&ab) * ac.norm_squared() + ac.cross(&across) * ab.norm_squared()) / (2.0 * square);
    let rise = (radius_m * radius_m - to_middle.norm_squared()) / square;
    (rise >= 0.0).then(|| [1.0, -1.0].map(|side| a + to_middle + across * (side * rise.sqrt())))
}
