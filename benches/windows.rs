//! Cost of the phase maps of a window by the number of steps, relative to a copy of its images:
//! `cargo bench --bench windows`.
//!
//! Measures for one camera: plain decoding of N images, the sequence check of the window, and decoding of the window (N
//! images and the extra ones) with motion.

// A program for people.
#![allow(clippy::print_stdout, clippy::unwrap_used)]

#[path = "../tests/sequence_faults/scenes.rs"]
#[allow(dead_code, reason = "only windows without faults are used here")]
mod scenes;

use std::hint::black_box;
use std::time::Instant;

use fringeflow::phase::{MotionFit, PhaseShifts, SequenceCheck, Validity, decode, decode_moving, usual_extra_images};
use fringeflow_base::grey::GreyLevels;
use fringeflow_dataset::GreyImage;
use fringeflow_lab::simulation::{NoiseLevel, Object};

use scenes::{Injection, MovingScene, shifts_rad};

const SIZE_PX: [usize; 2] = [640, 512];
const STEPS: [usize; 4] = [3, 4, 8, 16];
/// Motion from image to image, millimetres.
const SPEEDS_MM: [f64; 2] = [0.0, 0.1];
const ROUNDS: usize = 15;

fn main() {
    println!(
        "{} × {} pixels, one camera; median of {ROUNDS} rounds, relative to a copy of the window",
        SIZE_PX[0], SIZE_PX[1]
    );
    println!("{:>4}{:>12}{:>8}{:>8}{:>8}{:>10}", "N", "mm/image", "plain", "check", "moving", "copy µs");
    for mm_per_image in SPEEDS_MM {
        let images = STEPS[3] + usual_extra_images(STEPS[3]);
        let scene = MovingScene::new(Object::Nose, SIZE_PX, mm_per_image, images, NoiseLevel::Normal);
        for steps in STEPS {
            let [plain_us, check_us, moving_us, copy_us] = measure(&scene, steps);
            let copies = |us: f64| us / copy_us;
            println!(
                "{steps:>4}{mm_per_image:>12}{:>8.2}{:>8.2}{:>8.2}{copy_us:>10.0}",
                copies(plain_us),
                copies(check_us),
                copies(moving_us)
            );
        }
    }
}

/// Medians of decoding at rest, checking, decoding with motion, and copying the images, microseconds.
fn measure(scene: &MovingScene, steps: usize) -> [f64; 4] {
    let window = scene.window(0, steps, 0, Injection::None, 1);
    let levels: Vec<GreyLevels<'_>> = GreyImage::levels_of(&window);
    let [width, height] = SIZE_PX;
    let (cycle_rad, validity) = (shifts_rad(steps), Validity::default());
    let shifts = PhaseShifts::new(&cycle_rad).unwrap();
    let all_rad: Vec<f64> = cycle_rad.iter().copied().cycle().take(window.len()).collect();
    let fit = MotionFit::new(&all_rad).unwrap();
    let check = SequenceCheck::new(&cycle_rad, 0, window.len());
    let source = vec![1_u8; window.len() * width * height];
    let mut copy = source.clone();
    let mut times_us = [const { Vec::new() }; 4];
    let mut time = |place: usize, work: &mut dyn FnMut()| {
        let start = Instant::now();
        work();
        times_us[place].push(start.elapsed().as_secs_f64() * 1e6);
    };
    for _ in 0..ROUNDS {
        time(0, &mut || drop(black_box(decode(&levels[..steps], width, height, &shifts, &validity))));
        time(1, &mut || _ = black_box(check.find_fault(&levels, width, height, &validity)));
        time(2, &mut || drop(black_box(decode_moving(&levels, width, height, &fit, &validity))));
        time(3, &mut || black_box(&mut copy).copy_from_slice(black_box(&source)));
    }
    times_us.map(|mut times| {
        times.sort_by(f64::total_cmp);
        times[ROUNDS / 2]
    })
}
