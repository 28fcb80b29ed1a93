//! Feeds the cameras with pairs of images of all scenes, round after round: each camera through a device of its own, or
//! both side by side through one. The next pair is shown when a period has passed and the previous pair was taken, so a
//! slow machine loses none.

use std::time::Instant;

use crate::scenes::{self, STEPS};

use super::writer::Writer;
use super::{DEVICES, PERIOD};

/// Shows images to the devices.
pub(crate) struct Feeder {
    writers: Vec<Writer>,
    /// For each pair, the image of each device.
    shown: Vec<Vec<Vec<u8>>>,
    images: Vec<[Vec<u8>; 2]>,
    next: usize,
    last_shown: Instant,
}

impl Feeder {
    /// Opens a device for each camera and shows the first pair.
    pub(crate) fn new() -> Self {
        let writers = DEVICES.map(|device| Writer::open(device, size_px(), b"GREY"));
        Self::start(writers.into(), |[first, second]| vec![first.clone(), second.clone()])
    }

    /// Opens one device for both cameras and shows the first pair, side by side.
    pub(crate) fn side_by_side() -> Self {
        let [width, height] = size_px();
        let writer = Writer::open(DEVICES[0], [2 * width, height], b"GREY");
        Self::start(vec![writer], |pair| vec![side_by_side(pair, width as usize)])
    }

    fn start(writers: Vec<Writer>, shown: impl Fn(&[Vec<u8>; 2]) -> Vec<Vec<u8>>) -> Self {
        let images = images();
        let shown = images.iter().map(shown).collect();
        let mut feeder = Self { writers, shown, images, next: 0, last_shown: Instant::now() };
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
        let images = &self.shown[self.next % self.shown.len()];
        for (writer, image) in self.writers.iter_mut().zip(images) {
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

fn size_px() -> [u32; 2] {
    scenes::all()[0].image(1, 0).1
}

/// One image with the rows of both, that of camera 1 on the left.
fn side_by_side([left, right]: &[Vec<u8>; 2], width: usize) -> Vec<u8> {
    left.chunks(width).zip(right.chunks(width)).flat_map(|(left, right)| [left, right].concat()).collect()
}
