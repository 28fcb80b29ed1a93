//! Assigns the points of a cloud to surfels and merges them.

use rayon::prelude::*;

use fringeflow::geometry::{Pixel, Pose};

use crate::registration::{OrganizedSurface, PoseCovariance, SurfacePoint};

use super::index_map::IndexMap;
use super::surfel::{Measurement, Surfel};

/// Largest distance in the image between a surfel and a point of the same piece of surface, pixels.
const SAME_PLACE_PX: f64 = 0.75;
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

impl Placement {
    /// Returns the measurement of a point, or `None` if it has no normal.
    fn measurement(&self, point: &SurfacePoint) -> Option<Measurement> {
        let position = self.model_from_cam1 * point.position();
        let normal = self.model_from_cam1.rotation * point.unit_normal()?;
        Some(Measurement {
            position,
            normal,
            sigma_m: f64::from(point.sigma_m),
            intensity: point.intensity,
            pose_variance: self.covariance.variance_along(&position, &normal),
            cloud: self.cloud,
        })
    }

    /// Returns the surfel of a measurement at a pixel: of those whose plane it fits, the nearest in the image.
    fn owner(&self, surfels: &[Surfel], map: &IndexMap, pixel: &Pixel, m: &Measurement) -> Option<usize> {
        let width_m = self.pixel_per_m * (m.position - self.model_from_cam1.translation.vector).coords.norm();
        let fits = |surfel: &Surfel| {
            let sd_m = (m.sigma_m * m.sigma_m + surfel.noise_m().powi(2)).sqrt() * self.excess;
            let distance_m = (m.position - surfel.position).dot(&surfel.normal).abs();
            let reach_m = (SAME_PLANE_SD * sd_m).max(SAME_PLANE_PX * width_m);
            surfel.normal.dot(&m.normal) >= MIN_NORMAL_COSINE && distance_m <= reach_m
        };
        let near = map.surfels_near(pixel).map(|(index, seen)| (index, (seen.pixel - pixel).norm()));
        let owners = near.filter(|&(index, off_px)| off_px <= SAME_PLACE_PX && fits(&surfels[index]));
        owners.min_by(|(_, a), (_, b)| a.total_cmp(b)).map(|(index, _)| index)
    }
}

/// Merges a surface into the surfels, and returns the number of new surfels. `map` shows the surfels at the pose of the
/// cloud.
pub(super) fn merge(
    surfels: &mut Vec<Surfel>,
    map: &IndexMap,
    surface: &OrganizedSurface,
    placement: &Placement,
) -> usize {
    let assign = |point: &SurfacePoint| {
        let measurement = placement.measurement(point)?;
        let [u, v] = point.cam1_px.map(f64::from);
        let owner = placement.owner(surfels, map, &Pixel::new(u, v), &measurement);
        Some((owner, measurement))
    };
    // Assignment runs in parallel, since it only reads the surfels. The merging is sequential, so that the number of
    // threads changes no bit of the result.
    let assigned: Vec<_> = surface.points().par_iter().with_min_len(256).map(assign).collect();
    let before = surfels.len();
    for (owner, measurement) in assigned.into_iter().flatten() {
        match owner {
            Some(index) => surfels[index].add(&measurement),
            None => surfels.push(Surfel::new(&measurement)),
        }
    }
    surfels.len() - before
}
