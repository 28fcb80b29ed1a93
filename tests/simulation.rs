//! Checks the virtual scanner against first principles: the phase formula of textbooks, projections, brute-force
//! visibility.

#![expect(clippy::unwrap_used, clippy::panic, reason = "a dataset that cannot be written fails the test")]

use std::f64::consts::{PI, TAU};

use fringeflow::calibration::{Unit, read_calibration};
use fringeflow::geometry::{Point3, Rig};
use fringeflow_dataset::{CameraId, Dataset, DatasetError, EXACT_CALIBRATION_FILE, Problem, RenderedTruth, Truth};
use fringeflow_lab::evaluation::{SimulatedDatasetError, TOLERANCE_PX};
use fringeflow_lab::simulation::{
    Board, ImageSeed, NoiseLevel, Object, PointMm, RigOptions, Scene, Sensor, Simulation, SimulationError,
    SimulationOptions, Solid, View, VirtualRig, truth,
};
use fringeflow_patterns::{Direction, Pattern};

const SIZE: [usize; 2] = [320, 256];

fn options(object: Object) -> SimulationOptions {
    let usual = SimulationOptions::usual(object);
    let rig = RigOptions { size_px: SIZE, seed: 5, ..usual.rig };
    SimulationOptions { board: Board::Visible, rig, noise: NoiseLevel::None, seed: 5, ..usual }
}

fn wrapped(angle: f64) -> f64 {
    (angle + PI).rem_euclid(TAU) - PI
}

/// A point of the ground truth, metres.
fn point_m(point: [f32; 3]) -> Point3 {
    Point3::from(point.map(|c| f64::from(c) * 1e-3))
}

/// Phase, rad, and modulation by the textbook formula, from one value per image.
fn phase_and_modulation(values: &[f64]) -> (f64, f64) {
    let shifts = (0..values.len()).map(|k| TAU * k as f64 / values.len() as f64);
    let (s, c) = values.iter().zip(shifts).fold((0.0, 0.0), |(s, c), (i, d)| (s + i * d.sin(), c + i * d.cos()));
    ((-s).atan2(c), 2.0 / values.len() as f64 * s.hypot(c))
}

/// True projector column (or row) of a pixel; `None` unless its neighbourhood is smooth, measurable surface.
fn projector_coordinate(simulation: &Simulation, u: usize, v: usize, along: Direction) -> Option<f64> {
    if u == 0 || v == 0 || u + 1 == SIZE[0] || v + 1 == SIZE[1] {
        return None;
    }
    let truth = simulation.truth();
    let coordinate = |i: usize| {
        let pixel = simulation.rig().exact.project_projector(&point_m(truth.point[i]))?;
        truth.measurable[i].then_some(if along == Direction::Columns { pixel.x } else { pixel.y })
    };
    let at = |du: usize, dv: usize| coordinate((v + dv - 1) * SIZE[0] + u + du - 1);
    let middle = at(1, 1)?;
    for (a, b) in [((0, 1), (2, 1)), ((1, 0), (1, 2)), ((0, 0), (2, 2)), ((2, 0), (0, 2))] {
        if (at(a.0, a.1)? + at(b.0, b.1)? - 2.0 * middle).abs() > 0.1 {
            return None;
        }
    }
    Some(middle)
}

/// Errors of the decoded phase on bright, smooth surface, rad: without and with rounding to 8 bits.
fn phase_errors(simulation: &Simulation, direction: Direction) -> (Vec<f64>, Vec<f64>) {
    let sensor = Sensor::exposed(None, 1.0);
    let view = &simulation.views()[0];
    let pattern = match direction {
        Direction::Columns => simulation.rig().columns,
        Direction::Rows => simulation.rig().rows,
    };
    let fringes = |k: usize| Pattern::Fringes { direction, pattern, shift_rad: TAU * k as f64 / 8.0 };
    let seed = ImageSeed { seed: 0, camera: 0, image: 0 };
    let images: Vec<_> = (0..8).map(|k| sensor.image(view, &fringes(k), seed)).collect();
    let (mut unrounded, mut rounded) = (Vec::new(), Vec::new());
    for i in 0..SIZE[0] * SIZE[1] {
        let Some(coordinate) = projector_coordinate(simulation, i % SIZE[0], i / SIZE[0], direction) else { continue };
        let exact_values = std::array::from_fn::<f64, 8, _>(|k| sensor.grey(view, &fringes(k), i));
        let (exact, modulation) = phase_and_modulation(&exact_values);
        if modulation > 60.0 {
            let expected = TAU * pattern.phase_turns(coordinate);
            let rounded_values = std::array::from_fn::<f64, 8, _>(|k| f64::from(images[k].pixels[i]));
            let (decoded, _) = phase_and_modulation(&rounded_values);
            unrounded.push(wrapped(exact - expected).abs());
            rounded.push(wrapped(decoded - expected).abs());
        }
    }
    (unrounded, rounded)
}

