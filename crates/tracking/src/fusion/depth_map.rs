//! Projects the model into the image of camera 1, to find the surfels that other surfels hide.

use std::sync::atomic::{AtomicU32, Ordering};

use nalgebra::IsometryMatrix3;
use rayon::prelude::*;

use fringeflow::geometry::Camera;

use super::surfel::Surfel;

/// Largest depth difference of surfels of one surface within a pixel or two, as a share of the depth. With a larger
/// difference, one hides the other.
const SAME_SURFACE_SHARE: f32 = 0.01;

/// A surfel in the image of camera 1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Projection {
    /// Image point: column, row.
    pub(super) pixel: [f32; 2],
    /// Depth, metres; NaN if the surfel is outside the image or turned away.
    pub(super) depth_m: f32,
}

impl Projection {
    const NONE: Self = Self { pixel: [0.0; 2], depth_m: f32::NAN };

    /// The nearest pixel.
    pub(super) fn nearest_px(&self) -> [isize; 2] {
        // Coordinates in the image are at least −0.5, so the nearest integer needs no rounding down.
        self.pixel.map(|x| (x + 0.5) as isize)
    }

    /// The pixel at or before the point along both axes, perhaps one beside the image.
    pub(super) fn pixel_before(&self) -> [isize; 2] {
        self.pixel.map(|x| (x + 1.0) as isize - 1)
    }

    /// Square of the distance from an image point, pixels².
    pub(super) fn square_distance(&self, [u, v]: [f32; 2]) -> f32 {
        let [x, y] = [self.pixel[0] - u, self.pixel[1] - v];
        x * x + y * y
    }
}

/// The model in the image of camera 1 at a pose. Its memory lives from cloud to cloud.
#[derive(Debug, Default)]
pub(super) struct DepthMap {
    size_px: [usize; 2],
    /// Smallest depth of the surfels at each pixel, as the bits of a number above 0; these have the order of the
    /// numbers.
    least_depths: Vec<AtomicU32>,
    /// Projection of each surfel.
    projections: Vec<Projection>,
}

impl DepthMap {
    /// Projects the surfels, instead of those before.
    pub(super) fn draw(&mut self, surfels: &[Surfel], camera: &Camera, cam1_from_model: &IsometryMatrix3<f64>) {
        self.size_px = [camera.width_px(), camera.height_px()];
        let [width, height] = self.size_px;
        self.least_depths.clear();
        self.least_depths.resize_with(width * height, || AtomicU32::new(f32::INFINITY.to_bits()));
        let project = |surfel: &Surfel| {
            let Some(seen) = project(surfel, camera, cam1_from_model) else { return Projection::NONE };
            let [u, v] = seen.nearest_px().map(|place| place as usize);
            if u < width && v < height {
                self.least_depths[v * width + u].fetch_min(seen.depth_m.to_bits(), Ordering::Relaxed);
            }
            seen
        };
        surfels.par_iter().with_min_len(1024).map(project).collect_into_vec(&mut self.projections);
    }

    /// Returns the projection of a surfel, or `None` if it has none.
    pub(super) fn projection(&self, index: usize) -> Option<&Projection> {
        self.projections.get(index).filter(|seen| !seen.depth_m.is_nan())
    }

    /// Whether another surface lies in front of a projected surfel, at its pixel or beside it.
    pub(super) fn is_hidden(&self, seen: &Projection) -> bool {
        let limit_m = seen.depth_m * (1.0 - SAME_SURFACE_SHARE);
        let [width, height] = self.size_px;
        let [u, v] = seen.nearest_px();
        let around = |place: isize, side: usize| {
            ((place - 1).max(0) as usize).min(side)..((place + 2).max(0) as usize).min(side)
        };
        let (columns, rows) = (around(u, width), around(v, height));
        rows.into_iter().any(|row| {
            let depths = &self.least_depths[row * width..][columns.clone()];
            depths.iter().any(|depth| f32::from_bits(depth.load(Ordering::Relaxed)) < limit_m)
        })
    }
}

/// Returns where the camera sees a surfel that nothing hides, or `None` if it is outside the image or turned away.
pub(super) fn project(surfel: &Surfel, camera: &Camera, cam1_from_model: &IsometryMatrix3<f64>) -> Option<Projection> {
    let position = cam1_from_model * surfel.position();
    let faces_camera = (cam1_from_model.rotation * surfel.normal()).dot(&position.coords) < 0.0;
    let pixel = faces_camera.then(|| camera.project(&position))??;
    camera.sees(&pixel).then_some(Projection { pixel: [pixel.x as f32, pixel.y as f32], depth_m: position.z as f32 })
}

#[cfg(test)]
mod tests {
    use fringeflow::geometry::{Point3, Pose, Vector3};

    use super::*;
    use crate::fusion::surfel::Measurement;
    use crate::registration::tests::camera;
    use crate::registration::with_matrix;

    /// A surfel on the optical axis that faces the camera, at a distance.
    fn surfel(z_m: f64, normal: Vector3) -> Surfel {
        let position = Point3::new(0.0, 0.0, z_m);
        Surfel::new(&Measurement { position, normal, sigma_m: 1e-5, intensity: 100, pose_variance: 0.0, cloud: 0 })
    }

    #[test]
    fn another_surface_in_front_hides_and_one_that_is_turned_away_does_not() {
        let towards = -Vector3::z();
        let identity = with_matrix(&Pose::identity());
        let mut map = DepthMap::default();
        // The third is part of the surface of the second.
        let surfels = [surfel(0.31, towards), surfel(0.30, towards), surfel(0.299, towards), surfel(0.25, -towards)];
        map.draw(&surfels, &camera(), &identity);
        let hidden: Vec<_> = (0..4).map(|k| map.projection(k).map(|seen| map.is_hidden(seen))).collect();
        assert_eq!(hidden, [Some(true), Some(false), Some(false), None]);
    }
}
