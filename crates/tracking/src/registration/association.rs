//! Projective association: a point of the moved surface is paired with the reference point at the pixel it projects to.

use nalgebra::Vector6;
use rayon::prelude::*;

use fringeflow::geometry::{Camera, Point3, Pose};

use super::surface::{OrganizedSurface, SurfacePoint};

/// Least cosine between the normals of paired points, 45°.
const MIN_NORMAL_COSINE: f64 = 0.7;
/// Smallest cosine between ray and normal by which noise along the ray is reduced to noise across the surface: at
/// flatter angles, errors exceed the noise.
const MIN_COSINE: f64 = 0.2;
/// Least standard deviation of every distance, metres: points are stored with 0.03 µm, and even images without noise
/// have grey levels.
const LEAST_SD_M: f64 = 1e-7;

/// Parameters of a step: translation and rotation about a centre in the reference's frame. Rotations are multiplied by
/// a radius, so that all six parameters are lengths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Motion {
    pub(super) centre: Point3,
    pub(super) radius_m: f64,
}

/// A pair of points, and the distance of one from the plane of the other.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pair {
    /// Distance from the plane of the reference, metres.
    pub(super) residual_m: f64,
    /// Standard deviation of that distance by noise alone, metres.
    pub(super) sd_m: f64,
    /// Derivatives of the distance by translation and rotation.
    pub(super) row: Vector6<f64>,
    /// Pixel of the moved point.
    pub(super) cam1_px: [u16; 2],
}

impl Pair {
    /// The residual in standard deviations.
    pub(super) fn normalized(&self) -> f64 {
        self.residual_m / self.sd_m
    }
}

/// Finds the pairs of points.
pub(super) struct Association<'a> {
    /// Camera 1.
    pub(super) camera: &'a Camera,
    pub(super) reference: &'a OrganizedSurface,
    /// Largest distance between paired points, metres.
    pub(super) reach_m: f64,
    pub(super) motion: Motion,
}

impl Association<'_> {
    /// The pairs of every tile, under a pose.
    pub(super) fn pairs(&self, tiles: &[Vec<SurfacePoint>], reference_from_moved: &Pose) -> Vec<Vec<Pair>> {
        let tile_pairs =
            |tile: &Vec<SurfacePoint>| tile.iter().filter_map(|p| self.pair(p, reference_from_moved)).collect();
        tiles.par_iter().map(tile_pairs).collect()
    }

    fn pair(&self, moved: &SurfacePoint, reference_from_moved: &Pose) -> Option<Pair> {
        let place = reference_from_moved * moved.position();
        let pixel = self.camera.project(&place)?;
        let partner = self.reference.at(pixel.x.round() as isize, pixel.y.round() as isize)?;
        let normal = partner.unit_normal()?;
        let off = place - partner.position();
        let is_near = off.norm_squared() <= self.reach_m * self.reach_m;
        let is_alike = (reference_from_moved.rotation * moved.unit_normal()?).dot(&normal) >= MIN_NORMAL_COSINE;
        if !(is_near && is_alike) {
            return None;
        }
        let cosine = normal.dot(&place.coords.normalize()).abs().max(MIN_COSINE);
        let noise_m = (f64::from(moved.sigma_m).powi(2) + f64::from(partner.sigma_m).powi(2)).sqrt() * cosine;
        let turn = (place - self.motion.centre).cross(&normal) / self.motion.radius_m;
        Some(Pair {
            residual_m: off.dot(&normal),
            sd_m: (noise_m * noise_m + LEAST_SD_M * LEAST_SD_M).sqrt(),
            row: Vector6::new(normal.x, normal.y, normal.z, turn.x, turn.y, turn.z),
            cam1_px: moved.cam1_px,
        })
    }
}
