//! What an image costs: time of the capture service on a processor, against one copy of the image in this machine.

use std::hint::black_box;
use std::time::Instant;

use super::super::capture::Capture;
use crate::scenes;
use crate::support::Bench;

/// Images that are measured.
const IMAGES: usize = 100;
/// More images than the caches of any processor hold.
const COPIES: usize = 64;

#[test]
#[ignore = "runs in the virtual machine"]
fn an_image_costs_little_more_than_its_copy() {
    let _vivid = super::load();
    // A lower rate than that of the size: while it draws an image, vivid locks out who asks for the one before.
    let bench = Bench::of(&super::scanner_of(&scenes::large(), "1280x720@25", ""));
    let mut capture = Capture::start(&bench);
    capture.images(20);
    let (before_ns, before) = (capture.processor_ns(), capture.counts().passed);
    capture.images(IMAGES);
    let (busy_ns, images) = (capture.processor_ns() - before_ns, capture.counts().passed - before);
    capture.stop();
    let (image_ns, copy_ns) = (busy_ns as f64 / images as f64, copy_ns(1280 * 1024));
    eprintln!(
        "capture {:.0} µs an image, a copy of it {:.0} µs: {:.2} copies",
        image_ns * 1e-3,
        copy_ns * 1e-3,
        image_ns / copy_ns
    );
}

/// Mean time of a copy of so many bytes between places that are in no cache.
fn copy_ns(bytes: usize) -> f64 {
    let from: Vec<Vec<u8>> = (0..COPIES).map(|k| vec![k as u8; bytes]).collect();
    let mut to = from.clone();
    let start = Instant::now();
    for (to, from) in to.iter_mut().zip(&from) {
        black_box(to).copy_from_slice(black_box(from));
    }
    start.elapsed().as_nanos() as f64 / COPIES as f64
}
