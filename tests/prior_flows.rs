//! Flows that a prior predicts for the next window, against a rig with known motion.

#![expect(clippy::unwrap_used, reason = "a rig that cannot be built fails the test")]

use nalgebra::Vector3;

use fringeflow::geometry::{Pixel, Point3};
use fringeflow::prior::{Moment, Prior, Relief, RigidMotion};
use fringeflow_lab::simulation::{RigOptions, VirtualRig};

fn rig() -> VirtualRig {
    VirtualRig::new(&RigOptions { size_px: [160, 128], ..RigOptions::usual(0.025) }).unwrap()
}

/// A plane perpendicular to the optical axis of C1.
fn relief(depth_m: f32) -> Relief {
    let pixels = (0..128).flat_map(|v| (0..160).map(move |u| [u, v]));
    Relief::from_points([160, 128], pixels.map(|pixel| (pixel, depth_m)))
}

const MOTION: RigidMotion =
    RigidMotion { velocity_m_s: Vector3::new(0.02, -0.01, 0.015), rate_rad_s: Vector3::new(0.05, 0.08, -0.04) };
const MOMENT: Moment = Moment { age_s: 0.05, spacing_s: 0.01 };

#[test]
fn flows_are_the_image_motion_of_the_points() {
    let rig = rig();
    let [flow1, flow2] = Prior { motion: MOTION, relief: relief(0.3), drift: None }
        .flows(&rig.calibrated, &rig.columns, MOMENT)
        .unwrap();
    // The middle of both images.
    let pixel = Pixel::new(79.5, 63.5);
    let point_at = |images: f64| {
        let ray = rig.calibrated.cam1.ray(&pixel).unwrap();
        let now_from_then = MOTION.pose_after(MOMENT.age_s + images * MOMENT.spacing_s).inverse();
        now_from_then * Point3::from(ray * 0.3)
    };
    let phase = |point: &Point3| {
        std::f64::consts::TAU * rig.columns.phase_turns(rig.calibrated.project_projector(point).unwrap().x)
    };
    let (before, after) = (point_at(-0.5), point_at(0.5));
    let motion_rad = (phase(&after) - phase(&before)) as f32;
    let displacements_px = [
        rig.calibrated.cam1.project(&after).unwrap() - rig.calibrated.cam1.project(&before).unwrap(),
        rig.calibrated.project_cam2(&after).unwrap() - rig.calibrated.project_cam2(&before).unwrap(),
    ];
    for (flow, displacement) in [flow1, flow2].iter().zip(displacements_px) {
        let tile = flow.motion_at([80, 64]).unwrap();
        let [u, v] = tile.velocity_px;
        let [expected_u, expected_v] = [displacement.x as f32, displacement.y as f32];
        assert!((u - expected_u).abs() < 0.02 && (v - expected_v).abs() < 0.02, "{tile:?}; {displacement}");
        assert!((tile.motion_rad - motion_rad).abs() < 0.02, "{tile:?}; {motion_rad} rad");
    }
}

#[test]
fn an_unusable_prior_or_moment_gives_no_flow() {
    let rig = rig();
    let flows = |prior: &Prior, moment| prior.flows(&rig.calibrated, &rig.columns, moment);
    let prior = Prior { motion: MOTION, relief: relief(0.3), drift: None };
    assert!(flows(&prior, MOMENT).is_some());
    for moment in [
        Moment { age_s: -0.01, ..MOMENT },
        Moment { age_s: 5.0, ..MOMENT },
        Moment { age_s: f64::NAN, ..MOMENT },
        Moment { spacing_s: 0.0, ..MOMENT },
        Moment { spacing_s: f64::NAN, ..MOMENT },
    ] {
        assert!(flows(&prior, moment).is_none(), "{moment:?}");
    }
    let with_velocity = |velocity: f64| Prior {
        motion: RigidMotion { velocity_m_s: Vector3::repeat(velocity), ..MOTION },
        ..prior.clone()
    };
    // Extreme velocities must not panic, whether or not they give a flow.
    for velocity in [f64::NAN, f64::INFINITY, 1e3, -1e3, 1e300] {
        let _ = flows(&with_velocity(velocity), MOMENT);
    }
    assert!(flows(&with_velocity(f64::NAN), MOMENT).is_none());
    let empty = Relief::from_points([160, 128], std::iter::empty());
    assert!(flows(&Prior { relief: empty, ..prior.clone() }, MOMENT).is_none());
    let other_size = Relief::from_points([64, 64], std::iter::once(([0, 0], 0.3)));
    assert!(flows(&Prior { relief: other_size, ..prior }, MOMENT).is_none());
}

#[test]
fn a_relief_cell_is_the_mean_of_inverse_depths() {
    let relief =
        Relief::from_points([40, 20], [([0, 0], 0.25), ([15, 15], 0.5), ([16, 0], 0.3), ([99, 0], 0.3)].into_iter());
    assert_eq!(Relief::cell_counts([40, 20]), [3, 2]);
    let cells = relief.cells().to_vec();
    // The mean of 4 and 2 is 3 per metre.
    assert_eq!(cells, [(3.0f64 * 65535.0 / 30.0).round() as u16, (65535.0f64 / 9.0).round() as u16, 0, 0, 0, 0]);
    assert_eq!(Relief::from_cells([40, 20], cells.clone()), Some(relief));
    assert_eq!(Relief::from_cells([80, 20], cells), None);
}
