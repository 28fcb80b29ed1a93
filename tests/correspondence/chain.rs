//! The whole chain on a simulated scene.

use fringeflow::correspondence::{
    DriftMap, MatchError, MatchSettings, Matcher, Matches, OutcomeCounts, ResolutionMethod, SegmentTable,
    match_phases_with_grounds,
};
use fringeflow::phase::PhaseShifts;
use fringeflow::reconstruction::{Reconstruction, ReconstructionError, Reconstructor, Settings};
use fringeflow_base::grey::PixelFormat;
use fringeflow_dataset::{CameraId, Dataset, GreyImage};
use fringeflow_lab::evaluation::{Evaluation, Frames, Scores, against_rendered, reliability};
use fringeflow_lab::simulation::{
    Arrangement, Board, BoardApart, ImageSeed, NoiseLevel, Object, Projected, RigOptions, Sensor, Simulation,
    SimulationOptions, Staging, VirtualRig,
};
use fringeflow_simd::Level;

/// Width and height of the images, pixels.
const SIZE_PX: [usize; 2] = [320, 256];

fn simulation(object: Object) -> Simulation {
    simulation_with(object, Arrangement::TABLE_TOP)
}

/// A rig whose calibration is off by so much, δ in rad.
fn simulation_of_drift(object: Object, sd_rad: f64) -> Simulation {
    let usual = options(object, Arrangement::TABLE_TOP);
    Simulation::new(SimulationOptions { rig: RigOptions { sd_rad, ..usual.rig }, ..usual }).unwrap()
}

fn simulation_with(object: Object, arrangement: Arrangement) -> Simulation {
    Simulation::new(options(object, arrangement)).unwrap()
}

fn options(object: Object, arrangement: Arrangement) -> SimulationOptions {
    let rig = RigOptions { arrangement, size_px: SIZE_PX, seed: 3, ..RigOptions::usual(0.025) };
    let usual = SimulationOptions::usual(object);
    SimulationOptions { board: Board::Visible, rig, steps: 4, gray: false, supersampling: 1, seed: 3, ..usual }
}

fn reconstruct(simulation: &Simulation) -> Reconstruction {
    reconstruct_with(simulation, CameraId::BOTH, simulation.rig()).unwrap()
}

/// Reconstructs from the images of two cameras, the first taken for C1, with the calibration of a rig.
fn reconstruct_with(
    simulation: &Simulation,
    cameras: [CameraId; 2],
    rig: &VirtualRig,
) -> Result<Reconstruction, ReconstructionError> {
    let sensor = Sensor::exposed(NoiseLevel::Normal.noise(), 1.0);
    reconstruct_by(&sensor, simulation, cameras, rig, Settings::default())
}

/// The same, of the images of another sensor and by other settings.
fn reconstruct_by(
    sensor: &Sensor,
    simulation: &Simulation,
    cameras: [CameraId; 2],
    rig: &VirtualRig,
    settings: Settings,
) -> Result<Reconstruction, ReconstructionError> {
    let table = SegmentTable::build(&rig.calibrated, &rig.volume, &rig.columns).unwrap();
    let fringes: Vec<(f64, Projected)> = simulation
        .images()
        .into_iter()
        .filter_map(|(_, pattern)| match pattern {
            Projected::Fringes { shift_rad, .. } => Some((shift_rad, pattern)),
            _ => None,
        })
        .collect();
    let [cam1, cam2] = cameras.map(|camera| {
        let view = &simulation.views()[camera as usize];
        let image = |(k, (_, pattern)): (usize, &(f64, Projected))| {
            sensor.image(view, pattern, ImageSeed { seed: 3, camera: camera as u8, image: k as u32 })
        };
        fringes.iter().enumerate().map(image).collect::<Vec<_>>()
    });
    let shifts = PhaseShifts::new(&fringes.iter().map(|(s, _)| *s).collect::<Vec<_>>()).unwrap();
    let mut reconstructor = Reconstructor::new(&rig.calibrated, &rig.columns, table, &shifts, settings).unwrap();
    reconstructor.reconstruct(0, &GreyImage::levels_of(&cam1), &GreyImage::levels_of(&cam2), None)
}

