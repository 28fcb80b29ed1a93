//! The way of a window through all processes, against the same work in one.

use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::Instant;

use serde_json::Value;

use fringeflow_dataset::GreyImage;
use fringeflow_recording::{Recording, WindowPrior};

use super::bench::Bench;
use super::clock::median;
use super::line::{Report, Wanted, milliseconds};
use super::processors;
use super::scenes::{FULL_PX, bench_folder};

const NAME: &str = "last image received → cloud, p50, live ÷ in process";
const WANTED: f64 = 1.3;
/// Runs of the whole scanner, and how long each is.
const ROUNDS: usize = 3;
const SECONDS: u64 = 10;

pub(crate) fn measure(bench: &mut Bench, report: &mut Report) {
    let Some(command) = command().filter(|_| bench.is_measured) else {
        return report
            .skipped(NAME, "there is no release command; cargo build --release -p fringeflow-command makes it");
    };
    match rounds(&command) {
        Ok(rounds) => {
            let of = |side: usize| median(rounds.iter().map(|round| round[side]));
            let ratios: Vec<f64> = rounds.iter().map(|[live, in_process]| live / in_process).collect();
            let values = [of(0), of(1)].map(milliseconds);
            report.figure(NAME, values, median(ratios.iter().copied()), &ratios, Wanted::AtMost(WANTED));
        }
        Err(why) => report.skipped(NAME, &why),
    }
}

/// The command beside which cargo built this program.
fn command() -> Option<PathBuf> {
    let folder = std::env::current_exe().ok()?.parent()?.parent()?.to_owned();
    Some(folder.join("fringeflow")).filter(|file| file.is_file())
}

/// Nanoseconds live and in process, round by round.
fn rounds(command: &Path) -> Result<Vec<[f64; 2]>, String> {
    let folder = bench_folder().join("live");
    std::fs::create_dir_all(&folder).map_err(|e| e.to_string())?;
    let (configuration, recording) = (configuration(&folder)?, folder.join("live.mcap"));
    // A thread of its own, since this one is pinned: processes run on all processors, and so must the work in this one.
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
        work.join().map_err(|_| "it could not be measured; why stands above".to_owned())?
    })
}

/// The demo as it is but for its images: larger and fewer ones, and other places for its files.
fn configuration(folder: &Path) -> Result<PathBuf, String> {
    let demo = concat!(env!("CARGO_MANIFEST_DIR"), "/../configs/demo.toml");
    let text = std::fs::read_to_string(demo).map_err(|e| format!("{demo}: {e}"))?;
    let changes = [
        ("name = \"demo\"", "name = \"ratios\"".to_owned()),
        ("\"../demo-output/demo.images\"", format!("{:?}", folder.join("images"))),
        ("\"../demo-output\"", format!("{folder:?}")),
        ("size_px = [640, 512]", format!("size_px = {FULL_PX:?}")),
        ("rate_hz = 30.0", "rate_hz = 10.0".to_owned()),
        ("poses = 240", "poses = 16".to_owned()),
        ("object = \"elephant\"", "object = \"nose\"".to_owned()),
        ("travel_mm = [12.0, 9.0, 2.0]", "travel_mm = [0.1, 0.09, 0.016]".to_owned()),
        ("turn_deg = [12.0, 26.0, 8.0]", "turn_deg = [0.06, 0.1, 0.15]".to_owned()),
        ("every = 3", "every = 4".to_owned()),
        ("enabled = true", "enabled = false".to_owned()),
    ];
    let mut changed = text;
    for (from, to) in changes {
        if !changed.contains(from) {
            return Err(format!("configs/demo.toml has no {from}: benches/ratios/live.rs does not fit it"));
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
        Ok(status) => Err(format!("fringeflow run ended with {status}; what it said stands above")),
        Err(e) => Err(format!("{}: {e}", command.display())),
    }
}

/// From when the images had reached the machine until the cloud was out: without the time of the camera.
fn live_ns(command: &Path, recording: &Path) -> Result<f64, String> {
    let told = Command::new(command).arg("latency").arg(recording).arg("--json").output().map_err(|e| e.to_string())?;
    let figures: Value = serde_json::from_slice(&told.stdout).map_err(|e| format!("fringeflow latency --json: {e}"))?;
    let segments = figures["segments"].as_array().ok_or("fringeflow latency --json tells no segments")?;
    let camera = segments.iter().find(|segment| segment["segment"] == "camera").ok_or("no segment camera")?;
    let p50_ms = |latency: &Value| latency["p50_ms"].as_f64().ok_or("no p50_ms: no window became a cloud");
    Ok((p50_ms(&figures["exposure_to_cloud"])? - p50_ms(&camera["latency"])?) * 1e6)
}

/// The same windows in one process, with as many threads as each service has.
fn in_process_ns(recording: &Path) -> Result<f64, String> {
    // The pool of this program has one thread, which waits for this one.
    rayon::ThreadPoolBuilder::new().build().map_err(|e| e.to_string())?.install(|| {
        let recording = Recording::open(recording).map_err(|e| e.to_string())?;
        let mut reconstructor = fringeflow_replay::reconstructor(&recording).map_err(|e| e.to_string())?;
        let priors = recording.priors().map_err(|e| e.to_string())?;
        let mut taken_ns = Vec::new();
        for header in recording.cloud_headers() {
            // The first windows may have begun before the recording.
            let Ok(images) = recording.images(&header.window) else { continue };
            let [cam1, cam2] = images.each_ref().map(|images| GreyImage::levels_of(images));
            let WindowPrior::Used(known) = priors.used_by(&header.window) else { continue };
            let start = Instant::now();
            let made = reconstructor.reconstruct(header.window.first_step as usize, &cam1, &cam2, known);
            taken_ns.push(start.elapsed().as_nanos() as f64);
            made.map_err(|e| e.to_string())?;
        }
        Ok(median(taken_ns))
    })
}
