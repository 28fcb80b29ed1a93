//! Tracks and fuses clouds of simulated surfaces, and compares the result with the true poses and surface.

use fringeflow::calibration::Unit;
use fringeflow::cloud::{Cloud, CloudExport};
use fringeflow::geometry::{Camera, Point3, Pose, Vector3};

use crate::registration::Lost;
use crate::registration::tests::{camera_of, cloud_of, hills};

use super::*;

const SIGMA_M: f64 = 3e-5;

fn camera() -> Camera {
    camera_of([120, 96])
}

/// A closed path over the hills: up to 6 mm and 3° to each side.
fn pose(k: usize, clouds: usize) -> Pose {
    let angle = std::f64::consts::TAU * k as f64 / clouds as f64;
    let (s, c) = (angle.sin(), 1.0 - angle.cos());
    Pose::new(Vector3::new(0.006 * s, 0.004 * c, 0.002 * s), Vector3::new(0.05 * c, 0.04 * s, 0.03 * s))
}

fn cloud(world_from_cam1: &Pose, seed: u64) -> Cloud {
    cloud_of(&camera(), SIGMA_M, seed, |ray| hills(world_from_cam1, 0.004, ray))
}

fn fused(clouds: usize) -> (Tracker, Vec<Tracked>) {
    let mut tracker = Tracker::new(camera(), FusionSettings::default());
    let steps =
        (0..=clouds).map(|k| tracker.step(cloud(&pose(k, clouds), k as u64).points, cloud_time_ns(k as u64))).collect();
    (tracker, steps)
}

fn error_m(found: &Pose, truth: &Pose) -> f64 {
    let centre = Point3::new(0.0, 0.0, 0.3);
    (found * centre - truth * centre).norm()
}

/// Distance of a point from the hills, roughly along their normal, metres.
fn distance_to_hills_m(place: &Point3) -> f64 {
    let ray = place.coords / place.z;
    (hills(&Pose::identity(), 0.004, &ray).unwrap() - place).norm()
}

/// Time of a cloud, nanoseconds.
fn cloud_time_ns(cloud: u64) -> u64 {
    cloud * 50_000_000
}

#[test]
fn a_scanner_is_tracked_and_its_model_is_better_than_a_cloud() {
    let clouds = 16;
    let (tracker, steps) = fused(clouds);
    for (k, step) in steps.iter().enumerate() {
        assert_eq!(step.tracking.name(), if k == 0 { "first" } else { "tracked" }, "cloud {k}: {step:?}");
        let off = error_m(&step.model_from_cam1, &pose(k, clouds));
        let sd = step.covariance.sd_at(&Point3::new(0.0, 0.0, 0.3));
        assert!(off <= 4.0 * sd + 1e-6, "cloud {k} is {off:e} m off, standard deviation {sd:e} m");
    }
    let surfels: Vec<_> = tracker.model().supported(3).collect();
    let rms = |off: &mut dyn Iterator<Item = f64>| {
        let squares: Vec<f64> = off.map(|x| x * x).collect();
        (squares.iter().sum::<f64>() / squares.len() as f64).sqrt()
    };
    let of_model = rms(&mut surfels.iter().map(|s| distance_to_hills_m(&s.position())));
    let single = cloud(&Pose::identity(), 0);
    let of_cloud =
        rms(&mut single.points.iter().map(|p| distance_to_hills_m(&Point3::from(p.position_m.map(f64::from)))));
    assert!(of_model < 0.5 * of_cloud, "model {of_model:e} m, cloud {of_cloud:e} m");
    // The error of each surfel matches its standard deviation.
    let normalized = rms(&mut surfels.iter().map(|s| distance_to_hills_m(&s.position()) / s.sigma_m()));
    assert!((0.5..2.0).contains(&normalized), "surfels are off by {normalized} of their standard deviations");
    // There are as many surfels as points in the first cloud, and a few that came into view.
    let per_point = surfels.len() as f64 / single.points.len() as f64;
    assert!((1.0..1.8).contains(&per_point), "{} surfels for {} points", surfels.len(), single.points.len());
}

