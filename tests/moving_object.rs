//! Datasets of a moving object: every image has its own pose, and the ground truth follows the motion.

#![expect(clippy::unwrap_used, clippy::panic, reason = "a dataset that cannot be written fails the test")]

use std::path::Path;

use fringeflow::correspondence::SegmentTable;
use fringeflow::geometry::Pose;
use fringeflow::phase::PhaseShifts;
use fringeflow::reconstruction::{Reconstructor, Settings};
use fringeflow_dataset::{CameraId, Dataset, GreyImage, Motion, Truth};
use fringeflow_lab::evaluation::{Evaluation, Frames, against_rendered, against_rendered_at};
use fringeflow_lab::simulation::{
    Board, ImageSeed, MotionOptions, NoiseLevel, Object, RigOptions, Scene, Sensor, Simulation, SimulationOptions,
    Staging, View, VirtualRig,
};
use fringeflow_patterns::{Direction, Pattern};

const SIZE_PX: [usize; 2] = [320, 256];
const STEPS: usize = 4;
const FAST: MotionOptions =
    MotionOptions { mm_per_image: 0.2, deg_per_image: 0.04, cycles: 4, blur: 0.0, tremor: 0.0, seed: 1 };

fn options(object: Object) -> SimulationOptions {
    let usual = SimulationOptions::usual(object);
    let rig = RigOptions { size_px: SIZE_PX, ..usual.rig };
    SimulationOptions { board: Board::Visible, rig, steps: STEPS, noise: NoiseLevel::None, supersampling: 1, ..usual }
}

fn simulate_motion(options: SimulationOptions, motion: MotionOptions) -> Simulation {
    Simulation::staged(options, Staging { motion: Some(motion), ..Staging::default() }).unwrap()
}

fn write_dataset(simulation: &Simulation, folder: &Path) -> Dataset {
    let target = folder.join("set");
    simulation.write(&target, || ()).unwrap();
    Dataset::open(&target, None).unwrap()
}

/// The view of a camera on an object at rest at the pose to which `motion` moves it.
fn view_at_rest(rig: &VirtualRig, object: Object, motion: &Pose, camera: CameraId) -> View {
    let scene = Scene::from_object(object, Board::Visible, &rig.exact_volume);
    let cam1_from_volume = rig.exact_volume.cam1_from_volume();
    let pose = cam1_from_volume * motion * cam1_from_volume.inverse() * scene.cam1_from_object();
    View::trace(&rig.exact, &scene.at(pose), camera, 1).unwrap()
}

fn fringes(rig: &VirtualRig, image: usize) -> Pattern {
    let shift_rad = std::f64::consts::TAU * (image % STEPS) as f64 / STEPS as f64;
    Pattern::Fringes { direction: Direction::Columns, pattern: rig.columns, shift_rad }
}

fn render_fringes(rig: &VirtualRig, view: &View, image: usize) -> GreyImage {
    let seed = ImageSeed { seed: 1, camera: 0, image: 0 };
    Sensor::exposed(None, 1.0).image(view, &fringes(rig, image), seed)
}

#[test]
fn every_image_shows_the_scene_at_its_pose() {
    let folder = tempfile::tempdir().unwrap();
    let simulation = simulate_motion(options(Object::Tooth), FAST);
    let motion = simulation.motion().unwrap();
    let dataset = write_dataset(&simulation, folder.path());
    assert_eq!((motion.poses.len(), dataset.setup.steps, dataset.setup.sequence.shifts_rad.len()), (16, 4, 16));
    for camera in CameraId::BOTH {
        for image in [0, 5, 15] {
            let view = view_at_rest(simulation.rig(), Object::Tooth, &motion.poses[image], camera);
            let images = dataset.phase_images(camera, &[image]).unwrap();
            assert!(images[0] == render_fringes(simulation.rig(), &view, image), "{camera:?}, image {image}");
        }
        let (white, _) = dataset.white_and_black(camera).unwrap().unwrap();
        let resting = view_at_rest(simulation.rig(), Object::Tooth, &Pose::identity(), camera);
        let seed = ImageSeed { seed: 1, camera: 0, image: 0 };
        assert!(white == Sensor::exposed(None, 1.0).image(&resting, &Pattern::White, seed));
    }
}

