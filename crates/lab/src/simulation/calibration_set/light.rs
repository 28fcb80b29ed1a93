//! What a pixel of a camera receives from the board, for any pattern.
//!
//! In: a pose of the board. Out: for each pixel the lit albedo, and mean and variance of the projector pixels that light
//! it, over the point spread of the pixel: its square, the blur of the lens, and the defocus. So albedo edges shift the
//! phase as they do in real images, and fringes lose contrast where the image is not sharp. Cost: one ray a pixel, and 16
//! looks at the print where it changes within the pixel.

use rayon::prelude::*;

use fringeflow::geometry::{Camera, Pixel, Point3, Pose, Rig, Vector3};
use fringeflow_dataset::CameraId;

use super::surface::Surface;
use crate::simulation::solid::MM_PER_M;

/// Blur of sharp lenses, pixels of the camera and of the projector.
const CAMERA_BLUR_PX: f64 = 0.45;
const PROJECTOR_BLUR_PX: f64 = 0.4;
/// Defocus is stated for this relative distance from the plane of focus.
const DEFOCUS_AT: f64 = 0.1;
/// Distance from the projector at which the light is 1, metres.
const REFERENCE_DISTANCE_M: f64 = 0.31;
/// Points of a pixel at which the print is looked at: an evenly spread sequence (Roberts 2018), so that an edge in any
/// direction passes them one by one, and its mirror image, so that the middle of them is that of the pixel.
const LOOKS: usize = 16;
const SPREAD: [f64; 2] = [0.754_877_666_2, 0.569_840_290_998];

/// A camera with the projector before a board.
pub(super) struct Eye<'a> {
    pub(super) rig: &'a Rig,
    pub(super) surface: &'a Surface<'a>,
    pub(super) camera: CameraId,
    /// Distances at which camera and projector are sharp, metres.
    pub(super) focus_m: [f64; 2],
    pub(super) defocus_px: f64,
}

/// What a pixel receives.
#[derive(Clone, Copy, Default)]
pub(super) struct Light {
    /// Mean albedo, for the ambient light.
    pub(super) albedo: f32,
    /// Mean of albedo times light of the projector that shows white.
    pub(super) lit: f32,
    /// Mean projector column and row, weighted by that light, and their variances with the blur of the projector.
    pub(super) at_px: [f32; 2],
    pub(super) variance_px2: [f32; 2],
}

/// Sums over the point spread: albedo, lit albedo, and its products with column, row and their squares.
type Sums = [f64; 6];

/// The board at a point of the image.
#[derive(Clone, Copy)]
struct Seen {
    /// Point of the print, millimetres.
    place: [f64; 2],
    /// Projector pixel.
    projector: [f64; 2],
    /// Light of the projector; 0 outside its image.
    light: f64,
    /// Blur of camera and of projector, pixels.
    blur: [f64; 2],
}

