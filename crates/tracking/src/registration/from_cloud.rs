//! The surface of a cloud, with normals from the pixel grid.

use fringeflow::cloud::Cloud;

use super::normals::normals;
use super::surface::{OrganizedSurface, SurfacePoint, grid_step};

impl OrganizedSurface {
    /// Creates the surface of a cloud of C1 with images of `size_px` (width, height), and computes normals from the
    /// pixel grid.
    ///
    /// Skips points outside the image, and points that are not in front of the camera.
    #[must_use]
    pub fn from_cloud(cloud: &Cloud, size_px: [usize; 2]) -> Self {
        let mut surface = Self::without_normals(cloud, size_px);
        surface.compute_normals(1);
        surface
    }

    /// [`Self::from_cloud`] with normals for only about `count` points, on a regular grid of pixels. This is enough for
    /// a registration and takes less time.
    #[must_use]
    pub fn sampled(cloud: &Cloud, size_px: [usize; 2], count: usize) -> Self {
        let mut surface = Self::without_normals(cloud, size_px);
        let step_px = grid_step(surface.points().len(), count);
        surface.compute_normals(step_px);
        surface
    }

    fn without_normals(cloud: &Cloud, size_px: [usize; 2]) -> Self {
        let points = cloud.points.iter().map(|p| SurfacePoint {
            position_m: p.position_m,
            normal: None,
            sigma_m: p.sigma_m,
            intensity: p.intensity,
            cam1_px: p.cam1_px,
        });
        Self::new(size_px, points)
    }

    fn compute_normals(&mut self, step_px: usize) {
        let normals = normals(self, step_px);
        self.set_normals(step_px, normals.into_iter().flatten());
    }
}