#[test]
fn the_description_states_the_requested_motion() {
    let folder = tempfile::tempdir().unwrap();
    let simulation = simulate_motion(options(Object::Tooth), FAST);
    let dataset = write_dataset(&simulation, folder.path());
    let (simulated, read) = (simulation.motion().unwrap(), dataset.setup.motion.unwrap());
    assert_eq!((simulated.reference, read.reference), (7.5, 7.5));
    for (simulated, read) in simulated.poses.iter().zip(&read.poses) {
        assert!((simulated.to_homogeneous() - read.to_homogeneous()).amax() < 1e-12);
    }
    for pair in read.poses.windows(2) {
        assert!(((pair[1].translation.vector - pair[0].translation.vector).norm() * 1e3 - 0.2).abs() < 1e-9);
        assert!((pair[0].rotation.angle_to(&pair[1].rotation).to_degrees() - 0.04).abs() < 1e-9);
    }
    assert!((read.pose_at(7.5).unwrap().to_homogeneous() - Pose::identity().to_homogeneous()).amax() < 1e-8);
}

#[test]
fn a_tremor_changes_the_path_but_hardly_the_pose_of_the_truth() {
    let poses = |tremor| simulate_motion(options(Object::Tooth), MotionOptions { tremor, ..FAST }).motion().unwrap();
    let (steady, trembling) = (poses(0.0), poses(0.1));
    let offset_mm =
        |k: usize| (steady.poses[k].translation.vector - trembling.poses[k].translation.vector).norm() * 1e3;
    assert!((0..16).map(offset_mm).fold(0.0, f64::max) > 0.05);
    // The truth is that of the middle of the sequence, between images 7 and 8.
    assert!(offset_mm(7) < 0.1 && offset_mm(8) < 0.1, "{} mm, {} mm", offset_mm(7), offset_mm(8));
}

#[test]
fn a_blurred_image_is_the_mean_of_many_sharp_ones() {
    let folder = tempfile::tempdir().unwrap();
    let fast = MotionOptions { mm_per_image: 0.5, deg_per_image: 0.1, cycles: 1, blur: 1.0, ..FAST };
    let simulation = simulate_motion(SimulationOptions { gray: false, ..options(Object::Tooth) }, fast);
    let (motion, rig) = (simulation.motion().unwrap(), simulation.rig());
    let dataset = write_dataset(&simulation, folder.path());
    let blurred = dataset.phase_images(CameraId::Cam1, &[2]).unwrap().remove(0);
    let moments = (0..20).map(|i| 1.5 + (f64::from(i) + 0.5) / 20.0);
    let views = moments.map(|at| view_at_rest(rig, Object::Tooth, &motion.pose_at(at).unwrap(), CameraId::Cam1));
    let sharp: Vec<GreyImage> = views.map(|view| render_fringes(rig, &view, 2)).collect();
    let count = blurred.pixels.len();
    let mean = |i: usize| sharp.iter().map(|image| f64::from(image.pixels[i])).sum::<f64>() / 20.0;
    let difference =
        |image: &GreyImage| (0..count).map(|i| (f64::from(image.pixels[i]) - mean(i)).powi(2)).sum::<f64>();
    let at_middle = render_fringes(rig, &view_at_rest(rig, Object::Tooth, &motion.poses[2], CameraId::Cam1), 2);
    let (blurred, sharp) = (difference(&blurred), difference(&at_middle));
    assert!(blurred * 4.0 < sharp, "squared differences: blurred {blurred}, sharp {sharp}");
}

