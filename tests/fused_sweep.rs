//! Tracks and fuses a sweep of the virtual scanner. The poses agree with the true ones, and the model lies on the true
//! surface.

#![expect(clippy::unwrap_used, reason = "a scanner that cannot be simulated fails the test")]

use std::collections::HashSet;
use std::ops::ControlFlow;

use fringeflow::cloud::Cloud;
use fringeflow::correspondence::SegmentTable;
use fringeflow::geometry::{Point3, Pose};
use fringeflow::phase::PhaseShifts;
use fringeflow::reconstruction::{Reconstructor, Settings};
use fringeflow_dataset::CameraId;
use fringeflow_lab::evaluation::{StatedPose, against_trajectory};
use fringeflow_lab::simulation::{
    Board, ImageLoop, Object, RigOptions, Scene, Surface, SweepOptions, View, VirtualScanner, VirtualScannerOptions,
};
use fringeflow_tracking::fusion::{FusionSettings, Tracker};

const SIZE_PX: [usize; 2] = [320, 256];
const STEPS: usize = 4;
const POSES: usize = 64;

/// A scanner that moves by about 1 mm and 1° to each side, 0.1 mm from image to image.
fn scanner() -> VirtualScanner {
    let sweep =
        SweepOptions { poses: POSES, travel_mm: [0.8, 0.7, 0.2], turn_deg: [0.6, 0.8, 0.8], ..SweepOptions::default() };
    VirtualScanner::new(VirtualScannerOptions {
        board: Board::Dark,
        rig: RigOptions { size_px: SIZE_PX, seed: 3, ..RigOptions::usual(0.03) },
        steps: STEPS,
        sweep,
        seed: 3,
        ..VirtualScannerOptions::usual(Object::Elephant)
    })
    .unwrap()
}

/// The clouds of the sweep. The first window is repeated at the end, so the path is closed.
fn clouds(scanner: &VirtualScanner) -> Vec<Cloud> {
    let rig = scanner.rig();
    let images = ImageLoop::render(scanner, |_| ControlFlow::Continue(())).unwrap().unwrap();
    let shifts_rad: Vec<f64> = (0..STEPS).map(|k| std::f64::consts::TAU * k as f64 / STEPS as f64).collect();
    let table = SegmentTable::build(&rig.calibrated, &rig.volume, &rig.columns).unwrap();
    let shifts = PhaseShifts::new(&shifts_rad).unwrap();
    let mut reconstructor =
        Reconstructor::new(&rig.calibrated, &rig.columns, table, &shifts, Settings::default()).unwrap();
    let mut cloud = |start: usize| {
        let window = |camera| {
            let image = |step: usize| images.image(camera, (start + step) as u64, step as u32).unwrap();
            (0..STEPS).map(image).collect::<Vec<_>>()
        };
        reconstructor.reconstruct(0, &window(CameraId::Cam1), &window(CameraId::Cam2), None).unwrap().cloud
    };
    (0..=POSES).step_by(STEPS).map(&mut cloud).collect()
}

/// True poses of the exact C1 in the frame of the object, at the middle of each window.
fn true_poses(scanner: &VirtualScanner) -> Vec<Pose> {
    let object_from_cam1 = |number: usize| scanner.cam1_from_object(number).inverse();
    let middle = |start: usize| object_from_cam1(start + 1).lerp_slerp(&object_from_cam1(start + 2), 0.5);
    (0..=POSES).step_by(STEPS).map(middle).collect()
}

/// The surface that C1 saw at a true pose. Points are in the frame of the calibrated C1 at that pose.
struct TrueSurface {
    scanner: VirtualScanner,
    object_from_cam1: Pose,
    exact_from_cam1: Pose,
    view: View,
}

impl TrueSurface {
    fn new(scanner: VirtualScanner, object_from_cam1: Pose, exact_from_cam1: Pose) -> Self {
        let rig = scanner.rig();
        let scene = Scene::from_object(Object::Elephant, Board::Dark, &rig.exact_volume).at(object_from_cam1.inverse());
        let view = View::trace(&rig.exact, &scene, CameraId::Cam1, 1).unwrap();
        Self { scanner, object_from_cam1, exact_from_cam1, view }
    }

