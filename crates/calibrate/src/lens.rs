//! The image of a point in a camera or in the projector, with its derivatives.
//!
//! In: nine intrinsic parameters and a point in the frame of the device. Out: the pixel, and its derivatives with
//! respect to the parameters and to the point. Cost: some hundred operations. Oracle: [`Camera::project`].

use fringeflow::geometry::{Camera, Distortion, Pixel, Vector3};
use nalgebra::{Matrix2, Matrix2x3, SMatrix, Vector2};

/// Number of intrinsic parameters of a device.
pub const INTRINSICS: usize = 9;

/// Names of the intrinsic parameters, in their order.
pub const INTRINSIC_NAMES: [&str; INTRINSICS] = ["fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3"];

/// Derivatives of a pixel with respect to the intrinsic parameters.
pub(crate) type ByIntrinsics = SMatrix<f64, 2, INTRINSICS>;

/// Intrinsic parameters: fx, fy, cx, cy in pixels, and k1, k2, p1, p2, k3 in OpenCV's order.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lens(pub [f64; INTRINSICS]);

/// The image of a point, with derivatives.
pub(crate) struct Imaged {
    pub(crate) pixel: Pixel,
    pub(crate) by_intrinsics: ByIntrinsics,
    pub(crate) by_point: Matrix2x3<f64>,
}

impl Lens {
    /// A lens without distortion.
    #[must_use]
    pub fn ideal(focal_px: [f64; 2], principal_px: [f64; 2]) -> Self {
        Self([focal_px[0], focal_px[1], principal_px[0], principal_px[1], 0.0, 0.0, 0.0, 0.0, 0.0])
    }

    /// Focal lengths (x, y), pixels.
    #[must_use]
    pub fn focal_px(&self) -> [f64; 2] {
        [self.0[0], self.0[1]]
    }

    /// Principal point, pixels.
    #[must_use]
    pub fn principal_px(&self) -> [f64; 2] {
        [self.0[2], self.0[3]]
    }

    /// The distortion.
    #[must_use]
    pub fn distortion(&self) -> Distortion {
        Distortion::from_opencv(&self.0[4..])
    }

    /// The camera with this lens and an image of `size_px` (width, height).
    #[must_use]
    pub fn camera(&self, size_px: [usize; 2]) -> Camera {
        Camera::new(self.focal_px(), self.principal_px(), self.distortion(), size_px)
    }

    /// The image of a point in the frame of the device; `None` behind it.
    pub(crate) fn image(&self, point: &Vector3) -> Option<Imaged> {
        if point.z <= 0.0 {
            return None;
        }
        let (x, y, distortion) = (point.x / point.z, point.y / point.z, self.distortion());
        let ideal = Vector2::new(x, y);
        let [distorted, focal_px] = [distortion.distort(ideal), Vector2::from(self.focal_px())];
        let pixel = Pixel::from(distorted.component_mul(&focal_px) + Vector2::from(self.principal_px()));
        let r2 = x * x + y * y;
        // One column for each coefficient: the term that it multiplies, in units of the focal length.
        let terms = [
            ideal * r2,
            ideal * r2 * r2,
            Vector2::new(2.0 * x * y, r2 + 2.0 * y * y),
            Vector2::new(r2 + 2.0 * x * x, 2.0 * x * y),
            ideal * r2 * r2 * r2,
        ];
        let mut by_intrinsics = ByIntrinsics::zeros();
        by_intrinsics[(0, 0)] = distorted.x;
        by_intrinsics[(1, 1)] = distorted.y;
        by_intrinsics[(0, 2)] = 1.0;
        by_intrinsics[(1, 3)] = 1.0;
        for (k, term) in terms.into_iter().enumerate() {
            by_intrinsics.set_column(4 + k, &term.component_mul(&focal_px));
        }
        let by_ideal = Matrix2::from_diagonal(&focal_px) * distortion.jacobian(ideal);
        let ideal_by_point = Matrix2x3::new(1.0, 0.0, -x, 0.0, 1.0, -y) / point.z;
        Some(Imaged { pixel, by_intrinsics, by_point: by_ideal * ideal_by_point })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fringeflow::geometry::Point3;

    #[test]
    fn derivatives_are_those_of_the_camera_model() {
        let lens = Lens([900.0, 910.0, 310.0, 260.0, -0.2, 0.15, 0.002, -0.001, 0.05]);
        let point = Vector3::new(0.08, -0.05, 0.31);
        let image = lens.image(&point).unwrap();
        let seen = |lens: &Lens, p: &Vector3| lens.camera([640, 512]).project(&Point3::from(*p)).unwrap();
        assert!((image.pixel - seen(&lens, &point)).norm() < 1e-9);
        for k in 0..INTRINSICS {
            let step = 1e-6 * lens.0[k].abs().max(1.0);
            let moved = |h: f64| {
                let mut other = lens;
                other.0[k] += h;
                seen(&other, &point)
            };
            let numeric = (moved(step) - moved(-step)) / (2.0 * step);
            assert!((image.by_intrinsics.column(k) - numeric).norm() < 1e-4, "{}", INTRINSIC_NAMES[k]);
        }
        for k in 0..3 {
            let step = Vector3::from_fn(|i, _| if i == k { 1e-7 } else { 0.0 });
            let numeric = (seen(&lens, &(point + step)) - seen(&lens, &(point - step))) / 2e-7;
            assert!((image.by_point.column(k) - numeric).norm() < 1e-3);
        }
    }
}
