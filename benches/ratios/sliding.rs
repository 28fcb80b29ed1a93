//! A window that slides by one image, against one that nobody saw anything of.

use std::hint::black_box;
use std::sync::Arc;

use fringeflow::phase::usual_extra_images;
use fringeflow_base::grey::GreyLevels;

use super::bench::{Bench, STEPS};
use super::clock::{contender, interleave};
use super::line::{Report, Time, Wanted};
use super::scenes::{Images, MOVING_IMAGES, Workers};

/// A further cloud in one from scratch.
const WANTED: f64 = 0.8;

pub(crate) fn measure(bench: &mut Bench, report: &mut Report) {
    let easy = bench.easy();
    let images = easy.scene.moving_images(STEPS);
    let new = || Workers::with_table(&easy.scene, Arc::clone(&easy.table), STEPS);
    let mut sliding = new();
    // Both see the same windows in the same order.
    let [mut next, mut same] = [0, 1].map(|_| {
        let mut first = 0;
        move || {
            first = (first + 1) % (MOVING_IMAGES - window_images());
            first
        }
    });
    let mut contenders = [
        contender(|| {
            let first = next();
            _ = black_box(sliding.cloud(first % STEPS, &window(&images, first)));
        }),
        contender(|| {
            let first = same();
            _ = black_box(new().cloud(first % STEPS, &window(&images, first)));
        }),
    ];
    let spent = interleave(bench.repetitions, &mut contenders);
    let name = "each further cloud of a sliding window ÷ one from scratch";
    report.ratio(name, &spent[0], &spent[1], Time::Cpu, Wanted::AtMost(WANTED));
}

/// Images of a window that compensates motion.
pub(crate) fn window_images() -> usize {
    STEPS + usual_extra_images(STEPS)
}

/// The window that begins with an image.
pub(crate) fn window(images: &Images, first: usize) -> [Vec<GreyLevels<'_>>; 2] {
    images.levels().map(|levels| levels[first..first + window_images()].to_vec())
}
