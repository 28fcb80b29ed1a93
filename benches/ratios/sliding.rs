//! A window that slides by one image, relative to a window computed from scratch.

use std::hint::black_box;
use std::sync::Arc;

use fringeflow::phase::usual_extra_images;
use fringeflow_base::grey::GreyLevels;

use super::bench::{Bench, STEPS};
use super::clock::{contender, interleave};
use super::line::{Report, Target, Time};
use super::scenes::{Images, MOVING_IMAGES, Workers};

/// Target: largest time of a further cloud, relative to one from scratch.
const TARGET: f64 = 0.8;

pub(crate) fn measure(bench: &mut Bench, report: &mut Report) {
    let easy = bench.easy();
    let images = easy.scene.moving_images(STEPS);
    let new_workers = || Workers::with_table(&easy.scene, Arc::clone(&easy.table), STEPS);
    let mut sliding = new_workers();
    // Both contenders get the same windows in the same order.
    let [mut next_sliding, mut next_scratch] = [0, 1].map(|_| {
        let mut first = 0;
        move || {
            first = (first + 1) % (MOVING_IMAGES - window_images());
            first
        }
    });
    let mut contenders = [
        contender(|| {
            let first = next_sliding();
            _ = black_box(sliding.cloud(first % STEPS, &window(&images, first)));
        }),
        contender(|| {
            let first = next_scratch();
            _ = black_box(new_workers().cloud(first % STEPS, &window(&images, first)));
        }),
    ];
    let spent = interleave(bench.repetitions, &mut contenders);
    let name = "each further cloud of a sliding window ÷ one from scratch";
    report.ratio(name, &spent[0], &spent[1], Time::Cpu, Target::AtMost(TARGET));
}

/// Number of images of a window with motion compensation.
pub(crate) fn window_images() -> usize {
    STEPS + usual_extra_images(STEPS)
}

/// The window that starts with image `first`.
pub(crate) fn window(images: &Images, first: usize) -> [Vec<GreyLevels<'_>>; 2] {
    images.levels().map(|levels| levels[first..first + window_images()].to_vec())
}
