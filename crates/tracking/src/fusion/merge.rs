//! Assigns the points of a cloud to surfels and merges them.

use rayon::prelude::*;

use fringeflow::geometry::{Point3, Pose, Vector3};
use fringeflow_simd::prefetch;

use crate::registration::{OrganizedSurface, PoseCovariance, SurfacePoint};

use super::index_map::IndexMap;
use super::surfel::{Measurement, Surfel};

/// Largest distance in the image between a surfel and a point of the same piece of surface, pixels.
const SAME_PLACE_PX: f32 = 0.75;
/// Minimum cosine between the normals of a surfel and a point assigned to it, 60°.
const MIN_NORMAL_COSINE: f64 = 0.5;
/// Largest distance of a point from the plane of its surfel, in standard deviations and in pixels; the larger applies.
/// Errors of calibration and motion exceed noise. If such points made new surfels, a second layer would appear beside
/// the first, which is worse than an average of both.
const SAME_PLANE_SD: f64 = 4.0;
const SAME_PLANE_PX: f64 = 1.0;

/// Placement of a cloud relative to the model.
pub(super) struct Placement {
    pub(super) model_from_cam1: Pose,
    pub(super) covariance: PoseCovariance,
    /// Factor by which distances exceed those of noise alone, at least 1.
    pub(super) excess: f64,
    /// Width of a pixel at a distance of one metre, metres.
    pub(super) pixel_per_m: f64,
    /// Index of the cloud among the merged clouds.
    pub(super) cloud: u32,
}

/// A point placed in the frame of the model.
struct Placed {
    position: Point3,
    normal: Vector3,
    sigma_m: f64,
}

impl Placement {
    /// Places a point, or returns `None` if it has no normal.
    fn place(&self, point: &SurfacePoint) -> Option<Placed> {
        Some(Placed {
            position: self.model_from_cam1 * point.position(),
            normal: self.model_from_cam1.rotation * point.unit_normal()?,
            sigma_m: f64::from(point.sigma_m),
        })
    }

    /// Returns the measurement of a point, or `None` if it has no normal.
    fn measurement(&self, point: &SurfacePoint) -> Option<Measurement> {
        let Placed { position, normal, sigma_m } = self.place(point)?;
        Some(Measurement {
            position,
            normal,
            sigma_m,
            intensity: point.intensity,
            pose_variance: self.covariance.variance_along(&position, &normal),
            cloud: self.cloud,
        })
    }

    /// Returns the surfel of a measurement at a pixel: of those whose plane it fits, the nearest in the image.
    fn owner(&self, surfels: &[Surfel], map: &IndexMap, pixel: [f32; 2], m: &Placed) -> Option<usize> {
        let width_m = self.pixel_per_m * (m.position - self.model_from_cam1.translation.vector).coords.norm();
        let fits = |surfel: &Surfel| {
            let sd_m = (m.sigma_m * m.sigma_m + surfel.noise_m().powi(2)).sqrt() * self.excess;
            let distance_m = (m.position - surfel.position()).dot(&surfel.normal()).abs();
            let reach_m = (SAME_PLANE_SD * sd_m).max(SAME_PLANE_PX * width_m);
            surfel.normal().dot(&m.normal) >= MIN_NORMAL_COSINE && distance_m <= reach_m
        };
        let (mut nearest, mut nearest_px2) = (None, SAME_PLACE_PX * SAME_PLACE_PX);
        map.visit_near(pixel, |index, seen| {
            let off_px2 = seen.square_distance(pixel);
            if off_px2 < nearest_px2 && fits(&surfels[index]) {
                (nearest, nearest_px2) = (Some(index), off_px2);
            }
        });
        nearest
    }
}

/// Surfels of the pixel this many columns ahead are loaded into the cache.
const AHEAD: usize = 12;
/// A point without a surfel, or without a normal.
const NONE: u32 = u32::MAX;

/// Merges a surface into the surfels, and returns the number of new surfels. `map` shows the surfels at the pose of the
/// cloud. `owners` is a buffer.
pub(super) fn merge(
    surfels: &mut Vec<Surfel>,
    map: &IndexMap,
    surface: &OrganizedSurface,
    placement: &Placement,
    owners: &mut Vec<u32>,
) -> usize {
    let [width, height] = surface.size_px();
    owners.resize(width * height, NONE);
    // Assignment runs in parallel, since it only reads the surfels. The merging is sequential, so that the number of
    // threads changes no bit of the result. Placing a point twice is cheaper than keeping it.
    owners.par_chunks_mut(width.max(1)).enumerate().for_each(|(row, owners)| {
        for point in surface.row(row) {
            let [u, v] = point.cam1_px;
            map.prefetch_at([usize::from(u) + AHEAD, row], surfels);
            let pixel = [f32::from(u), f32::from(v)];
            let owner = placement.place(&point).and_then(|m| placement.owner(surfels, map, pixel, &m));
            owners[usize::from(u)] = owner.map_or(NONE, |index| index as u32);
        }
    });
    let before = surfels.len();
    for row in 0..height {
        for point in surface.row(row) {
            let pixel = row * width + usize::from(point.cam1_px[0]);
            let next = owners.get(pixel + AHEAD).copied().unwrap_or(NONE);
            prefetch(surfels, next as usize);
            let Some(measurement) = placement.measurement(&point) else { continue };
            match owners[pixel] {
                NONE => surfels.push(Surfel::new(&measurement)),
                index => surfels[index as usize].add(&measurement),
            }
        }
    }
    surfels.len() - before
}
