//! Hidden faults of the image sequence (lost, duplicated and swapped images) are found and named from the images alone.
//! Motion is not taken for a fault.

#![expect(clippy::unwrap_used, reason = "a scene that cannot be simulated fails the test")]

mod scenes;

use fringeflow::phase::{PhaseShifts, SequenceCheck, SequenceFaultKind, Validity, usual_extra_images};
use fringeflow::worker::{ImagesError, PhasePair, PhaseWorker};
use fringeflow_base::grey::GreyLevels;
use fringeflow_dataset::GreyImage;
use fringeflow_lab::simulation::{NoiseLevel, Object};

use scenes::{Injection, MovingScene, find_fault, motion_rad, seeded_rng, shifts_rad};

const SIZE_PX: [usize; 2] = [112, 96];
/// Motion from image to image, millimetres.
const SPEEDS_MM: [f64; 3] = [0.0, 0.1, 0.3];
const STEPS: [usize; 4] = [3, 4, 8, 16];
/// Poses of a scene: enough for the longest window with the longest loss.
const POSES: usize = 32;
/// Injections of each kind per scene and number of steps.
const INJECTIONS: usize = 3;

/// Whether a fault is visible at this motion.
fn is_visible(kind: SequenceFaultKind, steps: usize, first_step: usize, motion_rad: f64) -> bool {
    let check = SequenceCheck::new(&shifts_rad(steps), first_step, steps + usual_extra_images(steps));
    // Some pixels move more than the median, some less.
    let shares = [0.85, 1.0, 1.15].map(|factor| check.residual_share(kind, factor * motion_rad));
    shares.into_iter().all(|share| share > 1.2 * check.least_residual_share())
}

#[test]
fn visible_faults_are_found_and_motion_is_no_fault() {
    let (mut visible, mut found, mut correct, mut invisible, mut seed) = (0, 0, 0, 0, 0);
    for mm_per_image in SPEEDS_MM {
        let scene = MovingScene::new(Object::Nose, SIZE_PX, mm_per_image, POSES, NoiseLevel::Normal);
        for (steps, camera) in STEPS.into_iter().flat_map(|steps| [(steps, 0), (steps, 1)]) {
            let images = steps + usual_extra_images(steps);
            let clean = scene.window(camera, steps, 1, Injection::None, 0);
            let motion_rad = motion_rad(&clean, SIZE_PX, steps, 1);
            for k in 0..2 * INJECTIONS as u64 {
                let window = scene.window(camera, steps, k as usize % steps, Injection::None, 1000 + k);
                let fault = find_fault(&window, SIZE_PX, steps, k as usize % steps);
                assert_eq!(fault, None, "{steps} steps, {mm_per_image} mm, camera {}", camera + 1);
            }
            for kind in (2..=6).flat_map(|kind| [kind; INJECTIONS]) {
                seed += 1;
                let mut rng = seeded_rng(seed);
                let injection = Injection::draw(kind, steps, images, &mut rng);
                let expected = injection.fault().unwrap();
                let first_step = seed as usize % steps;
                let window = scene.window(camera, steps, first_step, injection, seed);
                let fault = find_fault(&window, SIZE_PX, steps, first_step);
                if matches!(injection, Injection::Frozen(_)) || is_visible(expected, steps, first_step, motion_rad) {
                    visible += 1;
                    let what = format!("{injection:?} of {steps} steps, {mm_per_image} mm, {motion_rad} rad");
                    // In a long window of a fast scene, motion may leave as large a residual as the fault.
                    assert!(fault.is_some() || (steps > 4 && mm_per_image > 0.0), "{what}: not found");
                    found += usize::from(fault.is_some());
                    correct += usize::from(fault.is_some_and(|fault| fault.kind == expected));
                } else {
                    invisible += 1;
                }
            }
        }
    }
    assert!(visible > 300 && invisible * 8 < visible, "{visible} visible, {invisible} not");
    assert!(found * 100 >= visible * 97, "{found} of {visible} found");
    assert!(correct * 100 >= found * 85, "{correct} of {found} named correctly");
}

#[test]
fn a_window_whose_images_are_all_ahead_by_the_same_steps_shows_no_fault() {
    // This is why slips are detected from δ.
    let scene = MovingScene::new(Object::Nose, SIZE_PX, 0.1, POSES, NoiseLevel::Normal);
    for (steps, ahead) in [(3, 1), (4, 2), (8, 5)] {
        let window = scene.window(0, steps, 0, Injection::Slip(ahead), 5);
        assert_eq!(find_fault(&window, SIZE_PX, steps, 0), None);
    }
}

#[test]
fn the_worker_refuses_the_window_and_names_camera_fault_and_image() {
    let scene = MovingScene::new(Object::Nose, SIZE_PX, 0.1, POSES, NoiseLevel::Normal);
    let shifts = PhaseShifts::new(&shifts_rad(4)).unwrap();
    let mut worker = PhaseWorker::new(&scene.rig.calibrated, &scene.rig.columns, &shifts, Validity::default());
    let mut step = |injections: [Injection; 2]| {
        let windows = [0, 1].map(|camera| scene.window(camera, 4, 1, injections[camera], 7));
        let [cam1, cam2]: [Vec<GreyLevels<'_>>; 2] = [0, 1].map(|camera: usize| GreyImage::levels_of(&windows[camera]));
        worker.step(1, &cam1, &cam2, None, &mut PhasePair::default())
    };
    assert_eq!(step([Injection::None; 2]), Ok(()));
    let error = step([Injection::None, Injection::Lost(3, 1)]).unwrap_err();
    let ImagesError::Sequence(faults) = &error else { panic!("{error}") };
    assert_eq!(faults.cam1, None);
    assert_eq!(faults.cam2.unwrap().kind, SequenceFaultKind::Lost { after: 3, images: 1 });
    let text = error.to_string();
    assert!(text.contains("camera 2: an image was lost after image 4 (of 6;"), "{text}");
    let error = step([Injection::Swapped(1); 2]).unwrap_err().to_string();
    assert!(error.contains("both cameras (or the projector): images 2 and 3 are exchanged"), "{error}");
}
