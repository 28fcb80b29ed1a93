//! The adjustment against a rig whose truth is known, with measurements as noisy as real ones.

use fringeflow::geometry::{Pixel, Pose, Vector3};
use nalgebra::{Matrix2x6, Translation3, UnitQuaternion};
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use super::*;
use crate::lens::Lens;
use crate::observations::PhasePatch;
use crate::shape::BoardShape;

const CORNER_SD_PX: f64 = 0.05;
const PHASE_SD_PX: f64 = 0.03;

fn normal(rng: &mut ChaCha8Rng) -> f64 {
    let (a, b): (f64, f64) = (rng.random(), rng.random());
    (-2.0 * (1.0 - a).ln()).sqrt() * (std::f64::consts::TAU * b).cos()
}

fn pose(turn: [f64; 3], shift: [f64; 3]) -> Pose {
    let turn = UnitQuaternion::from_scaled_axis(Vector3::from(turn));
    Pose::from_parts(Translation3::from(Vector3::from(shift)), turn)
}

/// A rig with 20 views of a board of 11 × 8 corners.
fn truth(rng: &mut ChaCha8Rng) -> State {
    let lens = |f: f64, rng: &mut ChaCha8Rng| {
        let k = [-0.15, 0.1, 0.001, -0.001, 0.05].map(|k| k * (1.0 + 0.5 * normal(rng)));
        Lens([f, f * 1.001, 322.0, 251.0, k[0], k[1], k[2], k[3], k[4]])
    };
    let device = |lens, from_first| Device { lens, from_first };
    let devices = vec![
        device(lens(1000.0, rng), Pose::identity()),
        device(lens(1010.0, rng), pose([0.01, 0.3, -0.02], [-0.1, 0.002, 0.015])),
        device(lens(1500.0, rng), pose([0.05, 0.12, 0.01], [-0.04, 0.03, 0.01])),
    ];
    let boards = (0..20).map(|_| {
        let turn = [0.4 * normal(rng), 0.4 * normal(rng), 0.3 * normal(rng)].map(|t: f64| t.clamp(-0.7, 0.7));
        pose(turn, [0.02 * normal(rng), 0.015 * normal(rng), 0.32 + 0.02 * normal(rng)])
    });
    State { devices, boards: boards.collect(), shape: BoardShape::flat() }
}

fn features_m() -> Vec<Vector2<f64>> {
    (0..88).map(|k| Vector2::new(f64::from(k % 11) - 5.0, f64::from(k / 11) - 3.5) * 0.012).collect()
}

fn problem(truth: &State, rng: &mut ChaCha8Rng) -> Problem {
    let features_m = features_m();
    let mut measurements = Vec::new();
    for view in 0..truth.boards.len() {
        for (feature, position_m) in features_m.iter().enumerate() {
            let point = truth.point(view, *position_m);
            let image = |device: usize| {
                let Device { lens, from_first } = &truth.devices[device];
                lens.image(&(from_first.rotation * point + from_first.translation.vector)).unwrap().pixel
            };
            let lit = image(2);
            for device in 0..2 {
                let noise = Vector2::new(normal(rng), normal(rng)) * CORNER_SD_PX;
                let pixel = image(device) + noise;
                // A patch whose slope is that of a projector with another magnification.
                let noise = Vector2::new(normal(rng), normal(rng)) * PHASE_SD_PX;
                let value = lit.coords + noise + (pixel - image(device)) * 1.5;
                let mut coefficients = Matrix2x6::zeros();
                coefficients.set_column(0, &value);
                coefficients[(0, 1)] = 1.5 * 8.0;
                coefficients[(1, 2)] = 1.5 * 8.0;
                let patch =
                    PhasePatch { feature, centre: pixel, radius_px: 8.0, coefficients, sd_px: [PHASE_SD_PX / 2.0; 2] };
                measurements.push(Measurement {
                    view,
                    feature,
                    device,
                    group: device,
                    measured: Measured::Pixel(pixel, CORNER_SD_PX),
                });
                measurements.push(Measurement {
                    view,
                    feature,
                    device,
                    group: 2 + device,
                    measured: Measured::Phase(patch),
                });
            }
        }
    }
    Problem { features_m, measurements, sizes_px: vec![[640, 512], [640, 512], [912, 1140]], groups: 4 }
}

/// A state as far from the truth as first guesses are.
fn disturbed(truth: &State, rng: &mut ChaCha8Rng) -> State {
    let layout = Layout::of(truth);
    let mut step = DVector::from_fn(layout.len(), |_, _| 0.01 * normal(rng));
    for d in 0..truth.devices.len() {
        for k in 0..9 {
            step[layout.lens(d) + k] = if k < 4 { 20.0 * normal(rng) } else { -truth.devices[d].lens.0[k] };
        }
    }
    truth.moved(step.as_view())
}

#[test]
fn derivatives_are_differences() {
    let mut rng = ChaCha8Rng::seed_from_u64(3);
    let mut truth = truth(&mut rng);
    truth.shape = BoardShape::free(0.06);
    let problem = problem(&truth, &mut rng);
    let layout = Layout::of(&truth);
    let at = |state: &State, m: &Measurement, d: &mut residual::Derivatives| {
        residual::residual(state, &layout, m, problem.features_m[m.feature], d).unwrap()
    };
    for measurement in [&problem.measurements[400], &problem.measurements[401], &problem.measurements[703]] {
        let mut derivatives = residual::Derivatives::default();
        at(&truth, measurement, &mut derivatives);
        let found = std::mem::take(&mut derivatives.columns);
        for parameter in 0..layout.len() {
            let column = found.iter().find(|(at, _)| *at == parameter).map_or(Vector2::zeros(), |(_, c)| *c);
            let moved = |h: f64, d: &mut residual::Derivatives| {
                let mut step = DVector::zeros(layout.len());
                step[parameter] = h;
                at(&truth.moved(step.as_view()), measurement, d)
            };
            let h = 1e-6;
            let numeric = (moved(h, &mut derivatives) - moved(-h, &mut derivatives)) / (2.0 * h);
            assert!((column - numeric).norm() <= 1e-4 * (1.0 + column.norm()), "{parameter}: {column} {numeric}");
        }
    }
}

