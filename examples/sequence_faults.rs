//! Measures the check of image sequences. Injects hidden faults (lost, duplicated and swapped images) into rendered
//! windows, and prints how many the images alone reveal, and how many windows without a fault are refused.
//!
//! ```text
//! cargo run --release --example sequence_faults [INJECTIONS [CLEAN]]      by default 4000 and 10000
//! ```
//!
//! Images have 128 × 96 pixels: the middle of images of 640 × 512 pixels with the same fringes, so the motion is the
//! same too. Whether a fault is visible at all is computed from the motion measured in the window without the fault.

#![expect(clippy::print_stdout, clippy::unwrap_used, reason = "it prints its results, and needs every scene")]

#[path = "../tests/sequence_faults/scenes.rs"]
mod scenes;

use std::collections::BTreeMap;

use rayon::prelude::*;

use fringeflow::phase::{SequenceCheck, usual_extra_images};
use fringeflow_lab::simulation::{NoiseLevel, Object};

use scenes::{Injection, MovingScene, find_fault, motion_rad, seeded_rng, shifts_rad};

const SIZE_PX: [usize; 2] = [128, 96];
const OBJECTS: [Object; 3] = [Object::Nose, Object::Elephant, Object::Machine];
/// Motion from image to image, millimetres.
const SPEEDS_MM: [f64; 5] = [0.0, 0.05, 0.1, 0.2, 0.3];
/// Scenes for windows without a fault. No threshold of the check was chosen with them.
const CLEAN_OBJECTS: [Object; 3] = [Object::Prism, Object::Teeth, Object::Clutter];
const CLEAN_SPEEDS_MM: [f64; 5] = [0.0, 0.07, 0.15, 0.25, 0.4];
const NOISE: [NoiseLevel; 2] = [NoiseLevel::Normal, NoiseLevel::High];
const STEPS: [usize; 4] = [3, 4, 8, 16];
/// Poses of a scene: enough for the longest window with the longest loss.
const POSES: usize = 32;
const KINDS: [&str; 6] = ["slip", "lost", "frozen", "repeated", "skipped", "swapped"];

/// Counts of the injections of one kind.
#[derive(Default)]
struct Row {
    injected: usize,
    found: usize,
    /// Found, with the correct kind and place.
    correct: usize,
    /// Not found, and too small to be visible.
    invisible: usize,
    /// Not found, but visible.
    missed: usize,
}

/// Result of one injection.
struct Trial {
    /// Kind, number of steps, and whether the object moves.
    row: (usize, usize, bool),
    is_found: bool,
    is_correct: bool,
    is_visible: bool,
    description: String,
}

fn main() {
    let argument = |k: usize, default: usize| std::env::args().nth(k).map_or(default, |text| text.parse().unwrap());
    let (injections, clean) = (argument(1, 4000), argument(2, 10_000));
    let scenes = render_scenes(OBJECTS, SPEEDS_MM);
    let trials: Vec<Trial> = (0..injections).into_par_iter().map(|number| run_trial(&scenes, number)).collect();
    print_table(&trials);
    let scenes = render_scenes(CLEAN_OBJECTS, CLEAN_SPEEDS_MM);
    let alarms: Vec<String> = (0..clean).into_par_iter().filter_map(|number| false_alarm(&scenes, number)).collect();
    println!("\n{} false alarms in {clean} windows without a fault", alarms.len());
    alarms.iter().take(20).for_each(|alarm| println!("  {alarm}"));
}

/// Renders a scene for each pair of object and speed, with its speed.
fn render_scenes<const M: usize, const N: usize>(objects: [Object; M], speeds_mm: [f64; N]) -> Vec<(f64, MovingScene)> {
    let noise = || NOISE.into_iter().cycle();
    let each = |object| speeds_mm.into_iter().zip(noise()).map(move |(mm, noise)| (object, mm, noise));
    let render = |(object, mm, noise)| (mm, MovingScene::new(object, SIZE_PX, mm, POSES, noise));
    objects.into_iter().flat_map(each).map(render).collect()
}

