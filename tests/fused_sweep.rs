//! A sweep of the virtual scanner, tracked and fused: the poses are the true ones, and the model lies on the true surface at
//! least as well as it must.

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

/// 2 mm about and 1° to each side, 0.1 mm from image to image.
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

/// The clouds of the sweep, the first once more at the end: a closed way.
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

/// True poses of the exact C1 in the frame of the object, at the middles of the windows.
fn true_poses(scanner: &VirtualScanner) -> Vec<Pose> {
    let object_from_cam1 = |number: usize| scanner.cam1_from_object(number).inverse();
    let middle = |start: usize| object_from_cam1(start + 1).lerp_slerp(&object_from_cam1(start + 2), 0.5);
    (0..=POSES).step_by(STEPS).map(middle).collect()
}

/// Distances of places of the calibrated C1, as it stood at a true pose, from the surface that it truly saw, millimetres.
struct TrueSurface {
    scanner: VirtualScanner,
    object_from_cam1: Pose,
    exact_from_cam1: Pose,
    view: View,
}

impl TrueSurface {
    fn of(scanner: VirtualScanner, object_from_cam1: Pose, exact_from_cam1: Pose) -> Self {
        let rig = scanner.rig();
        let scene = Scene::from_object(Object::Elephant, Board::Dark, &rig.exact_volume).at(object_from_cam1.inverse());
        let view = View::trace(&rig.exact, &scene, CameraId::Cam1, 1).unwrap();
        Self { scanner, object_from_cam1, exact_from_cam1, view }
    }

    /// `None` where the ray of the place misses the object.
    fn off_mm(&self, place: &Point3) -> Option<f64> {
        let exact = self.exact_from_cam1 * place;
        let pixel = self.scanner.rig().exact.cam1.project(&exact)?;
        let [u, v] = [pixel.x.round(), pixel.y.round()].map(|c| c as usize);
        let hit = self.view.centres.get(v * self.view.width + u)?.hit.filter(|hit| hit.surface == Surface::Object)?;
        Some(((self.object_from_cam1 * exact).coords * 1e3 - hit.point).dot(&hit.normal).abs())
    }

    /// Root mean square, and the share of the places that are half a millimetre off or lie on nothing.
    fn scores(&self, places: &[Point3]) -> (f64, f64) {
        let off: Vec<f64> = places.iter().filter_map(|p| self.off_mm(p)).filter(|off| *off < 0.5).collect();
        let rms_mm = (off.iter().map(|x| x * x).sum::<f64>() / off.len() as f64).sqrt();
        (rms_mm, 1.0 - off.len() as f64 / places.len() as f64)
    }
}

#[test]
fn a_sweep_is_tracked_and_its_model_is_true() {
    let scanner = scanner();
    let (clouds, truth) = (clouds(&scanner), true_poses(&scanner));
    let rig = scanner.rig().clone();
    let cam1_from_exact = rig.volume.cam1_from_volume() * rig.exact_volume.cam1_from_volume().inverse();
    let mut tracker = Tracker::new(rig.calibrated.cam1.clone(), FusionSettings::default());
    let mut poses = Vec::new();
    for (k, cloud) in clouds.iter().enumerate() {
        let tracked = tracker.step(cloud, k as u64 * 100_000_000);
        assert_eq!(tracked.tracking.name(), if k == 0 { "first" } else { "tracked" }, "cloud {k}: {tracked:?}");
        poses.push(StatedPose { first_from_cam1: tracked.model_from_cam1, covariance: tracked.covariance.0 });
    }

    let scores = against_trajectory(&poses, &truth, &cam1_from_exact, &tracker.model().centre()).unwrap();
    // Motion within the windows shifts each cloud by a few hundredths of the 0.3 mm that a pixel is wide.
    assert!(scores.rms_m < 2e-5 && scores.rms_rad.to_degrees() < 0.05, "{scores:?}");
    let closure = tracker.closure().unwrap();
    assert!(closure.drift_m < 1.5e-5, "{closure:?}");

    let surface = TrueSurface::of(scanner, truth[0], cam1_from_exact.inverse());
    let model: Vec<Point3> = tracker.model().supported(3).map(|surfel| surfel.position).collect();
    let single: Vec<Point3> = clouds[0].points.iter().map(|p| Point3::from(p.position_m.map(f64::from))).collect();
    let ((model_mm, model_off), (single_mm, single_off)) = (surface.scores(&model), surface.scores(&single));
    assert!(model_mm < 1.5 * single_mm, "rms of the model {model_mm} mm, of its first cloud {single_mm} mm");
    assert!(model_off < single_off + 0.005, "{model_off} of the model is off, {single_off} of its first cloud");

    // What the first cloud saw is in the model, and hardly a place twice.
    let pixel = |place: &Point3| rig.calibrated.cam1.project(place).map(|p| [p.x.round() as i32, p.y.round() as i32]);
    let covered: HashSet<[i32; 2]> = model.iter().filter_map(pixel).collect();
    let is_there = |place: &&Point3| {
        pixel(place).is_some_and(|[u, v]| (-1..=1).any(|dv| (-1..=1).any(|du| covered.contains(&[u + du, v + dv]))))
    };
    let there = single.iter().filter(is_there).count() as f64 / single.len() as f64;
    assert!(there > 0.95, "{there} of the first cloud is in the model");
    let per_point = model.len() as f64 / single.len() as f64;
    assert!((0.9..1.3).contains(&per_point), "{per_point} surfels a point");
}