#[test]
fn errors_are_as_large_as_the_covariance_says() {
    let (mut squares, mut count) = (0.0, 0.0);
    for seed in 0..6 {
        let mut rng = ChaCha8Rng::seed_from_u64(seed);
        let truth = truth(&mut rng);
        let problem = problem(&truth, &mut rng);
        let adjusted = adjust(&problem, disturbed(&truth, &mut rng)).unwrap();
        for (group, noise) in adjusted.groups.iter().zip([1.0, 1.0, 2.0, 2.0]) {
            assert!((group.noise / noise - 1.0).abs() < 0.05, "{adjusted:?}", adjusted = adjusted.groups);
            assert!(group.left_out <= 4);
        }
        let layout = Layout::of(&truth);
        for (d, device) in truth.devices.iter().enumerate() {
            for k in 0..9 {
                let error = adjusted.state.devices[d].lens.0[k] - device.lens.0[k];
                let normalized = error / adjusted.sd(layout.lens(d) + k);
                assert!(normalized.abs() < 5.0, "seed {seed}, device {d}, parameter {k}: {normalized}");
                squares += normalized * normalized;
                count += 1.0;
            }
            let focal_error = adjusted.state.devices[d].lens.0[0] / device.lens.0[0] - 1.0;
            assert!(focal_error.abs() < 5e-4, "seed {seed}, device {d}: {focal_error}");
        }
    }
    let rms = f64::sqrt(squares / count);
    assert!((0.8..1.25).contains(&rms), "{rms}");
}

#[test]
fn outliers_have_no_influence_and_are_counted() {
    let mut rng = ChaCha8Rng::seed_from_u64(11);
    let truth = truth(&mut rng);
    let mut problem = problem(&truth, &mut rng);
    let clean = adjust(&problem, disturbed(&truth, &mut rng)).unwrap();
    let mut wrong = 0;
    for measurement in problem.measurements.iter_mut().step_by(50) {
        if let Measured::Pixel(pixel, _) = &mut measurement.measured {
            *pixel += Vector2::new(12.0, -5.0);
            wrong += 1;
        }
    }
    assert!(wrong > 50);
    let adjusted = adjust(&problem, disturbed(&truth, &mut rng)).unwrap();
    let left_out: usize = adjusted.groups.iter().map(|group| group.left_out).sum();
    assert!((wrong..wrong + 5).contains(&left_out), "{left_out} of {wrong}");
    for (found, expected) in adjusted.state.devices.iter().zip(&clean.state.devices) {
        assert!((found.lens.0[0] - expected.lens.0[0]).abs() < 0.2);
    }
}

#[test]
fn a_bent_board_is_found() {
    let mut rng = ChaCha8Rng::seed_from_u64(5);
    let mut truth = truth(&mut rng);
    let bent = BoardShape::free(0.06);
    truth.shape = bent.moved(|mode| if mode == 0 { 4e-4 } else { 0.0 });
    let problem = problem(&truth, &mut rng);
    let flat = adjust(&problem, State { shape: BoardShape::flat(), ..disturbed(&truth, &mut rng) }).unwrap();
    let free = adjust(&problem, State { shape: bent, ..disturbed(&truth, &mut rng) }).unwrap();
    assert!(flat.groups[0].noise > 1.2 * free.groups[0].noise);
    assert!((free.state.shape.modes()[0] - 4e-4).abs() < 5e-5, "{:?}", free.state.shape);
}

#[test]
fn each_device_alone_is_found_from_nothing() {
    use crate::initial::{DeviceViews, calibrate_device};
    let mut rng = ChaCha8Rng::seed_from_u64(9);
    let truth = truth(&mut rng);
    let views = |device: usize, rng: &mut ChaCha8Rng| {
        let Device { lens, from_first } = truth.devices[device];
        let view = |view: usize, rng: &mut ChaCha8Rng| {
            let image = |position_m: &Vector2<f64>| {
                let point = truth.point(view, *position_m);
                lens.image(&(from_first.rotation * point + from_first.translation.vector)).unwrap().pixel
            };
            let noisy = |p: Pixel, rng: &mut ChaCha8Rng| p + Vector2::new(normal(rng), normal(rng)) * CORNER_SD_PX;
            features_m().iter().enumerate().map(|(k, m)| (k, noisy(image(m), rng))).collect()
        };
        let views = (0..truth.boards.len()).map(|v| view(v, rng)).collect();
        DeviceViews { features_m: features_m(), size_px: [640, 512], views }
    };
    for device in 0..3 {
        let found = calibrate_device(&views(device, &mut rng)).unwrap();
        let expected = truth.devices[device].lens;
        assert!((found.lens.0[0] / expected.0[0] - 1.0).abs() < 2e-3, "{:?} {expected:?}", found.lens);
        assert!(found.poses.iter().all(Option::is_some));
    }
}
