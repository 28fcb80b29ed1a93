//! `fringeflow project`: shows patterns on a projector that is a second monitor.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use serde::Serialize;

use fringeflow_config::{ProjectorDriver, ScannerConfiguration};
use fringeflow_lab::simulation::read_configuration;
use fringeflow_patterns::{Direction, FringeCycle, PatternSet};
use fringeflow_projector::{Announced, Cycle, Monitor, ProjectorError, Screen, Steadiness, announce, check, show};
use fringeflow_runtime::Stop;
use fringeflow_transport::Instance;

use crate::acting_options::{ActingOptions, Mode};
use crate::calibrated_rig::configured_setup;
use crate::failure::Failure;
use crate::globals::Globals;

/// Arguments of `fringeflow project`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Configuration of a running instance. Its patterns are shown while it scans, and each is announced to it. Needs
    /// projector.driver = "external".
    #[arg(long, value_name = "FILE", required_unless_present_any = ["patterns", "list", "check"], conflicts_with = "patterns")]
    config: Option<PathBuf>,
    /// Show the patterns of this patterns.toml or its folder without an instance, again and again: to focus, to aim, or
    /// for cameras that take them on their own.
    #[arg(long, value_name = "FILE|FOLDER")]
    patterns: Option<PathBuf>,
    /// List the monitors.
    #[arg(long, conflicts_with_all = ["check", "config", "patterns"])]
    list: bool,
    /// Show a new pattern at each refresh for three seconds, and tell size, rate and how steadily they appear. Without
    /// patterns these are fringes.
    ///
    /// Exit code 3: some patterns came too late.
    #[arg(long)]
    check: bool,
    /// The projector, as --list names it. The default is the only monitor, or the only one beside the primary monitor.
    #[arg(long, value_name = "NAME")]
    monitor: Option<String>,
    /// The X server. The default is the environment variable DISPLAY.
    #[arg(long, value_name = "NAME")]
    display: Option<String>,
    /// Time from the moment at which a pattern goes to the monitor to the start of the exposure that it lights: the
    /// latency of the projector, and the delay of the cameras.
    #[arg(long, value_name = "MS", default_value_t = 0.0, allow_negative_numbers = true)]
    delay_ms: f64,
    /// Show each pattern for S seconds.
    #[arg(long, value_name = "S", default_value_t = 1.0)]
    seconds: f64,
    /// Print the result as one JSON object.
    #[arg(long)]
    json: bool,
}

/// Where the options act.
pub(crate) const OPTIONS: ActingOptions<Args> = ActingOptions {
    always: &["display", "json"],
    choices: &[&[
        Mode { name: "with --list", is_chosen: |args| args.list, options: &["list"] },
        Mode {
            name: "with --check",
            is_chosen: |args| args.check,
            options: &["check", "monitor", "config", "patterns", "log_format"],
        },
        Mode {
            name: "with --patterns",
            is_chosen: |args| args.patterns.is_some(),
            options: &["patterns", "monitor", "seconds", "log_format"],
        },
        Mode { name: "with --config", is_chosen: |_| true, options: &["config", "monitor", "delay_ms", "log_format"] },
    ]],
};

/// Longest --delay-ms. An event may come up to a second before its exposure.
const MAX_DELAY_MS: f64 = 1000.0;
/// Longest --seconds.
const MAX_SECONDS: f64 = 3600.0;

/// What was shown.
#[derive(Serialize)]
struct Report {
    monitor: Monitor,
    #[serde(skip_serializing_if = "Option::is_none")]
    steadiness: Option<Steadiness>,
    #[serde(skip_serializing_if = "Option::is_none")]
    counts: Option<fringeflow_projector::ShownCounts>,
}

impl Args {
    pub(crate) fn run(&self, globals: &Globals) -> Result<(), Failure> {
        globals.start_log("project");
        let screen = Screen::open(self.display.as_deref())?;
        if self.list {
            return self.print_monitors(&screen.monitors()?);
        }
        let monitor = screen.monitor(self.monitor.as_deref())?;
        if self.check {
            let set = self.checked_patterns(&monitor)?;
            return self.print_steadiness(&monitor, check(&screen, &monitor, &set)?);
        }
        let stop = Stop::from_signals()?;
        let announced = match (&self.patterns, &self.config) {
            (Some(patterns), _) => {
                let seconds = in_range("--seconds", self.seconds, 0.0, MAX_SECONDS)?;
                show(&screen, &monitor, &PatternSet::read(patterns)?, seconds, &stop)?
            }
            (None, Some(config)) => self.announce(config, &screen, &monitor, &stop)?,
            (None, None) => return Err(Failure::Usage("give --config or --patterns".to_owned())),
        };
        self.print_counts(&monitor, announced)
    }

