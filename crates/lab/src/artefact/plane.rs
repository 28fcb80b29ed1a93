//! The plane with the smallest sum of squared distances.

use nalgebra::Matrix3;

use fringeflow::geometry::{Point3, Vector3};

/// A plane through a point, with its unit normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// A point of the plane: the mean of the fitted points.
    pub point: Point3,
    /// Unit normal, towards the origin.
    pub normal: Vector3,
}

impl Plane {
    /// The plane with the smallest sum of squared distances from the points, the eigenvector of their covariance;
    /// `None` if they do not span a plane.
    pub fn fit(points: &[Point3]) -> Option<Self> {
        let mean = points.iter().map(|point| point.coords).sum::<Vector3>() / points.len() as f64;
        let covariance: Matrix3<f64> = points.iter().map(|p| (p.coords - mean) * (p.coords - mean).transpose()).sum();
        if points.len() < 3 || !covariance.iter().all(|value| value.is_finite()) {
            return None;
        }
        let eigen = covariance.symmetric_eigen();
        let (least, value) = eigen.eigenvalues.argmin();
        let middle = eigen.eigenvalues.sum() - value - eigen.eigenvalues.max();
        let normal = eigen.eigenvectors.column(least).into_owned();
        // Points on a line have two small eigenvalues.
        (middle > 1e-9 * eigen.eigenvalues.max()).then(|| Self::through(mean.into(), normal))
    }

    /// The plane through a point with this normal, turned towards the origin.
    pub(super) fn through(point: Point3, normal: Vector3) -> Self {
        let normal = if normal.dot(&point.coords) > 0.0 { -normal } else { normal };
        Self { point, normal }
    }

    /// Distance of a point, positive on the side of the origin, metres.
    #[must_use]
    pub fn distance_m(&self, point: &Point3) -> f64 {
        (point - self.point).dot(&self.normal)
    }

    /// Two unit vectors in the plane, at right angles.
    pub(super) fn axes(&self) -> [Vector3; 2] {
        axes_across(&self.normal)
    }
}

/// Two unit vectors at right angles to a unit vector, the first as near to the x axis as possible. For a surface that
/// faces C1 they run right and down.
pub(super) fn axes_across(normal: &Vector3) -> [Vector3; 2] {
    let start = if normal.x.abs() < 0.9 { Vector3::x() } else { Vector3::y() };
    let first = (start - normal * normal.dot(&start)).normalize();
    [first, first.cross(normal)]
}
