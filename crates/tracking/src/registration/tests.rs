//! Registers simulated surfaces with known poses and noise.

use nalgebra::Vector6;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use fringeflow::cloud::{Cloud, CloudPoint, Normals};
use fringeflow::geometry::{Camera, Distortion, Pixel, Point3, Pose, Vector3};

use super::*;

/// Returns a normally distributed number of mean 0 and standard deviation 1 (Box and Muller 1958).
fn standard_normal(rng: &mut ChaCha8Rng) -> f64 {
    let (a, b): (f64, f64) = (rng.random(), rng.random());
    (-2.0 * (1.0 - a).ln()).sqrt() * (std::f64::consts::TAU * b).cos()
}

/// A small camera; its pixels are 1.3 mm wide at 0.3 m.
pub(crate) fn camera() -> Camera {
    camera_of([80, 64])
}

pub(crate) fn camera_of(size_px: [usize; 2]) -> Camera {
    let focal = 2.9 * size_px[0] as f64;
    let principal = size_px.map(|side| side as f64 / 2.0 - 0.3);
    Camera::new([focal, focal * 1.001], principal, Distortion::from_opencv(&[-0.12, 0.3, 1e-3, -5e-4]), size_px)
}

/// Creates the cloud of a surface with noise along the rays. `meet` intersects a ray (z = 1) with the surface.
pub(crate) fn cloud_of(camera: &Camera, sigma_m: f64, seed: u64, meet: impl Fn(&Vector3) -> Option<Point3>) -> Cloud {
    let mut rng = ChaCha8Rng::seed_from_u64(seed);
    let mut points = Vec::new();
    for v in 0..camera.height_px() {
        for u in 0..camera.width_px() {
            let ray = camera.ray(&Pixel::new(u as f64, v as f64)).unwrap();
            let Some(point) = meet(&ray) else { continue };
            let noisy = point + ray.normalize() * (sigma_m * standard_normal(&mut rng));
            points.push(CloudPoint {
                position_m: noisy.coords.map(|c| c as f32).into(),
                intensity: 100,
                cam1_px: [u as u16, v as u16],
                sigma_m: sigma_m as f32,
                ..CloudPoint::default()
            });
        }
    }
    Cloud { points }
}

pub(crate) fn surface_of(
    camera: &Camera,
    sigma_m: f64,
    seed: u64,
    meet: impl Fn(&Vector3) -> Option<Point3>,
) -> OrganizedSurface {
    let cloud = cloud_of(camera, sigma_m, seed, meet);
    let mut surface = OrganizedSurface::default();
    surface.organize(&cloud.points, [camera.width_px(), camera.height_px()]);
    surface.compute_normals(&mut Normals::default());
    surface
}

/// All points of such a surface that have a normal.
pub(crate) fn sample_of(
    camera: &Camera,
    sigma_m: f64,
    seed: u64,
    meet: impl Fn(&Vector3) -> Option<Point3>,
) -> SampledPoints {
    SampledPoints::of_surface(&surface_of(camera, sigma_m, seed, meet), usize::MAX)
}

/// Intersects the ray of a camera at `world_from_cam1` with hills of a height, about 0.3 m away.
pub(crate) fn hills(world_from_cam1: &Pose, height_m: f64, ray: &Vector3) -> Option<Point3> {
    let world_z =
        |p: &Point3| 0.3 + height_m * ((p.x * 90.0).sin() + (p.y * 75.0 + 0.4).cos() + (p.x * 40.0 - p.y * 55.0).sin());
    let mut depth = 0.3;
    for _ in 0..30 {
        let p = world_from_cam1 * Point3::from(ray * depth);
        depth += (world_z(&p) - p.z) / (world_from_cam1.rotation * ray).z;
    }
    Some(Point3::from(ray * depth))
}

/// Intersects a ray with hills of 4 mm, in the frame of the world.
pub(crate) fn bowl(ray: &Vector3) -> Option<Point3> {
    hills(&Pose::identity(), 0.004, ray)
}

fn motion() -> Pose {
    Pose::new(Vector3::new(0.0021, -0.0013, 0.0008), Vector3::new(0.004, -0.006, 0.008))
}

/// Returns the error of a pose as a translation and a rotation about the origin.
fn error(found: &Pose, truth: &Pose) -> Vector6<f64> {
    let off = found * truth.inverse();
    let (shift, turn) = (off.translation.vector, off.rotation.scaled_axis());
    Vector6::new(shift.x, shift.y, shift.z, turn.x, turn.y, turn.z)
}

fn registered(camera: &Camera, sigma_m: f64, seed: u64) -> Registration {
    let truth = motion();
    let reference = sample_of(camera, sigma_m, 2 * seed, bowl);
    let moved = surface_of(camera, sigma_m, 2 * seed + 1, |ray| hills(&truth, 0.004, ray));
    register(camera, &reference, &moved, &Pose::identity(), &RegistrationSettings::default()).unwrap()
}

