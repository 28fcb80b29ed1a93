//! `fringeflow latency`: shows the latencies of a recorded run.

mod text;

use std::path::{Path, PathBuf};

use fringeflow_base::atomic_file::{check_writable, write_atomically};
use fringeflow_config::{CameraSource, ScannerConfiguration};
use fringeflow_message::{Counts, Stage, StageReport, flags};
use fringeflow_recording::{Content, Message, Recording, RecordingError, Topic};
use fringeflow_telemetry::{Exposures, RunReport, TraceWriter, WORST_WINDOWS};

use crate::acting_options::ActingOptions;
use crate::failure::Failure;
use crate::json;
use crate::report::{RunFigures, RunInfo, write_html};

/// Longest time from exposure to cloud in a live run, nanoseconds.
const MAX_LIVE_LATENCY_NS: u64 = 60_000_000_000;

/// Arguments of `fringeflow latency`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Recording of a run.
    input: PathBuf,
    /// Number of slowest windows to show.
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u16).range(..=1000))]
    worst: u16,
    /// Print one JSON object, with the time line.
    #[arg(long)]
    json: bool,
    /// Write an HTML page with all figures over time.
    #[arg(long, value_name = "FILE")]
    html: Option<PathBuf>,
    /// Write a trace of every item in every stage. Perfetto (ui.perfetto.dev) and chrome://tracing open it.
    #[arg(long, value_name = "FILE")]
    trace: Option<PathBuf>,
}

/// Where the options act.
pub(crate) const OPTIONS: ActingOptions<Args> = ActingOptions::all(&["input", "worst", "json", "html", "trace"]);

impl Args {
    pub(crate) fn run(&self) -> Result<(), Failure> {
        [&self.html, &self.trace].into_iter().flatten().try_for_each(|path| check_writable(path))?;
        let recording = Recording::open(&self.input)?;
        if recording.count(Topic::Report) == 0 {
            return Err(no_reports(&self.input));
        }
        let run = self.gather(&recording)?;
        let counts: Vec<(Stage, Counts)> = run.tally().stages().map(|(stage, tally)| (stage, tally.counts)).collect();
        let configuration = ScannerConfiguration::parse_recorded(recording.configuration_text(), Path::new(".")).ok();
        let info = RunInfo {
            instance: configuration.as_ref().map(|configuration| configuration.name.as_str()),
            version: recording.writer_version(),
            origin: recording.origin(),
            image_size_px: recording.setup().image_size_px,
            virtual_images: configuration.as_ref().is_some_and(|found| found.cameras == CameraSource::Virtual),
            steps: recording.setup().steps,
            recording: Some(&self.input),
            is_recorded: true,
        };
        let mut figures = RunFigures::new(info, &counts, &run);
        if let Some(path) = &self.html {
            write_atomically(path, |out| write_html(out, &figures))?;
        }
        if let Some(path) = &self.trace {
            self.write_trace(&recording, path)?;
        }
        figures.worst.truncate(usize::from(self.worst));
        if self.json { json::print(&figures) } else { text::print(&figures) }
    }

    /// Collects all reports, in the order of their arrival.
    fn gather(&self, recording: &Recording) -> Result<RunReport, Failure> {
        let exposures = if is_replayed(recording)? { Exposures::Replayed } else { Exposures::Live };
        let shown_on_page = if self.html.is_some() { WORST_WINDOWS } else { 0 };
        let mut run = RunReport::new(exposures, usize::from(self.worst).max(shown_on_page));
        let mut windows = recording.messages_of(Topic::WindowReport).peekable();
        for report in reports(recording) {
            let report = report?;
            run.add(&report);
            if Stage::from_code(report.stage) != Some(Stage::Correspondence) || report.of_item == 0 {
                continue;
            }
            // The figures of a window are recorded at the time of its images. In a replay that is long before its
            // reports, so they are matched by exposure.
            while let Some(window) = windows.next_if(|window| is_up_to(window, report.exposure_start_ns)) {
                if let Content::WindowReport(figures) = window?.content {
                    run.add_window(&figures);
                }
            }
        }
        Ok(run)
    }

    fn write_trace(&self, recording: &Recording, path: &Path) -> Result<(), Failure> {
        // Read first: an error in the recording must not be reported as an error in writing the trace.
        let reports: Vec<StageReport> = reports(recording).collect::<Result<_, _>>()?;
        write_atomically(path, |out| {
            let mut trace = TraceWriter::new(out)?;
            reports.iter().try_for_each(|report| trace.add(report))?;
            trace.finish().map(drop)
        })?;
        Ok(())
    }
}

/// Whether this is the recording of a replay, judged by the flags of the images and by the latencies of the clouds.
fn is_replayed(recording: &Recording) -> Result<bool, Failure> {
    let mut frames = [1, 2].into_iter().flat_map(|camera| recording.frame_headers(camera));
    if frames.any(|header| header.flags & flags::REPLAYED != 0) {
        return Ok(true);
    }
    for report in reports(recording) {
        let report = report?;
        let is_cloud = Stage::from_code(report.stage) == Some(Stage::Cloud) && report.of_item != 0;
        if is_cloud && report.passed_ns.saturating_sub(report.exposure_start_ns) > MAX_LIVE_LATENCY_NS {
            return Ok(true);
        }
    }
    Ok(false)
}

/// Whether a message is about a window whose last exposure is at `exposure_ns` or earlier. True for an unreadable
/// message too, so that the caller reports its error.
fn is_up_to(message: &Result<Message, RecordingError>, exposure_ns: u64) -> bool {
    match message {
        Ok(Message { content: Content::WindowReport(figures), .. }) => figures.window.last_exposure_ns <= exposure_ns,
        _ => true,
    }
}

fn reports(recording: &Recording) -> impl Iterator<Item = Result<StageReport, Failure>> {
    recording.messages_of(Topic::Report).filter_map(|message| match message {
        Ok(message) => match message.content {
            Content::Report(report) => Some(Ok(*report)),
            _ => None,
        },
        Err(error) => Some(Err(error.into())),
    })
}

fn no_reports(input: &Path) -> Failure {
    Failure::Usage(format!(
        "{}: the recording has no reports of the stages, so its latencies are unknown; `fringeflow run --record` and \
         `fringeflow replay --record` make recordings with reports",
        input.display()
    ))
}
