//! Measures CPU time of the capture service per image, relative to one copy of the image on this machine.
//!
//! The result serves to notice changes; it is not that of a real machine. In emulation, the seven system calls per
//! image and the code around them take as long as two copies. On a real processor they take about a tenth of one.

use std::hint::black_box;
use std::time::{Duration, Instant};

use super::DEVICES;
use super::writer::Writer;
use crate::guest::capture::Capture;
use crate::scenes;
use crate::support::Bench;

/// Image size of a real camera.
pub(crate) const SIZE: &str = "1280x1024";
/// Images per measurement, and number of measurements. The least one was disturbed least by other work.
const IMAGES: usize = 40;
const MEASUREMENTS: usize = 4;
/// Time from one image to the next.
const PERIOD: Duration = Duration::from_millis(33);
/// Copies per measurement: more than the caches of any processor hold.
const COPIES: usize = 32;
/// Gaps between the copies, bytes. Depending on the relative position of source and target, a copy takes up to twice as
/// long on an emulated processor. The fastest one is the reference.
const GAPS: [usize; 8] = [0, 512, 1536, 4096, 3 * 4096, 7 * 4096, 15 * 4096, 31 * 4096];

#[test]
#[ignore = "runs in the virtual machine"]
fn an_image_costs_little_more_than_its_copy() {
    let scene = &scenes::of_name(SIZE);
    let _loopback = super::load();
    let (image, size_px) = scene.image(1, 0);
    let mut writer = Writer::open(DEVICES[0], size_px, b"GREY");
    writer.show(&image);
    let bench = Bench::from_configuration(&super::scanner(scene, "GREY", "timeout_ms = 60000"));
    let mut capture = Capture::start(&bench);
    capture.wait_for_images(1);
    let mut image_us = || {
        let before_ns = capture.cpu_ns();
        for _ in 0..IMAGES {
            std::thread::sleep(PERIOD);
            capture.act_and_wait_for_images(1, || writer.show(&image));
        }
        (capture.cpu_ns() - before_ns) as f64 * 1e-3 / IMAGES as f64
    };
    // Discard the first measurement, which touches memory for the first time.
    image_us();
    let image_us = minimum((0..MEASUREMENTS).map(|_| image_us()));
    capture.stop();
    let copy_us = minimum(GAPS.into_iter().map(|gap| copy_us(image.len(), gap)));
    eprintln!("capture {image_us:.0} µs per image, copy {copy_us:.0} µs: {:.2} copies", image_us / copy_us);
}

fn minimum(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(f64::INFINITY, f64::min)
}

/// Mean time to copy this number of bytes between uncached memory, microseconds.
fn copy_us(bytes: usize, gap: usize) -> f64 {
    let from: Vec<Vec<u8>> = (0..COPIES).map(|k| vec![k as u8; bytes + gap]).collect();
    let mut to = from.clone();
    let start = Instant::now();
    for (to, from) in to.iter_mut().zip(&from) {
        black_box(&mut to[gap..]).copy_from_slice(black_box(&from[..bytes]));
    }
    start.elapsed().as_secs_f64() * 1e6 / COPIES as f64
}
