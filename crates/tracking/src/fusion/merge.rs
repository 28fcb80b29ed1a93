//! Merges the points of a cloud into the surfels that they measure, and makes surfels of the others.
//!
//! Each point belongs to the nearest of the surfels beside it in the image whose plane it fits. A surfel that others keep
//! from all points is never confirmed and goes: so a model is no denser than the images. Surfels claim their points in any
//! order, and are visited in the order in which they lie in memory.

use std::sync::atomic::{AtomicU64, Ordering};

use nalgebra::IsometryMatrix3;
use rayon::prelude::*;

use crate::registration::{OrganizedSurface, PoseCovariance, SurfacePoint};

use super::clean::{Verdict, verdict};
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

    /// Claims the points beside a surfel that fit its plane.
    fn claim(&self, surfel: &Surfel, index: usize, seen: &Projection, surface: &OrganizedSurface, claims: &Claims) {
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
        for (off_px2, [column, row]) in beside(seen) {
            if surface.at(column, row).is_some_and(|point| fits(&point)) {
                claims.at(column, row).fetch_min(claim(off_px2, index), Ordering::Relaxed);
            }
        }
    }
}

/// Returns the pixels beside a surfel, with the squares of their distances.
fn beside(seen: &Projection) -> impl Iterator<Item = (f32, [isize; 2])> {
    let [left, top] = seen.pixel_before();
    let pixels = [[left, top], [left + 1, top], [left, top + 1], [left + 1, top + 1]];
    let with_distance = pixels.map(|[column, row]| (seen.square_distance([column as f32, row as f32]), [column, row]));
    with_distance.into_iter().filter(|(off_px2, _)| *off_px2 < SAME_PLACE_PX * SAME_PLACE_PX)
}

/// The claim of a surfel: the least of a pixel is that of the nearest surfel, of equals that of the first.
fn claim(off_px2: f32, index: usize) -> u64 {
    u64::from(off_px2.to_bits()) << 32 | index as u64
}

/// The least claim to each pixel of an image, or [`UNCLAIMED`]. Its memory lives from cloud to cloud.
#[derive(Debug, Default)]
pub(super) struct Claims {
    width: usize,
    pixels: Vec<AtomicU64>,
}

const UNCLAIMED: u64 = u64::MAX;

impl Claims {
    fn clear(&mut self, [width, height]: [usize; 2]) {
        self.width = width;
        self.pixels.clear();
        self.pixels.resize_with(width * height, || AtomicU64::new(UNCLAIMED));
    }

    /// The claim to a pixel in the image.
    fn at(&self, column: isize, row: isize) -> &AtomicU64 {
        &self.pixels[row as usize * self.width + column as usize]
    }

    /// Returns the points that belong to a surfel.
    fn points_of(
        &self,
        index: usize,
        seen: &Projection,
        surface: &OrganizedSurface,
    ) -> impl Iterator<Item = SurfacePoint> {
        beside(seen).filter_map(move |(off_px2, [column, row])| {
            let point = surface.at(column, row)?;
            (self.at(column, row).load(Ordering::Relaxed) == claim(off_px2, index)).then_some(point)
        })
    }
}

/// Merges a surface into the surfels, and returns the number of new surfels. `map` shows the surfels at the pose of the
/// cloud. `claims` is a buffer.
pub(super) fn merge(
    surfels: &mut Vec<Surfel>,
    map: &DepthMap,
    surface: &OrganizedSurface,
    placement: &Placement,
    claims: &mut Claims,
) -> usize {
    claims.clear(surface.size_px());
    surfels.par_iter().enumerate().with_min_len(1024).for_each(|(index, surfel)| {
        if let Some(seen) = map.projection(index) {
            placement.claim(surfel, index, seen, surface, claims);
        }
    });
    surfels.par_iter_mut().enumerate().with_min_len(1024).for_each(|(index, surfel)| {
        let Some(seen) = map.projection(index) else { return };
        let before = surfel.measurements();
        let measurements = claims.points_of(index, seen, surface).filter_map(|point| placement.measurement(&point));
        measurements.for_each(|measurement| surfel.add(&measurement));
        let is_measured = surfel.measurements() > before;
        surfel.judge(if is_measured { Verdict::Measured } else { verdict(map, surface, seen) });
    });
    let before = surfels.len();
    for row in 0..surface.size_px()[1] {
        for point in surface.row(row) {
            let [column, row] = point.cam1_px.map(|place| place as isize);
            if claims.at(column, row).load(Ordering::Relaxed) == UNCLAIMED {
                surfels.extend(placement.measurement(&point).map(|measurement| Surfel::new(&measurement)));
            }
        }
    }
    surfels.len() - before
}
