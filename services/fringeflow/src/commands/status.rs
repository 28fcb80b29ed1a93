//! `fringeflow status`: what a running instance does, seen from another terminal.

use std::io::Write as _;
use std::time::Duration;

use fringeflow::message::{Command, ControlRequest, ScanState, Stage};
use fringeflow::telemetry::{Latency, StageFigures, StageTally, TrackingFigures};
use fringeflow::transport::{Instance, request};
use fringeflow_runtime::{clock, dashboard_file};
use fringeflow_supervisor::{Observed, headline, observe, stage_line};

use crate::failure::Failure;
use crate::json;

/// How long reports are gathered: every stage gives a sign of life, and a rate can be told.
const SPAN_NS: u64 = 2_500_000_000;
/// How long an answer may take.
pub(crate) const ANSWER: Duration = Duration::from_secs(3);

/// Arguments of `fringeflow status`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Name of the instance: key instance.name of its configuration.
    #[arg(default_value = "fringeflow")]
    instance: String,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

#[derive(serde::Serialize)]
struct Report {
    instance: String,
    scanning: bool,
    recording: Option<String>,
    /// Where the dashboard is.
    dashboard: Option<String>,
    stages: Vec<StageReport>,
    exposure_to_cloud: Option<Latency>,
    /// Where the scanner is, while clouds are tracked.
    tracking: Option<TrackingFigures>,
}

#[derive(serde::Serialize)]
struct StageReport {
    #[serde(flatten)]
    figures: StageFigures,
    rate_hz: f64,
    restarts: u32,
    silent: bool,
}

impl Args {
    pub(crate) fn run(&self) -> Result<(), Failure> {
        let instance = Instance::new(&self.instance)?;
        let asked = ControlRequest { command: Command::State as u32, ..ControlRequest::default() };
        let state = request(&instance, &asked, ANSWER)?.state;
        let observed = observe(&instance, SPAN_NS)?;
        if self.json {
            return json::print(&self.report(&state, observed));
        }
        let mut out = std::io::stdout().lock();
        let now_ns = clock::now_ns();
        writeln!(out, "{}: {}", self.instance, headline(&state, &[]))?;
        if let Some(url) = dashboard(&self.instance) {
            writeln!(out, "dashboard: {url}")?;
        }
        for (stage, of_stage) in observed.tally.stages() {
            writeln!(out, "{}", stage_line(stage, of_stage, now_ns).trim_end())?;
        }
        if let Some(tracking) = &observed.tracking {
            writeln!(out, "{tracking}")?;
        }
        Ok(())
    }

    fn report(&self, state: &ScanState, Observed { tally, tracking }: Observed) -> Report {
        let now_ns = clock::now_ns();
        let stage = |(stage, of_stage): (Stage, &StageTally)| StageReport {
            figures: StageFigures::of(stage, &of_stage.counts, Some(of_stage)),
            rate_hz: of_stage.rate_hz,
            restarts: of_stage.restarts,
            silent: of_stage.is_silent(now_ns),
        };
        Report {
            instance: self.instance.clone(),
            scanning: state.scanning != 0,
            dashboard: dashboard(&self.instance),
            recording: (state.recording != 0).then(|| state.recording_file.to_text()),
            stages: tally.stages().map(stage).collect(),
            exposure_to_cloud: tally.total().brief(),
            tracking,
        }
    }
}

/// Where the dashboard of an instance is, if it has one.
fn dashboard(instance: &str) -> Option<String> {
    let file = dashboard_file(&Instance::new(instance).ok()?);
    std::fs::read_to_string(file).ok()
}
