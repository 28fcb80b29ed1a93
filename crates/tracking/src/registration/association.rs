//! Which point of the reference a point of the moved surface meets: the one at the pixel it is projected to.

use nalgebra::Vector6;
use rayon::prelude::*;

use fringeflow::geometry::{Camera, Point3, Pose};

use super::surface::{OrganizedSurface, SurfacePoint};

/// Least cosine between the normals of points that are paired, 45°.
const MIN_NORMAL_COSINE: f64 = 0.7;
/// Smallest cosine between ray and normal that makes a noise along the ray smaller across the surface: flatter places err
/// by more than their noise.
const MIN_COSINE: f64 = 0.2;
/// Standard deviation that every distance has at least, metres: points are stored to 0.03 µm, and even images without
/// noise have grey levels.
const LEAST_SD_M: f64 = 1e-7;

/// The turns and shifts that a step is made of: about a centre of the reference's frame, turns times a radius, so that all
/// six are lengths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Motion {
    pub(super) centre: Point3,
    pub(super) radius_m: f64,
}

/// A pair of points: how far one is from the plane of the other.
#[derive(Clone, Copy, Debug)]
pub(super) struct Pair {
    /// Distance from the plane of the reference, metres.
    pub(super) residual_m: f64,
    /// Standard deviation that noise alone gives it, metres.
    pub(super) sd_m: f64,
    /// Its change by shift and turn.
    pub(super) row: Vector6<f64>,
    /// Pixel of the moved point.
    pub(super) cam1_px: [u16; 2],
}

impl Pair {
    /// The residual, in standard deviations.
    pub(super) fn normalized(&self) -> f64 {
        self.residual_m / self.sd_m
    }
}

/// Who is paired with whom.
pub(super) struct Association<'a> {
    /// Camera 1.
    pub(super) camera: &'a Camera,
    pub(super) reference: &'a OrganizedSurface,
    /// Furthest that paired points may stand apart, metres.
    pub(super) reach_m: f64,
    pub(super) motion: Motion,
}

impl Association<'_> {
    /// The pairs of every tile, under a pose.
    pub(super) fn pairs(&self, tiles: &[Vec<SurfacePoint>], reference_from_moved: &Pose) -> Vec<Vec<Pair>> {
        let of_tile =
            |tile: &Vec<SurfacePoint>| tile.iter().filter_map(|p| self.pair(p, reference_from_moved)).collect();
        tiles.par_iter().map(of_tile).collect()
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
