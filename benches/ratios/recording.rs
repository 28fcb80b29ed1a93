//! Recording images, relative to writing as many bytes to the same disk. Both are synchronized to the disk at the end.
//!
//! Like those of cameras, images are pushed only when the previous ones are being written. Pushed all at once, they
//! would fill the queue and touch its memory for the first time, which does not happen in longer recordings.

use std::fs::File;
use std::io::Write as _;
use std::sync::Arc;
use std::time::Duration;

use fringeflow_dataset::{GreyImage, Setup};
use fringeflow_message::{FrameHeader, PixelFormat};
use fringeflow_recording::{Opening, Origin, Recorder};

use super::bench::Bench;
use super::clock::{contender, interleave};
use super::line::{Report, Target, Time};
use super::scenes::bench_folder;

const TARGET: f64 = 1.15;
/// Image pairs per recording, and a queue that could hold them all.
const PAIRS: u64 = 40;
const QUEUE_BYTES: usize = 1 << 30;
/// Number of waiting images at which no further one is pushed, and the time between checks.
const MAX_WAITING: usize = 2;
const POLL_INTERVAL: Duration = Duration::from_micros(200);

pub(crate) fn measure(bench: &mut Bench, report: &mut Report) {
    let easy = bench.easy();
    let setup = Setup::parse(easy.scene.setup_text(), None).unwrap();
    let pairs = if bench.is_measured { PAIRS } else { 1 };
    let folder = bench_folder();
    let [target, plain] = [folder.join("ratio.mcap"), folder.join("plain.bytes")];
    // Shared and unchanged until dropped, like images in the memory of a channel.
    let shared = |image: &GreyImage| Arc::<[u8]>::from(image.pixels.as_slice());
    let images = easy.images.cameras.each_ref().map(|images| images.iter().map(shared).collect::<Vec<_>>());
    let image = |camera: usize, number: u64| &images[camera][number as usize % 4];
    let record = || {
        let origin = Origin::here();
        let opening = Opening { setup: &setup, configuration: "", origin: &origin, min_free_bytes: 0 };
        let _ = std::fs::remove_file(&target);
        let recorder = Recorder::create(&target, &opening, QUEUE_BYTES).unwrap();
        for number in 0..pairs {
            for camera in 0..2 {
                while recorder.waiting() >= MAX_WAITING {
                    std::thread::sleep(POLL_INTERVAL);
                }
                let header = header(bench.size_px, camera as u32 + 1, number);
                recorder.push_held(&header, Arc::clone(image(camera, number)));
            }
        }
        recorder.finish().unwrap();
    };
    record();
    let bytes = std::fs::metadata(&target).unwrap().len();
    let write = || {
        let mut file = File::create(&plain).unwrap();
        let mut left = bytes as usize;
        for number in 0.. {
            let image = image(number as usize % 2, number / 2);
            let part = &image[..image.len().min(left)];
            file.write_all(part).unwrap();
            left -= part.len();
            if left == 0 {
                break;
            }
        }
        file.sync_all().unwrap();
    };
    let spent = interleave(bench.repetitions.min(9), &mut [contender(record), contender(write)]);
    for (time, name) in [(Time::Cpu, "CPU"), (Time::Wall, "wall")] {
        let name = format!("recording uncompressed ÷ plain write of {:.0} MB, {name}", bytes as f64 * 1e-6);
        report.ratio(&name, &spent[0], &spent[1], time, Target::AtMost(TARGET));
    }
    [target, plain].iter().for_each(|file| std::fs::remove_file(file).unwrap());
}

fn header([width, height]: [usize; 2], camera: u32, number: u64) -> FrameHeader {
    let exposure_start_ns = 1 + number * 16_000_000;
    FrameHeader {
        session: 1,
        sequence: number,
        published: number,
        exposure_start_ns,
        received_ns: exposure_start_ns + 9_000_000,
        exposure_ns: 4_000_000,
        width_px: width as u32,
        height_px: height as u32,
        stride_bytes: width as u32,
        pixel_format: PixelFormat::Grey.code(),
        flags: 0,
        camera,
    }
}
