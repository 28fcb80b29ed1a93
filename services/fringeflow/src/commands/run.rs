//! `fringeflow run`: a whole instance, live.

use std::path::PathBuf;

use fringeflow_base::atomic_file::check_writable;
use fringeflow_runtime::{ServiceArgs, ServiceKind, live_services};
use fringeflow_supervisor::{Plan, run};

use crate::failure::Failure;
use crate::globals::Globals;
use crate::report::RunPage;
use crate::run_summary::{self, Summary};

use super::scanner_check;

/// Arguments of `fringeflow run`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Configuration of the scanner, see configs/scanner.toml and configs/demo.toml.
    #[arg(long, value_name = "FILE")]
    config: PathBuf,
    /// File of the segment table. It is read if it exists, else computed and written.
    #[arg(long, value_name = "FILE")]
    segment_table: Option<PathBuf>,
    #[command(flatten)]
    scan: Scan,
    /// Only check whether everything is as the configuration says: cameras, calibration, memory, folders.
    ///
    /// The check sets the cameras as configured and releases them. Exit code 2: something is wrong.
    #[arg(long, conflicts_with_all = ["seconds", "record", "report", "no_report", "trace"])]
    check: bool,
}

/// How long a scan lasts and what is kept of it.
#[derive(clap::Args)]
pub(super) struct Scan {
    /// Stop after S seconds of scanning. By default the scan lasts until Ctrl-C.
    #[arg(long, value_name = "S")]
    seconds: Option<f64>,
    /// Record to this file from the start. The file must not exist.
    #[arg(long, value_name = "REC")]
    record: Option<PathBuf>,
    /// File for the report on the run. By default it goes to the folder of the recordings, named by the time.
    #[arg(long, value_name = "FILE")]
    report: Option<PathBuf>,
    /// Write no report on the run.
    #[arg(long, conflicts_with = "report")]
    no_report: bool,
    /// Write a trace of every item in every stage. Perfetto (ui.perfetto.dev) and chrome://tracing open it.
    #[arg(long, value_name = "FILE")]
    trace: Option<PathBuf>,
    /// Print the result as one JSON object.
    #[arg(long)]
    json: bool,
}

impl Args {
    pub(crate) fn run(&self, globals: &Globals) -> Result<(), Failure> {
        globals.start_log("run");
        let arguments = ServiceArgs {
            config: self.config.clone(),
            setup: None,
            segment_table: self.segment_table.clone(),
            restarts: 0,
            supervised: false,
        };
        if self.check { scanner_check::check(&arguments, self.scan.json) } else { self.scan.run(&arguments, globals) }
    }
}

impl Scan {
    /// Runs the instance that the arguments describe, from beginning to end.
    pub(super) fn run(&self, arguments: &ServiceArgs, globals: &Globals) -> Result<(), Failure> {
        [&self.report, &self.trace].into_iter().flatten().try_for_each(|path| check_writable(path))?;
        let configuration = arguments.configuration()?;
        let recording = self.record.as_ref().map(|file| file.to_string_lossy().into_owned());
        let recording = recording.or_else(|| configuration.recorder.from_start.then(String::new));
        let plan = plan(arguments, globals, live_services(&configuration), recording)?;
        scanner_check::refuse_settings(&plan.configuration, &plan.setup)?;
        let plan = Plan { duration_ns: self.duration_ns()?, trace: self.trace.clone(), ..plan };
        let outcome = run(&plan, None)?;
        let page = RunPage { plan: &plan, outcome: &outcome };
        let report = if self.no_report { None } else { page.write(self.report.as_deref()) };
        run_summary::print(&Summary::of(&outcome, report.as_deref()), self.json)?;
        run_summary::judge(&outcome)
    }

    fn duration_ns(&self) -> Result<Option<u64>, Failure> {
        match self.seconds {
            Some(s) if !(s > 0.0 && s < 1e9) => {
                Err(Failure::Usage(format!("--seconds {s}: give a number above 0 and below a billion")))
            }
            seconds => Ok(seconds.map(|s| (s * 1e9) as u64)),
        }
    }
}

/// What an instance is to be run with, without end.
pub(super) fn plan(
    arguments: &ServiceArgs,
    globals: &Globals,
    services: Vec<ServiceKind>,
    recording: Option<String>,
) -> Result<Plan, Failure> {
    let configuration = arguments.configuration()?;
    arguments.check_processors(&configuration)?;
    let setup = arguments.setup(&configuration)?;
    // Computed here once, so that its file is there, and its faults are told, before anything starts.
    drop(arguments.segment_table(&configuration, &setup)?);
    Ok(Plan {
        configuration,
        setup,
        services,
        program: std::env::current_exe()?,
        before: globals.to_command_line(),
        arguments: arguments.to_command_line(),
        duration_ns: None,
        recording,
        trace: None,
    })
}