    fn announce(&self, config: &Path, screen: &Screen, monitor: &Monitor, stop: &Stop) -> Result<Announced, Failure> {
        let delay_ms = in_range("--delay-ms", self.delay_ms, -MAX_DELAY_MS, MAX_DELAY_MS)?;
        let configuration = read_configuration(config)?;
        if configuration.projector != ProjectorDriver::External {
            return Err(Failure::Usage(format!(
                "{}: the instance takes no announcements; set projector.driver = \"external\"",
                config.display()
            )));
        }
        let set = configured_patterns(config, &configuration)?;
        let period_px = set.cycle().map_err(Failure::unusable)?.pattern.period_px;
        let cycle = Cycle { rate_hz: configuration.rate_hz, period_px, delay_ns: (delay_ms * 1e6).round() as i64 };
        let instance = Instance::new(&configuration.name)?;
        Ok(announce(screen, monitor, &set, &cycle, &instance, stop)?)
    }

    fn checked_patterns(&self, monitor: &Monitor) -> Result<PatternSet, Failure> {
        match (&self.patterns, &self.config) {
            (Some(patterns), _) => Ok(PatternSet::read(patterns)?),
            (None, Some(config)) => configured_patterns(config, &read_configuration(config)?),
            (None, None) => {
                let cycle = FringeCycle::even(4, 16.0);
                PatternSet::fringes(monitor.size_px, &[Direction::Columns], &cycle, false).map_err(Failure::unusable)
            }
        }
    }

    fn print_monitors(&self, monitors: &[Monitor]) -> Result<(), Failure> {
        let mut out = std::io::stdout().lock();
        if self.json {
            serde_json::to_writer(&mut out, monitors).map_err(std::io::Error::from)?;
            return Ok(writeln!(out)?);
        }
        for monitor in monitors {
            writeln!(out, "{}", described(monitor))?;
        }
        Ok(())
    }

    fn print_steadiness(&self, monitor: &Monitor, steadiness: Steadiness) -> Result<(), Failure> {
        let Steadiness { refresh_hz, shown, missed, flipped, jitter_rms_us, jitter_max_us } = steadiness;
        let mut out = std::io::stdout().lock();
        if self.json {
            let report = Report { monitor: monitor.clone(), steadiness: Some(steadiness), counts: None };
            serde_json::to_writer(&mut out, &report).map_err(std::io::Error::from)?;
            writeln!(out)?;
        } else {
            writeln!(
                out,
                "{}\n{shown} patterns at {refresh_hz:.3} refreshes a second, {missed} missed; {flipped} went straight to \
                 the monitor, {} were copied\njitter {jitter_rms_us:.0} µs rms, {jitter_max_us:.0} µs at most",
                described(monitor),
                shown - flipped
            )?;
        }
        let losses = || Failure::Losses(format!("{missed} refreshes had no new pattern; close other programs"));
        if missed > 0 { Err(losses()) } else { Ok(()) }
    }

    fn print_counts(&self, monitor: &Monitor, announced: Announced) -> Result<(), Failure> {
        let counts = announced.counts;
        let mut out = std::io::stdout().lock();
        if self.json {
            let report = Report { monitor: monitor.clone(), steadiness: None, counts: Some(counts) };
            serde_json::to_writer(&mut out, &report).map_err(std::io::Error::from)?;
            writeln!(out)?;
        } else {
            let verb = if self.patterns.is_some() { "shown" } else { "shown and announced" };
            writeln!(
                out,
                "{} patterns due, each for {} refreshes of {}: {} {verb}, {} dropped (overrun)",
                counts.due, announced.refreshes, monitor.name, counts.announced, counts.dropped
            )?;
        }
        let losses = || Failure::Losses(format!("{} patterns were not shown in their time", counts.dropped));
        if counts.dropped > 0 { Err(losses()) } else { Ok(()) }
    }
}

/// The patterns of a configuration: those of the file that it names, or the fringes that it states.
fn configured_patterns(config: &Path, configuration: &ScannerConfiguration) -> Result<PatternSet, Failure> {
    if let Some(named) = &configuration.pattern_file {
        return Ok(PatternSet::read(&named.file)?);
    }
    let setup = configured_setup(config)?;
    let (projector, sequence) = (&setup.rig.projector, setup.sequence);
    let cycle = FringeCycle { pattern: sequence.pattern, shifts_rad: sequence.shifts_rad };
    let set = PatternSet::fringes([projector.width_px(), projector.height_px()], &[Direction::Columns], &cycle, false);
    set.map_err(|problem| Failure::Usage(format!("{}: {problem}", config.display())))
}

fn described(monitor: &Monitor) -> String {
    let ([width, height], [x, y]) = (monitor.size_px, monitor.place_px);
    let rate = monitor.refresh_hz.map_or("rate unknown".to_owned(), |rate| format!("{rate:.2} Hz"));
    let primary = if monitor.primary { ", primary" } else { "" };
    format!("{}: {width} × {height} pixels, {rate}, at ({x}, {y}){primary}", monitor.name)
}

fn in_range(option: &str, value: f64, min: f64, max: f64) -> Result<f64, Failure> {
    let refused = || Failure::Usage(format!("{option} {value}: it must lie between {min} and {max}"));
    (min..=max).contains(&value).then_some(value).ok_or_else(refused)
}

impl From<ProjectorError> for Failure {
    fn from(error: ProjectorError) -> Self {
        match error {
            ProjectorError::Transport(error) => Self::Transport(error),
            error => Self::Projector(error),
        }
    }
}