/// Scene, camera, number of steps and first step of a trial. Over the numbers, all combinations are evenly spread.
fn trial_setting(scenes: &[(f64, MovingScene)], number: usize) -> (&(f64, MovingScene), usize, usize, usize) {
    let steps = STEPS[number % STEPS.len()];
    let rest = number / STEPS.len();
    (&scenes[rest % scenes.len()], rest / scenes.len() % 2, steps, rest / 7 % steps)
}

fn run_trial(scenes: &[(f64, MovingScene)], number: usize) -> Trial {
    let kind = 1 + number % KINDS.len();
    let ((mm, scene), camera, steps, first_step) = trial_setting(scenes, number / KINDS.len());
    let mut rng = seeded_rng(number as u64);
    let images = steps + usual_extra_images(steps);
    let injection = Injection::draw(kind, steps, images, &mut rng);
    let seed = 50_000 + number as u64;
    let window = scene.window(camera, steps, first_step, injection, seed);
    let fault = find_fault(&window, SIZE_PX, steps, first_step);
    let expected = injection.fault();
    let clean = scene.window(camera, steps, first_step, Injection::None, seed);
    let motion_rad = motion_rad(&clean, SIZE_PX, steps, first_step);
    let check = SequenceCheck::new(&shifts_rad(steps), first_step, images);
    let share = expected.map_or(0.0, |kind| check.residual_share(kind, motion_rad));
    Trial {
        row: (kind, steps, *mm > 0.0),
        is_found: fault.is_some(),
        is_correct: expected.is_some() && fault.map(|fault| fault.kind) == expected,
        // A frozen image is always visible: it equals the one before.
        is_visible: matches!(injection, Injection::Frozen(_)) || share >= check.least_residual_share(),
        description: format!(
            "{injection:?}, {steps} steps, {mm} mm, {motion_rad:.3} rad, residual share {share:.3}: {fault:?}"
        ),
    }
}

fn print_table(trials: &[Trial]) {
    let mut rows: BTreeMap<(usize, usize, bool), Row> = BTreeMap::new();
    for trial in trials {
        let row = rows.entry(trial.row).or_default();
        row.injected += 1;
        row.found += usize::from(trial.is_found);
        row.correct += usize::from(trial.is_correct);
        row.invisible += usize::from(!trial.is_found && !trial.is_visible);
        row.missed += usize::from(!trial.is_found && trial.is_visible);
    }
    println!(
        "{:<10}{:>4}{:>9}{:>10}{:>8}{:>9}{:>11}{:>8}",
        "kind", "N", "", "injected", "found", "correct", "invisible", "missed"
    );
    let mut all = Row::default();
    for ((kind, steps, moving), row) in &rows {
        let Row { injected, found, correct, invisible, missed } = row;
        let motion = if *moving { "moving" } else { "still" };
        println!(
            "{:<10}{steps:>4}{motion:>9}{injected:>10}{found:>8}{correct:>9}{invisible:>11}{missed:>8}",
            KINDS[kind - 1]
        );
        all.injected += injected;
        all.found += found;
        all.correct += correct;
        all.invisible += invisible;
        all.missed += missed;
    }
    let Row { injected, found, correct, invisible, missed } = all;
    println!("{:<23}{injected:>10}{found:>8}{correct:>9}{invisible:>11}{missed:>8}", "all");
    for trial in trials.iter().filter(|trial| !trial.is_found && trial.is_visible).take(20) {
        println!("missed: {}", trial.description);
    }
}

/// Describes the fault found in a window without one; `None` if none is found.
fn false_alarm(scenes: &[(f64, MovingScene)], number: usize) -> Option<String> {
    let ((mm, scene), camera, steps, first_step) = trial_setting(scenes, number);
    let window = scene.window(camera, steps, first_step, Injection::None, 1_000_000 + number as u64);
    let fault = find_fault(&window, SIZE_PX, steps, first_step)?;
    Some(format!("{steps} steps, {mm} mm, camera {}: {fault:?}", camera + 1))
}
