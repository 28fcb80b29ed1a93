//! What an image costs: time of the capture service on a processor, against one copy of the image in this machine.

use std::hint::black_box;
use std::time::Instant;

use super::super::capture::Capture;
use crate::scenes;
use crate::support::Bench;

/// Width and height of a real camera's image.
const BYTES: usize = 1280 * 1024;
/// Images of a measurement, and measurements: the least is that which this busy machine disturbed least.
const IMAGES: usize = 40;
const MEASUREMENTS: usize = 6;
/// More images than the caches of any processor hold.
const COPIES: usize = 32;

#[test]
#[ignore = "runs in the virtual machine"]
fn an_image_costs_little_more_than_its_copy() {
    let _vivid = super::load();
    // A lower rate than that of the size: while it draws an image, vivid locks out who asks for the one before.
    let bench = Bench::of(&super::scanner_of(&scenes::large(), "1280x720@25", ""));
    let mut capture = Capture::start(&bench);
    capture.images(IMAGES);
    let images_us = (0..MEASUREMENTS).map(|_| image_us(&mut capture));
    let image_us = images_us.fold(f64::INFINITY, f64::min);
    capture.stop();
    let copy_us = (0..MEASUREMENTS).map(|_| copy_us()).fold(f64::INFINITY, f64::min);
    eprintln!("capture {image_us:.0} µs an image, a copy {copy_us:.0} µs: {:.2} copies", image_us / copy_us);
}

/// Mean time on a processor that an image takes.
fn image_us(capture: &mut Capture<'_>) -> f64 {
    let (before_ns, before) = (capture.processor_ns(), capture.counts().passed);
    capture.images(IMAGES);
    let (busy_ns, images) = (capture.processor_ns() - before_ns, capture.counts().passed - before);
    busy_ns as f64 * 1e-3 / images as f64
}

/// Mean time of a copy of an image between places that are in no cache.
fn copy_us() -> f64 {
    let from: Vec<Vec<u8>> = (0..COPIES).map(|k| vec![k as u8; BYTES]).collect();
    let mut to = from.clone();
    let start = Instant::now();
    for (to, from) in to.iter_mut().zip(&from) {
        black_box(to).copy_from_slice(black_box(from));
    }
    start.elapsed().as_secs_f64() * 1e6 / COPIES as f64
}