/// What the images of a simulation yield whose patterns are so many steps ahead of what is said of them.
fn slipped(simulation: &Simulation, ahead: [usize; 2]) -> Reconstruction {
    let rig = simulation.rig();
    let table = SegmentTable::build(&rig.calibrated, &rig.volume, &rig.columns).unwrap();
    let fringes = simulation.images().into_iter().filter_map(|(_, pattern)| match pattern {
        Projected::Fringes { shift_rad, .. } => Some((shift_rad, pattern)),
        _ => None,
    });
    let (shifts, patterns): (Vec<f64>, Vec<Projected>) = fringes.unzip();
    let sensor = Sensor::exposed(None, 1.0);
    let [cam1, cam2] = CameraId::BOTH.map(|camera| {
        let image = |k: usize| {
            let k = (k + ahead[camera as usize]) % patterns.len();
            let seed = ImageSeed { seed: 3, camera: camera as u8, image: k as u32 };
            sensor.image(&simulation.views()[camera as usize], &patterns[k], seed)
        };
        (0..patterns.len()).map(image).collect::<Vec<_>>()
    });
    let shifts = PhaseShifts::new(&shifts).unwrap();
    let mut reconstructor =
        Reconstructor::new(&rig.calibrated, &rig.columns, table, &shifts, Settings::default()).unwrap();
    reconstructor.reconstruct(0, &GreyImage::levels_of(&cam1), &GreyImage::levels_of(&cam2), None).unwrap()
}

#[test]
fn slips_of_one_or_both_cameras_are_found_and_corrected() {
    let simulation = simulation(Object::Prism);
    let as_said = slipped(&simulation, [0, 0]);
    assert_eq!(as_said.matches.slip_steps, [0, 0]);
    let (points, com_percent) = (as_said.cloud.points.len(), scores(&simulation, &as_said).com_percent);
    for ahead in [[1, 1], [2, 2], [3, 3], [1, 0], [0, 1], [2, 1]] {
        let made = slipped(&simulation, ahead);
        assert_eq!(made.matches.slip_steps, ahead);
        // The same samples in another order: their sums round otherwise in the last bit.
        assert!(made.cloud.points.len().abs_diff(points) <= points / 500, "{ahead:?}: {}", made.cloud.points.len());
        assert!(scores(&simulation, &made).com_percent > com_percent - 0.1, "{ahead:?}");
    }
}

/// A scene before a dim board so far behind the measurement volume, of a rig with such a seed.
fn before_board(object: Object, distance_mm: f64, seed: u64) -> Simulation {
    let usual = options(object, Arrangement::TABLE_TOP);
    let board = Board::Apart(BoardApart { distance_mm, albedo: 0.3, tilt_deg: 0.0 });
    Simulation::new(SimulationOptions { board, rig: RigOptions { seed, ..usual.rig }, ..usual }).unwrap()
}

#[test]
fn a_board_just_behind_the_volume_is_not_taken_for_a_slip() {
    // With the patterns 2 and 1 steps ahead, all of this board would lie within.
    let simulation = before_board(Object::Tooth, 5.0, 2);
    let made = slipped(&simulation, [0, 0]);
    assert_eq!(made.matches.slip_steps, [0, 0]);
    let Scores { com_percent, fpc_percent, .. } = scores(&simulation, &made);
    assert!(com_percent > 90.0 && fpc_percent < 0.5, "com {com_percent} %, fpc {fpc_percent} %");
}

#[test]
fn a_body_whose_border_has_the_phase_of_a_board_behind_it_keeps_its_border() {
    let simulation = before_board(Object::Machine, 85.0, 2);
    let interior_percent = scores(&simulation, &reconstruct(&simulation)).interior_percent.unwrap();
    assert!(interior_percent > 99.9, "{interior_percent} %");
}

#[test]
fn a_strip_of_a_board_as_large_as_the_body_is_not_saved_by_its_lead() {
    let board = BoardApart { distance_mm: 40.0, albedo: 0.3, tilt_deg: 5.0 };
    for (object, board, least_com_percent) in
        [(Object::Tooth, Board::Apart(board), 95.0), (Object::Clutter, Board::BEHIND, 85.0)]
    {
        let usual = SimulationOptions::usual(object);
        let simulation = Simulation::new(SimulationOptions { board, steps: 4, gray: false, ..usual }).unwrap();
        let Scores { com_percent, fpc_percent, .. } = scores(&simulation, &reconstruct_written(&simulation));
        let is_right = com_percent > least_com_percent && fpc_percent < 0.8;
        assert!(is_right, "{object:?}: com {com_percent} %, fpc {fpc_percent} %");
    }
}

