//! Projective association: pairs each point of the moved surface with the reference point at the pixel that it projects
//! to.

use nalgebra::Vector6;
use rayon::prelude::*;

use fringeflow::geometry::{Camera, Point3, Pose};

use super::surface::{Reference, SurfacePoint};

/// Minimum cosine between the normals of paired points, 45°.
const MIN_NORMAL_COSINE: f64 = 0.7;
/// Minimum cosine between ray and normal when converting noise along the ray to noise across the surface. At flatter
/// angles, other errors exceed the noise.
const MIN_COSINE: f64 = 0.2;
/// Minimum standard deviation of a distance, metres: points are stored with a resolution of 0.03 µm, and even images
/// without noise are quantized to grey levels.
const MIN_SD_M: f64 = 1e-7;

/// Parameters of a step: a translation and a rotation about `centre`, in the frame of the reference. Rotations are
/// multiplied by `radius_m`, so that all six parameters are lengths.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Parametrization {
    pub(super) centre: Point3,
    pub(super) radius_m: f64,
}

/// A pair of points, with the distance of the moved point from the plane of the reference point.
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

/// The reference point at the pixel that a moved point projects to. From step to step most points stay in their pixel.
#[derive(Clone, Copy)]
struct Partner {
    pixel: [isize; 2],
    point: Option<SurfacePoint>,
}

/// The points of a level, by tile, with the partners of the last step.
pub(super) struct Tiles<'a> {
    points: &'a [Vec<SurfacePoint>],
    partners: Vec<Vec<Partner>>,
}

impl<'a> Tiles<'a> {
    /// Creates tiles whose points have no partners yet.
    pub(super) fn new(points: &'a [Vec<SurfacePoint>]) -> Self {
        let none = Partner { pixel: [isize::MIN; 2], point: None };
        Self { points, partners: points.iter().map(|tile| vec![none; tile.len()]).collect() }
    }
}

/// Finds the pairs of points.
pub(super) struct Association<'a, R> {
    /// Camera 1.
    pub(super) camera: &'a Camera,
    pub(super) reference: &'a R,
    /// Largest distance between paired points, metres.
    pub(super) reach_m: f64,
    pub(super) parametrization: Parametrization,
}

impl<R: Reference> Association<'_, R> {
    /// Finds the pairs of each tile at a pose.
    pub(super) fn pairs(&self, tiles: &mut Tiles<'_>, reference_from_moved: &Pose) -> Vec<Vec<Pair>> {
        let Tiles { points, partners } = tiles;
        let tile_pairs = |(points, partners): (&Vec<SurfacePoint>, &mut Vec<Partner>)| {
            points.iter().zip(partners).filter_map(|(p, last)| self.pair(p, last, reference_from_moved)).collect()
        };
        points.par_iter().zip(partners).map(tile_pairs).collect()
    }

    fn pair(&self, moved: &SurfacePoint, last: &mut Partner, reference_from_moved: &Pose) -> Option<Pair> {
        let position = reference_from_moved * moved.position();
        let projected = self.camera.project(&position)?;
        let pixel = [projected.x.round() as isize, projected.y.round() as isize];
        if last.pixel != pixel {
            *last = Partner { pixel, point: self.reference.at(pixel[0], pixel[1]) };
        }
        let partner = last.point?;
        let normal = partner.unit_normal()?;
        let off = position - partner.position();
        let is_near = off.norm_squared() <= self.reach_m * self.reach_m;
        let is_alike = (reference_from_moved.rotation * moved.unit_normal()?).dot(&normal) >= MIN_NORMAL_COSINE;
        if !(is_near && is_alike) {
            return None;
        }
        let cosine = normal.dot(&position.coords.normalize()).abs().max(MIN_COSINE);
        let noise_m = (f64::from(moved.sigma_m).powi(2) + f64::from(partner.sigma_m).powi(2)).sqrt() * cosine;
        let turn = (position - self.parametrization.centre).cross(&normal) / self.parametrization.radius_m;
        Some(Pair {
            residual_m: off.dot(&normal),
            sd_m: (noise_m * noise_m + MIN_SD_M * MIN_SD_M).sqrt(),
            row: Vector6::new(normal.x, normal.y, normal.z, turn.x, turn.y, turn.z),
            cam1_px: moved.cam1_px,
        })
    }
}
