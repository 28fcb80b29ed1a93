//! Artefacts that random numbers draw, seen from C1, against what is known of them.

use std::f64::consts::TAU;

use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;

use fringeflow::geometry::{Point3, Vector3};

use super::*;
use crate::simulation::standard_normal;

/// Pixels of the simulated view, and their width as a direction.
const SIZE: [i32; 2] = [320, 256];
const PIXEL: f64 = 1.0 / 920.0;

/// Distance at which a surface meets a ray.
type DistanceAlong<'a> = dyn Fn(&Vector3) -> Option<f64> + 'a;

/// Points at which the rays of C1 meet surfaces: the nearest one counts. Noise stands along the ray.
fn seen(surfaces: &[&DistanceAlong<'_>], noise_m: f64, seed: u64) -> Vec<Point3> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut points = Vec::new();
    for v in 0..SIZE[1] {
        for u in 0..SIZE[0] {
            let [x, y] = [f64::from(u - SIZE[0] / 2) * PIXEL, f64::from(v - SIZE[1] / 2) * PIXEL];
            let ray = Vector3::new(x, y, 1.0).normalize();
            let distance_m = surfaces.iter().filter_map(|surface| surface(&ray)).fold(f64::INFINITY, f64::min);
            if distance_m.is_finite() {
                points.push(Point3::from(ray * (distance_m + noise_m * standard_normal(&mut random))));
            }
        }
    }
    points
}

fn ball(centre: [f64; 3], radius_m: f64) -> impl Fn(&Vector3) -> Option<f64> {
    let centre = Vector3::from(centre);
    move |ray: &Vector3| {
        let along = ray.dot(&centre);
        let inside = radius_m * radius_m - (centre.norm_squared() - along * along);
        (inside > 0.0).then(|| along - inside.sqrt())
    }
}

fn plate(point: [f64; 3], normal: [f64; 3]) -> impl Fn(&Vector3) -> Option<f64> {
    let (point, normal) = (Vector3::from(point), Vector3::from(normal).normalize());
    move |ray: &Vector3| Some(point.dot(&normal) / ray.dot(&normal))
}

fn of_cam1(points: &[Point3]) -> MeasuredPoints<'_> {
    MeasuredPoints { points_m: points, views: Views::Cam1, fringes: None }
}

fn balls(
    points: &[Point3],
    diameters_m: &[f64],
    spacings_m: &[f64],
) -> Result<(Vec<BallFigures>, Vec<Spacing>), NotFound> {
    let artefact = Artefact::Balls { diameters_m: diameters_m.to_vec(), spacings_m: spacings_m.to_vec() };
    match measure(&of_cam1(points), &artefact)? {
        Measurement::Balls { balls, spacings } => Ok((balls, spacings)),
        Measurement::Plane(_) => unreachable!("balls were asked for"),
    }
}

fn flat(points: &[Point3]) -> FlatFigures {
    match measure(&of_cam1(points), &Artefact::Plane).unwrap() {
        Measurement::Plane(flat) => flat,
        Measurement::Balls { .. } => unreachable!("a plane was asked for"),
    }
}

#[test]
fn exact_balls_among_a_table_and_other_balls_have_no_error() {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    for seed in 0..8 {
        let mut shift = || random.random_range(-0.004..0.004);
        let first = [-0.03 + shift(), shift(), 0.3 + shift()];
        let direction = Vector3::new(1.0, 0.2 + 30.0 * shift(), 20.0 * shift()).normalize();
        let second: [f64; 3] = (Vector3::from(first) + direction * 0.06).into();
        let table = plate([0.0, 0.0, 0.315], [0.1, 0.0, 1.0]);
        let other = ball([0.0, 0.03, 0.305], 0.0065);
        let (a, b) = (ball(first, 0.01), ball(second, 0.01));
        let points = seen(&[&a, &b, &table, &other], 0.0, seed);
        let (balls, spacings) = balls(&points, &[0.02, 0.02], &[0.06]).unwrap();
        assert!(spacings[0].error_m.abs() < 1e-9, "{spacings:?}");
        for ball in &balls {
            assert!(ball.size_error_m.abs() < 1e-9 && ball.surface.range_m < 1e-9, "{ball:?}");
            assert_eq!(ball.surface.left_out.far, 0);
        }
    }
}