/// Reconstructs from the images that the simulation writes, with its own exposure and noise.
fn reconstruct_written(simulation: &Simulation) -> Reconstruction {
    let folder = tempfile::tempdir().unwrap();
    let set = folder.path().join("set");
    simulation.write(&set, || ()).unwrap();
    let dataset = Dataset::open(&set, None).unwrap();
    let setup = &dataset.setup;
    let numbers: Vec<usize> = (0..setup.steps).collect();
    let images = CameraId::BOTH.map(|camera| dataset.phase_images(camera, &numbers).unwrap());
    let [cam1, cam2] = images.each_ref().map(|images| GreyImage::levels_of(images));
    let (volume, pattern) = (setup.volume.as_ref().unwrap(), &setup.sequence.pattern);
    let table = SegmentTable::build(&setup.rig, volume, pattern).unwrap();
    let shifts = PhaseShifts::new(setup.cycle_shifts_rad()).unwrap();
    let mut reconstructor = Reconstructor::new(&setup.rig, pattern, table, &shifts, Settings::default()).unwrap();
    reconstructor.reconstruct(0, &cam1, &cam2, None).unwrap()
}

/// com and fpc against the simulation's exact truth.
fn scores(simulation: &Simulation, made: &Reconstruction) -> Scores {
    evaluation(simulation, made).scores
}

fn evaluation(simulation: &Simulation, made: &Reconstruction) -> Evaluation {
    let rig = simulation.rig();
    let cam1 = &rig.calibrated.cam1;
    let frames = Frames {
        cam1_from_volume: *rig.volume.cam1_from_volume(),
        exact_cam1_from_volume: *rig.exact_volume.cam1_from_volume(),
        unit_m: 1e-3,
    };
    against_rendered(&made.cloud, [cam1.width_px(), cam1.height_px()], simulation.truth(), &frames).unwrap()
}

#[test]
fn a_simulated_scene_is_reconstructed_and_every_pixel_accounted_for() {
    let simulation = simulation(Object::Prism);
    let made = reconstruct(&simulation);
    let counts = OutcomeCounts::from_outcomes(&made.matches.outcomes);
    assert_eq!(counts.iter().map(|(_, n)| n).sum::<u64>(), (SIZE_PX[0] * SIZE_PX[1]) as u64);
    let found: u64 = counts.iter().filter(|(o, _)| o.is_found()).map(|(_, n)| n).sum();
    assert_eq!(found, made.cloud.points.len() as u64);
    let scores = scores(&simulation, &made);
    assert!(scores.com_percent > 97.5 && scores.fpc_percent < 0.3, "{scores:?}");
    let deltas: Vec<f64> = made.cloud.points.iter().map(|p| f64::from(p.delta_rad)).filter(|d| d.abs() < 0.5).collect();
    let mean = deltas.iter().sum::<f64>() / deltas.len() as f64;
    let sd = (deltas.iter().map(|d| (d - mean).powi(2)).sum::<f64>() / deltas.len() as f64).sqrt();
    assert!(
        (made.matches.delta.sd_rad / sd - 1.0).abs() < 0.25,
        "{} measured, {sd} over the points",
        made.matches.delta.sd_rad
    );
}

#[test]
fn what_a_wall_hides_from_camera_2_yields_no_points() {
    // Walls hide strips of the ground from C2, which sees there, now and then, the phase that the ground has.
    for object in [Object::Plane, Object::Machine] {
        let simulation = simulation(object);
        let scores = scores(&simulation, &reconstruct(&simulation));
        assert!(scores.fpc_percent < 0.03, "{object:?}: {scores:?}");
    }
}

#[test]
fn a_calibration_error_is_taken_off_however_large() {
    // efc of Eq. (1) from 0.2 to 2: without the drift, hardly a pixel would be unambiguous at the end.
    for sd_rad in [0.041, 0.21, 0.42] {
        let simulation = simulation_of_drift(Object::Elephant, sd_rad);
        let made = reconstruct(&simulation);
        let drift = made.matches.drift.as_ref().unwrap();
        assert!(drift.residual_sd_rad < 0.012, "sd {sd_rad}: {drift:?}");
        // The figure that an alarm is raised by is the true one.
        assert!((drift.rms_rad / sd_rad - 1.0).abs() < 0.1 && drift.explains_most_pixels(), "sd {sd_rad}: {drift:?}");
        let scores = scores(&simulation, &made);
        assert!(scores.com_percent > 97.0 && scores.fpc_percent < 0.1, "sd {sd_rad}: {scores:?}");
    }
}