/// Evaluates the cloud of the window that starts with image `start`, at the middle of the window.
fn evaluate_window(dataset: &Dataset, start: usize) -> Evaluation {
    let (setup, numbers) = (&dataset.setup, (start..start + STEPS).collect::<Vec<_>>());
    let shifts: Vec<f64> = numbers.iter().map(|&n| setup.sequence.shifts_rad[n]).collect();
    let table = SegmentTable::build(&setup.rig, setup.volume.as_ref().unwrap(), &setup.sequence.pattern).unwrap();
    let shifts = PhaseShifts::new(&shifts).unwrap();
    let mut reconstructor =
        Reconstructor::new(&setup.rig, &setup.sequence.pattern, table, &shifts, Settings::default()).unwrap();
    let [cam1, cam2] = CameraId::BOTH.map(|camera| dataset.phase_images(camera, &numbers).unwrap());
    let result =
        reconstructor.reconstruct(0, &GreyImage::levels_of(&cam1), &GreyImage::levels_of(&cam2), None).unwrap();
    let Some(Truth::Rendered(truth)) = dataset.truth().unwrap() else { panic!("no truth of a rendered scene") };
    let middle = start as f64 + (STEPS as f64 - 1.0) / 2.0;
    let evaluation = against_rendered_at(&result.cloud, setup, &truth, middle).unwrap();
    // At the moment of the truth, both evaluations agree.
    if Some(middle) == setup.motion.as_ref().map(|motion| motion.reference) {
        assert_eq!(evaluation, against_rendered(&result.cloud, SIZE_PX, &truth, &Frames::from_setup(setup)).unwrap());
    }
    evaluation
}

#[test]
fn windows_at_other_times_score_like_the_one_of_the_truth() {
    for object in [Object::Nose, Object::Elephant] {
        let folder = tempfile::tempdir().unwrap();
        let slow = MotionOptions { mm_per_image: 0.1, deg_per_image: 0.02, ..FAST };
        let dataset = write_dataset(&simulate_motion(options(object), slow), folder.path());
        let scores = [6, 0, 3, 7, 12].map(|start| evaluate_window(&dataset, start).scores);
        let [reference, others @ ..] = scores;
        // Shadows and silhouettes have moved by a pixel, which changes the misses. The median reveals a wrong pose.
        for other in others {
            assert!((other.com_percent - reference.com_percent).abs() < 1.0, "{object:?}: {other:?}, {reference:?}");
            assert!((other.fpc_percent - reference.fpc_percent).abs() < 0.2, "{object:?}: {other:?}, {reference:?}");
            let [other, reference] = [other, reference].map(|scores| scores.median_m.unwrap());
            assert!((other / reference - 1.0).abs() < 0.15, "{object:?}: median {other} m, {reference} m");
        }
    }
}

#[test]
fn impossible_motions_are_refused() {
    let refused = |motion| {
        let staging = Staging { motion: Some(motion), ..Staging::default() };
        Simulation::staged(options(Object::Tooth), staging).err().unwrap().to_string()
    };
    assert!(refused(MotionOptions { mm_per_image: f64::NAN, ..FAST }).contains("the motion is NaN mm per image"));
    assert!(refused(MotionOptions { mm_per_image: -0.1, ..FAST }).contains("-0.1 mm per image"));
    assert!(refused(MotionOptions { cycles: 0, ..FAST }).contains("the number of cycles is 0"));
    assert!(refused(MotionOptions { blur: 1.5, ..FAST }).contains("the blur is 1.5"));
    assert!(refused(MotionOptions { tremor: 2.0, ..FAST }).contains("the tremor is 2 mm"));
    let turning = refused(MotionOptions { deg_per_image: 4.0, cycles: 50, ..FAST });
    assert!(turning.contains("the rotation from the middle of the sequence"), "{turning}");
}

#[test]
fn the_default_sequence_has_a_whole_cycle_in_its_middle() {
    for (steps, cycles) in [(3, 7), (4, 4), (5, 5), (6, 3), (8, 2), (16, 2)] {
        assert_eq!(MotionOptions::usual_cycles(steps), cycles, "{steps} steps");
        let images = steps * cycles;
        let motion = Motion { reference: (images as f64 - 1.0) / 2.0, poses: vec![Pose::identity(); images] };
        assert!(images >= 16 && (motion.reference - (steps as f64 - 1.0) / 2.0).fract() == 0.0, "{steps} steps");
    }
}