#[test]
fn noise_shows_in_precision_and_stays_out_of_trueness() {
    let (mut errors, mut u) = (Vec::new(), Vec::new());
    for seed in 0..12 {
        let surface = ball([0.004, -0.003, 0.3], 0.01);
        let (found, _) = balls(&seen(&[&surface], 2e-5, seed), &[0.02], &[]).unwrap();
        let figures = &found[0];
        // Noise stands along the ray, so an inclined surface has a smaller part of it along its normal.
        assert!((1.4e-5..2.1e-5).contains(&figures.surface.noise_m[0]), "{:?}", figures.surface.noise_m);
        assert!(figures.surface.form_rms_m < 3e-6, "{}", figures.surface.form_rms_m);
        errors.push(figures.size_error_m);
        u.push(figures.diameter_u_m);
    }
    let rms = (errors.iter().map(|error| error * error).sum::<f64>() / errors.len() as f64).sqrt();
    let stated = u.iter().sum::<f64>() / u.len() as f64;
    assert!(rms < 6e-6 && (0.4..2.5).contains(&(rms / stated)), "{rms} m rms, {stated} m stated");
}

#[test]
fn the_noise_of_a_plate_is_measured_and_its_range_leaves_out_0_3_percent() {
    let surface = plate([0.0, 0.0, 0.3], [0.0, 0.0, 1.0]);
    let figures = flat(&seen(&[&surface], 1e-5, 3));
    let LeftOut { points, used, far } = figures.surface.left_out;
    assert!((points - used) as f64 <= 0.003 * points as f64 && points - used > 200 && far == 0);
    assert!((figures.surface.noise_m[0] / 1e-5 - 1.0).abs() < 0.02, "{:?}", figures.surface.noise_m);
    // 0.3 % of a normal distribution lie beyond 2.97 standard deviations.
    assert!((figures.surface.range_m / 5.94e-5 - 1.0).abs() < 0.02, "{}", figures.surface.range_m);
    let window = Measurement::Plane(figures);
    assert!(causes(&[&window], 0.0, 0.0).is_empty());
}

#[test]
fn a_bent_plate_is_told_from_a_noisy_one() {
    let flat_plate = plate([0.0, 0.0, 0.3], [0.1, -0.05, 1.0]);
    let bent = |ray: &Vector3| Some(flat_plate(ray)? + 4e-5 * ((ray.x / 0.17).powi(2) + (ray.y / 0.17).powi(2)));
    let window = Measurement::Plane(flat(&seen(&[&bent], 1e-5, 5)));
    let found = causes(&[&window], 0.0, 0.0);
    let [Cause::Bend(bend)] = found[..] else { panic!("{found:?}") };
    // The corners of the used part are at 0.96 of the image: 4e-5 · 0.92 · (1 + 0.64).
    assert!((bend.range_m / 6.1e-5 - 1.0).abs() < 0.1 && bend.share > 0.9, "{bend:?}");
}

#[test]
fn a_longer_base_is_a_scale_error_and_no_other() {
    let (a, b) = (ball([-0.03, 0.0, 0.3], 0.01), ball([0.03, 0.0, 0.3], 0.01));
    let points: Vec<Point3> = seen(&[&a, &b], 5e-6, 7).into_iter().map(|point| point * 1.001).collect();
    let (balls, spacings) = balls(&points, &[0.02; 2], &[0.06]).unwrap();
    let window = Measurement::Balls { balls, spacings };
    let found = causes(&[&window], 1e-7, 1e-7);
    let [Cause::Scale { share, u }] = found[..] else { panic!("{found:?}") };
    assert!((share - 0.001).abs() < 2e-5 && u < 4e-5, "{share} ± {u}");
}

#[test]
fn a_ripple_is_found_at_its_place_in_the_fringe() {
    let surface = plate([0.0, 0.0, 0.3], [0.05, 0.0, 1.0]);
    let phase = |ray: &Vector3| TAU * ray.x / ray.z / (8.6 * PIXEL);
    let rippled = |ray: &Vector3| Some(surface(ray)? + 4e-6 * (4.0 * phase(ray)).sin());
    let points = seen(&[&rippled], 1e-5, 9);
    let phases: Vec<f64> = points.iter().map(|point| phase(&point.coords)).collect();
    let measured = MeasuredPoints { fringes: Some((&phases, 4)), ..of_cam1(&points) };
    let window = measure(&measured, &Artefact::Plane).unwrap();
    let found = causes(&[&window], 0.0, 0.0);
    let [Cause::Ripple(ripple)] = found[..] else { panic!("{found:?}") };
    assert!(ripple.per_fringe == 4 && (ripple.amplitude_m / 4e-6 - 1.0).abs() < 0.1, "{ripple:?}");
}

