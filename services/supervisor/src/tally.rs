//! What the stages report, gathered: counts, rates, latencies.

use std::collections::BTreeMap;

use fringeflow::message::{Counts, Skew, Stage, StageReport};
use hdrhistogram::Histogram;

/// Longest latency that is told apart, nanoseconds; longer ones count as this.
const LONGEST_NS: u64 = 60_000_000_000;
/// Shortest, nanoseconds.
const SHORTEST_NS: u64 = 1_000;
/// Significant digits of a latency.
const DIGITS: u8 = 2;
/// A stage that gives no sign of life for this long is silent, nanoseconds.
const SILENT_NS: u64 = 3_000_000_000;
/// Span over which rates are taken, nanoseconds.
const RATE_SPAN_NS: u64 = 1_000_000_000;

/// Reports of all stages.
#[derive(Debug, Default)]
pub struct Tally {
    stages: BTreeMap<Stage, StageTally>,
    /// From the start of the last exposure of a cloud to its publication.
    total: Latencies,
}

/// Reports of one stage.
#[derive(Debug)]
pub struct StageTally {
    /// Last counts.
    pub counts: Counts,
    /// Starts of the service after the first.
    pub restarts: u32,
    /// Items put out in a second.
    pub rate_hz: f64,
    /// Time of the last report.
    pub time_ns: u64,
    /// By how much images of camera 2 begin later, where the stage pairs them.
    pub skew: Skew,
    latency: Latencies,
    rate_from: (u64, u64),
}

/// A latency distribution in brief, milliseconds.
#[derive(Clone, Copy, Debug, PartialEq, serde::Serialize)]
pub struct Latency {
    /// Median.
    pub p50_ms: f64,
    /// 99th percentile.
    pub p99_ms: f64,
    /// Longest.
    pub max_ms: f64,
}

impl Tally {
    /// Takes a report; one of a stage that does not exist is passed over.
    pub fn add(&mut self, report: &StageReport) {
        let Some(stage) = Stage::of(report.stage) else { return };
        let tally = self.stages.entry(stage).or_insert_with(|| StageTally::new(report));
        tally.add(report);
        if stage == Stage::Cloud && report.of_item != 0 {
            self.total.record(report.exposure_start_ns, report.passed_ns);
        }
    }

    /// The stages that reported, in the order of the pipeline.
    pub fn stages(&self) -> impl Iterator<Item = (Stage, &StageTally)> + '_ {
        self.stages.iter().map(|(&stage, tally)| (stage, tally))
    }

    /// One stage, if it reported.
    #[must_use]
    pub fn stage(&self, stage: Stage) -> Option<&StageTally> {
        self.stages.get(&stage)
    }

    /// From the start of the last exposure to the published cloud.
    #[must_use]
    pub fn total(&self) -> Option<Latency> {
        self.total.brief()
    }
}

impl StageTally {
    fn new(report: &StageReport) -> Self {
        Self {
            counts: Counts::default(),
            restarts: 0,
            rate_hz: 0.0,
            time_ns: 0,
            skew: Skew::default(),
            latency: Latencies::default(),
            rate_from: (report.time_ns, report.counts.passed),
        }
    }

    fn add(&mut self, report: &StageReport) {
        self.counts = report.counts;
        self.restarts = report.restarts;
        self.time_ns = report.time_ns;
        self.skew.join(&report.skew);
        if report.of_item != 0 {
            self.latency.record(report.taken_ns, report.passed_ns);
        }
        let (from_ns, passed) = self.rate_from;
        let span_ns = report.time_ns.saturating_sub(from_ns);
        if span_ns >= RATE_SPAN_NS {
            self.rate_hz = report.counts.passed.saturating_sub(passed) as f64 / (span_ns as f64 * 1e-9);
            self.rate_from = (report.time_ns, report.counts.passed);
        }
    }

    /// From taking an item to putting it out.
    #[must_use]
    pub fn latency(&self) -> Option<Latency> {
        self.latency.brief()
    }

    /// Whether it has given no sign of life for long.
    #[must_use]
    pub fn is_silent(&self, now_ns: u64) -> bool {
        now_ns.saturating_sub(self.time_ns) > SILENT_NS
    }
}

/// Latencies of items.
#[derive(Debug)]
struct Latencies(Option<Histogram<u64>>);

impl Default for Latencies {
    fn default() -> Self {
        // The bounds are valid, so there always is a histogram.
        Self(Histogram::new_with_bounds(SHORTEST_NS, LONGEST_NS, DIGITS).ok())
    }
}

impl Latencies {
    fn record(&mut self, from_ns: u64, to_ns: u64) {
        if let Some(histogram) = &mut self.0 {
            histogram.saturating_record(to_ns.saturating_sub(from_ns).clamp(SHORTEST_NS, LONGEST_NS));
        }
    }

    fn brief(&self) -> Option<Latency> {
        let histogram = self.0.as_ref().filter(|histogram| !histogram.is_empty())?;
        let ms = |ns: u64| ns as f64 * 1e-6;
        Some(Latency {
            p50_ms: ms(histogram.value_at_quantile(0.5)),
            p99_ms: ms(histogram.value_at_quantile(0.99)),
            max_ms: ms(histogram.max()),
        })
    }
}
