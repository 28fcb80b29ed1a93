//! A pinhole camera with lens distortion. The projector is one too: light travels the other way.
//!
//! In: intrinsic parameters. Out: the pixel of a 3D point and the ray of a pixel. Cost: one evaluation of the
//! distortion per projection, about four Newton steps per ray.

use nalgebra::{Point2, Vector2};

use super::{Distortion, Pixel, Point3, Vector3};

/// Intrinsic parameters of a camera or of the projector.
///
/// ```
/// use fringeflow::geometry::{Camera, Distortion, Pixel, Point3};
///
/// let lens = Distortion::from_opencv(&[-0.15, 0.2, -0.002, 0.0016]);
/// let camera = Camera::new([1850.0, 1852.0], [320.0, 250.0], lens, [640, 512]);
/// // The direction of a ray has z = 1, so its parameter is the depth in metres.
/// let pixel = Pixel::new(100.0, 80.0);
/// let ray = camera.ray(&pixel).ok_or("this pixel cannot be undistorted")?;
/// let seen = camera.project(&Point3::from(ray * 0.3)).ok_or("this point is not visible")?;
/// assert!((seen - pixel).norm() < 1e-9);
/// # Ok::<(), &str>(())
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Camera {
    focal_px: Vector2<f64>,
    skew_px: f64,
    principal_px: Point2<f64>,
    distortion: Distortion,
    width_px: usize,
    height_px: usize,
    max_ideal_radius: f64,
}

impl Camera {
    /// A camera from focal lengths, principal point (pixels), distortion and image size (width, height).
    #[must_use]
    pub fn new(focal_px: [f64; 2], principal_px: [f64; 2], distortion: Distortion, size_px: [usize; 2]) -> Self {
        Self {
            focal_px: focal_px.into(),
            skew_px: 0.0,
            principal_px: principal_px.into(),
            max_ideal_radius: distortion.max_invertible_radius(),
            distortion,
            width_px: size_px[0],
            height_px: size_px[1],
        }
    }

    /// The same camera with a skew term `K[0][1]`.
    #[must_use]
    pub fn with_skew(mut self, skew_px: f64) -> Self {
        self.skew_px = skew_px;
        self
    }

    /// Focal lengths (x, y), pixels.
    #[must_use]
    pub fn focal_px(&self) -> [f64; 2] {
        self.focal_px.into()
    }

    /// Principal point, pixels.
    #[must_use]
    pub fn principal_px(&self) -> [f64; 2] {
        [self.principal_px.x, self.principal_px.y]
    }

    /// Skew `K[0][1]`, pixels; zero for nearly every camera.
    #[must_use]
    pub fn skew_px(&self) -> f64 {
        self.skew_px
    }

    /// The lens distortion.
    #[must_use]
    pub fn distortion(&self) -> &Distortion {
        &self.distortion
    }

    /// Radius of ideal points (z = 1) beyond which the distortion folds back.
    pub(super) fn max_ideal_radius(&self) -> f64 {
        self.max_ideal_radius
    }

    /// Image width, pixels.
    #[must_use]
    pub fn width_px(&self) -> usize {
        self.width_px
    }

    /// Image height, pixels.
    #[must_use]
    pub fn height_px(&self) -> usize {
        self.height_px
    }

    /// Raw (distorted) image point of a point in this camera's frame; `None` behind the camera or beyond the radius
    /// at which the distortion folds back.
    #[must_use]
    pub fn project(&self, point: &Point3) -> Option<Pixel> {
        if point.z <= 0.0 {
            return None;
        }
        let ideal = Vector2::new(point.x / point.z, point.y / point.z);
        (ideal.norm() <= self.max_ideal_radius).then(|| self.pixel_of_ideal(ideal))
    }

    /// Direction of the ray through a raw image point, scaled to `z = 1`; `None` where the distortion has no inverse.
    #[must_use]
    pub fn ray(&self, pixel: &Pixel) -> Option<Vector3> {
        let y = (pixel.y - self.principal_px.y) / self.focal_px.y;
        let x = (pixel.x - self.principal_px.x - self.skew_px * y) / self.focal_px.x;
        let ideal = self.distortion.undistort(Vector2::new(x, y))?;
        (ideal.norm() <= self.max_ideal_radius).then(|| Vector3::new(ideal.x, ideal.y, 1.0))
    }

    /// Whether a raw image point lies on the sensor: within half a pixel of a pixel centre.
    #[must_use]
    pub fn sees(&self, pixel: &Pixel) -> bool {
        pixel.x >= -0.5
            && pixel.y >= -0.5
            && pixel.x <= self.width_px as f64 - 0.5
            && pixel.y <= self.height_px as f64 - 0.5
    }

    fn pixel_of_ideal(&self, ideal: Vector2<f64>) -> Pixel {
        let d = self.distortion.distort(ideal);
        Pixel::new(
            self.focal_px.x * d.x + self.skew_px * d.y + self.principal_px.x,
            self.focal_px.y * d.y + self.principal_px.y,
        )
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub(in crate::geometry) fn camera() -> Camera {
        let d = Distortion::from_opencv(&[-0.15, 0.66, -0.002, 0.0016, 0.1]);
        Camera::new([1851.6, 1851.9], [338.0, 239.7], d, [640, 512]).with_skew(0.3)
    }

    #[test]
    fn ray_inverts_project() {
        let camera = camera();
        for (u, v) in [(0.0, 0.0), (639.0, 511.0), (320.0, 256.0), (12.5, 400.25)] {
            let ray = camera.ray(&Pixel::new(u, v)).unwrap();
            let back = camera.project(&Point3::from(ray * 0.31)).unwrap();
            assert!((back - Pixel::new(u, v)).norm() < 1e-8);
        }
    }

    #[test]
    fn nothing_behind_the_camera_is_projected() {
        assert!(camera().project(&Point3::new(0.0, 0.0, -1.0)).is_none());
        assert!(camera().project(&Point3::new(0.0, 0.0, 0.0)).is_none());
    }
}