#[test]
fn without_noise_the_pose_is_found() {
    let found = registered(&camera_of([320, 256]), 0.0, 1);
    let centre = Point3::new(0.0, 0.0, 0.3);
    let off_m = (found.reference_from_moved * centre - motion() * centre).norm();
    // A point off the centre of a pixel lies off its plane because the surface bends, here by up to 1 µm.
    assert!(off_m < 5e-7, "{off_m:e} m off");
    assert!(found.share > 0.8 && found.rms_m < 1e-6, "{found:?}");
}

#[test]
fn the_covariance_matches_the_scatter_of_the_poses() {
    let camera = camera_of([160, 128]);
    let (trials, mut sum) = (40, 0.0);
    for seed in 0..trials {
        let found = registered(&camera, 5e-5, 100 + seed);
        let e = error(&found.reference_from_moved, &motion());
        sum += e.dot(&(found.covariance.0.try_inverse().unwrap() * e)) / 6.0;
        assert!((0.8..1.3).contains(&found.excess), "residuals as the noise says: {}", found.excess);
    }
    let normalized = sum / f64::from(trials as u32);
    assert!((0.5..2.0).contains(&normalized), "squared error {normalized} times the covariance");
}

#[test]
fn errors_shared_by_neighbours_are_not_independent() {
    // A ripple of 0.05 mm that moves with the camera, as motion within a window produces.
    let camera = camera_of([160, 128]);
    let rippled = |pose: Pose, phase: f64| {
        move |ray: &Vector3| {
            hills(&pose, 0.004, ray).map(|p| p * (1.0 + 1.7e-4 * (ray.x * 90.0 + ray.y * 20.0 + phase).sin()))
        }
    };
    let (trials, mut sum) = (24, 0.0);
    for k in 0..trials {
        let phase = f64::from(k) * 0.26;
        let reference = sample_of(&camera, 1e-5, 1, rippled(Pose::identity(), 0.0));
        let moved = surface_of(&camera, 1e-5, 2, rippled(motion(), phase));
        let found = register(&camera, &reference, &moved, &Pose::identity(), &RegistrationSettings::default()).unwrap();
        let e = error(&found.reference_from_moved, &motion());
        sum += e.dot(&(found.covariance.0.try_inverse().unwrap() * e)) / 6.0;
    }
    let normalized = sum / f64::from(trials);
    assert!(normalized < 3.0, "squared error {normalized} times the covariance");
}

#[test]
fn a_plane_is_degenerate() {
    let camera = camera_of([160, 128]);
    let plane = |ray: &Vector3| hills(&Pose::identity(), 0.0, ray);
    let (flat, moved) = (sample_of(&camera, 2e-5, 1, plane), surface_of(&camera, 2e-5, 2, plane));
    let lost = register(&camera, &flat, &moved, &Pose::identity(), &RegistrationSettings::default());
    assert!(matches!(lost, Err(Lost::Degenerate { .. })), "{lost:?}");
}

#[test]
fn a_distant_surface_has_no_partners() {
    let camera = camera();
    let (reference, moved) = (sample_of(&camera, 2e-5, 1, bowl), surface_of(&camera, 2e-5, 2, bowl));
    let settings = RegistrationSettings::default();
    let far = Pose::translation(0.0, 0.0, 0.05);
    let lost = register(&camera, &reference, &moved, &far, &settings);
    assert!(matches!(lost, Err(Lost::TooFewInCommon { .. })), "{lost:?}");
    let nothing = register(&camera, &reference, &OrganizedSurface::default(), &Pose::identity(), &settings);
    assert!(matches!(nothing, Err(Lost::TooFewInCommon { .. })), "{nothing:?}");
    let none = register(&camera, &SampledPoints::default(), &moved, &Pose::identity(), &settings);
    assert!(matches!(none, Err(Lost::TooFewInCommon { .. })), "{none:?}");
}

#[test]
fn another_surface_is_refused() {
    let camera = camera_of([160, 128]);
    let reference = sample_of(&camera, 2e-5, 1, bowl);
    // Hills that are lower by a third.
    let other = surface_of(&camera, 2e-5, 2, |ray| hills(&Pose::identity(), 0.0027, ray));
    let settings = RegistrationSettings { max_rms_share: 2e-4, ..RegistrationSettings::default() };
    let lost = register(&camera, &reference, &other, &Pose::identity(), &settings);
    assert!(matches!(lost, Err(Lost::ResidualTooLarge { .. } | Lost::TooFewInCommon { .. })), "{lost:?}");
}

#[test]
fn the_number_of_threads_changes_no_bit() {
    let camera = camera();
    let with_threads =
        |n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap().install(|| registered(&camera, 3e-5, 1));
    assert_eq!(with_threads(1), with_threads(3));
}
