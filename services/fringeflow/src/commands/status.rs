//! `fringeflow status`: lists the running instances, or shows one of them.

use std::collections::BTreeMap;
use std::io::Write;

use fringeflow_config::SERVICES;
use fringeflow_message::{Command, ControlRequest, ScanState, Stage};
use fringeflow_runtime::processors::ResourceGrants;
use fringeflow_runtime::{Preparation, RecorderStatus, accounts_folder, clock, has_virtual_images};
use fringeflow_supervisor::{Observed, headline, observe, read_startup_status, stage_line};
use fringeflow_telemetry::{
    Capacity, GaugeFigures, HealthFigures, Latency, StageFigures, StageTally, Tally, TrackingFigures, Verdict,
};
use fringeflow_transport::{Instance, request};

use crate::acting_options::ActingOptions;
use crate::failure::Failure;
use crate::json;

use super::status_list::{self, RESPONSE_TIMEOUT, dashboard_url};

/// How long reports are collected, nanoseconds: long enough for every stage to report, and for a rate.
const OBSERVATION_NS: u64 = 2_500_000_000;

/// Arguments of `fringeflow status`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Name of the instance to show. Without it, all running instances are listed.
    #[arg(value_name = "NAME")]
    instance: Option<String>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

#[derive(serde::Serialize)]
struct Report {
    instance: String,
    scanning: bool,
    /// Whether the virtual scanner takes the images.
    virtual_images: bool,
    /// Preparation of a service that the scan waits for.
    preparation: Option<Preparation>,
    /// File of the recording that was asked for.
    recording: Option<String>,
    /// What the recorder does: whether that recording ended early, and how long the disk lasts.
    recorder: Option<RecorderStatus>,
    /// URL of the dashboard.
    dashboard: Option<String>,
    /// What was lost and left out since the start.
    lost: Verdict,
    /// Rate that the machine holds, what bounds it, and settings that help; `null` unless clouds were made.
    capacity: Option<Capacity>,
    stages: Vec<StageReport>,
    /// CPUs, priority and memory of the services for which the configuration sets them.
    processors: BTreeMap<&'static str, ResourceGrants>,
    exposure_to_cloud: Option<Latency>,
    /// Health of the scanner in the last window; `null` if no window came while the reports were collected.
    health: Option<Health>,
    /// Pose of the scanner, if it is tracked.
    tracking: Option<TrackingFigures>,
}

#[derive(serde::Serialize)]
struct Health {
    state: &'static str,
    quantities: Vec<Quantity>,
}

#[derive(serde::Serialize)]
struct Quantity {
    #[serde(flatten)]
    figures: GaugeFigures,
    /// Time since it entered its state, seconds; `null` if unknown.
    for_s: Option<f64>,
}

#[derive(serde::Serialize)]
struct StageReport {
    #[serde(flatten)]
    figures: StageFigures,
    rate_hz: f64,
    restarts: u32,
    silent: bool,
}

/// Where the options act.
pub(crate) const OPTIONS: ActingOptions<Args> = ActingOptions::all(&["instance", "json"]);

impl Args {
    pub(crate) fn run(&self) -> Result<(), Failure> {
        match &self.instance {
            Some(name) => self.show(&Instance::new(name)?),
            None => status_list::list(self.json),
        }
    }