    /// Distance of a point from the surface, millimetres; `None` if the ray of the point misses the object.
    fn distance_mm(&self, point: &Point3) -> Option<f64> {
        let exact = self.exact_from_cam1 * point;
        let pixel = self.scanner.rig().exact.cam1.project(&exact)?;
        let [u, v] = [pixel.x.round(), pixel.y.round()].map(|c| c as usize);
        let hit = self.view.centres.get(v * self.view.width + u)?.hit.filter(|hit| hit.surface == Surface::Object)?;
        Some(((self.object_from_cam1 * exact).coords * 1e3 - hit.point).dot(&hit.normal).abs())
    }

    /// Root mean square of the distances below 0.5 mm, millimetres, and the share of the other points.
    fn scores(&self, points: &[Point3]) -> (f64, f64) {
        let near_mm: Vec<f64> = points.iter().filter_map(|p| self.distance_mm(p)).filter(|mm| *mm < 0.5).collect();
        let rms_mm = (near_mm.iter().map(|mm| mm * mm).sum::<f64>() / near_mm.len() as f64).sqrt();
        (rms_mm, 1.0 - near_mm.len() as f64 / points.len() as f64)
    }
}

#[test]
fn a_sweep_is_tracked_and_its_model_lies_on_the_true_surface() {
    let scanner = scanner();
    let (clouds, truth) = (clouds(&scanner), true_poses(&scanner));
    let rig = scanner.rig().clone();
    let cam1_from_exact = rig.volume.cam1_from_volume() * rig.exact_volume.cam1_from_volume().inverse();
    let mut tracker = Tracker::new(rig.calibrated.cam1, FusionSettings::default());
    let mut poses = Vec::new();
    for (k, cloud) in clouds.iter().enumerate() {
        let tracked = tracker.step(&cloud.points, k as u64 * 100_000_000);
        assert_eq!(tracked.tracking.name(), if k == 0 { "first" } else { "tracked" }, "cloud {k}: {tracked:?}");
        poses.push(StatedPose { first_from_cam1: tracked.model_from_cam1, covariance: tracked.covariance.0 });
    }

    let scores = against_trajectory(&poses, &truth, &cam1_from_exact, &tracker.model().centre()).unwrap();
    // A pixel is 0.3 mm wide. Motion within a window shifts its cloud by a few hundredths of that.
    assert!(scores.rms_m < 2e-5 && scores.rms_rad.to_degrees() < 0.05, "{scores:?}");
    let closure = tracker.closure().unwrap();
    assert!(closure.drift_m < 1.5e-5, "{closure:?}");

    let surface = TrueSurface::new(scanner, truth[0], cam1_from_exact.inverse());
    let model: Vec<Point3> = tracker.model().supported(3).map(|surfel| surfel.position()).collect();
    let single: Vec<Point3> = clouds[0].points.iter().map(|p| Point3::from(p.position_m.map(f64::from))).collect();
    let ((model_mm, model_outliers), (single_mm, single_outliers)) = (surface.scores(&model), surface.scores(&single));
    assert!(model_mm < 1.5 * single_mm, "rms of the model {model_mm} mm, of its first cloud {single_mm} mm");
    assert!(
        model_outliers < single_outliers + 0.005,
        "outliers: {model_outliers} of the model, {single_outliers} of its first cloud"
    );

    // The model covers the first cloud, with about one surfel per point.
    let pixel = |point: &Point3| rig.calibrated.cam1.project(point).map(|p| [p.x.round() as i32, p.y.round() as i32]);
    let covered: HashSet<[i32; 2]> = model.iter().filter_map(pixel).collect();
    let is_covered = |point: &&Point3| {
        pixel(point).is_some_and(|[u, v]| (-1..=1).any(|dv| (-1..=1).any(|du| covered.contains(&[u + du, v + dv]))))
    };
    let share = single.iter().filter(is_covered).count() as f64 / single.len() as f64;
    assert!(share > 0.95, "{share} of the first cloud is in the model");
    let per_point = model.len() as f64 / single.len() as f64;
    assert!((0.9..1.3).contains(&per_point), "{per_point} surfels per point");
}
