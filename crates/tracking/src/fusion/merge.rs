//! Which surfel a new point belongs to, and what becomes of both.

use rayon::prelude::*;

use fringeflow::geometry::{Pixel, Pose};

use crate::registration::{OrganizedSurface, PoseCovariance, SurfacePoint};

use super::index_map::IndexMap;
use super::surfel::{Measurement, Surfel};

/// A surfel and a point further apart than this on the image are not the same piece of surface, pixels.
const SAME_PLACE_PX: f64 = 0.75;
/// Least cosine between the normals of a surfel and a point that it takes, 60°.
const MIN_NORMAL_COSINE: f64 = 0.5;
/// Distance from a surfel's plane up to which a point belongs to it: standard deviations, or pixels where these are more.
/// Errors of calibration and motion exceed noise, and a second layer of surfels beside the first would be worse than both.
const SAME_PLANE_SD: f64 = 4.0;
const SAME_PLANE_PX: f64 = 1.0;

/// How a cloud lies to the model.
pub(super) struct Placement {
    pub(super) model_from_cam1: Pose,
    pub(super) covariance: PoseCovariance,
    /// How many times larger distances are than noise alone makes them, 1 at least.
    pub(super) excess: f64,
    /// Width of a pixel a metre away, metres.
    pub(super) pixel_per_m: f64,
    /// Number of the cloud among those merged.
    pub(super) cloud: u32,
}

impl Placement {
    /// A point that has a normal as it goes into a surfel.
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

    /// The surfel that a measurement at a pixel belongs to: of those on its plane the one seen next to it.
    fn owner(&self, surfels: &[Surfel], map: &IndexMap, pixel: &Pixel, m: &Measurement) -> Option<usize> {
        let width_m = self.pixel_per_m * (m.position - self.model_from_cam1.translation.vector).coords.norm();
        let belongs = |surfel: &Surfel| {
            let sd_m = (m.sigma_m * m.sigma_m + surfel.noise_m().powi(2)).sqrt() * self.excess;
            let distance_m = (m.position - surfel.position).dot(&surfel.normal).abs();
            let reach_m = (SAME_PLANE_SD * sd_m).max(SAME_PLANE_PX * width_m);
            surfel.normal.dot(&m.normal) >= MIN_NORMAL_COSINE && distance_m <= reach_m
        };
        let near = map.around(pixel).map(|(place, seen)| (place, (seen.pixel - pixel).norm()));
        let owners = near.filter(|&(place, off_px)| off_px <= SAME_PLACE_PX && belongs(&surfels[place]));
        owners.min_by(|(_, a), (_, b)| a.total_cmp(b)).map(|(place, _)| place)
    }
}

/// Merges a surface into the surfels, which the map shows from its place; returns how many surfels are new.
pub(super) fn merge(
    surfels: &mut Vec<Surfel>,
    map: &IndexMap,
    surface: &OrganizedSurface,
    placement: &Placement,
) -> usize {
    let judge = |point: &SurfacePoint| {
        let measurement = placement.measurement(point)?;
        let [u, v] = point.cam1_px.map(f64::from);
        let owner = placement.owner(surfels, map, &Pixel::new(u, v), &measurement);
        Some((owner, measurement))
    };
    let judged: Vec<_> = surface.points().par_iter().with_min_len(256).map(judge).collect();
    let before = surfels.len();
    for (owner, measurement) in judged.into_iter().flatten() {
        match owner {
            Some(place) => surfels[place].take(&measurement),
            None => surfels.push(Surfel::new(&measurement)),
        }
    }
    surfels.len() - before
}
