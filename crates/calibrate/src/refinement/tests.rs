//! Refinement against rigs whose truth is known.

use fringeflow::geometry::{Distortion, Point3};
use nalgebra::{Translation3, UnitQuaternion, Vector3};

use super::*;

fn pose(turn: [f64; 3], shift: [f64; 3]) -> Pose {
    let turn = UnitQuaternion::from_scaled_axis(Vector3::from(turn));
    Pose::from_parts(Translation3::from(Vector3::from(shift)), turn)
}

fn truth() -> Rig {
    let camera = |f, c, d: &[f64], size| Camera::new([f, f], c, Distortion::from_opencv(d), size);
    Rig {
        cam1: camera(1000.0, [322.0, 251.0], &[-0.1, 0.05, 0.0, 0.0, 0.0], [640, 512]),
        cam2: camera(1010.0, [318.0, 258.0], &[-0.12, 0.06, 0.0, 0.0, 0.0], [640, 512]),
        projector: camera(1400.0, [455.0, 700.0], &[0.02, 0.0, 0.0, 0.0, 0.0], [912, 1140]),
        cam2_from_cam1: pose([0.0, 0.3, 0.0], [-0.1, 0.0, 0.015]),
        projector_from_cam1: pose([0.02, 0.12, 0.0], [-0.04, 0.02, 0.01]),
    }
}

/// Points of a wavy surface that all devices see.
fn points(rig: &Rig) -> Vec<ScanPoint> {
    let mut points = Vec::new();
    for v in (8..504).step_by(16) {
        for u in (8..632).step_by(16) {
            let pixel = Pixel::new(f64::from(u), f64::from(v));
            let depth = 0.32 + 0.02 * (f64::from(u) / 60.0).sin() * (f64::from(v) / 70.0).cos();
            let point = Point3::from(rig.cam1.ray(&pixel).unwrap() * depth);
            let (Some(cam2_px), Some(lit)) = (rig.project_cam2(&point), rig.project_projector(&point)) else {
                continue;
            };
            if rig.cam2.sees(&cam2_px) && rig.projector.sees(&lit) {
                points.push(ScanPoint { cam1_px: pixel, cam2_px, column_px: lit.x });
            }
        }
    }
    points
}

#[test]
fn a_turned_projector_is_turned_back() {
    let truth = truth();
    let points = points(&truth);
    let wrong = Rig { projector_from_cam1: pose([0.02, 0.122, 0.001], [-0.0403, 0.02, 0.0102]), ..truth };
    let refined = refine(&wrong, &usual_covariance(&wrong), &points).unwrap();
    assert!(refined.fits[0].median_px.abs() > 1.0, "{:?}", refined.fits);
    assert!(refined.fits[1].median_px.abs() < 0.01 && refined.fits[1].sd_px < 0.01, "{:?}", refined.fits);
    // What δ does not see stays: the images of both cameras still meet.
    for point in points.iter().step_by(53) {
        let gap_m = |rig: &Rig| triangulate(rig, &point.cam1_px, &point.cam2_px).unwrap().gap_m;
        assert!(gap_m(&refined.rig) < 3e-5, "{}", gap_m(&refined.rig));
    }
    assert!(refined.held.iter().any(|name| name == "fy_p"), "{:?}", refined.held);
    assert!(!refined.held.iter().any(|name| name == "cx_p"), "{:?}", refined.held);
}

#[test]
fn a_projector_is_found_from_columns_alone() {
    let truth = truth();
    let scan = points(&truth);
    let seen: Vec<(Vector3<f64>, f64)> = scan
        .iter()
        .map(|p| (triangulate(&truth, &p.cam1_px, &p.cam2_px).unwrap().point_cam1.coords, p.column_px))
        .collect();
    let (camera, from_cam1) = projector_from_columns(&seen, [912, 1140]).unwrap();
    // The direct transform knows no distortion.
    for (point, column_px) in &seen {
        let found = camera.project(&(from_cam1 * Point3::from(*point))).unwrap();
        assert!((found.x - column_px).abs() < 1.5, "{} {column_px}", found.x);
    }
    let plane: Vec<_> = seen.iter().map(|(p, c)| (Vector3::new(p.x, p.y, 0.3), *c)).take(60).collect();
    assert!(projector_from_columns(&plane[..20], [912, 1140]).is_none());
}

#[test]
fn sensitivities_are_differences() {
    let truth = truth();
    let state = state_of(&truth);
    let names = parameter_names(3);
    for point in points(&truth).iter().step_by(97) {
        let column = |state: &State| {
            let rig = rig_of(state, &truth);
            let position = triangulate(&rig, &point.cam1_px, &point.cam2_px).unwrap().point_cam1;
            rig.project_projector(&position).unwrap().x
        };
        let position = triangulate(&truth, &point.cam1_px, &point.cam2_px).unwrap().point_cam1;
        let [by_rig, _] = scan_sensitivity(&state, &position.coords).unwrap();
        for k in 0..by_rig.len() {
            let moved = |h: f64| {
                let mut step = DVector::zeros(by_rig.len());
                step[k] = h;
                column(&state.moved(step.as_view()))
            };
            let numeric = (moved(1e-6) - moved(-1e-6)) / 2e-6;
            assert!(
                (by_rig[k] - numeric).abs() < 0.02 * numeric.abs().max(0.05),
                "{}: {} {numeric}",
                names[k],
                by_rig[k]
            );
        }
    }
}