impl Eye<'_> {
    fn camera(&self) -> (&Camera, Pose) {
        match self.camera {
            CameraId::Cam1 => (&self.rig.cam1, Pose::identity()),
            CameraId::Cam2 => (&self.rig.cam2, self.rig.cam2_from_cam1.inverse()),
        }
    }

    /// What all pixels receive, row by row, as the mean over the poses during an exposure.
    pub(super) fn light(&self, poses: &[Pose]) -> Vec<Light> {
        let (camera, _) = self.camera();
        let (w, h) = (camera.width_px(), camera.height_px());
        let mut sums = vec![[0.0; 6]; w * h];
        let mut projector_blur = vec![PROJECTOR_BLUR_PX; w * h];
        for pose in poses {
            let seen = self.seen(pose);
            let mut sharp = vec![[0.0; 6]; w * h];
            sharp.par_chunks_mut(w.max(1)).enumerate().for_each(|(v, row)| {
                row.iter_mut().enumerate().for_each(|(u, sum)| *sum = self.pixel(&seen, pose, u, v));
            });
            let usual = mean_blur(&seen);
            let blur: Vec<f64> = seen.iter().map(|seen| seen.map_or(usual, |seen| seen.blur[0])).collect();
            let blurred = blurred(&blurred(&sharp, &blur, w, 1), &blur, w, w);
            sums.iter_mut().zip(blurred).for_each(|(sum, more)| (0..6).for_each(|k| sum[k] += more[k]));
            projector_blur.iter_mut().zip(&seen).for_each(|(blur, seen)| {
                if let Some(seen) = seen {
                    *blur = seen.blur[1];
                }
            });
        }
        let n = poses.len().max(1) as f64;
        let light = |(sum, blur): (&Sums, &f64)| {
            let [albedo, lit, column, row, columns, rows] = *sum;
            let weight = lit.max(1e-12);
            let at = [column / weight, row / weight];
            let variance = |square: f64, mean: f64| (square / weight - mean * mean).max(0.0) + blur * blur;
            Light {
                albedo: (albedo / n) as f32,
                lit: (lit / n) as f32,
                at_px: at.map(|px| px as f32),
                variance_px2: [variance(columns, at[0]) as f32, variance(rows, at[1]) as f32],
            }
        };
        sums.iter().zip(&projector_blur).map(light).collect()
    }

    /// What the middle of each pixel sees.
    fn seen(&self, pose: &Pose) -> Vec<Option<Seen>> {
        let (camera, _) = self.camera();
        let (w, h) = (camera.width_px(), camera.height_px());
        let mut seen = vec![None; w * h];
        seen.par_chunks_mut(w.max(1)).enumerate().for_each(|(v, row)| {
            row.iter_mut().enumerate().for_each(|(u, seen)| *seen = self.look(pose, Pixel::new(u as f64, v as f64)));
        });
        seen
    }

    fn look(&self, cam1_from_board: &Pose, pixel: Pixel) -> Option<Seen> {
        let (camera, cam1_from_camera) = self.camera();
        let board_from_camera = cam1_from_board.inverse() * cam1_from_camera;
        let direction = board_from_camera.rotation * camera.ray(&pixel)?;
        let hit = self.surface.hit(&(board_from_camera.translation.vector * MM_PER_M), &direction)?;
        let point = cam1_from_board * Point3::from(hit.point_mm / MM_PER_M);
        let in_projector = self.rig.projector_from_cam1 * point;
        let in_camera = cam1_from_camera.inverse() * point;
        let to_light: Vector3 = self.rig.centre_of_projector() - point;
        let cosine = to_light.dot(&(cam1_from_board * hit.normal)).max(0.0) / to_light.norm();
        let lit = self.rig.projector.project(&in_projector);
        let is_lit = lit.is_some_and(|pixel| self.rig.projector.sees(&pixel));
        let projector = lit.unwrap_or_default();
        let blur = |sharp: f64, focus: f64, z: f64| sharp.hypot(self.defocus_px / DEFOCUS_AT * (1.0 - focus / z).abs());
        Some(Seen {
            place: [hit.point_mm.x, hit.point_mm.y],
            projector: [projector.x, projector.y],
            light: if is_lit { cosine * (REFERENCE_DISTANCE_M / to_light.norm()).powi(2) } else { 0.0 },
            blur: [
                blur(CAMERA_BLUR_PX, self.focus_m[0], in_camera.z),
                blur(PROJECTOR_BLUR_PX, self.focus_m[1], in_projector.z),
            ],
        })
    }

    /// Sums over the square of a pixel.
    fn pixel(&self, seen: &[Option<Seen>], pose: &Pose, u: usize, v: usize) -> Sums {
        let (camera, _) = self.camera();
        let (w, h) = (camera.width_px(), camera.height_px());
        let at = |u: usize, v: usize| seen[v * w + u];
        let is_inner = u > 0 && v > 0 && u + 1 < w && v + 1 < h;
        let around = is_inner.then(|| [at(u - 1, v), at(u + 1, v), at(u, v - 1), at(u, v + 1)]);
        // Shifted from pixel to pixel: the looks of all pixels on an upright edge would err alike.
        let shift = [0.618_034 * u as f64 + 0.754_878 * v as f64, 0.569_84 * u as f64 + 0.324_718 * v as f64];
        let offset = |k: usize| {
            let side = if k.is_multiple_of(2) { 1.0 } else { -1.0 };
            [0, 1].map(|i| side * ((SPREAD[i] * (k / 2) as f64 + shift[i]) % 1.0 - 0.5))
        };
        match (at(u, v), around) {
            (None, Some([None, None, None, None])) => [0.0; 6],
            (Some(middle), Some([Some(left), Some(right), Some(up), Some(down)]))
                if [left, right, up, down].iter().all(|seen| (seen.light > 0.0) == (middle.light > 0.0)) =>
            {
                let slopes = Slopes { middle, along: [half(&left, &right), half(&up, &down)] };
                let corners = [[-0.5, -0.5], [0.5, -0.5], [-0.5, 0.5], [0.5, 0.5]];
                let albedo = |offset: [f64; 2]| self.surface.albedo(slopes.place(offset));
                let first = albedo([0.0, 0.0]);
                if corners.iter().all(|corner| albedo(*corner) == first) {
                    return slopes.even(first);
                }
                mean((0..LOOKS).map(|k| slopes.at(offset(k))).map(|seen| self.sums(&seen)))
            }
            // At the border of the board or of the light, each look has its own ray.
            _ => mean((0..LOOKS).map(|k| {
                let [du, dv] = offset(k);
                self.look(pose, Pixel::new(u as f64 + du, v as f64 + dv)).map_or([0.0; 6], |seen| self.sums(&seen))
            })),
        }
    }

    fn sums(&self, seen: &Seen) -> Sums {
        let albedo = self.surface.albedo(seen.place);
        weighted(albedo, albedo * seen.light, seen.projector, [0.0; 2])
    }
}