#[test]
fn decoded_phase_is_the_phase_of_the_true_projector_pixel() {
    for object in [Object::Plane, Object::Nose] {
        for supersampling in [1, 2] {
            let simulation = Simulation::new(SimulationOptions { supersampling, ..options(object) }).unwrap();
            for direction in [Direction::Columns, Direction::Rows] {
                let (mut unrounded, rounded) = phase_errors(&simulation, direction);
                let count = rounded.len();
                assert!(count > 10_000, "{object:?} {direction:?}: {count} bright pixels");
                unrounded.sort_by(f64::total_cmp);
                // With supersampling, a pixel averages phases weighted by brightness. This is not an error of the
                // simulation.
                let (worst, bound) =
                    if supersampling == 1 { (unrounded[count - 1], 5e-4) } else { (unrounded[count * 99 / 100], 5e-3) };
                assert!(worst < bound, "{object:?} {direction:?} {supersampling}: {worst} rad before rounding");
                let rms = (rounded.iter().map(|e| e * e).sum::<f64>() / count as f64).sqrt();
                assert!(rms < 0.003, "{object:?} {direction:?}: {rms} rad after rounding");
            }
        }
    }
}

#[test]
fn every_object_can_be_measured_and_its_truth_fits_the_rig() {
    for object in Object::ALL {
        let options = options(object);
        let rig = VirtualRig::new(&options.rig).unwrap();
        let scene = Scene::from_object(object, Board::None, &rig.exact_volume);
        let view = View::trace(&rig.exact, &scene, CameraId::Cam1, 1).unwrap();
        let truth = truth(&rig.exact, &rig.exact_volume, &scene, &view, Unit::Millimetre);
        let count = truth.measurable.iter().filter(|&&m| m).count();
        // At 640 × 512 pixels there are four times as many: thousands even for the tooth, the smallest object.
        assert!(count > 1000, "{object:?}: {count} pixels");
        for i in 0..truth.measurable.len() {
            let hit = truth.cam2_px[i][0].is_finite();
            assert!(
                !hit || truth.in_volume[i] || !object.fits_volume(),
                "{object:?} leaves its volume at {:?}",
                truth.point[i]
            );
            if !hit {
                continue;
            }
            let point = point_m(truth.point[i]);
            let (p, q) = (rig.exact.cam1.project(&point).unwrap(), rig.exact.project_cam2(&point).unwrap());
            assert!((p.x - (i % SIZE[0]) as f64).hypot(p.y - (i / SIZE[0]) as f64) < 1e-3);
            assert!((q.x - f64::from(truth.cam2_px[i][0])).hypot(q.y - f64::from(truth.cam2_px[i][1])) < 1e-3);
            let surface_mm = scene.cam1_from_object().inverse() * point;
            let off_mm = object.solid().distance_mm(&(surface_mm.coords * 1e3));
            // The ground truth is in single precision: 3e-5 mm at 300 mm.
            assert!(off_mm.abs() < 1e-4, "{object:?}: {off_mm} mm off the surface");
        }
    }
}

/// Upper bound of the height of objects in the default volume, millimetres.
const HIGHEST_MM: f64 = 25.0;

/// Whether the line from a surface point to a device is unobstructed, tested in small equal steps. `None` if it is too
/// close to call.
fn is_unobstructed(solid: &dyn Solid, point: &PointMm, target: &PointMm) -> Option<bool> {
    let line = target - point;
    let step = 0.01 / line.norm();
    let mut least = f64::INFINITY;
    // The first 50 µm are too close to the surface itself.
    let mut share = 5.0 * step;
    while share < 1.0 && (point + line * share).z < HIGHEST_MM {
        let p = point + line * share;
        least = least.min(solid.distance_mm(&p)).min(if p.z > 0.0 { f64::INFINITY } else { -1.0 });
        share += step;
    }
    // For rays that graze a surface, both results are right.
    (least.abs() > 2e-3).then_some(least > 0.0)
}

