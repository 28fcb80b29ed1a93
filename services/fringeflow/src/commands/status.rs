//! `fringeflow status`: which instances run, and what one of them does, seen from another terminal.

use std::collections::BTreeMap;
use std::io::Write;
use std::time::Duration;

use fringeflow_config::SERVICES;
use fringeflow_message::{Command, ControlRequest, ScanState, Stage};
use fringeflow_runtime::processors::Standing;
use fringeflow_runtime::{Preparation, accounts_folder, clock, dashboard_file};
use fringeflow_supervisor::{Observed, headline, observe, stage_line, waiting_from_outside};
use fringeflow_telemetry::{
    GaugeFigures, HealthFigures, Latency, Losses, Pace, StageFigures, StageTally, Tally, TrackingFigures,
};
use fringeflow_transport::{Instance, request};

use crate::failure::Failure;
use crate::json;

use super::instances;

/// How long reports are gathered: every stage gives a sign of life, and a rate can be told.
const SPAN_NS: u64 = 2_500_000_000;
/// How long an answer may take.
pub(super) const ANSWER: Duration = Duration::from_secs(3);

/// Arguments of `fringeflow status`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Name of the instance to show in full. Without it all instances that run are listed.
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
    /// What a service prepares before the scan can begin.
    preparation: Option<Preparation>,
    recording: Option<String>,
    /// Where the dashboard is.
    dashboard: Option<String>,
    /// What was lost since the start, each loss once.
    lost: Losses,
    /// What rate the machine holds, where windows are left out for lack of time.
    pace: Option<Pace>,
    stages: Vec<StageReport>,
    /// CPUs, priority and memory of services, where the configuration sets them.
    processors: BTreeMap<&'static str, Standing>,
    exposure_to_cloud: Option<Latency>,
    /// Health of the scanner as of the last window; `null` where none came while the reports were gathered.
    health: Option<Health>,
    /// Where the scanner is, while clouds are tracked.
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
    /// For how long it has been in its state; `null` while that is not known.
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

impl Args {
    pub(crate) fn run(&self) -> Result<(), Failure> {
        match &self.instance {
            Some(name) => self.show(&Instance::new(name)?),
            None => instances::list(self.json),
        }
    }

    /// Shows one instance in full.
    fn show(&self, instance: &Instance) -> Result<(), Failure> {
        let asked = ControlRequest { command: Command::State as u32, ..ControlRequest::default() };
        let state = request(instance, &asked, ANSWER)?.state;
        let observed = observe(instance, SPAN_NS)?;
        if self.json {
            return json::print(&Report::of(instance, &state, observed));
        }
        let mut out = std::io::stdout().lock();
        let now_ns = clock::now_ns();
        let waiting = waiting_from_outside(instance, &state);
        writeln!(out, "{}: {}", instance.name(), headline(&state, waiting.as_deref()))?;
        if let Some(url) = dashboard(instance) {
            writeln!(out, "dashboard: {url}")?;
        }
        writeln!(out, "{}", losses(&observed.tally))?;
        if let Some(pace) = Pace::from_tally(&observed.tally) {
            writeln!(out, "{pace}")?;
        }
        for (stage, of_stage) in observed.tally.stages() {
            writeln!(out, "{}", stage_line(stage, of_stage, now_ns).trim_end())?;
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
    fn of(instance: &Instance, state: &ScanState, Observed { tally, window, tracking }: Observed) -> Self {
        let now_ns = clock::now_ns();
        let stage = |(stage, of_stage): (Stage, &StageTally)| StageReport {
            figures: StageFigures::new(stage, &of_stage.counts, Some(of_stage)),
            rate_hz: of_stage.rate_hz,
            restarts: of_stage.restarts,
            silent: of_stage.is_silent(now_ns),
        };
        Self {
            instance: instance.name().to_owned(),
            scanning: state.scanning != 0,
            preparation: Preparation::read(instance),
            dashboard: dashboard(instance),
            recording: (state.recording != 0).then(|| state.recording_file.to_text()),
            lost: losses(&tally),
            pace: Pace::from_tally(&tally),
            stages: tally.stages().map(stage).collect(),
            processors: processors(instance),
            exposure_to_cloud: tally.total().brief(),
            health: window.as_ref().and_then(|window| window.health.as_ref()).map(|health| Health::of(health, now_ns)),
            tracking,
        }
    }
}

fn losses(tally: &Tally) -> Losses {
    Losses::from_counts(&tally.stages().map(|(stage, of_stage)| (stage, of_stage.counts)).collect::<Vec<_>>())
}

impl Health {
    fn of(health: &HealthFigures, now_ns: u64) -> Self {
        let quantity = |figures: &GaugeFigures| Quantity { figures: *figures, for_s: figures.seconds_in_state(now_ns) };
        Self { state: health.state.name(), quantities: health.quantities.iter().map(quantity).collect() }
    }
}

/// A line on the whole, one on each quantity, and what to do about those that are not as they should be.
fn write_health(out: &mut impl Write, health: Option<&HealthFigures>, now_ns: u64) -> std::io::Result<()> {
    let Some(health) = health else {
        return writeln!(out, "health: unknown, because no window came in the last {:.1} s", SPAN_NS as f64 * 1e-9);
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

/// Where the dashboard of an instance is, if it has one.
pub(super) fn dashboard(instance: &Instance) -> Option<String> {
    std::fs::read_to_string(dashboard_file(instance)).ok()
}

/// What the services of an instance were given of the machine, by name.
fn processors(instance: &Instance) -> BTreeMap<&'static str, Standing> {
    let accounts = accounts_folder(instance);
    SERVICES.into_iter().filter_map(|service| Some((service, Standing::read(&accounts, service)?))).collect()
}
