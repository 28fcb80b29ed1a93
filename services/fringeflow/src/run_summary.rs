//! Summary of a finished run: the counts and latencies of each stage, losses and health.

use std::fmt;
use std::io::Write as _;
use std::path::Path;

use fringeflow_config::CameraSource;
use fringeflow_message::{Counts, Stage};
use fringeflow_replayer::Compared;
use fringeflow_supervisor::{Outcome, Plan};
use fringeflow_telemetry::{Capacity, DriftFigures, HealthRecord, Latency, SkewFigures, StageFigures, Verdict};

use crate::failure::Failure;
use crate::json;

/// Figures of a run.
#[derive(serde::Serialize)]
pub(crate) struct Summary<'a> {
    /// Whether the virtual scanner took the images.
    virtual_images: bool,
    stages: Vec<StageFigures>,
    /// From the start of the last exposure of a cloud to its publication.
    exposure_to_cloud: Option<Latency>,
    /// Drift in the last window; `None` if the resolution does not measure it.
    #[serde(skip_serializing_if = "Option::is_none")]
    drift: Option<&'a DriftFigures>,
    /// Health over all windows.
    #[serde(skip_serializing_if = "HealthRecord::is_empty")]
    health: &'a HealthRecord,
    /// What was lost and left out.
    lost: Verdict,
    /// Rate that the machine held in the last seconds, what bounded it, and settings that help.
    #[serde(skip_serializing_if = "Option::is_none")]
    capacity: Option<Capacity>,
    restarts: u32,
    #[serde(skip_serializing_if = "Option::is_none")]
    recording: Option<&'a Path>,
    #[serde(skip_serializing_if = "Option::is_none")]
    trace: Option<&'a Path>,
    /// The page with all figures.
    #[serde(skip_serializing_if = "Option::is_none")]
    report: Option<&'a Path>,
    #[serde(skip_serializing_if = "Option::is_none")]
    compared: Option<Compared>,
    imbalances: Vec<String>,
}

/// Prints the summary of a run.
pub(crate) fn print(summary: &Summary<'_>, json: bool) -> Result<(), Failure> {
    if json {
        return json::print(summary);
    }
    Ok(write!(std::io::stdout(), "{summary}")?)
}

/// Fails if the counts of a run do not add up.
pub(crate) fn check_balance(outcome: &Outcome) -> Result<(), Failure> {
    let imbalances = outcome.balance.imbalances();
    imbalances.first().map_or(Ok(()), |imbalance| Err(Failure::Imbalance(imbalance.to_string())))
}

/// Fails if the counts of a run do not add up, if data were lost, or if a service ended with an error.
pub(crate) fn check(outcome: &Outcome) -> Result<(), Failure> {
    check_balance(outcome)?;
    let verdict = Verdict::from_counts(&outcome.balance.0);
    if verdict.is_loss {
        return Err(Failure::Losses(verdict.losses.to_string()));
    }
    if outcome.failed_services.is_empty() { Ok(()) } else { Err(Failure::Losses(describe_failed_services(outcome))) }
}

fn describe_failed_services(outcome: &Outcome) -> String {
    let services: Vec<String> = outcome.failed_services.iter().map(|(name, how)| format!("{name}: {how}")).collect();
    format!("services ended with errors: {}", services.join(", "))
}

impl<'a> Summary<'a> {
    /// Summary of a live run. `report` is the path of its report.
    pub(crate) fn from_run(plan: &Plan, outcome: &'a Outcome, report: Option<&'a Path>) -> Self {
        let tally = outcome.run.tally();
        let (exposure_to_cloud, capacity) = (tally.total().brief(), Capacity::from_tally(tally));
        let virtual_images = plan.configuration.cameras == CameraSource::Virtual;
        Self { virtual_images, exposure_to_cloud, report, capacity, ..Self::from_replay(outcome, None) }
    }

