//! Figures of a run, as `latency --json` prints them and the page shows them.

use std::path::Path;

use serde::Serialize;

use fringeflow_message::{Counts, Stage};
use fringeflow_recording::Origin;
use fringeflow_telemetry::{
    DropLine, Exposures, HealthRecord, Journey, Latency, RunReport, Sample, Segment, StageFigures, StageTally, Verdict,
    WindowFigures,
};

/// General information about a run.
#[derive(Serialize)]
pub(crate) struct RunInfo<'a> {
    /// Name of the instance, if known.
    pub(crate) instance: Option<&'a str>,
    /// Version of Fringeflow in the run.
    pub(crate) version: &'a str,
    /// The machine, and the wall clock for its times.
    pub(crate) origin: Origin,
    /// Width and height of the images, pixels.
    pub(crate) image_size_px: [usize; 2],
    /// Whether the virtual scanner took the images.
    pub(crate) virtual_images: bool,
    /// Steps of the shift cycle.
    pub(crate) steps: usize,
    /// The recording from which the figures come, or which the run made.
    pub(crate) recording: Option<&'a Path>,
    /// Whether the figures come from a recording. It may hold only a part of the run.
    pub(crate) is_recorded: bool,
}

/// Figures of a run.
#[derive(Serialize)]
pub(crate) struct RunFigures<'a> {
    #[serde(flatten)]
    pub(crate) info: RunInfo<'a>,
    /// Whether the run was a replay. Then the times before a window was complete are unknown.
    pub(crate) replayed: bool,
    /// Time of the first image on the wall clock, Unix milliseconds; `None` if none arrived.
    pub(crate) started_wall_ms: Option<f64>,
    /// Time from the first image to the last report, seconds.
    pub(crate) duration_s: f64,
    /// Windows that were followed from exposure to cloud.
    pub(crate) windows: u64,
    /// Windows with a cloud that lack the report of an earlier stage.
    pub(crate) windows_incomplete: u64,
    pub(crate) exposure_to_cloud: Option<Latency>,
    pub(crate) stages: Vec<StageLine>,
    pub(crate) segments: Vec<SegmentLine>,
    pub(crate) worst: Vec<WindowLine>,
    drops: Vec<DropLine>,
    /// What was lost and left out, and the same as a sentence.
    verdict: Verdict,
    verdict_text: String,
    last_window: Option<&'a WindowFigures>,
    health: &'a HealthRecord,
    /// Names of all segments, in the order of the lists of durations.
    segment_names: [&'static str; Segment::ALL.len()],
    /// Interval between the points of the time line, seconds.
    span_s: f64,
    time_line: Vec<Sample>,
}

/// A stage.
#[derive(Serialize)]
pub(crate) struct StageLine {
    #[serde(flatten)]
    pub(crate) figures: StageFigures,
    /// Items passed on per second, from the first item to the last.
    mean_rate_hz: Option<f64>,
}

/// A segment of the time from exposure to cloud.
#[derive(Serialize)]
pub(crate) struct SegmentLine {
    pub(crate) segment: &'static str,
    pub(crate) latency: Option<Latency>,
    /// Share of the total time over all windows, percent.
    pub(crate) share: f64,
}

/// A slow window.
#[derive(Serialize)]
pub(crate) struct WindowLine {
    /// Start of its last exposure on the wall clock, Unix milliseconds; in a replay, the time when it was complete.
    pub(crate) wall_ms: f64,
    /// The same time in seconds since the first image.
    pub(crate) time_s: f64,
    pub(crate) total_ms: f64,
    /// Why it was slow, in words.
    pub(crate) cause: String,
    /// The segment that is the cause; `None` if every segment took at most its median.
    cause_segment: Option<&'static str>,
    /// Durations of all segments, in their order.
    segments_ms: [f64; Segment::ALL.len()],
}

impl<'a> RunFigures<'a> {
    /// Figures of a run. `counts` are the final counts of its stages.
    pub(crate) fn new(info: RunInfo<'a>, counts: &[(Stage, Counts)], run: &'a RunReport) -> Self {
        let bounds_ns = run.history().bounds_ns();
        let [first_ns, last_ns] = bounds_ns.unwrap_or_default();
        let wall_ms = |time_ns| info.origin.unix_ms(time_ns);
        let time_line = run.samples(wall_ms);
        let verdict = Verdict::from_counts(counts);
        Self {
            replayed: run.exposures() == Exposures::Replayed,
            started_wall_ms: bounds_ns.map(|_| wall_ms(first_ns)),
            duration_s: seconds(last_ns - first_ns),
            windows: run.windows(),
            windows_incomplete: run.incomplete(),
            exposure_to_cloud: run.exposure_to_cloud().and_then(|latencies| latencies.brief()),
            stages: counts.iter().map(|(stage, counts)| StageLine::new(*stage, counts, run)).collect(),
            segments: segment_lines(run),
            worst: run
                .worst()
                .iter()
                .map(|journey| WindowLine::from_journey(journey, run, wall_ms, first_ns))
                .collect(),
            drops: DropLine::from_counts(counts),
            verdict_text: verdict.to_string(),
            verdict,
            last_window: run.window(),
            health: run.health(),
            segment_names: Segment::ALL.map(Segment::name),
            span_s: seconds(run.history().span_ns()),
            time_line,
            info,
        }
    }
}

impl StageLine {
    fn new(stage: Stage, counts: &Counts, run: &RunReport) -> Self {
        let tally = run.tally().stage(stage);
        Self {
            figures: StageFigures::new(stage, counts, tally),
            mean_rate_hz: tally.and_then(StageTally::mean_rate_hz),
        }
    }
}

impl WindowLine {
    fn from_journey(journey: &Journey, run: &RunReport, wall_ms: impl Fn(u64) -> f64, first_ns: u64) -> Self {
        let start_ns = journey.exposure_start_ns;
        let cause = run.cause(journey);
        Self {
            wall_ms: wall_ms(start_ns),
            time_s: seconds(start_ns) - seconds(first_ns),
            total_ms: milliseconds(journey.total_ns()),
            cause: cause.map_or_else(|| "no segment took longer than its median".to_owned(), |cause| cause.to_string()),
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