/// Sums of a part of a pixel whose projector pixels have a mean and a variance.
fn weighted(albedo: f64, lit: f64, [column, row]: [f64; 2], [spread_c, spread_r]: [f64; 2]) -> Sums {
    [albedo, lit, lit * column, lit * row, lit * (column * column + spread_c), lit * (row * row + spread_r)]
}

/// How what a pixel sees changes within it.
struct Slopes {
    middle: Seen,
    along: [Seen; 2],
}

impl Slopes {
    fn place(&self, [du, dv]: [f64; 2]) -> [f64; 2] {
        [0, 1].map(|k| self.middle.place[k] + du * self.along[0].place[k] + dv * self.along[1].place[k])
    }

    fn at(&self, offset: [f64; 2]) -> Seen {
        let [a, b] = &self.along;
        let [du, dv] = offset;
        Seen {
            place: self.place(offset),
            projector: [0, 1].map(|k| self.middle.projector[k] + du * a.projector[k] + dv * b.projector[k]),
            light: self.middle.light + du * a.light + dv * b.light,
            ..self.middle
        }
    }

    /// Sums over the whole pixel, if the print is even there.
    fn even(&self, albedo: f64) -> Sums {
        let spread = [0, 1].map(|k| (self.along[0].projector[k].powi(2) + self.along[1].projector[k].powi(2)) / 12.0);
        weighted(albedo, albedo * self.middle.light, self.middle.projector, spread)
    }
}

/// Half the difference of two opposite neighbours.
fn half(a: &Seen, b: &Seen) -> Seen {
    let half = |a: [f64; 2], b: [f64; 2]| [0, 1].map(|k| (b[k] - a[k]) / 2.0);
    Seen {
        place: half(a.place, b.place),
        projector: half(a.projector, b.projector),
        light: (b.light - a.light) / 2.0,
        blur: a.blur,
    }
}

fn mean(looks: impl Iterator<Item = Sums>) -> Sums {
    let mut sum = [0.0; 6];
    for look in looks {
        (0..6).for_each(|k| sum[k] += look[k] / LOOKS as f64);
    }
    sum
}

fn mean_blur(seen: &[Option<Seen>]) -> f64 {
    let (sum, n) = seen.iter().flatten().fold((0.0, 0), |(sum, n), seen| (sum + seen.blur[0], n + 1));
    if n == 0 { CAMERA_BLUR_PX } else { sum / f64::from(n) }
}

/// Blurs along the rows (`stride` 1) or the columns (`stride` width) with the blur of each pixel.
fn blurred(sums: &[Sums], blur: &[f64], width: usize, stride: usize) -> Vec<Sums> {
    let mut out = vec![[0.0; 6]; sums.len()];
    out.par_chunks_mut(width.max(1)).enumerate().for_each(|(v, row)| {
        for (u, out) in row.iter_mut().enumerate() {
            let k = v * width + u;
            let (place, length) = if stride == 1 { (u, width) } else { (v, sums.len() / width) };
            let reach = (3.5 * blur[k]).ceil() as usize;
            let falloff = -0.5 / (blur[k] * blur[k]);
            let mut total = 0.0;
            for other in place.saturating_sub(reach)..(place + reach + 1).min(length) {
                let distance = other.abs_diff(place) as f64;
                let weight = (falloff * distance * distance).exp();
                let from = &sums[k + other * stride - place * stride];
                (0..6).for_each(|i| out[i] += weight * from[i]);
                total += weight;
            }
            (0..6).for_each(|i| out[i] /= total);
        }
    });
    out
}
