//! Loses, duplicates and swaps images of rendered windows without a trace, and prints what of it is found by the images
//! alone; and how many windows in which nothing is wrong are refused.
//!
//! ```text
//! cargo run --release --example sequence_faults [INJECTIONS [CLEAN]]      by default 4000 and 10000
//! ```
//!
//! Images have 128 × 96 pixels: the middle of those of 640 × 512, with the same fringes, so that motions are the same too.
//! What nobody can see is reckoned from the motion that is measured where nothing is wrong.

#![expect(
    clippy::print_stdout,
    clippy::unwrap_used,
    reason = "it prints what it finds, and cannot go on without a scene"
)]

#[path = "../tests/sequence_faults/scenes.rs"]
mod scenes;

use std::collections::BTreeMap;

use rayon::prelude::*;

use fringeflow::phase::{SequenceCheck, usual_extra_images};
use fringeflow_lab::simulation::{NoiseLevel, Object};

use scenes::{Injection, MovingScene, motion_rad, random, shifts_rad, told};

const SIZE_PX: [usize; 2] = [128, 96];
const OBJECTS: [Object; 3] = [Object::Nose, Object::Elephant, Object::Machine];
/// Millimetres from image to image.
const SPEEDS_MM: [f64; 5] = [0.0, 0.05, 0.1, 0.2, 0.3];
/// Of the windows in which nothing is wrong: others, that no threshold of the check was chosen by.
const CLEAN_OBJECTS: [Object; 3] = [Object::Prism, Object::Teeth, Object::Clutter];
const CLEAN_SPEEDS_MM: [f64; 5] = [0.0, 0.07, 0.15, 0.25, 0.4];
const NOISE: [NoiseLevel; 2] = [NoiseLevel::Normal, NoiseLevel::High];
const STEPS: [usize; 4] = [3, 4, 8, 16];
/// Images that the longest window with the longest loss reaches over.
const POSES: usize = 32;
const KINDS: [&str; 6] = ["slip", "lost", "frozen", "repeated", "skipped", "swapped"];

/// What became of the injections of a kind.
#[derive(Default)]
struct Row {
    injected: usize,
    found: usize,
    rightly: usize,
    invisible: usize,
    missed: usize,
}

/// What became of one.
struct Trial {
    place: (usize, usize, bool),
    is_found: bool,
    is_rightly: bool,
    is_visible: bool,
    what: String,
}

fn main() {
    let number = |k: usize, usual: usize| std::env::args().nth(k).map_or(usual, |text| text.parse().unwrap());
    let (injections, clean) = (number(1, 4000), number(2, 10_000));
    let scenes = scenes_of(OBJECTS, SPEEDS_MM);
    let trials: Vec<Trial> = (0..injections).into_par_iter().map(|number| trial(&scenes, number)).collect();
    print(&trials);
    let scenes = scenes_of(CLEAN_OBJECTS, CLEAN_SPEEDS_MM);
    let alarms: Vec<String> = (0..clean).into_par_iter().filter_map(|number| false_alarm(&scenes, number)).collect();
    println!("\n{} false alarms over {clean} windows in which nothing is wrong", alarms.len());
    alarms.iter().take(20).for_each(|alarm| println!("  {alarm}"));
}

fn scenes_of<const M: usize, const N: usize>(objects: [Object; M], speeds_mm: [f64; N]) -> Vec<(f64, MovingScene)> {
    let noise = || NOISE.into_iter().cycle();
    let each = |object| speeds_mm.into_iter().zip(noise()).map(move |(mm, noise)| (object, mm, noise));
    let of = |(object, mm, noise)| (mm, MovingScene::new(object, SIZE_PX, mm, POSES, noise));
    objects.into_iter().flat_map(each).map(of).collect()
}

/// Scene, camera, number of steps and first step of a trial; evenly spread.
fn setting(scenes: &[(f64, MovingScene)], number: usize) -> (&(f64, MovingScene), usize, usize, usize) {
    let steps = STEPS[number % STEPS.len()];
    let rest = number / STEPS.len();
    (&scenes[rest % scenes.len()], rest / scenes.len() % 2, steps, rest / 7 % steps)
}

fn trial(scenes: &[(f64, MovingScene)], number: usize) -> Trial {
    let kind = 1 + number % KINDS.len();
    let ((mm, scene), camera, steps, first_step) = setting(scenes, number / KINDS.len());
    let mut rng = random(number as u64);
    let images = steps + usual_extra_images(steps);
    let injection = Injection::draw(kind, steps, images, &mut rng);
    let seed = 50_000 + number as u64;
    let window = scene.window(camera, steps, first_step, injection, seed);
    let fault = told(&window, SIZE_PX, steps, first_step);
    let expected = injection.fault();
    let clean = scene.window(camera, steps, first_step, Injection::None, seed);
    let motion_rad = motion_rad(&clean, SIZE_PX, steps, first_step);
    let check = SequenceCheck::new(&shifts_rad(steps), first_step, images);
    let share = expected.map_or(0.0, |kind| check.residual_share(kind, motion_rad));
    Trial {
        place: (kind, steps, *mm > 0.0),
        is_found: fault.is_some(),
        is_rightly: expected.is_some() && fault.map(|fault| fault.kind) == expected,
        is_visible: matches!(injection, Injection::Frozen(_)) || share >= check.least_residual_share(),
        what: format!("{injection:?}, {steps} steps, {mm} mm, {motion_rad:.3} rad, {share:.3} to be seen: {fault:?}"),
    }
}

fn print(trials: &[Trial]) {
    let mut rows: BTreeMap<(usize, usize, bool), Row> = BTreeMap::new();
    for trial in trials {
        let row = rows.entry(trial.place).or_default();
        row.injected += 1;
        row.found += usize::from(trial.is_found);
        row.rightly += usize::from(trial.is_rightly);
        row.invisible += usize::from(!trial.is_found && !trial.is_visible);
        row.missed += usize::from(!trial.is_found && trial.is_visible);
    }
    println!(
        "{:<10}{:>4}{:>9}{:>10}{:>8}{:>9}{:>11}{:>8}",
        "kind", "N", "", "injected", "found", "rightly", "invisible", "missed"
    );
    let mut all = Row::default();
    for ((kind, steps, moving), row) in &rows {
        let Row { injected, found, rightly, invisible, missed } = row;
        let motion = if *moving { "moving" } else { "still" };
        println!(
            "{:<10}{steps:>4}{motion:>9}{injected:>10}{found:>8}{rightly:>9}{invisible:>11}{missed:>8}",
            KINDS[kind - 1]
        );
        all.injected += injected;
        all.found += found;
        all.rightly += rightly;
        all.invisible += invisible;
        all.missed += missed;
    }
    let Row { injected, found, rightly, invisible, missed } = all;
    println!("{:<23}{injected:>10}{found:>8}{rightly:>9}{invisible:>11}{missed:>8}", "all");
    for trial in trials.iter().filter(|trial| !trial.is_found && trial.is_visible).take(20) {
        println!("missed: {}", trial.what);
    }
}

fn false_alarm(scenes: &[(f64, MovingScene)], number: usize) -> Option<String> {
    let ((mm, scene), camera, steps, first_step) = setting(scenes, number);
    let window = scene.window(camera, steps, first_step, Injection::None, 1_000_000 + number as u64);
    let fault = told(&window, SIZE_PX, steps, first_step)?;
    Some(format!("{steps} steps, {mm} mm, camera {}: {fault:?}", camera + 1))
}