    /// Summary of a replay and its comparison with the recording. It has no latency from exposure to cloud, as the
    /// exposures are long past.
    pub(crate) fn from_replay(outcome: &'a Outcome, compared: Option<Compared>) -> Self {
        let stage =
            |(stage, counts): &(Stage, Counts)| StageFigures::new(*stage, counts, outcome.run.tally().stage(*stage));
        Self {
            virtual_images: false,
            stages: outcome.balance.0.iter().map(stage).collect(),
            exposure_to_cloud: None,
            drift: outcome.run.window().and_then(|window| window.drift.as_ref()),
            health: outcome.run.health(),
            lost: Verdict::from_counts(&outcome.balance.0),
            capacity: None,
            restarts: outcome.restarts,
            recording: outcome.recording.as_deref(),
            trace: outcome.trace.as_deref(),
            report: None,
            compared,
            imbalances: outcome.balance.imbalances().iter().map(ToString::to_string).collect(),
        }
    }
}

impl fmt::Display for Summary<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if self.virtual_images {
            writeln!(f, "the images were virtual: no camera took them")?;
        }
        writeln!(
            f,
            "{:<15} {:>8} {:>8}  {:>7} {:>7} {:>7}  dropped",
            "stage", "in", "out", "p50 ms", "p99 ms", "max ms"
        )?;
        for stage in &self.stages {
            let times = times(stage.latency);
            let dropped: Vec<String> = stage.dropped.iter().map(|(reason, n)| format!("{reason} {n}")).collect();
            let line =
                format!("{:<15} {:>8} {:>8}  {times}  {}", stage.stage, stage.taken, stage.passed, dropped.join(", "));
            writeln!(f, "{}", line.trim_end())?;
        }
        if self.exposure_to_cloud.is_some() {
            writeln!(f, "{:<33}  {}", "exposure to cloud", times(self.exposure_to_cloud))?;
        }
        if let Some(capacity) = self.capacity {
            writeln!(f, "{capacity}")?;
        }
        for StageFigures { stage, incidents, .. } in self.stages.iter().filter(|stage| !stage.incidents.is_empty()) {
            let survived: Vec<String> = incidents.iter().map(|(incident, n)| format!("{incident} {n}")).collect();
            writeln!(f, "{stage} survived: {}", survived.join(", "))?;
        }
        for SkewFigures { mean_ms, least_ms, greatest_ms } in self.stages.iter().filter_map(|s| s.skew.as_ref()) {
            let (mean, least, greatest) = (mean_ms, least_ms, greatest_ms);
            writeln!(f, "images of camera 2 start {mean:.3} ms later on average ({least:.3} to {greatest:.3} ms)")?;
        }
        if let Some(drift) = self.drift {
            writeln!(f, "drift of the calibration {:.3} rad rms in the last window", drift.rms_rad)?;
        }
        if !self.health.is_empty() {
            writeln!(f, "{}", self.health)?;
        }
        if self.restarts > 0 {
            writeln!(f, "service restarts: {}", self.restarts)?;
        }
        for imbalance in &self.imbalances {
            writeln!(f, "does not add up: {imbalance}")?;
        }
        if self.imbalances.is_empty() {
            writeln!(f, "balance: in = out + dropped at every stage")?;
        }
        writeln!(f, "{}", self.lost)?;
        if let Some(Compared { same, different, new, missing }) = self.compared {
            writeln!(
                f,
                "clouds: {same} identical byte by byte, {different} differ, {missing} were not reproduced, {new} new"
            )?;
        }
        for (what, file) in [("recording", self.recording), ("trace", self.trace), ("report", self.report)] {
            if let Some(file) = file {
                writeln!(f, "{what}: {}", file.display())?;
            }
        }
        Ok(())
    }
}

/// The three latency columns, empty if nothing was measured.
fn times(latency: Option<Latency>) -> String {
    let times = latency.map(|l| [l.p50_ms, l.p99_ms, l.max_ms].map(|ms| format!("{ms:>7.1}")));
    times.unwrap_or_else(|| [""; 3].map(|nothing| format!("{nothing:>7}"))).join(" ")
}
