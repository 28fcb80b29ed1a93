//! What stands before the cameras: the images of all scenes, round after round, in pairs. The next pair is shown when its
//! time has come and the one before was taken, so that a slow machine loses none.

use std::time::Instant;

use crate::scenes::{self, STEPS};

use super::writer::Writer;
use super::{DEVICES, PERIOD};

/// Shows images to both devices.
pub(crate) struct Feeder {
    writers: [Writer; 2],
    images: Vec<[Vec<u8>; 2]>,
    next: usize,
    shown: Instant,
}

impl Feeder {
    /// Shows the first pair.
    pub(crate) fn new() -> Self {
        let (_, size_px) = scenes::all()[0].image(1, 0);
        let writers = DEVICES.map(|device| Writer::open(device, size_px, b"GREY"));
        let mut feeder = Self { writers, images: images(), next: 0, shown: Instant::now() };
        feeder.show();
        feeder
    }

    /// Shows the next pair, a period after the one before at the earliest.
    pub(crate) fn show_next(&mut self) {
        std::thread::sleep((self.shown + PERIOD).saturating_duration_since(Instant::now()));
        self.show();
    }

    /// The image that a camera (1 or 2) has of a number of the driver.
    pub(crate) fn image(&self, camera: u32, number: u64) -> &[u8] {
        &self.images[number as usize % self.images.len()][camera as usize - 1]
    }

    /// Pairs shown so far; the driver numbers them from 0.
    pub(crate) fn shown(&self) -> usize {
        self.next
    }

    /// Pairs of a round.
    pub(crate) fn round(&self) -> usize {
        self.images.len()
    }

    /// Shows the next pair.
    pub(crate) fn show(&mut self) {
        let pair = &self.images[self.next % self.images.len()];
        for (writer, image) in self.writers.iter_mut().zip(pair) {
            writer.show(image);
        }
        (self.next, self.shown) = (self.next + 1, Instant::now());
    }
}

/// The images of both cameras, scene by scene and step by step.
fn images() -> Vec<[Vec<u8>; 2]> {
    let scenes = scenes::all();
    let steps = scenes.iter().flat_map(|scene| (0..STEPS).map(move |step| (scene, step)));
    steps.map(|(scene, step)| [1, 2].map(|camera| scene.image(camera, step).0)).collect()
}
