//! A window of a slowly moving scanner gives nearly as good a cloud as one of a scanner at rest.

#![expect(clippy::unwrap_used, reason = "a scanner that cannot be simulated fails the test")]

use std::ops::ControlFlow;

use fringeflow::calibration::Unit;
use fringeflow::correspondence::SegmentTable;
use fringeflow::phase::PhaseShifts;
use fringeflow::reconstruction::{Reconstructor, Settings};
use fringeflow_dataset::CameraId;
use fringeflow_lab::evaluation::{Frames, Scores, against_rendered};
use fringeflow_lab::simulation::{
    ImageLoop, Object, RigOptions, Scene, SweepOptions, View, VirtualScanner, VirtualScannerOptions, truth,
};

const SIZE_PX: [usize; 2] = [320, 256];
const STEPS: usize = 4;
const RESTING: SweepOptions = SweepOptions {
    poses: 4,
    travel_mm: [0.0; 3],
    turn_deg: [0.0; 3],
    tremor_mm: 0.0,
    tremor_deg: 0.0,
    outside_mm: 0.0,
    seed: 1,
};

fn scanner(sweep: SweepOptions) -> VirtualScanner {
    VirtualScanner::new(VirtualScannerOptions {
        rig: RigOptions { size_px: SIZE_PX, seed: 3, ..RigOptions::usual(0.025) },
        steps: STEPS,
        sweep,
        seed: 3,
        ..VirtualScannerOptions::usual(Object::Tooth)
    })
    .unwrap()
}

/// Scores of the window that starts with the first pose, against the ground truth at its middle.
fn scores(scanner: &VirtualScanner) -> Scores {
    let (rig, options) = (scanner.rig(), scanner.options());
    let images = ImageLoop::render(scanner, |_| ControlFlow::Continue(())).unwrap().unwrap();
    let window = |camera| (0..STEPS).map(|k| images.image(camera, k as u64, k as u32).unwrap()).collect::<Vec<_>>();
    let shifts_rad: Vec<f64> = (0..STEPS).map(|k| std::f64::consts::TAU * k as f64 / STEPS as f64).collect();
    let shifts = PhaseShifts::new(&shifts_rad).unwrap();
    let table = SegmentTable::build(&rig.calibrated, &rig.volume, &rig.columns).unwrap();
    let mut reconstructor =
        Reconstructor::new(&rig.calibrated, &rig.columns, table, &shifts, Settings::default()).unwrap();
    let result = reconstructor.reconstruct(0, &window(CameraId::Cam1), &window(CameraId::Cam2), None).unwrap();

    let scene = Scene::from_object(options.object, options.board, &rig.exact_volume);
    let scene = scene.at(scanner.cam1_from_object(STEPS / 2));
    let view = View::trace(&rig.exact, &scene, CameraId::Cam1, 1).unwrap();
    let truth = truth(&rig.exact, &rig.exact_volume, &scene, &view, Unit::Millimetre);
    let frames = Frames {
        cam1_from_volume: *rig.volume.cam1_from_volume(),
        exact_cam1_from_volume: *rig.exact_volume.cam1_from_volume(),
        unit_m: 1e-3,
    };
    against_rendered(&result.cloud, SIZE_PX, &truth, &frames).unwrap().scores
}

#[test]
fn motion_of_0_03_mm_per_image_costs_little() {
    let resting = scores(&scanner(RESTING));
    let slow = SweepOptions { poses: 16, travel_mm: [0.075, 0.075, 0.01], turn_deg: [0.01, 0.01, 0.02], ..RESTING };
    let moving = scanner(slow);
    let speed = moving.speed();
    assert!((0.027..0.033).contains(&speed.mean_mm), "{speed:?}");
    let moving = scores(&moving);
    assert!(resting.com_percent > 96.0, "at rest: {resting:?}");
    assert!(moving.com_percent > resting.com_percent - 0.5, "moving: {moving:?}; at rest: {resting:?}");
    assert!(moving.fpc_percent < 0.1, "moving: {moving:?}");
}