fn centre_mm(scene: &Scene, centre_cam1: &Point3) -> PointMm {
    (scene.cam1_from_object().inverse() * centre_cam1).coords * 1e3
}

fn is_in_projector_image(rig: &Rig, point: &Point3) -> bool {
    rig.project_projector(point).is_some_and(|p| rig.projector.sees(&p))
}

#[test]
fn visibility_and_shadows_agree_with_brute_force() {
    for object in [Object::Prism, Object::Teeth, Object::Elephant] {
        let rig = VirtualRig::new(&options(object).rig).unwrap();
        let scene = Scene::from_object(object, Board::Visible, &rig.exact_volume);
        let view = View::trace(&rig.exact, &scene, CameraId::Cam1, 1).unwrap();
        let truth = truth(&rig.exact, &rig.exact_volume, &scene, &view, Unit::Millimetre);
        let solid = object.solid();
        let (light, cam2) =
            (centre_mm(&scene, &rig.exact.centre_of_projector()), centre_mm(&scene, &rig.exact.centre_of_cam2()));
        let (mut judged, mut dark, mut hidden, mut wrong) = (0, 0, 0, 0);
        for i in (0..SIZE[0] * SIZE[1]).step_by(97) {
            let Some(hit) = view.centres[i].hit else { continue };
            let point = point_m(truth.point[i]);
            if !is_in_projector_image(&rig.exact, &point)
                || !rig.exact.project_cam2(&point).is_some_and(|q| rig.exact.cam2.sees(&q))
            {
                continue;
            }
            for (target, claimed, negatives) in
                [(&light, truth.lit[i], &mut dark), (&cam2, truth.seen_by_cam2[i], &mut hidden)]
            {
                let facing = (target - hit.point).dot(&hit.normal) > 0.0;
                let Some(free) = is_unobstructed(solid.as_ref(), &hit.point, target) else { continue };
                judged += 1;
                *negatives += usize::from(!claimed);
                wrong += usize::from(claimed != (free && facing));
            }
        }
        assert!(judged > 200 && dark > 3 && hidden > 0, "{object:?}: {judged} judged, {dark} dark, {hidden} hidden");
        assert_eq!(wrong, 0, "{object:?}: of {judged}");
    }
}

#[test]
fn files_do_not_depend_on_the_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    let mut options = options(Object::Prism);
    options.noise = NoiseLevel::Normal;
    options.rig.size_px = [128, 96];
    let write = |threads: usize| {
        let target = folder.path().join(threads.to_string());
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| Simulation::new(options).unwrap().write(&target, || ()).unwrap());
        target
    };
    let (one, two) = (write(1), write(2));
    let mut compared = 0;
    for subfolder in ["", "cam1", "cam2"] {
        for entry in std::fs::read_dir(one.join(subfolder)).unwrap() {
            let path = entry.unwrap().path();
            if path.is_file() {
                let twin = two.join(path.strip_prefix(&one).unwrap());
                assert!(std::fs::read(&path).unwrap() == std::fs::read(twin).unwrap(), "{}", path.display());
                compared += 1;
            }
        }
    }
    assert_eq!(compared, 4 + 2 * (8 + 7 + 2));
}

