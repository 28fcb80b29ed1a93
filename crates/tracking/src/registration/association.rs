//! Projective association: pairs each point of the reference with the point of the moved surface at the pixel that it
//! projects to.

use nalgebra::{IsometryMatrix3, Vector6};
use rayon::prelude::*;

use fringeflow::geometry::{Camera, Point3, Pose};

use super::surface::{OrganizedSurface, point_of};
use super::thinning::ReferencePoint;

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

/// Finds the pairs of points.
pub(super) struct Association<'a> {
    /// Camera 1.
    pub(super) camera: &'a Camera,
    pub(super) moved: &'a OrganizedSurface,
    /// Largest distance between paired points, metres.
    pub(super) reach_m: f64,
    pub(super) parametrization: Parametrization,
}

impl Association<'_> {
    /// Finds the pairs of each tile of reference points at a pose.
    pub(super) fn pairs(&self, tiles: &[Vec<ReferencePoint>], reference_from_moved: &Pose) -> Vec<Vec<Pair>> {
        let [reference_from_moved, moved_from_reference] =
            [reference_from_moved, &reference_from_moved.inverse()].map(with_matrix);
        let of_tile = |tile: &Vec<ReferencePoint>| {
            // The pixels lie apart in memory. All of a tile are asked for before the first is read.
            let pixels: Vec<_> = tile.iter().map(|point| self.pixel_of(point, &moved_from_reference)).collect();
            let pair = |(point, pixel): (_, Option<[isize; 2]>)| self.pair(point, pixel?, &reference_from_moved);
            tile.iter().zip(pixels).filter_map(pair).collect()
        };
        tiles.par_iter().map(of_tile).collect()
    }

    /// Returns the pixel that a point of the reference projects to, and starts to load it into the cache.
    fn pixel_of(&self, point: &ReferencePoint, moved_from_reference: &IsometryMatrix3<f64>) -> Option<[isize; 2]> {
        let pixel = self.camera.project(&(moved_from_reference * point.position()))?;
        // Coordinates in the image are at least −0.5, so the nearest integer needs no rounding down.
        let pixel = self.camera.sees(&pixel).then_some([pixel.x, pixel.y].map(|x| (x + 0.5) as isize))?;
        self.moved.prefetch(pixel);
        Some(pixel)
    }

    fn pair(
        &self,
        point: &ReferencePoint,
        [column, row]: [isize; 2],
        reference_from_moved: &IsometryMatrix3<f64>,
    ) -> Option<Pair> {
        let [x, y, z, sigma_m] = self.moved.measured_at(column, row)?;
        let moved = point_of([x, y, z]);
        let position = reference_from_moved * moved;
        let (off, normal) = (position - point.position(), point.normal());
        if off.norm_squared() > self.reach_m * self.reach_m {
            return None;
        }
        let own_normal = reference_from_moved.rotation * self.moved.rough_normal([column, row], moved.coords);
        // A point with too few beside it has the normal 0, which contradicts none.
        let is_alike = own_normal.dot(&normal) >= MIN_NORMAL_COSINE * own_normal.norm();
        if !is_alike {
            return None;
        }
        let ray = position.coords - reference_from_moved.translation.vector;
        let cosine = (normal.dot(&ray).abs() / ray.norm()).max(MIN_COSINE);
        let noise_m = (f64::from(sigma_m).powi(2) + f64::from(point.sigma_m).powi(2)).sqrt() * cosine;
        let turn = (position - self.parametrization.centre).cross(&normal) / self.parametrization.radius_m;
        Some(Pair {
            residual_m: off.dot(&normal),
            sd_m: (noise_m * noise_m + MIN_SD_M * MIN_SD_M).sqrt(),
            row: Vector6::new(normal.x, normal.y, normal.z, turn.x, turn.y, turn.z),
            cam1_px: [column as u16, row as u16],
        })
    }
}

/// A pose with its rotation as a matrix, which turns vectors faster.
pub(crate) fn with_matrix(pose: &Pose) -> IsometryMatrix3<f64> {
    IsometryMatrix3::from_parts(pose.translation, pose.rotation.to_rotation_matrix())
}