    /// Shows the details of one instance.
    fn show(&self, instance: &Instance) -> Result<(), Failure> {
        let state_request = ControlRequest { command: Command::State as u32, ..ControlRequest::default() };
        let state = request(instance, &state_request, RESPONSE_TIMEOUT)?.state;
        let observed = observe(instance, OBSERVATION_NS)?;
        if self.json {
            return json::print(&Report::new(instance, &state, observed));
        }
        let mut out = std::io::stdout().lock();
        let now_ns = clock::now_ns();
        let waiting = read_startup_status(instance, &state);
        let recorder = RecorderStatus::read(instance);
        let headline = headline(&state, recorder.as_ref(), waiting.as_deref(), has_virtual_images(instance));
        writeln!(out, "{}: {headline}", instance.name())?;
        if let Some(url) = dashboard_url(instance) {
            writeln!(out, "dashboard: {url}")?;
        }
        if let Some(recorder) = &recorder {
            writeln!(out, "{recorder}")?;
        }
        writeln!(out, "{}", verdict(&observed.tally))?;
        if let Some(capacity) = Capacity::from_tally(&observed.tally) {
            writeln!(out, "{capacity}")?;
        }
        for (stage, stage_tally) in observed.tally.stages() {
            writeln!(out, "{}", stage_line(stage, stage_tally, now_ns).trim_end())?;
        }
        for (service, standing) in processors(instance) {
            writeln!(out, "{service} {standing}")?;
        }
        if let Some(tracking) = &observed.tracking {
            writeln!(out, "{tracking}")?;
        }
        let health = observed.window.as_ref().and_then(|window| window.health.as_ref());
        Ok(write_health(&mut out, health, now_ns)?)
    }
}

impl Report {
    fn new(instance: &Instance, state: &ScanState, Observed { tally, window, tracking }: Observed) -> Self {
        let now_ns = clock::now_ns();
        let stage = |(stage, stage_tally): (Stage, &StageTally)| StageReport {
            figures: StageFigures::new(stage, &stage_tally.counts, Some(stage_tally)),
            rate_hz: stage_tally.rate_hz,
            restarts: stage_tally.restarts,
            silent: stage_tally.is_silent(now_ns),
        };
        Self {
            instance: instance.name().to_owned(),
            scanning: state.scanning != 0,
            virtual_images: has_virtual_images(instance),
            preparation: Preparation::read(instance),
            dashboard: dashboard_url(instance),
            recording: (state.recording != 0).then(|| state.recording_file.to_text()),
            recorder: RecorderStatus::read(instance),
            lost: verdict(&tally),
            capacity: Capacity::from_tally(&tally),
            stages: tally.stages().map(stage).collect(),
            processors: processors(instance),
            exposure_to_cloud: tally.total().brief(),
            health: window.as_ref().and_then(|window| window.health.as_ref()).map(|health| Health::new(health, now_ns)),
            tracking,
        }
    }
}

fn verdict(tally: &Tally) -> Verdict {
    Verdict::from_counts(&tally.stages().map(|(stage, stage_tally)| (stage, stage_tally.counts)).collect::<Vec<_>>())
}

impl Health {
    fn new(health: &HealthFigures, now_ns: u64) -> Self {
        let quantity = |figures: &GaugeFigures| Quantity { figures: *figures, for_s: figures.seconds_in_state(now_ns) };
        Self { state: health.state.name(), quantities: health.quantities.iter().map(quantity).collect() }
    }
}

/// Writes a line about the overall health, one about each quantity, and a remedy for each quantity beyond its limits.
fn write_health(out: &mut impl Write, health: Option<&HealthFigures>, now_ns: u64) -> std::io::Result<()> {
    let Some(health) = health else {
        return writeln!(out, "health: unknown, no window in the last {:.1} s", OBSERVATION_NS as f64 * 1e-9);
    };
    writeln!(out, "health: {}", health.state.name())?;
    for gauge in &health.quantities {
        let limits = format!("warn {}, bad {}", gauge.with_unit(gauge.warn), gauge.with_unit(gauge.bad));
        let since = gauge.seconds_in_state(now_ns).map_or_else(String::new, |for_s| format!("  for {for_s:.0} s"));
        let (state, level) = (gauge.state.name(), gauge.level_text());
        writeln!(out, "  {:<9} {:<35}{level:>11}  ({limits}){since}", state, gauge.title)?;
    }
    health.beyond_limits().iter().try_for_each(|gauge| writeln!(out, "{gauge}"))
}

/// CPUs, priority and memory of the services of an instance, by service name.
fn processors(instance: &Instance) -> BTreeMap<&'static str, ResourceGrants> {
    let accounts = accounts_folder(instance);
    SERVICES.into_iter().filter_map(|service| Some((service, ResourceGrants::read(&accounts, service)?))).collect()
}
