//! `fringeflow simulate --config`: records the output of a virtual scanner, with the true poses of the object.

use std::io::Write as _;
use std::path::Path;

use fringeflow_lab::simulation::VirtualScanner;
use fringeflow_recording::{OfflineRecorder, Opening, Origin, Topic};

use crate::failure::Failure;
use crate::{json, progress};

use super::configured::ConfiguredSimulation;
use super::simulated_time::{LiveError, LiveScanner};

#[derive(serde::Serialize)]
struct Report<'a> {
    recording: &'a Path,
    set: &'a str,
    poses: u64,
    images: [u64; 2],
    patterns: u64,
    /// Mean motion of a point of the object from image to image, millimetres.
    mean_motion_mm: f64,
    max_motion_mm: f64,
}

/// Records the virtual scanner of a configuration for `seconds`, or for one round of its sweep.
pub(super) fn record(config: &Path, target: &Path, seconds: Option<f64>, as_json: bool) -> Result<(), Failure> {
    let ConfiguredSimulation { configuration, setup, scanner: options } = ConfiguredSimulation::read(config)?;
    let unusable = |what: &dyn std::fmt::Display| Failure::Usage(format!("{}: {what}", config.display()));
    let scanner = VirtualScanner::new(options.scanner).map_err(|e| unusable(&e))?;
    let round = scanner.sweep().poses() as u64;
    let patterns = seconds.map_or(round, |seconds| (seconds * configuration.rate_hz).round().max(1.0) as u64);
    let live = LiveScanner::new(&scanner, &configuration, &options, &setup);
    let mut live = live.map_err(|e| unusable(&e))?;
    let text = configuration.recorded_text();
    let opening = Opening { setup: &setup, configuration: &text, origin: &Origin::default(), min_free_bytes: 0 };
    let mut recorder = OfflineRecorder::create(target, &opening)?;
    let bar = progress::bar("taking images", patterns);
    let ran = live.run(patterns, &mut |message| recorder.put(message), || bar.inc(1));
    bar.finish_and_clear();
    match ran {
        Ok(()) => {}
        Err(LiveError::Recording(problem)) => return Err(recorder.abort(problem).into()),
        Err(error) => {
            recorder.discard();
            return Err(unusable(&error));
        }
    }
    let counts = recorder.finish()?;
    let written = |topic| counts.topics.get(&topic).map_or(0, |counts| counts.passed);
    let speed = scanner.speed();
    let report = Report {
        recording: target,
        set: &setup.name,
        poses: written(Topic::TruthPose),
        images: [written(Topic::Cam1Frame), written(Topic::Cam2Frame)],
        patterns: written(Topic::Pattern),
        mean_motion_mm: speed.mean_mm,
        max_motion_mm: speed.max_mm,
    };
    if as_json {
        return json::print(&report);
    }
    Ok(writeln!(
        std::io::stdout().lock(),
        "{}: {} and {} images of {} poses in {}; points of the object move by {:.3} mm per image, {:.3} at most",
        report.set,
        report.images[0],
        report.images[1],
        report.poses,
        target.display(),
        speed.mean_mm,
        speed.max_mm,
    )?)
}

/// Parses the duration of a recording, seconds.
pub(super) fn parse_seconds(text: &str) -> Result<f64, String> {
    let seconds = text.parse::<f64>().ok().filter(|seconds| *seconds > 0.0 && *seconds <= 3600.0);
    seconds.ok_or_else(|| format!("{text:?} is not a duration; write seconds, more than 0 and at most 3600"))
}
