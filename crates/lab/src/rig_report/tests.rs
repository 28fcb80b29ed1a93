//! Tests of the report on a rectified rig, for which every figure has a closed form.
//!
//! With a = x/z and w = 1/z, C1 sees a point at f·a, C2 at f·(a − b·w), P at f·(a − r·b·w), each plus its principal
//! point. A plane is w = w0 + g·(a − a0), and δ of the candidate k orders away is 2π·k·r·(1 − b·g)/(1 − r·b·g).

use std::f64::consts::{SQRT_2, TAU};

use fringeflow::geometry::{Camera, Distortion, FringePattern, MeasurementVolume, Point3, Pose, Rig};

use super::evaluate::evaluate;
use super::*;

const BASE_M: f64 = 0.02;
const FOCAL_PX: f64 = 12_000.0;
const DEPTHS_M: [f64; 2] = [3.0, 7.0];
const PERIOD_PX: f64 = 2.5;
const GRID_PX: usize = 64;

/// A rectified rig: centres on a line, parallel axes, and principal points shifted so that all devices look at the
/// middle of the volume.
fn rectified(r: f64) -> RigSetup {
    let device = |place: f64, width: usize| {
        let shift = FOCAL_PX * place * BASE_M / 5.0;
        let size = [width, 1024];
        Camera::new([FOCAL_PX; 2], [width as f64 / 2.0 + shift, 512.0], Distortion::default(), size)
    };
    RigSetup {
        rig: Rig {
            cam1: device(0.0, 640),
            cam2: device(1.0, 1280),
            projector: device(r, 1280),
            cam2_from_cam1: Pose::translation(-BASE_M, 0.0, 0.0),
            projector_from_cam1: Pose::translation(-r * BASE_M, 0.0, 0.0),
        },
        volume: volume([-0.5, -0.5, DEPTHS_M[0]], [0.5, 0.5, DEPTHS_M[1]]),
        pattern: FringePattern { period_px: PERIOD_PX, sign: 1.0, offset_rad: 0.3 },
    }
}

fn volume(min: [f64; 3], max: [f64; 3]) -> MeasurementVolume {
    MeasurementVolume::new(Pose::identity(), min.into(), max.into()).unwrap()
}

/// Assumptions with an sd of exactly 0.04 rad.
fn exact_sd() -> Assumptions {
    Assumptions { noise_grey: 0.0, calibration: CalibrationQuality::SdRad(0.04), ..Assumptions::default() }
}

#[track_caller]
fn assert_close(value: f64, expected: f64, tolerance: f64) {
    assert!((value - expected).abs() <= tolerance * expected.abs(), "{value} is not {expected} ± {tolerance}");
}

#[test]
fn periods_and_orders_of_a_rectified_rig_match_the_formula() {
    let r = 0.3;
    let evaluation = evaluate(&rectified(r), &exact_sd(), GRID_PX).unwrap();
    let n = FOCAL_PX * BASE_M * (1.0 / DEPTHS_M[0] - 1.0 / DEPTHS_M[1]) / PERIOD_PX;
    for periods in [evaluation.periods.mean, evaluation.periods.min, evaluation.periods.max] {
        assert_close(periods, n, 2e-3);
    }
    assert_close(evaluation.periods.orders_spanned_mean, r * n, 1e-9);
    assert_close(evaluation.efc, 3.0 * 0.04 * (n - 1.0) / std::f64::consts::PI, 3e-3);
}

#[test]
fn noise_and_calibration_errors_propagate_as_in_the_formula() {
    let r = 0.38;
    let assumptions = Assumptions {
        steps: 8,
        noise_grey: 2.0,
        modulation_grey: 50.0,
        calibration: CalibrationQuality::ErrorPx(0.05),
    };
    let deviation = evaluate(&rectified(r), &assumptions, GRID_PX).unwrap().deviation;
    let phase_sd_rad = 0.5 * 2.0 / 50.0;
    assert_close(deviation.phase_sd_rad, phase_sd_rad, 1e-12);
    assert_close(deviation.amplification, r, 1e-2);
    let (square_r, square_rest) = (r * r, (1.0 - r) * (1.0 - r));
    assert_close(deviation.noise_sd_rad, phase_sd_rad * (square_r + square_rest).sqrt(), 1e-2);
    let calibration = TAU * 0.05 / PERIOD_PX * (1.0 + square_r + square_rest).sqrt();
    assert_close(deviation.calibration_sd_rad, calibration, 1e-2);
    assert_close(deviation.sd_rad, deviation.noise_sd_rad.hypot(calibration), 1e-2);
    assert_close(deviation.threshold_rad, 3.0 * deviation.sd_rad, 1e-12);
    let depth_sd = SQRT_2 * phase_sd_rad / TAU * 25.0 * PERIOD_PX / (FOCAL_PX * BASE_M);
    assert_close(deviation.depth_sd_m, depth_sd, 1e-2);
}

