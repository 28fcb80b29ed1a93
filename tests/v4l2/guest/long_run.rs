//! Long runs, started by hand. The variable `LONG_RUN` lists them, separated by commas. Each has format, seconds, images
//! per second, and the microseconds by which the period of camera 2 is longer. With an arrangement after the format, one
//! device gives both images:
//!
//! ```text
//! LONG_RUN="Y10P 60 10 0, YUYV:side-by-side 60 10 0" \
//!     cargo test -p fringeflow-command --test v4l2 -- --ignored --nocapture a_long_run
//! LONG_RUN="GREY 300 30 33" …     two cameras at 30.00 and 29.97 images per second that run free
//! ```
//!
//! The images are those that `fringeflow simulate --format` writes. The accounts must be exact: each image that was
//! written is taken, and passed or dropped with a reason.

use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

use fringeflow_message::{DropReason, Stage};
use fringeflow_pixels::{DeviceImages, SourceFormat, StereoLayout};

use crate::machine::SHARE;
use crate::scenes::{self, Scene};
use crate::support::{Bench, wait_until};

use super::loopback::{self, DEVICES, Shown, Ticking, camera_table};
use super::scanner::configuration;

const FILE: &str = "long_runs";

/// All runs, as `LONG_RUN` has them.
pub(crate) struct LongRuns {
    text: String,
    runs: Vec<LongRun>,
}

/// One run.
struct LongRun {
    text: String,
    format: SourceFormat,
    layout: Option<StereoLayout>,
    seconds: u64,
    rate_hz: f64,
    slower_us: u64,
}

impl LongRuns {
    /// Reads the list.
    pub(crate) fn parse(text: String) -> Self {
        let runs = text.split(',').map(|run| LongRun::parse(run.trim())).collect();
        Self { text, runs }
    }

    /// Time for all runs, seconds, with start and end of each pipeline.
    pub(crate) fn limit_s(&self) -> u64 {
        self.runs.iter().map(|run| 2 * run.seconds + 60).sum()
    }

    /// Makes the images in the share. Runs on the host.
    pub(crate) fn make(&self, share: &Path) {
        fs::write(share.join(FILE), &self.text).unwrap();
        for run in &self.runs {
            scenes::make_device_scene(share, &run.text, run.format, run.layout);
        }
    }
}

#[test]
#[ignore = "runs in the virtual machine"]
fn accounts_are_exact() {
    let _loopback = loopback::load();
    for run in LongRuns::parse(fs::read_to_string(Path::new(SHARE).join(FILE)).unwrap()).runs {
        run.check_accounts();
    }
}

impl LongRun {
    fn parse(text: &str) -> Self {
        let words: Vec<&str> = text.split_whitespace().collect();
        let [images, seconds, rate_hz, slower_us] = words[..] else { panic!("{text:?}") };
        let (format, layout) = images.split_once(':').map_or((images, None), |(format, layout)| (format, Some(layout)));
        let layout = layout.map(|name| StereoLayout::ALL.into_iter().find(|layout| layout.name() == name).unwrap());
        Self {
            text: text.to_owned(),
            format: format.parse().unwrap(),
            layout,
            seconds: seconds.parse().unwrap(),
            rate_hz: rate_hz.parse().unwrap(),
            slower_us: slower_us.parse().unwrap(),
        }
    }

    /// Runs the pipeline on the images, and compares its accounts with what was written.
    fn check_accounts(&self) {
        let scene = scenes::of_name(&self.text);
        let shown: Vec<Shown> =
            self.folders().iter().zip(DEVICES).map(|(folder, device)| self.show(&scene, folder, device)).collect();
        let bench = Bench::from_configuration(&self.configuration(&scene));
        let live = bench.start(&[]);
        let taken = || [Stage::Camera1, Stage::Camera2].map(|stage| bench.counts(stage).taken);
        live.wait_until("the first images are taken", || taken() == [1, 1]);
        let (start, period) = (Instant::now(), Duration::from_secs_f64(1.0 / self.rate_hz));
        let periods = [period, period + Duration::from_micros(self.slower_us)];
        let ticking: Vec<Ticking> =
            shown.into_iter().zip(periods).map(|(shown, period)| shown.tick(start, period)).collect();
        std::thread::sleep(Duration::from_secs(self.seconds));
        let written: Vec<u64> = ticking.into_iter().map(Ticking::stop).collect();
        // The last images may come late. If some never come, the counts are printed before the test fails.
        let _ = wait_until(|| taken().iter().zip(written.iter().cycle()).all(|(taken, written)| taken == written));
        let ended = live.quit();
        eprintln!("{}: written {written:?}", self.text);
        for stage in ["camera1", "camera2", "pairing", "windowing", "phase", "correspondence", "cloud"] {
            eprintln!("{stage}: {:?}", ended.stage(stage));
        }
        eprintln!("notices of skew: {}", ended.log.matches("cameras.max_skew_us allows").count());
        ended.assert_balanced();
        // Cameras that drift apart may complete no window.
        assert!(self.slower_us > 0 || ended.stage("cloud").passed > 0, "no cloud");
        for (camera, written) in ["camera1", "camera2"].into_iter().zip(written.iter().cycle()) {
            let counts = ended.stage(camera);
            assert_eq!(counts.taken, *written, "{camera}: {counts:?}");
            assert_eq!(counts.dropped(DropReason::BadImage), 0, "{camera}: {counts:?}");
        }
    }

    fn images(&self) -> DeviceImages {
        DeviceImages::new(self.format, None, self.layout).unwrap()
    }

    /// Folders of the images, one for each device.
    fn folders(&self) -> &'static [&'static str] {
        if self.images().holds_both_views() { &["both"] } else { &["cam1", "cam2"] }
    }

    /// Shows the images of a folder on a device.
    fn show(&self, scene: &Scene, folder: &str, device: &str) -> Shown {
        let size_px = self.images().image_px(scenes::DEVICE_SIZE_PX).unwrap().map(|side| side as u32);
        let images = (0..scenes::STEPS).map(|step| scene.device_image(folder, step)).collect();
        Shown::new(device, size_px, self.format.code().to_le_bytes(), images)
    }

    fn configuration(&self, scene: &Scene) -> String {
        // The first image stands until all services are ready.
        let table = |name: &str, device: &str| camera_table(name, device, "timeout_ms = 60000");
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
