//! A long run, started by hand. The variable `LONG_RUN` has format, seconds, images per second, and the microseconds by
//! which the period of camera 2 is longer. With an arrangement after the format, one device gives both images:
//!
//! ```text
//! LONG_RUN="Y10P 60 10 0" cargo test -p fringeflow-command --test v4l2 -- --ignored --nocapture a_long_run
//! LONG_RUN="YUYV:side-by-side 60 10 0" …
//! LONG_RUN="GREY 300 30 33" …     two cameras at 30.00 and 29.97 images per second that run free
//! ```
//!
//! The images are those that `fringeflow simulate --format` writes. The accounts must be exact: each image that was
//! written is taken, and passed or dropped with a reason.

use std::fs;
use std::path::Path;
use std::time::Duration;

use fringeflow_message::{DropReason, Stage};
use fringeflow_pixels::{DeviceImages, SourceFormat, StereoLayout};

use crate::machine::SHARE;
use crate::scenes::{self, Scene};
use crate::support::Bench;

use super::loopback::{self, BUFFERS, DEVICES, TickingWriter};
use super::scanner::configuration;

const FILE: &str = "long_run";

/// What is run.
struct LongRun {
    format: SourceFormat,
    layout: Option<StereoLayout>,
    seconds: u64,
    rate_hz: f64,
    slower_us: u64,
}

/// Makes the images in the share. Runs on the host.
pub(crate) fn make(share: &Path, wanted: &str) {
    let run = LongRun::parse(wanted);
    fs::write(share.join(FILE), wanted).unwrap();
    scenes::make_device_scene(share, run.format, run.layout);
}

#[test]
#[ignore = "runs in the virtual machine"]
fn accounts_are_exact() {
    let run = LongRun::parse(&fs::read_to_string(Path::new(SHARE).join(FILE)).unwrap());
    let scene = scenes::device_scene();
    let _loopback = loopback::load();
    let writers: Vec<TickingWriter> =
        run.folders().iter().zip(0..).map(|(folder, n)| run.write(&scene, folder, n)).collect();
    let bench = Bench::from_configuration(&run.configuration(&scene));
    let live = bench.start(&[]);
    std::thread::sleep(Duration::from_secs(run.seconds));
    let written: Vec<u64> = writers.into_iter().map(TickingWriter::stop).collect();
    live.wait_until("the last images are taken", || {
        let taken = [Stage::Camera1, Stage::Camera2].map(|stage| bench.counts(stage).taken);
        taken.iter().zip(written.iter().cycle()).all(|(taken, written)| taken == written)
    });
    let ended = live.quit();
    for stage in ["camera1", "camera2", "pairing", "windowing", "phase", "cloud"] {
        eprintln!("{stage}: {:?}", ended.stage(stage));
    }
    eprintln!("written {written:?}; notices of skew: {}", ended.log.matches("cameras.max_skew_us allows").count());
    ended.assert_balanced();
    for (camera, written) in ["camera1", "camera2"].into_iter().zip(written.iter().cycle()) {
        let counts = ended.stage(camera);
        assert_eq!(counts.taken, *written, "{camera}: {counts:?}");
        assert_eq!(counts.dropped(DropReason::BadImage), 0, "{camera}: {counts:?}");
    }
}

impl LongRun {
    fn parse(text: &str) -> Self {
        let words: Vec<&str> = text.split_whitespace().collect();
        let [images, seconds, rate_hz, slower_us] = words[..] else { panic!("{text:?}") };
        let (format, layout) = images.split_once(':').map_or((images, None), |(format, layout)| (format, Some(layout)));
        let layout = layout.map(|name| StereoLayout::ALL.into_iter().find(|layout| layout.name() == name).unwrap());
        Self {
            format: format.parse().unwrap(),
            layout,
            seconds: seconds.parse().unwrap(),
            rate_hz: rate_hz.parse().unwrap(),
            slower_us: slower_us.parse().unwrap(),
        }
    }

    fn images(&self) -> DeviceImages {
        DeviceImages::new(self.format, None, self.layout).unwrap()
    }

    /// Folders of the images, one for each device.
    fn folders(&self) -> &'static [&'static str] {
        if self.images().holds_both_views() { &["both"] } else { &["cam1", "cam2"] }
    }

    /// Writes the images of a folder to device `number`.
    fn write(&self, scene: &Scene, folder: &str, number: usize) -> TickingWriter {
        let size_px = self.images().image_px(scenes::DEVICE_SIZE_PX).unwrap().map(|side| side as u32);
        let images = (0..scenes::STEPS).map(|step| scene.device_image(folder, step)).collect();
        let period = Duration::from_secs_f64(1.0 / self.rate_hz);
        let period = period + Duration::from_micros(self.slower_us) * number as u32;
        TickingWriter::start(DEVICES[number], size_px, self.format.code().to_le_bytes(), images, period)
    }

    fn configuration(&self, scene: &Scene) -> String {
        let table = |name: &str, device: &str| {
            format!("[cameras.{name}]\ndevice = \"{device}\"\nset_rate = false\nbuffers = {BUFFERS}\n")
        };
        let layout = self.layout.map_or_else(String::new, |layout| format!("stereo_layout = \"{}\"\n", layout.name()));
        let devices = match self.images().views() {
            2 => table("both", DEVICES[0]),
            _ => table("cam1", DEVICES[0]) + &table("cam2", DEVICES[1]),
        };
        let (rate_hz, format) = (self.rate_hz, self.format.name());
        let cameras = format!("rate_hz = {rate_hz:.3}\nformat = \"{format}\"\n{layout}{devices}");
        configuration(scene, &cameras, "[window]\nevery = 4\n")
    }
}
