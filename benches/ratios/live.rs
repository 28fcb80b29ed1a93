//! Latency of a window through all processes, relative to the same work in one process.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

use serde_json::Value;

use fringeflow_dataset::GreyImage;
use fringeflow_recording::{Recording, WindowPrior};

use super::bench::Bench;
use super::clock::median;
use super::line::{Report, Target, milliseconds};
use super::processors;
use super::scenes::{FULL_PX, bench_folder};

const NAME: &str = "last image received → cloud, p50, live ÷ in process";
const TARGET: f64 = 1.3;
/// Runs of the whole scanner, and their duration.
const ROUNDS: usize = 3;
const SECONDS: u64 = 10;

pub(crate) fn measure(bench: &mut Bench, report: &mut Report) {
    let Some(command) = command().filter(|_| bench.is_measured) else {
        return report.skipped(
            NAME,
            "the release command is missing; build it with cargo build --release -p fringeflow-command",
        );
    };
    match rounds(&command) {
        Ok(rounds) => {
            let median_ns = |side: usize| median(rounds.iter().map(|round| round[side]));
            let ratios: Vec<f64> = rounds.iter().map(|[live, in_process]| live / in_process).collect();
            let values = [median_ns(0), median_ns(1)].map(milliseconds);
            report.measurement(NAME, values, median(ratios.iter().copied()), &ratios, Target::AtMost(TARGET));
        }
        Err(why) => report.skipped(NAME, &why),
    }
}

/// The command in the target folder of this program.
fn command() -> Option<PathBuf> {
    let folder = std::env::current_exe().ok()?.parent()?.parent()?.to_owned();
    Some(folder.join("fringeflow")).filter(|file| file.is_file())
}

/// Latency live and in process by round, nanoseconds.
fn rounds(command: &Path) -> Result<Vec<[f64; 2]>, String> {
    let folder = bench_folder().join("live");
    std::fs::create_dir_all(&folder).map_err(|e| e.to_string())?;
    let (configuration, recording) = (configuration(&folder)?, folder.join("live.mcap"));
    // Use a new thread, because this one is pinned: the processes run on all CPUs, and so must the work in this
    // process.
    std::thread::scope(|scope| {
        let work = scope.spawn(|| {
            processors::pin(&processors::all());
            // The first run renders the images.
            (0..=ROUNDS)
                .map(|_| {
                    run(command, &folder, &configuration, &recording)?;
                    Ok([live_ns(command, &recording)?, in_process_ns(&recording)?])
                })
                .skip(1)
                .collect::<Result<Vec<_>, String>>()
        });
        work.join().map_err(|_| "it could not be measured; see the messages above".to_owned())?
    })
}

/// Writes the configuration of the demo, with fewer and larger images, other paths and without monitor and tracking.
fn configuration(folder: &Path) -> Result<PathBuf, String> {
    let demo = concat!(env!("CARGO_MANIFEST_DIR"), "/../configs/demo.toml");
    let text = std::fs::read_to_string(demo).map_err(|e| format!("{demo}: {e}"))?;
    let changes = [
        ("name = \"demo\"", "name = \"ratios\"".to_owned()),
        ("\"../demo-output/demo.images\"", format!("{:?}", folder.join("images"))),
        ("\"../demo-output\"", format!("{folder:?}")),
        ("size_px = [640, 512]", format!("size_px = {FULL_PX:?}")),
        ("rate_hz = 30.0", "rate_hz = 10.0".to_owned()),
        ("poses = 192", "poses = 16".to_owned()),
        ("object = \"elephant\"", "object = \"nose\"".to_owned()),
        ("travel_mm = [1.8, 1.5, 0.9]", "travel_mm = [0.1, 0.09, 0.016]".to_owned()),
        ("turn_deg = [7.2, 12.0, 3.0]", "turn_deg = [0.06, 0.1, 0.15]".to_owned()),
        ("every = 3", "every = 4".to_owned()),
        ("enabled = true", "enabled = false".to_owned()),
    ];
    let mut changed = text;
    for (from, to) in changes {
        if !changed.contains(from) {
            return Err(format!("configs/demo.toml has no {from}; adapt benches/ratios/live.rs"));
        }
        changed = changed.replace(from, &to);
    }
    let file = folder.join("live.toml");
    std::fs::write(&file, changed).map_err(|e| e.to_string())?;
    Ok(file)
}

fn run(command: &Path, folder: &Path, configuration: &Path, recording: &Path) -> Result<(), String> {
    let _ = std::fs::remove_file(recording);
    let mut run = Command::new(command);
    run.env("FRINGEFLOW_RUNTIME_DIR", folder.join("runtime")).env("FRINGEFLOW_LOG", "error");
    run.args(["run", "--no-report", "--seconds", &SECONDS.to_string(), "--record"]).arg(recording);
    run.arg("--config").arg(configuration).stdin(Stdio::null()).stdout(Stdio::null());
    match run.status() {
        // 3: done, but frames were dropped.
        Ok(status) if matches!(status.code(), Some(0 | 3)) => Ok(()),
        Ok(status) => Err(format!("fringeflow run ended with {status}; see its messages above")),
        Err(e) => Err(format!("{}: {e}", command.display())),
    }
}

/// Median time from the arrival of the images on the machine to the cloud, without the time of the camera.
fn live_ns(command: &Path, recording: &Path) -> Result<f64, String> {
    let output =
        Command::new(command).arg("latency").arg(recording).arg("--json").output().map_err(|e| e.to_string())?;
    let figures: Value =
        serde_json::from_slice(&output.stdout).map_err(|e| format!("fringeflow latency --json: {e}"))?;
    let segments = figures["segments"].as_array().ok_or("fringeflow latency --json printed no segments")?;
    let camera = segments.iter().find(|segment| segment["segment"] == "camera").ok_or("no segment camera")?;
    let p50_ms = |latency: &Value| latency["p50_ms"].as_f64().ok_or("no p50_ms: no window became a cloud");
    Ok((p50_ms(&figures["exposure_to_cloud"])? - p50_ms(&camera["latency"])?) * 1e6)
}

/// Median time of the same windows in this process, with as many threads as each service has.
fn in_process_ns(recording: &Path) -> Result<f64, String> {
    // Use a new pool: that of this program has only one thread, which waits for this one.
    rayon::ThreadPoolBuilder::new().build().map_err(|e| e.to_string())?.install(|| {
        let recording = Recording::open(recording).map_err(|e| e.to_string())?;
        let mut reconstructor = fringeflow_replay::reconstructor(&recording).map_err(|e| e.to_string())?;
        let priors = recording.priors().map_err(|e| e.to_string())?;
        let mut times_ns = Vec::new();
        for header in recording.cloud_headers() {
            // The first windows may have started before the recording.
            let Ok(images) = recording.images(&header.window) else { continue };
            let [cam1, cam2] = images.each_ref().map(|images| GreyImage::levels_of(images));
            let WindowPrior::Used(known) = priors.used_by(&header.window) else { continue };
            let start = Instant::now();
            let result = reconstructor.reconstruct(header.window.first_step as usize, &cam1, &cam2, known);
            times_ns.push(start.elapsed().as_nanos() as f64);
            result.map_err(|e| e.to_string())?;
        }
        Ok(median(times_ns))
    })
}
