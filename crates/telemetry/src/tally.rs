//! Totals of the reports of a run, by stage.

use std::collections::BTreeMap;

use fringeflow_message::{Counts, Skew, Stage, StageReport};

use super::journey::Journeys;
use super::load::LoadMeter;
use super::{Journey, Latencies, Load, Segment};

/// A stage counts as silent after this time without a report, nanoseconds.
const SILENT_NS: u64 = 3_000_000_000;
/// Time over which rates are measured, nanoseconds.
const RATE_SPAN_NS: u64 = 1_000_000_000;

/// Reports of all stages.
#[derive(Debug, Default)]
pub struct Tally {
    stages: BTreeMap<Stage, StageTally>,
    journeys: Journeys,
    total: Latencies,
    segments: [Latencies; Segment::ALL.len()],
}

/// Reports of one stage.
#[derive(Debug)]
pub struct StageTally {
    /// Last counts.
    pub counts: Counts,
    /// Process that reported last.
    pub pid: u32,
    /// Restarts of the service.
    pub restarts: u32,
    /// Items passed per second.
    pub rate_hz: f64,
    /// Number of processors that the instance may use; 0 if unknown.
    pub processors: u64,
    /// Number of items that the stage may have in work at once; 1 if unknown.
    pub at_once: u64,
    /// Time of the last report.
    pub time_ns: u64,
    /// Start of the images of camera 2 relative to camera 1, for the stage that pairs them.
    pub skew: Skew,
    /// Time from receiving an item to passing it on.
    pub latencies: Latencies,
    /// Time and count of passed items at the start of the present measurement of the rate.
    rate_from: (u64, u64),
    /// When the first and the last item were passed on, and the counts of passed items then.
    items: Option<[(u64, u64); 2]>,
    meter: LoadMeter,
}

impl Tally {
    /// Adds a report, and returns the journey of a window whose last report it is. Ignores a report of an unknown
    /// stage.
    pub fn add(&mut self, report: &StageReport) -> Option<Journey> {
        let stage = Stage::from_code(report.stage)?;
        let tally = self.stages.entry(stage).or_insert_with(|| StageTally::new(report));
        tally.add(report);
        if stage == Stage::Cloud && report.of_item != 0 {
            self.total.record(report.exposure_start_ns, report.passed_ns);
        }
        let journey = self.journeys.add(report)?;
        for (segment, begin_ns, end_ns) in journey.segments() {
            self.segments[segment as usize].record(begin_ns, end_ns);
        }
        Some(journey)
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

    /// Latencies from the start of the last exposure to the published cloud.
    #[must_use]
    pub fn total(&self) -> &Latencies {
        &self.total
    }

    /// Latencies of one segment of the time from exposure to cloud.
    #[must_use]
    pub fn segment(&self, segment: Segment) -> &Latencies {
        &self.segments[segment as usize]
    }
}

impl StageTally {
    fn new(report: &StageReport) -> Self {
        Self {
            counts: Counts::default(),
            pid: 0,
            restarts: 0,
            rate_hz: 0.0,
            processors: 0,
            at_once: 1,
            time_ns: 0,
            skew: Skew::default(),
            latencies: Latencies::default(),
            rate_from: (report.time_ns, report.counts.passed),
            items: None,
            meter: LoadMeter::new(report),
        }
    }

    fn add(&mut self, report: &StageReport) {
        self.counts = report.counts;
        self.pid = report.pid;
        self.restarts = report.restarts;
        self.processors = report.processors;
        self.at_once = report.at_once.max(1);
        self.time_ns = report.time_ns;
        self.meter.add(report);
        self.skew.join(&report.skew);
        if report.of_item != 0 {
            self.latencies.record(report.taken_ns, report.passed_ns);
            let item = (report.passed_ns, report.counts.passed);
            self.items = Some([self.items.map_or(item, |[first, _]| first), item]);
        }
        let (from_ns, passed) = self.rate_from;
        let span_ns = report.time_ns.saturating_sub(from_ns);
        if span_ns >= RATE_SPAN_NS {
            self.rate_hz = report.counts.passed.saturating_sub(passed) as f64 / (span_ns as f64 * 1e-9);
            self.rate_from = (report.time_ns, report.counts.passed);
        }
    }

    /// Returns its load in the last seconds; `None` before it has been measured for a second.
    #[must_use]
    pub fn load(&self) -> Option<Load> {
        self.meter.load()
    }

    /// Items passed per second, from the first item to the last; `None` for fewer than two.
    #[must_use]
    pub fn mean_rate_hz(&self) -> Option<f64> {
        let [(first_ns, before), (last_ns, passed)] = self.items?;
        let span_ns = last_ns.checked_sub(first_ns).filter(|&span_ns| span_ns > 0)?;
        Some(passed.saturating_sub(before) as f64 / (span_ns as f64 * 1e-9))
    }

    /// Whether the stage has not reported for three seconds.
    #[must_use]
    pub fn is_silent(&self, now_ns: u64) -> bool {
        now_ns.saturating_sub(self.time_ns) > SILENT_NS
    }
}
