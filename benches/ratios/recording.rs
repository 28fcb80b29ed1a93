//! Recording images, relative to a plain write of as many bytes through the page cache, on a disk and in memory. Both
//! are synchronized at the end. The plain write fills pages that the one before it set free, so it costs the
//! kernel the least that it can: pages that were never used cost several times as much.
//!
//! Like those of cameras, images are pushed only when the previous ones are being written. Pushed all at once, they
//! would fill the queue and touch its memory for the first time, which does not happen in longer recordings.

use std::fs::File;
use std::io::Write as _;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use fringeflow_dataset::{GreyImage, Setup};
use fringeflow_message::{FrameHeader, PixelFormat};
use fringeflow_recording::{Opening, Origin, Recordable, Recorder};

use super::bench::Bench;
use super::clock::{contender, interleave};
use super::line::{Report, Target, Time};
use super::scenes::bench_folder;

/// Largest ratio, on the disk and in memory. In memory our copy comes on top of the write.
const TARGET: f64 = 1.15;
/// A folder of a file system in memory.
const MEMORY_FOLDER: &str = "/dev/shm";
/// Image pairs per recording, and a queue that could hold them all.
const PAIRS: u64 = 40;
const QUEUE_BYTES: usize = 1 << 30;
/// Number of waiting images at which no further one is pushed, and the time between checks.
const MAX_WAITING: usize = 2;
const POLL_INTERVAL: Duration = Duration::from_micros(200);

/// Images to record.
struct Images {
    setup: Setup,
    size_px: [usize; 2],
    /// The images of each camera. They are shared and unchanged until dropped, like those in the memory of a channel.
    cameras: [Vec<Arc<[u8]>>; 2],
    /// Image pairs per recording.
    pairs: u64,
}

pub(crate) fn measure(bench: &mut Bench, report: &mut Report) {
    let easy = bench.easy();
    let shared = |image: &GreyImage| Arc::<[u8]>::from(image.pixels.as_slice());
    let images = Images {
        setup: Setup::parse(easy.scene.setup_text(), None).unwrap(),
        size_px: bench.size_px,
        cameras: easy.images.cameras.each_ref().map(|images| images.iter().map(shared).collect()),
        pairs: if bench.is_measured { PAIRS } else { 1 },
    };
    let repetitions = bench.repetitions.min(9);
    compare(&images, &bench_folder(), repetitions, report, "on the disk");
    let in_memory = "in memory";
    match tempfile::tempdir_in(MEMORY_FOLDER) {
        Ok(folder) => compare(&images, folder.path(), repetitions, report, in_memory),
        Err(e) => report.skipped(&format!("recording {in_memory}"), &format!("{MEMORY_FOLDER}: {e}")),
    }
}

/// Compares both ways to write in a folder, by time per MB.
fn compare(images: &Images, folder: &Path, repetitions: usize, report: &mut Report, place: &str) {
    let [recording, plain] = [folder.join("ratio.mcap"), folder.join("plain.bytes")];
    images.record(&recording);
    let bytes = std::fs::metadata(&recording).unwrap().len() as usize;
    let record = contender(|| images.record(&recording));
    let write = contender(|| images.write(&plain, bytes));
    let spent = interleave(repetitions, &mut [record, write]);
    let megabytes = bytes as f64 * 1e-6;
    for (time, name) in [(Time::Cpu, "CPU"), (Time::Wall, "wall")] {
        let name = format!("recording {place} ÷ plain write, {name} a MB");
        let sides = [(&spent[0][..], megabytes), (&spent[1][..], megabytes)];
        report.scaled_ratio(&name, sides, time, Target::AtMost(TARGET));
    }
    [recording, plain].iter().for_each(|file| std::fs::remove_file(file).unwrap());
}

impl Images {
    fn image(&self, camera: usize, number: u64) -> &Arc<[u8]> {
        &self.cameras[camera][number as usize % 4]
    }

    fn record(&self, target: &Path) {
        let opening = Opening { setup: &self.setup, configuration: "", origin: &Origin::here(), min_free_bytes: 0 };
        let _ = std::fs::remove_file(target);
        let recorder = Recorder::create(target, &opening, QUEUE_BYTES).unwrap();
        for number in 0..self.pairs {
            for camera in 0..2 {
                while recorder.waiting() >= MAX_WAITING {
                    std::thread::sleep(POLL_INTERVAL);
                }
                let header = header(self.size_px, camera as u32 + 1, number);
                let image = Arc::clone(self.image(camera, number));
                recorder.push_held(&header, image, |header, image| Recordable::Frame { header, image });
            }
        }
        recorder.finish().unwrap();
    }

    fn write(&self, target: &Path, bytes: usize) {
        let mut file = File::create(target).unwrap();
        let mut left = bytes;
        for number in 0.. {
            let image = self.image(number as usize % 2, number / 2);
            let part = &image[..image.len().min(left)];
            file.write_all(part).unwrap();
            left -= part.len();
            if left == 0 {
                break;
            }
        }
        file.sync_all().unwrap();
    }
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
