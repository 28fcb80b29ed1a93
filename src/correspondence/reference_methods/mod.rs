//! The reference methods with Gray code: CGC with two fringe directions, EGC with epipolar lines (paper, Table 2).
//!
//! In: absolute phase of both cameras. Out: one match a pixel of C1, and from the matches a cloud. They are what the
//! method without Gray code is measured against; no part of the live pipeline uses them.

mod cgc;
mod egc;
#[cfg(test)]
mod test_scene;

use rayon::prelude::*;

use super::Outcome;
use crate::cloud::{Cloud, CloudPoint};
use crate::geometry::{FringePattern, MeasurementVolume, Pixel, Point3, Rig, Vector3, range_per_pixel};
use crate::phase::{AbsolutePhase, PhaseMap};

pub use cgc::match_both_directions;
pub use egc::match_along_epipolar_lines;

/// The correspondence of a pixel of C1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReferenceMatch {
    /// Raw sub-pixel point in C2.
    pub cam2_px: Pixel,
    /// Depth (z in the frame of C1) on the ray of the pixel, metres.
    pub depth_m: f64,
    /// Fringe order: whole periods in the absolute phase.
    pub order: i16,
}

/// Why absolute phases cannot be matched.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum MatchError {
    /// A phase does not have the size of its camera's image.
    #[error(
        "the absolute phase of camera {camera} is {width} × {height} pixels, its calibration {expected_width} × \
         {expected_height}; decode images of the calibrated camera"
    )]
    Size {
        /// 1 or 2.
        camera: u8,
        /// Width found, pixels.
        width: usize,
        /// Height found, pixels.
        height: usize,
        /// Width of the calibrated camera, pixels.
        expected_width: usize,
        /// Height of the calibrated camera, pixels.
        expected_height: usize,
    },
    /// The rig has no epipolar frame.
    #[error(transparent)]
    Epipolar(#[from] crate::geometry::EpipolarError),
}

/// Points of matches, in the order of their pixels.
///
/// `pattern` and `phase` (of C1) give δ; `match_sd_px` is the standard deviation of a match along the epipolar line,
/// from which `sigma_m` follows.
#[must_use]
pub fn reference_cloud(
    rig: &Rig,
    pattern: &FringePattern,
    phase: &PhaseMap,
    matches: &[Option<ReferenceMatch>],
    match_sd_px: f64,
) -> Cloud {
    let point = |(i, found): (usize, &Option<ReferenceMatch>)| {
        let found = (*found)?;
        let (u, v) = (i % phase.width, i / phase.width);
        let position = Point3::from(rig.cam1.ray(&Pixel::new(u as f64, v as f64))? * found.depth_m);
        let lit_by = pattern.phase_turns(rig.project_projector(&position)?.x);
        let delta_turns = lit_by - f64::from(*phase.phase.get(i)?) / 65536.0;
        Some(CloudPoint {
            position_m: position.coords.map(|x| x as f32).into(),
            intensity: *phase.mean.get(i)?,
            cam1_px: [u as u16, v as u16],
            cam2_px: found.cam2_px.coords.map(|x| x as f32).into(),
            order: found.order,
            delta_rad: ((delta_turns - delta_turns.round()) * std::f64::consts::TAU) as f32,
            candidates: 1,
            stage: Outcome::GrayCode as u8,
            sigma_m: (match_sd_px * range_per_pixel(rig, &position)?) as f32,
        })
    };
    Cloud { points: matches.par_iter().enumerate().filter_map(point).collect() }
}

/// Depths (z, metres) between which the ray of a pixel of C1 is searched: the volume, or everything before C1.
fn depths_of(ray_cam1: &Vector3, volume: Option<&MeasurementVolume>) -> Option<(f64, f64)> {
    match volume {
        Some(volume) => volume.clip(ray_cam1),
        None => Some((f64::MIN_POSITIVE, f64::INFINITY)),
    }
}

/// Checks that absolute phases have the sizes of their cameras.
fn check_sizes(rig: &Rig, cam1: &AbsolutePhase, cam2: &AbsolutePhase) -> Result<(), MatchError> {
    for (camera, phase, calibrated) in [(1, cam1, &rig.cam1), (2, cam2, &rig.cam2)] {
        let (expected_width, expected_height) = (calibrated.width_px(), calibrated.height_px());
        let (width, height) = (phase.width, phase.height);
        if [width, height] != [expected_width, expected_height] {
            return Err(MatchError::Size { camera, width, height, expected_width, expected_height });
        }
    }
    Ok(())
}

/// Fringe order of an absolute phase.
fn order_of(turns: f32) -> i16 {
    turns.floor().clamp(f32::from(i16::MIN), f32::from(i16::MAX)) as i16
}

#[cfg(test)]
mod tests {
    use super::test_scene::{PATTERN, Scene};
    use super::*;

    #[test]
    fn the_points_of_a_cloud_project_onto_their_matches_and_fit_the_projector() {
        let scene = Scene::new();
        let (cam1, cam2) = (scene.cam1_columns(), scene.cam2_columns());
        let matches = match_along_epipolar_lines(&scene.rig, &cam1, &cam2, None).unwrap();
        let phase = PhaseMap {
            width: cam1.width,
            height: cam1.height,
            phase: cam1.turns.iter().map(|t| (t.rem_euclid(1.0) * 65536.0) as u16).collect(),
            mean: vec![77; cam1.turns.len()],
            ..PhaseMap::default()
        };
        let cloud = reference_cloud(&scene.rig, &PATTERN, &phase, &matches, 0.05);
        assert_eq!(cloud.points.len(), matches.iter().flatten().count());
        for point in &cloud.points {
            let position = Point3::from(point.position_m.map(f64::from));
            let seen = scene.rig.project_cam2(&position).unwrap();
            assert!((seen - Pixel::from(point.cam2_px.map(f64::from))).norm() < 1e-3);
            assert!(point.delta_rad.abs() < 0.02, "{}", point.delta_rad);
            assert!(point.sigma_m > 1e-6 && point.sigma_m < 1e-4, "{}", point.sigma_m);
        }
    }
}
