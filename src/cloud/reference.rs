//! Clouds of the reference methods (paper, Table 2). In: matched pixels. Out: points. Cost: three projections a point.

use rayon::prelude::*;

use super::{Cloud, CloudPoint};
use crate::correspondence::Outcome;
use crate::correspondence::reference_methods::ReferenceMatch;
use crate::geometry::{FringePattern, Pixel, Point3, Rig, range_per_pixel};
use crate::phase::PhaseMap;

/// The points of matches, in the order of their pixels.
///
/// δ follows from `pattern` and `phase` (of C1). `match_sd_px` is the standard deviation of a match along the epipolar
/// line; `sigma_m` follows from it.
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
        let back_projected_turns = pattern.phase_turns(rig.project_projector(&position)?.x);
        let delta_turns = back_projected_turns - f64::from(*phase.phase.get(i)?) / 65536.0;
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
            confidence: 0.0,
        })
    };
    Cloud { points: matches.par_iter().enumerate().filter_map(point).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::correspondence::reference_methods::match_along_epipolar_lines;
    use crate::correspondence::reference_methods::test_scene::{PATTERN, Scene};

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