#[test]
fn a_projector_in_the_middle_lets_every_second_order_survive() {
    let comb = evaluate(&rectified(0.5), &exact_sd(), GRID_PX).unwrap().comb;
    let even: Vec<&Tooth> = comb.teeth.iter().filter(|tooth| tooth.order % 2 == 0 && tooth.order.abs() <= 10).collect();
    assert_eq!(even.len(), 10);
    for tooth in even {
        assert!(tooth.present_share > 0.02, "{tooth:?}");
        assert_eq!(tooth.surviving_share, tooth.present_share, "{tooth:?}");
    }
    for tooth in comb.teeth.iter().filter(|tooth| tooth.order % 2 != 0) {
        assert_eq!(tooth.surviving_share, 0.0, "{tooth:?}");
    }
    assert!(comb.survivors > 1.0);
    assert_close(comb.survivors_facing, comb.survivors, 0.1);
}

#[test]
fn a_projector_at_0_38_lets_no_order_survive() {
    let comb = evaluate(&rectified(0.38), &exact_sd(), GRID_PX).unwrap().comb;
    assert!(comb.teeth.iter().any(|tooth| tooth.order == 12 && tooth.present_share > 0.0));
    assert_eq!((comb.survivors, comb.survivors_facing), (0.0, 0.0));
    for tooth in comb.teeth.iter().filter(|tooth| tooth.present_share > 0.0) {
        let difference = tooth.mean_abs_delta_rad - tooth.approximate_abs_delta_rad;
        assert!(difference.abs() < 0.05, "{tooth:?}");
    }
}

#[test]
fn deeper_volumes_have_more_periods_and_longer_periods_fewer() {
    let setup = rectified(0.4);
    let n = |setup: &RigSetup| evaluate(setup, &exact_sd(), GRID_PX).unwrap().periods.mean;
    assert!(n(&setup.with_depth_scaled(0.5).unwrap()) < n(&setup));
    assert!(n(&setup.with_depth_scaled(1.2).unwrap()) > n(&setup));
    assert_close(n(&setup.with_period_scaled(2.0)), n(&setup) / 2.0, 1e-9);
    assert!(setup.with_depth_scaled(0.0).is_err());
}

#[test]
fn a_moved_projector_is_at_its_place_and_aims_as_before() {
    let setup = rectified(0.5);
    let moved = setup.with_projector_place(0.2);
    assert!((moved.rig.projector_place_on_base() - 0.2).abs() < 1e-9);
    let aim = |setup: &RigSetup| setup.rig.project_projector(&setup.centre_cam1()).unwrap();
    assert!((aim(&moved) - aim(&setup)).norm() < 1e-6);
}

#[test]
fn the_advice_moves_a_projector_out_of_the_middle() {
    let report = report(&rectified(0.5), &exact_sd(), GRID_PX).unwrap();
    let moved = report.advice.iter().find(|a| matches!(a.change, Change::ProjectorPlace { .. })).unwrap();
    assert!(report.advice_base.survivors > 1.0);
    assert_eq!(moved.figures.survivors, 0.0);
    assert!(
        report.advice.iter().any(|a| matches!(a.change, Change::Depth { .. }) && a.figures.n < report.advice_base.n)
    );
}

