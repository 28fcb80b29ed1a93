//! `fringeflow run`: runs an instance live.

use std::path::PathBuf;

use fringeflow_base::atomic_file::check_writable;
use fringeflow_runtime::{ServiceArgs, ServiceKind, live_services};
use fringeflow_supervisor::{Plan, run};

use crate::acting_options::{ActingOptions, Mode};
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
    /// Let the virtual scanner take the images of this rig, in the place of its cameras and its projector.
    ///
    /// Rig, pattern, volume, rate, and size, region, binning and depth of the images are those of the configuration. Table
    /// [virtual_scanner] may name object, noise and motion; without a motion the scanner rests.
    #[arg(long = "virtual")]
    virtual_images: bool,
    /// File of the segment table. It is read if it exists, else computed and written.
    #[arg(long, value_name = "FILE")]
    segment_table: Option<PathBuf>,
    #[command(flatten)]
    scan: ScanArgs,
    /// Only check whether everything matches the configuration: cameras, calibration, memory, folders.
    ///
    /// The check sets the cameras as configured and releases them. Exit code 2: something is wrong.
    #[arg(long)]
    check: bool,
}

/// Duration and outputs of a scan.
#[derive(clap::Args)]
pub(super) struct ScanArgs {
    /// Stop after S seconds of scanning. By default the scan lasts until Ctrl-C.
    #[arg(long, value_name = "S")]
    seconds: Option<f64>,
    /// Record to this file from the start. The file must not exist.
    #[arg(long, value_name = "REC")]
    record: Option<PathBuf>,
    /// File for the report on the run. The default is a name with the time, in the folder of the recordings.
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

/// Where the options act.
pub(crate) const OPTIONS: ActingOptions<Args> = ActingOptions {
    always: &["config", "virtual_images", "segment_table", "json", "threads", "simd", "log_format"],
    choices: &[&[
        Mode { name: "with --check", is_chosen: |args| args.check, options: &["check"] },
        Mode {
            name: "without --check",
            is_chosen: |_| true,
            options: &["seconds", "record", "report", "no_report", "trace"],
        },
    ]],
};

impl Args {
    pub(crate) fn run(&self, globals: &Globals) -> Result<(), Failure> {
        globals.start_log("run");
        let arguments = ServiceArgs {
            config: self.config.clone(),
            virtual_images: self.virtual_images,
            segment_table: self.segment_table.clone(),
            ..ServiceArgs::default()
        };
        if self.check { scanner_check::check(&arguments, self.scan.json) } else { self.scan.run(&arguments, globals) }
    }
}

impl ScanArgs {
    /// Runs an instance from start to end, and prints its summary.
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
        run_summary::print(&Summary::from_run(&plan, &outcome, report.as_deref()), self.json)?;
        run_summary::check(&outcome)
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

/// Plans an instance that runs without a time limit.
pub(super) fn plan(
    arguments: &ServiceArgs,
    globals: &Globals,
    services: Vec<ServiceKind>,
    recording: Option<String>,
) -> Result<Plan, Failure> {
    let configuration = arguments.configuration()?;
    arguments.check_processors(&configuration)?;
    let setup = arguments.setup(&configuration)?;
    // Computed once before anything starts, so that its file exists and errors are reported at once.
    drop(arguments.segment_table(&configuration, &setup)?);
    Ok(Plan {
        configuration,
        setup,
        services,
        program: std::env::current_exe()?,
        global_arguments: globals.to_command_line(),
        arguments: arguments.clone(),
        duration_ns: None,
        recording,
        trace: None,
    })
}