#[test]
fn a_written_dataset_opens_and_equals_the_simulation() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("tooth");
    let mut options = options(Object::Tooth);
    options.rig.size_px = [96, 80];
    options.two_directions = true;
    let simulation = Simulation::new(options).unwrap();
    simulation.write(&target, || ()).unwrap();
    let dataset = Dataset::open(&target, None).unwrap();
    assert_eq!((dataset.setup.name.as_str(), dataset.setup.steps, dataset.setup.image_size_px), ("tooth", 8, [96, 80]));
    assert_eq!(dataset.setup.sequence.gray.unwrap().images, 7);
    assert_eq!(dataset.setup.second_direction.as_ref().unwrap().shifts_rad.len(), 8);
    assert_eq!(dataset.gray_images(CameraId::Cam2, true).unwrap().len(), 7);
    let exact = read_calibration(&target.join(EXACT_CALIBRATION_FILE), Unit::Millimetre).unwrap();
    let corner = Point3::new(0.03, -0.02, 0.3);
    for (read, made) in [(&exact, &simulation.rig().exact), (&dataset.setup.rig, &simulation.rig().calibrated)] {
        let (a, b) = (read.project_projector(&corner).unwrap(), made.project_projector(&corner).unwrap());
        assert!((a - b).norm() < 1e-6);
    }
    let (read, made) =
        (dataset.setup.exact_cam1_from_volume.unwrap(), *simulation.rig().exact_volume.cam1_from_volume());
    assert!((read.to_homogeneous() - made.to_homogeneous()).amax() < 1e-9);
    let Some(Truth::Rendered(truth)) = dataset.truth().unwrap() else { panic!("no truth") };
    assert_eq!(truth.measurable, simulation.truth().measurable);
    assert_eq!(truth.point, simulation.truth().point);
    let again = simulation.write(&target, || ()).unwrap_err();
    assert!(matches!(
        again,
        SimulatedDatasetError::Simulation(SimulationError::Dataset(DatasetError::File {
            problem: Problem::TargetExists,
            ..
        }))
    ));
}

/// Simulates and writes a dataset, and reads its ground truth.
fn written_truth(options: SimulationOptions) -> RenderedTruth {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("set");
    Simulation::new(options).unwrap().write(&target, || ()).unwrap();
    match Dataset::open(&target, None).unwrap().truth().unwrap() {
        Some(Truth::Rendered(truth)) => truth,
        _ => panic!("no truth of a rendered scene"),
    }
}

#[test]
fn the_reference_is_found_by_gray_code_and_confirmed_by_the_truth() {
    let simulated = SimulationOptions { noise: NoiseLevel::Normal, ..options(Object::Plane) };
    let truth = written_truth(simulated);
    let gray = truth.gray_cam2_px.unwrap();
    let (mut measurable, mut reference) = (0, 0);
    for i in 0..truth.reference.len() {
        measurable += usize::from(truth.measurable[i]);
        if truth.reference[i] {
            reference += 1;
            assert!(truth.measurable[i] && gray[i][0].is_nan() && gray[i][1].is_nan());
        } else if truth.measurable[i] && gray[i][0].is_finite() {
            let [dx, dy] = [0, 1].map(|k| gray[i][k] - truth.cam2_px[i][k]);
            assert!(f64::from(dx.hypot(dy)) > TOLERANCE_PX - 1e-3, "pixel {i} should belong to the reference");
        }
    }
    assert!(measurable > 10_000, "{measurable} measurable pixels");
    assert!(reference * 10 > measurable * 9, "{reference} of {measurable} measurable pixels are reference");
    let without = written_truth(SimulationOptions { gray: false, ..simulated });
    assert!(without.gray_cam2_px.is_none());
    assert_eq!(without.reference, without.measurable);
}

#[test]
fn noise_has_the_variance_of_shot_read_and_rounding_noise() {
    let options = options(Object::Plane);
    let rig = VirtualRig::new(&options.rig).unwrap();
    let scene = Scene::from_object(Object::Plane, Board::Visible, &rig.exact_volume);
    let view = View::trace(&rig.exact, &scene, CameraId::Cam1, 1).unwrap();
    let noise = NoiseLevel::Normal.noise().unwrap();
    let (noisy, quiet) = (Sensor::exposed(Some(noise), 1.0), Sensor::exposed(None, 1.0));
    let image = |image: u32| noisy.image(&view, &Pattern::White, ImageSeed { seed: 9, camera: 0, image });
    let (a, b) = (image(0), image(1));
    let (mut squares, mut expected) = (0.0, 0.0);
    for i in 0..a.pixels.len() {
        let grey = quiet.grey(&view, &Pattern::White, i);
        if grey > 50.0 {
            squares += (f64::from(a.pixels[i]) - f64::from(b.pixels[i])).powi(2);
            let per_electron = 255.0 / noise.full_well_e;
            let variance = (grey / per_electron + noise.read_noise_e.powi(2)) * per_electron.powi(2) + 1.0 / 12.0;
            expected += 2.0 * variance;
        }
    }
    assert!((squares / expected - 1.0).abs() < 0.03, "{squares} against {expected}");
}