#[test]
fn the_map_of_a_drift_shows_as_much_as_its_root_mean_square() {
    let simulation = simulation_of_drift(Object::Elephant, 0.123);
    let VirtualRig { calibrated, volume, columns, .. } = simulation.rig();
    let table = SegmentTable::build(calibrated, volume, columns).unwrap();
    let made = reconstruct(&simulation);
    let drift = made.matches.drift.as_ref().unwrap();
    let DriftMap { size_px, middle_rad, greatest_rad } = DriftMap::new(drift, &table);
    let seen: Vec<f64> = middle_rad.iter().flatten().map(|&rad| f64::from(rad)).collect();
    let rms_rad = (seen.iter().map(|rad| rad * rad).sum::<f64>() / seen.len() as f64).sqrt();
    assert!(size_px == SIZE_PX && (0.7..1.4).contains(&(rms_rad / drift.rms_rad)), "{rms_rad} {drift:?}");
    let greatest = f64::from(greatest_rad);
    assert!(seen.iter().all(|rad| rad.abs() <= greatest) && greatest < 6.0 * drift.rms_rad, "{greatest} {drift:?}");
}

#[test]
fn a_wrong_order_that_is_consistent_over_most_of_the_image_does_not_bend_the_drift() {
    // Over the flat board about the tooth the neighbouring order leaves δ as level as the right one: a field of drift
    // explains either, but one of them only by calibration errors of several pixels.
    let simulation = simulation_of_drift(Object::Tooth, 0.42);
    let made = reconstruct(&simulation);
    let drift = made.matches.drift.as_ref().unwrap();
    assert!(drift.error_px < 2.5, "{drift:?}");
    let scores = scores(&simulation, &made);
    assert!(scores.com_percent > 96.5 && scores.fpc_percent < 0.1, "{scores:?}");
}

#[test]
fn what_is_seen_beyond_the_volume_does_not_bend_the_drift_to_wrong_orders_within() {
    // Nearly all that is seen: of the clutter a corner is left, the board behind it is not to be measured.
    let mut options = options(Object::Clutter, Arrangement::TABLE_TOP);
    options.board = Board::BEHIND;
    let staging = Staging { shift_mm: [20.0, 0.0, 0.0], covered: Some(CameraId::Cam2), ..Staging::default() };
    let simulation = Simulation::staged(options, staging).unwrap();
    let made = reconstruct(&simulation);
    assert!(made.matches.drift.as_ref().unwrap().error_px < 0.5, "{:?}", made.matches.drift);
    let scores = scores(&simulation, &made);
    assert!(scores.com_percent > 75.0 && scores.fpc_percent < 0.5, "{scores:?}");
}

#[test]
fn confidence_says_how_many_points_are_true_and_can_be_asked_for() {
    let simulation = simulation(Object::Clutter);
    let with = |min_confidence: f32| {
        let mut settings = Settings::default();
        settings.matching.min_confidence = min_confidence;
        let sensor = Sensor::exposed(NoiseLevel::Normal.noise(), 1.0);
        reconstruct_by(&sensor, &simulation, CameraId::BOTH, simulation.rig(), settings).unwrap()
    };
    let made = with(0.5);
    let parts = reliability(&made.cloud, &evaluation(&simulation, &made).judgements, SIZE_PX[0]);
    assert_eq!(parts.len(), 10);
    for (place, part) in parts.into_iter().enumerate() {
        // In images as small as these more pixels lie beside edges, and are doubted more than they should be.
        let allowed = if place == 0 { 5.0 } else { 1.5 };
        let off = part.true_percent - part.stated_percent;
        assert!(off > -0.3 && off < allowed, "{part:?}");
    }
    let sure = with(0.99);
    assert!(sure.cloud.points.iter().all(|point| (0.99..=1.0).contains(&point.confidence)));
    let [all, some] = [&made, &sure].map(|made| scores(&simulation, made));
    assert!(some.points < all.points && some.fpc_percent < 0.7 * all.fpc_percent, "{all:?} {some:?}");
}

#[test]
fn both_resolutions_decide_an_easy_scene() {
    let simulation = simulation(Object::Prism);
    let by = |method: ResolutionMethod| {
        let mut settings = Settings::default();
        settings.matching.method = method;
        let sensor = Sensor::exposed(NoiseLevel::Normal.noise(), 1.0);
        let made = reconstruct_by(&sensor, &simulation, CameraId::BOTH, simulation.rig(), settings).unwrap();
        assert_eq!(made.matches.drift.is_some(), method == ResolutionMethod::SemiGlobal);
        let states_confidence = made.cloud.points.iter().all(|point| point.confidence > 0.0);
        assert_eq!(states_confidence, method == ResolutionMethod::SemiGlobal);
        scores(&simulation, &made)
    };
    for method in ResolutionMethod::ALL {
        let scores = by(method);
        assert!(scores.com_percent > 97.5 && scores.fpc_percent < 0.3, "{method:?}: {scores:?}");
    }
}

