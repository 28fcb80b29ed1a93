//! A run in figures: what `latency --json` prints and what the page shows.

use std::path::Path;

use serde::Serialize;

use fringeflow_message::{Counts, Stage};
use fringeflow_recording::Origin;
use fringeflow_telemetry::{
    DropLine, Exposures, HealthRecord, Journey, Latency, RunReport, Sample, Segment, StageFigures, WindowFigures,
};

/// Which run it was.
#[derive(Serialize)]
pub(crate) struct About<'a> {
    /// Name of the instance, where it is known.
    pub(crate) instance: Option<&'a str>,
    /// Version of the fringeflow that ran.
    pub(crate) version: &'a str,
    /// Machine, and the wall clock of the times.
    pub(crate) origin: Origin,
    /// Width and height of the images, pixels.
    pub(crate) image_size_px: [usize; 2],
    /// Steps of the shift cycle.
    pub(crate) steps: usize,
    /// The recording: that the figures come from, or that the run made.
    pub(crate) recording: Option<&'a Path>,
    /// Whether the figures come from a recording, which may hold a part of the run only.
    pub(crate) is_recorded: bool,
}

/// A run in figures.
#[derive(Serialize)]
pub(crate) struct RunFigures<'a> {
    #[serde(flatten)]
    pub(crate) about: About<'a>,
    /// Whether a recording was played: then nothing is told of what came before a window was complete.
    pub(crate) replayed: bool,
    /// Time of the first report on the wall clock, Unix milliseconds.
    pub(crate) started_wall_ms: f64,
    /// From the first report to the last, seconds.
    pub(crate) duration_s: f64,
    /// Windows that were followed from exposure to cloud.
    pub(crate) windows: u64,
    /// Windows with a cloud that lack the report of an earlier stage.
    pub(crate) windows_incomplete: u64,
    cloud_rate_hz: Option<f64>,
    pub(crate) exposure_to_cloud: Option<Latency>,
    pub(crate) stages: Vec<StageFigures>,
    pub(crate) segments: Vec<SegmentLine>,
    pub(crate) worst: Vec<WindowLine>,
    drops: Vec<DropLine>,
    last_window: Option<&'a WindowFigures>,
    health: &'a HealthRecord,
    /// Names of all segments, in the order of the lists of milliseconds.
    segment_names: [&'static str; Segment::ALL.len()],
    /// Length of the spans of the time line, seconds.
    span_s: f64,
    time_line: Vec<Sample>,
}

/// A part of the way from exposure to cloud.
#[derive(Serialize)]
pub(crate) struct SegmentLine {
    pub(crate) segment: &'static str,
    pub(crate) latency: Option<Latency>,
    /// Part of the whole way, percent of the time of all windows.
    pub(crate) share: f64,
}

/// A window that took long.
#[derive(Serialize)]
pub(crate) struct WindowLine {
    /// Start of its last exposure on the wall clock, Unix milliseconds; in a replay, when it was complete.
    pub(crate) wall_ms: f64,
    /// The same in seconds since the first report.
    pub(crate) time_s: f64,
    pub(crate) total_ms: f64,
    /// Why, in words.
    pub(crate) cause: String,
    /// The part that took longer than usual, if one did.
    cause_segment: Option<&'static str>,
    /// Its parts, in the order of all segments.
    segments_ms: [f64; Segment::ALL.len()],
}

impl<'a> RunFigures<'a> {
    /// The figures of a run whose stages ended with these counts.
    pub(crate) fn of(about: About<'a>, counts: &[(Stage, Counts)], run: &'a RunReport) -> Self {
        let [first_ns, last_ns] = run.history().bounds_ns().unwrap_or_default();
        let wall_ms = |time_ns| about.origin.unix_ms(time_ns);
        let stage = |(stage, counts): &(Stage, Counts)| StageFigures::new(*stage, counts, run.tally().stage(*stage));
        let time_line = run.samples(wall_ms);
        Self {
            replayed: run.exposures() == Exposures::Replayed,
            started_wall_ms: wall_ms(first_ns),
            duration_s: seconds(last_ns - first_ns),
            windows: run.windows(),
            windows_incomplete: run.incomplete(),
            cloud_rate_hz: run.cloud_rate_hz(),
            exposure_to_cloud: run.exposure_to_cloud().and_then(|latencies| latencies.brief()),
            stages: counts.iter().map(stage).collect(),
            segments: segment_lines(run),
            worst: run.worst().iter().map(|journey| WindowLine::of(journey, run, wall_ms, first_ns)).collect(),
            drops: DropLine::from_counts(counts),
            last_window: run.window(),
            health: run.health(),
            segment_names: Segment::ALL.map(Segment::name),
            span_s: seconds(run.history().span_ns()),
            time_line,
            about,
        }
    }
}

impl WindowLine {
    fn of(journey: &Journey, run: &RunReport, wall_ms: impl Fn(u64) -> f64, first_ns: u64) -> Self {
        let start_ns = journey.exposure_start_ns;
        let cause = run.cause(journey);
        Self {
            wall_ms: wall_ms(start_ns),
            time_s: seconds(start_ns) - seconds(first_ns),
            total_ms: milliseconds(journey.total_ns()),
            cause: cause.map_or_else(|| "every part took its usual time".to_owned(), |cause| cause.to_string()),
            cause_segment: cause.map(|cause| cause.segment.name()),
            segments_ms: Segment::ALL.map(|segment| milliseconds(journey.duration_ns(segment))),
        }
    }
}

fn segment_lines(run: &RunReport) -> Vec<SegmentLine> {
    let total_ns: u64 = run.segments().map(|(_, latencies)| latencies.sum_ns()).sum();
    let line = |(segment, latencies): (Segment, &fringeflow_telemetry::Latencies)| SegmentLine {
        segment: segment.name(),
        latency: latencies.brief(),
        share: 100.0 * latencies.sum_ns() as f64 / total_ns.max(1) as f64,
    };
    run.segments().map(line).collect()
}

fn seconds(ns: u64) -> f64 {
    ns as f64 * 1e-9
}

fn milliseconds(ns: u64) -> f64 {
    ns as f64 * 1e-6
}
