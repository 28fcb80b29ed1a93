//! Merges the points of a cloud into the surfels that they measure, and makes surfels of the others.
//!
//! Each surfel takes the nearest of the points beside it in the image that fit its plane. So surfels are independent of
//! each other, and are visited in the order in which they lie in memory.

use std::sync::atomic::{AtomicBool, Ordering};

use nalgebra::IsometryMatrix3;
use rayon::prelude::*;

use crate::registration::{OrganizedSurface, PoseCovariance, SurfacePoint};

use super::clean::verdict;
use super::depth_map::{DepthMap, Projection};
use super::surfel::{Measurement, Surfel};

/// Largest distance in the image between a surfel and a point of the same piece of surface, pixels.
const SAME_PLACE_PX: f32 = 0.75;
/// Minimum cosine between the normals of a surfel and a point that measures it, 60°.
const MIN_NORMAL_COSINE: f64 = 0.5;
/// Largest distance of a point from the plane of its surfel, in standard deviations and in pixels; the larger applies.
/// Errors of calibration and motion exceed noise. If such points made new surfels, a second layer would appear beside
/// the first, which is worse than an average of both.
const SAME_PLANE_SD: f64 = 4.0;
const SAME_PLANE_PX: f64 = 1.0;

/// Placement of a cloud relative to the model.
pub(super) struct Placement {
    pub(super) model_from_cam1: IsometryMatrix3<f64>,
    pub(super) cam1_from_model: IsometryMatrix3<f64>,
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

    /// Returns the point that measures a surfel: of those beside it that fit its plane, the nearest in the image.
    /// Marks all of them as covered.
    fn point_of(
        &self,
        surfel: &Surfel,
        seen: &Projection,
        surface: &OrganizedSurface,
        covered: &[AtomicBool],
    ) -> Option<SurfacePoint> {
        let (position, normal) =
            (self.cam1_from_model * surfel.position(), self.cam1_from_model.rotation * surfel.normal());
        let fits = |point: &SurfacePoint| {
            let Some(own_normal) = point.unit_normal() else { return false };
            let distance_m = (point.position() - position).dot(&normal);
            let variance = f64::from(point.sigma_m).powi(2) + surfel.noise_variance();
            let noise_m2 = (SAME_PLANE_SD * self.excess).powi(2) * variance;
            let pixel_m2 = (SAME_PLANE_PX * self.pixel_per_m).powi(2) * point.position().coords.norm_squared();
            normal.dot(&own_normal) >= MIN_NORMAL_COSINE && distance_m * distance_m <= noise_m2.max(pixel_m2)
        };
        let [left, top] = seen.pixel_before();
        let beside = [[left, top], [left + 1, top], [left, top + 1], [left + 1, top + 1]];
        let (mut nearest, mut nearest_px2) = (None, f32::INFINITY);
        for [column, row] in beside {
            let off_px2 = seen.square_distance([column as f32, row as f32]);
            if off_px2 >= SAME_PLACE_PX * SAME_PLACE_PX {
                continue;
            }
            let Some(point) = surface.at(column, row).filter(fits) else { continue };
            covered[row as usize * surface.size_px()[0] + column as usize].store(true, Ordering::Relaxed);
            if off_px2 < nearest_px2 {
                (nearest, nearest_px2) = (Some(point), off_px2);
            }
        }
        nearest
    }
}

/// Merges a surface into the surfels, and returns the number of new surfels. `map` shows the surfels at the pose of the
/// cloud. `covered` is a buffer.
pub(super) fn merge(
    surfels: &mut Vec<Surfel>,
    map: &DepthMap,
    surface: &OrganizedSurface,
    placement: &Placement,
    covered: &mut Vec<AtomicBool>,
) -> usize {
    let [width, height] = surface.size_px();
    covered.clear();
    covered.resize_with(width * height, AtomicBool::default);
    surfels.par_iter_mut().enumerate().with_min_len(1024).for_each(|(index, surfel)| {
        let Some(seen) = map.projection(index) else { return };
        let measurement = placement.point_of(surfel, seen, surface, covered).and_then(|p| placement.measurement(&p));
        match measurement {
            Some(measurement) => surfel.add(&measurement),
            None => surfel.judge(verdict(map, surface, seen)),
        }
    });
    let before = surfels.len();
    for row in 0..height {
        for point in surface.row(row) {
            let pixel = row * width + usize::from(point.cam1_px[0]);
            if !*covered[pixel].get_mut() {
                surfels.extend(placement.measurement(&point).map(|measurement| Surfel::new(&measurement)));
            }
        }
    }
    surfels.len() - before
}