#[test]
fn a_patch_at_a_wrong_order_is_counted_and_does_not_pull_the_plate() {
    let surface = plate([0.0, 0.0, 0.3], [0.1, 0.0, 1.0]);
    let patch = |ray: &Vector3| {
        let is_patch = (0.0..0.03).contains(&ray.x) && (0.0..0.03).contains(&ray.y);
        Some(surface(ray)? - if is_patch { 0.004 } else { 0.0 })
    };
    let window = Measurement::Plane(flat(&seen(&[&patch], 1e-5, 11)));
    let figures = window.surfaces()[0].clone();
    assert!(figures.range_m < 1e-4 && figures.left_out.exceeds(), "{:?}", figures.left_out);
    let found = causes(&[&window], 0.0, 0.0);
    let [Cause::Apart { share, offset_m }] = found[..] else { panic!("{found:?}") };
    assert!((0.005..0.02).contains(&share) && (offset_m - 0.004).abs() < 3e-4, "{share}, {offset_m} m");
}

#[test]
fn what_is_not_there_is_not_measured() {
    let table = plate([0.0, 0.0, 0.31], [0.1, 0.0, 1.0]);
    let points = seen(&[&table], 1e-5, 13);
    assert!(matches!(balls(&points, &[0.02], &[]), Err(NotFound::NoBall { found: 0, wanted: 1, .. })));
    let larger = ball([0.0, 0.0, 0.3], 0.013);
    let points = seen(&[&larger, &table], 1e-5, 13);
    assert!(matches!(balls(&points, &[0.02], &[]), Err(NotFound::NoBall { .. })));
    let on_table = seen(&[&ball([0.0, 0.0, 0.3], 0.02), &table], 1e-5, 13);
    assert!(matches!(measure(&of_cam1(&on_table), &Artefact::Plane), Err(NotFound::Covered { .. })));
    let (a, b) = (ball([-0.03, 0.0, 0.3], 0.01), ball([0.03, 0.0, 0.3], 0.01));
    let points = seen(&[&a, &b], 1e-5, 13);
    assert!(matches!(balls(&points, &[0.02; 2], &[0.05]), Err(NotFound::NoSpacing { .. })));
    assert!(matches!(measure(&of_cam1(&points), &Artefact::Plane), Err(NotFound::NoPlane { .. })));
    assert!(matches!(measure(&of_cam1(&points[..100]), &Artefact::Plane), Err(NotFound::FewPoints { points: 100 })));
}

#[test]
fn a_ball_of_a_model_is_measured_from_all_sides() {
    let centre = Point3::new(0.1, 0.2, -0.1);
    let points: Vec<Point3> = (0..40_000)
        .map(|i| {
            // A spiral spreads the points evenly over the ball; the foot of the stand takes the lowest tenth.
            let y = 1.0 - 1.8 * (f64::from(i) + 0.5) / 40_000.0;
            let (sin, cos) = (2.399_963_229_728_653 * f64::from(i)).sin_cos();
            let across = (1.0 - y * y).sqrt();
            centre + Vector3::new(across * cos, y, across * sin) * 0.01
        })
        .collect();
    let measured = MeasuredPoints { points_m: &points, views: Views::Several, fringes: None };
    let artefact = Artefact::Balls { diameters_m: vec![0.02], spacings_m: Vec::new() };
    let Measurement::Balls { balls, .. } = measure(&measured, &artefact).unwrap() else { unreachable!() };
    assert!(balls[0].size_error_m.abs() < 1e-9 && (balls[0].sphere.centre - centre).norm() < 1e-9);
    let LeftOut { points, far, .. } = balls[0].surface.left_out;
    // All but the border of what is there.
    assert!(points > 35_000 && points < 40_000 && far == 0, "{points}, {far}");
}