#[test]
fn rotations_keep_unit_length_in_long_scans() {
    let mut tracker = Tracker::new(camera_of([60, 48]), FusionSettings::default());
    for k in 0..80 {
        let pose = pose(k, 40);
        let cloud = cloud_of(&camera_of([60, 48]), SIGMA_M, k as u64, |ray| hills(&pose, 0.004, ray));
        let found = tracker.step(&cloud.points, cloud_time_ns(k as u64)).model_from_cam1;
        assert!((found.rotation.norm() - 1.0).abs() < 1e-14, "cloud {k}: length {}", found.rotation.norm());
    }
}

#[test]
fn a_closed_path_closes() {
    let (tracker, _) = fused(12);
    let closure = tracker.closure().unwrap();
    let sd = closure.direct.covariance.sd_at(&Point3::new(0.0, 0.0, 0.3));
    assert!(closure.drift_m < 6.0 * sd, "{closure:?}, standard deviation {sd:e} m");
}

#[test]
fn after_a_jump_the_scanner_is_lost_merges_nothing_and_is_relocalized() {
    let mut tracker = Tracker::new(camera(), FusionSettings::default());
    for k in 0..3 {
        tracker.step(cloud(&Pose::identity(), k).points, cloud_time_ns(k));
    }
    let before = tracker.model().clone();
    let away = Pose::translation(0.0, 0.0, -0.06);
    let lost = tracker.step(cloud(&away, 9).points, cloud_time_ns(9));
    assert!(matches!(lost.tracking, Tracking::Lost(Lost::TooFewInCommon { .. })), "{lost:?}");
    assert_eq!(tracker.model(), &before);
    // 6 mm nearer: beyond the reach of tracking, but within that of relocalization.
    let near = Pose::translation(0.0, 0.0, 0.006);
    let found = tracker.step(cloud(&near, 10).points, cloud_time_ns(10));
    assert_eq!(found.tracking.name(), "relocalized", "{found:?}");
    assert!(error_m(&found.model_from_cam1, &near) < 2e-5, "{found:?}");
}

#[test]
fn the_model_starts_with_the_first_cloud_that_has_points() {
    let mut tracker = Tracker::new(camera(), FusionSettings::default());
    let nothing = tracker.step(Cloud::default().points, cloud_time_ns(0));
    assert_eq!(nothing.tracking.name(), "lost");
    assert_eq!(tracker.step(cloud(&Pose::identity(), 1).points, cloud_time_ns(1)).tracking, Tracking::First);
    assert!(tracker.closure().is_none());
}

#[test]
fn contradicted_and_unconfirmed_surfels_are_removed() {
    let with = |seed: u64, plate: bool| {
        let mut cloud = cloud(&Pose::identity(), seed);
        for point in cloud.points.iter_mut().filter(|_| plate) {
            let [u, v] = point.cam1_px;
            // A plate 12 mm in front of the hills.
            if (40..60).contains(&u) && (30..50).contains(&v) {
                point.position_m = point.position_m.map(|c| c * 0.96);
            }
        }
        cloud
    };
    let on_plate = |tracker: &Tracker| {
        let surfels = tracker.model().surfels();
        surfels.iter().filter(|s| distance_to_hills_m(&s.position()) > 5e-3).count()
    };
    let mut tracker = Tracker::new(camera(), FusionSettings::default());
    for seed in 0..4 {
        tracker.step(with(seed, true).points, cloud_time_ns(seed));
    }
    assert!(on_plate(&tracker) > 200, "{}", on_plate(&tracker));
    for seed in 4..8 {
        tracker.step(with(seed, false).points, cloud_time_ns(seed));
    }
    assert_eq!(on_plate(&tracker), 0);
}

