//! What stands before the cameras: the images of all scenes, round after round, in pairs. The next pair is shown when its
//! time has come and the one before was taken, so that a slow machine loses none.

use std::fs::File;
use std::io::Write;
use std::time::Instant;

use crate::scenes::{self, STEPS};

use super::{DEVICES, PERIOD};

/// Shows images to both devices; they are cameras as long as this lives.
pub(crate) struct Feeder {
    devices: [File; 2],
    images: Vec<[Vec<u8>; 2]>,
    next: usize,
    shown: Instant,
}

impl Feeder {
    /// Shows the first pair: before, the devices do not say that they are cameras.
    pub(crate) fn new() -> Self {
        let devices = DEVICES.map(|device| File::options().write(true).open(device).unwrap());
        let mut feeder = Self { devices, images: images(), next: 0, shown: Instant::now() };
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

    fn show(&mut self) {
        let pair = &self.images[self.next % self.images.len()];
        for (device, image) in self.devices.iter_mut().zip(pair) {
            assert_eq!(device.write(image).unwrap(), image.len());
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
