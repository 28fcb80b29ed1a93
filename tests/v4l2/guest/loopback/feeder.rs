//! Feeds the cameras with pairs of images of all scenes, round after round. The next pair is shown when a period has
//! passed and the previous pair was taken, so a slow machine loses none.

use std::time::Instant;

use crate::scenes::{self, STEPS};

use super::writer::Writer;
use super::{DEVICES, PERIOD};

/// Shows images to both devices.
pub(crate) struct Feeder {
    writers: [Writer; 2],
    images: Vec<[Vec<u8>; 2]>,
    next: usize,
    last_shown: Instant,
}

impl Feeder {
    /// Opens both devices and shows the first pair.
    pub(crate) fn new() -> Self {
        let (_, size_px) = scenes::all()[0].image(1, 0);
        let writers = DEVICES.map(|device| Writer::open(device, size_px, b"GREY"));
        let mut feeder = Self { writers, images: images(), next: 0, last_shown: Instant::now() };
        feeder.show();
        feeder
    }

    /// Shows the next pair, at least a period after the previous one.
    pub(crate) fn show_next(&mut self) {
        std::thread::sleep((self.last_shown + PERIOD).saturating_duration_since(Instant::now()));
        self.show();
    }

    /// The image of a camera (1 or 2) that the driver numbers so.
    pub(crate) fn image(&self, camera: u32, number: u64) -> &[u8] {
        &self.images[number as usize % self.images.len()][camera as usize - 1]
    }

    /// Pairs shown so far; the driver numbers them from 0.
    pub(crate) fn shown(&self) -> usize {
        self.next
    }

    /// Pairs per round.
    pub(crate) fn round_pairs(&self) -> usize {
        self.images.len()
    }

    /// Shows the next pair.
    pub(crate) fn show(&mut self) {
        let pair = &self.images[self.next % self.images.len()];
        for (writer, image) in self.writers.iter_mut().zip(pair) {
            writer.show(image);
        }
        (self.next, self.last_shown) = (self.next + 1, Instant::now());
    }
}

/// The images of both cameras, scene by scene and step by step.
fn images() -> Vec<[Vec<u8>; 2]> {
    let scenes = scenes::all();
    let steps = scenes.iter().flat_map(|scene| (0..STEPS).map(move |step| (scene, step)));
    steps.map(|(scene, step)| [1, 2].map(|camera| scene.image(camera, step).0)).collect()
}