#[test]
fn the_file_holds_the_supported_surfels() {
    let (tracker, _) = fused(6);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("model.ply");
    let export = CloudExport { unit: Unit::Millimetre, dataset: "hills" };
    let count = write_model(&path, tracker.model(), 3, &export).unwrap();
    assert_eq!(count, tracker.model().supported(3).count());
    let bytes = std::fs::read(&path).unwrap();
    let end = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
    let header = std::str::from_utf8(&bytes[..end]).unwrap();
    assert!(header.contains("comment unit mm\n") && header.contains("comment origin cam1 at the first of 7 clouds\n"));
    let fields =
        ["float nz", "uchar intensity", "float sigma", "uint16 support", "uchar red", "uchar green", "uchar blue"];
    assert!(header.contains(&fields.map(|field| format!("property {field}\n")).concat()), "{header}");
    assert_eq!(bytes.len() - end, count * 34);
    let first = tracker.model().supported(3).next().unwrap();
    assert_eq!(bytes[end..end + 4], ((first.position().x * 1e3) as f32).to_le_bytes());
    assert_eq!(bytes[end + 24], 100);
    assert_eq!(bytes[end + 25..end + 29], ((first.sigma_m() * 1e3) as f32).to_le_bytes());
    assert_eq!(bytes[end + 31..end + 34], [100; 3]);
}

#[test]
fn the_number_of_threads_changes_nothing() {
    let with_threads = |n| rayon::ThreadPoolBuilder::new().num_threads(n).build().unwrap().install(|| fused(4));
    let ((a, steps_a), (b, steps_b)) = (with_threads(1), with_threads(3));
    assert_eq!(steps_a, steps_b);
    assert_eq!(a.model(), b.model());
}

#[test]
fn the_prior_of_the_next_windows_is_the_motion_of_the_scanner() {
    let mut tracker = Tracker::new(camera(), FusionSettings::default());
    let step = Pose::new(nalgebra::Vector3::new(2e-4, -1e-4, 1e-4), nalgebra::Vector3::new(1e-3, 2e-3, -5e-4));
    let pose = |k: i32| (0..k).fold(Pose::identity(), |pose, _| pose * step);
    tracker.step(cloud(&pose(0), 0).points, cloud_time_ns(0));
    assert!(tracker.prior(None).is_none(), "one cloud shows no motion");
    for k in 1..8 {
        tracker.step(cloud(&pose(k), k as u64).points, cloud_time_ns(k as u64));
    }
    let prior = tracker.prior(None).unwrap();
    let next = prior.motion.pose_after(0.05);
    // A tenth of the step at the centre of the surface. Along the surface, the motion is less well determined.
    let off = error_m(&next, &step);
    assert!(off < 2e-5, "{next:?} is {off:e} m off");
    assert!(next.rotation.angle_to(&step.rotation) < 1e-3, "{next:?}");
    let seen = prior.relief.cells().iter().filter(|&&cell| cell > 0).count();
    assert!(seen * 2 > prior.relief.cells().len(), "{seen} cells");
    // The motion of a lost scanner is unknown.
    let lost = tracker.step(cloud(&Pose::translation(0.0, 0.0, -0.06), 9).points, cloud_time_ns(9));
    assert_eq!((lost.tracking.name(), tracker.prior(None)), ("lost", None));
}

#[test]
fn a_surface_that_determines_only_the_distance_still_gives_the_motion_towards_it() {
    let mut tracker = Tracker::new(camera(), FusionSettings::default());
    let step = Pose::translation(1e-4, 0.0, -2e-4);
    let pose = |k: i32| (0..k).fold(Pose::identity(), |pose, _| pose * step);
    for k in 0..6 {
        let flat = |ray: &Vector3| hills(&pose(k), 1e-5, ray);
        let tracked = tracker.step(cloud_of(&camera(), SIGMA_M, k as u64, flat).points, cloud_time_ns(k as u64));
        assert_eq!(tracked.tracking.name(), if k == 0 { "first" } else { "lost" }, "cloud {k}: {tracked:?}");
        assert_eq!((tracked.model_from_cam1, tracker.model().clouds()), (Pose::identity(), 1));
    }
    let velocity_m_s = tracker.prior(None).unwrap().motion.velocity_m_s;
    assert!((velocity_m_s.z + 4e-3).abs() < 4e-4, "{velocity_m_s} m/s");
    assert!(velocity_m_s.xy().norm() < 0.015, "{velocity_m_s} m/s");
}