#[test]
fn lengths_angles_and_coverage_are_those_of_the_rig() {
    let report = report(&rectified(0.5), &Assumptions::default(), GRID_PX).unwrap();
    let layout = report.layout;
    assert_close(layout.base_cam1_cam2_m, BASE_M, 1e-9);
    assert_close(layout.base_cam1_projector_m, BASE_M / 2.0, 1e-9);
    assert_close(layout.projector_place_on_base, 0.5, 1e-9);
    assert!(layout.projector_off_base_m < 1e-12);
    assert_close(layout.angle_cam1_cam2_rad, (BASE_M / 5.0).atan(), 1e-6);
    assert_close(layout.working_distance_m, 5.0, 1e-9);
    assert_close(layout.volume_depth_m, 4.0, 1e-9);
    assert_close(layout.pixel_footprint_m, 5.0 / FOCAL_PX, 1e-9);
    assert_close(layout.depth_per_pixel_m, 25.0 / (FOCAL_PX * BASE_M), 1e-9);
    // Half the base, and 2π per period.
    assert_close(layout.depth_per_rad_m, layout.depth_per_pixel_m * 2.0 * layout.period_px / TAU, 1e-5);
    assert_eq!(report.coverage.image_with_segment, 1.0);
    assert_eq!(report.coverage.image_measurable, 1.0);
    assert!(report.coverage.volume_measurable > 0.0 && report.coverage.volume_measurable < 1.0);
}

#[test]
fn a_volume_that_a_device_never_sees_is_named_with_the_device() {
    let aside = Pose::rotation([0.0, 0.5, 0.0].into());
    let mut no_cam2 = rectified(0.5);
    no_cam2.rig.cam2_from_cam1 = aside * no_cam2.rig.cam2_from_cam1;
    let mut no_projector = rectified(0.5);
    no_projector.rig.projector_from_cam1 = aside * no_projector.rig.projector_from_cam1;
    let mut no_cam1 = rectified(0.5);
    no_cam1.volume = volume([2.0, -0.5, 3.5], [3.0, 0.5, 6.5]);
    for (setup, named) in [(no_cam1, Device::Cam1), (no_cam2, Device::Cam2), (no_projector, Device::Projector)] {
        let error = report(&setup, &Assumptions::default(), GRID_PX).unwrap_err();
        assert!(matches!(error, RigReportError::NeverSeen { device, .. } if device == named), "{error}");
        assert!(error.to_string().contains(&named.to_string()));
    }
}

#[test]
fn impossible_assumptions_are_refused() {
    let setup = rectified(0.5);
    let wrong = [
        Assumptions { steps: 2, ..Assumptions::default() },
        Assumptions { noise_grey: f64::NAN, ..Assumptions::default() },
        Assumptions { modulation_grey: 0.0, ..Assumptions::default() },
        Assumptions { calibration: CalibrationQuality::ErrorPx(-1.0), ..Assumptions::default() },
    ];
    for assumptions in wrong {
        let error = report(&setup, &assumptions, GRID_PX).unwrap_err();
        assert!(matches!(error, RigReportError::OutOfRange { .. }), "{error}");
    }
    let tiny = setup.with_period_scaled(0.1);
    assert!(matches!(report(&tiny, &exact_sd(), GRID_PX), Err(RigReportError::OutOfRange { .. })));
    let mut no_base = setup;
    no_base.rig.cam2_from_cam1 = Pose::identity();
    assert!(matches!(report(&no_base, &exact_sd(), GRID_PX), Err(RigReportError::NoBase { .. })));
}

#[test]
fn a_volume_around_the_camera_gives_finite_figures() {
    let mut setup = rectified(0.5);
    setup.volume = volume([-0.5, -0.5, -1.0], [0.5, 0.5, 6.5]);
    let figures = evaluate(&setup, &exact_sd(), 128).unwrap().figures();
    for figure in [figures.n, figures.sd_rad, figures.efc, figures.survivors, figures.depth_sd_m] {
        assert!(figure.is_finite());
    }
    assert!(setup.volume.contains(&Point3::origin()));
}

#[test]
fn the_report_does_not_depend_on_the_number_of_threads() {
    let with_threads = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let report = pool.install(|| report(&rectified(0.45), &Assumptions::default(), GRID_PX)).unwrap();
        serde_json::to_string(&report).unwrap()
    };
    assert_eq!(with_threads(1), with_threads(3));
}