#[test]
fn the_number_of_threads_does_not_show() {
    let simulation = simulation(Object::Prism);
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| reconstruct(&simulation))
    };
    assert!(with(1) == with(3));
}

#[test]
fn neither_the_instructions_nor_what_was_matched_before_show() {
    let simulations = [Object::Clutter, Object::Prism].map(simulation);
    let rig = simulations[0].rig();
    let table = SegmentTable::build(&rig.calibrated, &rig.volume, &rig.columns).unwrap();
    let made = simulations.each_ref().map(reconstruct);
    for method in ResolutionMethod::ALL {
        let settings = MatchSettings { method, ..MatchSettings::default() };
        let mut first: [Option<Matches>; 2] = [None, None];
        let (mut matcher, mut matches) = (Matcher::default(), Matches::default());
        for level in Level::ALL {
            // Other tests need not know: their results are the same.
            level.limit_to();
            for (made, first) in made.iter().zip(&mut first) {
                matcher.match_phases(&made.cam1, &made.cam2, &table, (&settings, None), &mut matches).unwrap();
                let first = first.get_or_insert_with(|| {
                    match_phases_with_grounds(&made.cam1, &made.cam2, &table, &settings).unwrap().0
                });
                assert!(*first == matches, "{method:?} {level:?}");
            }
        }
    }
}

#[test]
fn exchanged_images_are_told() {
    // On a flat scene a wrong order runs on over the whole image: its correspondences agree with each other.
    for object in [Object::Plane, Object::Prism] {
        let [cam1, cam2] = CameraId::BOTH;
        let simulation = simulation(object);
        let made = reconstruct_with(&simulation, [cam2, cam1], simulation.rig());
        assert!(
            matches!(made, Err(ReconstructionError::Match(MatchError::Exchanged { .. }))),
            "{object:?}: {:?}",
            made.map(|m| m.cloud.points.len())
        );
    }
}

#[test]
fn the_calibration_of_another_rig_is_told() {
    for object in [Object::Plane, Object::Nose] {
        let other =
            simulation_with(object, Arrangement { base_m: 0.09, projector_place: 0.6, ..Arrangement::TABLE_TOP });
        let made = reconstruct_with(&simulation(object), CameraId::BOTH, other.rig());
        let told = matches!(made, Err(ReconstructionError::Match(_)));
        assert!(told, "{object:?}: {:?}", made.map(|m| (m.cloud.points.len(), m.matches.delta)));
    }
}

#[test]
fn deeper_images_spread_the_phase_difference_less() {
    // The calibration is exact: what is left of δ comes from the images.
    let rig = RigOptions { sd_rad: 0.0, ..options(Object::Plane, Arrangement::TABLE_TOP).rig };
    let simulation =
        Simulation::new(SimulationOptions { rig, board: Board::None, ..options(Object::Plane, rig.arrangement) })
            .unwrap();
    let errors = |noise: NoiseLevel, format| {
        let sensor = Sensor { format, ..Sensor::exposed(noise.noise(), 1.0) };
        let made = reconstruct_by(&sensor, &simulation, CameraId::BOTH, simulation.rig(), Settings::default()).unwrap();
        let scores = scores(&simulation, &made);
        assert!(scores.com_percent > 98.5 && scores.fpc_percent == 0.0, "{format:?}: {scores:?}");
        [made.matches.delta.noise_sd_rad, scores.median_m.unwrap()]
    };
    // Where rounding is all the noise, two bits make it four times less.
    let [eight, ten, twelve] =
        [PixelFormat::Grey, PixelFormat::Y10, PixelFormat::Y12].map(|format| errors(NoiseLevel::None, format));
    for (i, what) in ["spread of δ, rad", "distance to the surface, m"].into_iter().enumerate() {
        let [eight, ten, twelve] = [eight[i], ten[i], twelve[i]];
        assert!(ten < 0.35 * eight && twelve < 0.45 * ten, "{what}: {eight:e}, {ten:e}, {twelve:e}");
    }
    // Beside the shot noise of a good camera it is still to be seen.
    let [eight, twelve] = [PixelFormat::Grey, PixelFormat::Y12].map(|format| errors(NoiseLevel::Low, format)[0]);
    assert!(twelve < 0.97 * eight, "{eight} {twelve}");
}
