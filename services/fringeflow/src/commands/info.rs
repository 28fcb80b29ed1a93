//! `fringeflow info`: shows the contents of a recording.

use std::path::{Path, PathBuf};

use fringeflow_config::{CameraSource, ScannerConfiguration};
use fringeflow_recording::{Content, Recording, RecordingError, Summary, Topic};
use fringeflow_telemetry::HealthRecord;

use crate::acting_options::ActingOptions;
use crate::failure::Failure;
use crate::json;

/// Arguments of `fringeflow info`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Recording to show.
    input: PathBuf,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Where the options act.
pub(crate) const OPTIONS: ActingOptions<Args> = ActingOptions::all(&["input", "json"]);

impl Args {
    pub(crate) fn run(&self) -> Result<(), Failure> {
        let recording = Recording::open(&self.input)?;
        let virtual_images = has_virtual_images(&recording);
        let report = Report { summary: recording.summary()?, virtual_images, health: health(&recording)? };
        if self.json { json::print(&report) } else { Ok(print(&mut std::io::stdout().lock(), &report)?) }
    }
}

#[derive(serde::Serialize)]
struct Report {
    #[serde(flatten)]
    summary: Summary,
    /// Whether the virtual scanner took the images, by the recorded configuration.
    virtual_images: bool,
    /// Health over all recorded windows; empty if they do not report it.
    #[serde(skip_serializing_if = "HealthRecord::is_empty")]
    health: HealthRecord,
}

/// Whether the recorded configuration has virtual cameras.
fn has_virtual_images(recording: &Recording) -> bool {
    let configuration = ScannerConfiguration::parse_recorded(recording.configuration_text(), Path::new("."));
    configuration.is_ok_and(|configuration| configuration.cameras == CameraSource::Virtual)
}

/// Collects the health of the scanner from the recorded windows.
fn health(recording: &Recording) -> Result<HealthRecord, RecordingError> {
    let mut record = HealthRecord::default();
    for message in recording.messages_of(Topic::WindowReport) {
        if let Content::WindowReport(report) = message?.content {
            record.add(&report);
        }
    }
    Ok(record)
}

fn print(out: &mut impl std::io::Write, Report { summary: s, virtual_images, health }: &Report) -> std::io::Result<()> {
    let [width, height] = s.image_size_px;
    let origin = &s.origin;
    let megabytes = s.bytes as f64 * 1e-6;
    writeln!(
        out,
        "{}: {:.2} s, {megabytes:.1} MB, {width} × {height} pixels, {} steps, {}{}",
        s.name,
        s.duration_s,
        s.steps,
        s.pixel_format,
        if *virtual_images { ", virtual images" } else { "" }
    )?;
    let known = |text: &str| if text.is_empty() { "–".to_owned() } else { text.to_owned() };
    writeln!(
        out,
        "fringeflow {}, host {}, Linux {}, {}",
        s.version,
        known(&origin.host),
        known(&origin.kernel),
        known(&origin.cpu)
    )?;
    for topic in &s.topics {
        let rate = topic.rate_hz.map(|rate| format!("{rate:9.2} Hz")).unwrap_or_default();
        writeln!(out, "{:>8}  {:<20}{rate}", topic.messages, topic.topic)?;
    }
    for (topic, messages) in &s.foreign {
        writeln!(out, "{messages:>8}  {topic:<20} (not of Fringeflow, not read)")?;
    }
    writeln!(out, "{} points in all clouds", s.points)?;
    for mark in &s.marks {
        writeln!(out, "mark at {:.3} s: {}", mark.time_s, mark.text)?;
    }
    for loss in &s.losses {
        writeln!(out, "loss at {:.3} s: {}", loss.time_s, loss.text)?;
    }
    for stage in s.stages.iter().filter(|stage| !stage.dropped.is_empty()) {
        let dropped: Vec<String> = stage.dropped.iter().map(|(reason, count)| format!("{reason} {count}")).collect();
        writeln!(out, "stage {}: {} of {} passed, {}", stage.stage, stage.passed, stage.taken, dropped.join(", "))?;
    }
    if !health.is_empty() {
        writeln!(out, "{health}")?;
    }
    writeln!(out, "losses: {}", s.lost)
}
