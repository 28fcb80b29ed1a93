//! An interval of a run, which becomes one point of a timeline.

use std::collections::BTreeMap;

use serde::Serialize;

use fringeflow_message::{Counts, Stage, StageReport, WindowReport};

use super::{Journey, Latencies, Latency, Losses, Segment, WindowFigures};

/// Reports of an interval.
#[derive(Clone, Debug, Default)]
pub struct Interval {
    begin_ns: u64,
    total: Latencies,
    stages: BTreeMap<Stage, StageSpan>,
    /// Sums over the windows, nanoseconds.
    segments_ns: [u64; Segment::ALL.len()],
    journeys: u64,
    window: Option<WindowReport>,
}

/// One stage in an interval.
#[derive(Clone, Debug)]
struct StageSpan {
    /// Items passed before the interval.
    passed_before: u64,
    counts: Counts,
    latencies: Latencies,
}

/// One point of a timeline.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Sample {
    /// End of the interval on the wall clock, Unix milliseconds.
    pub wall_ms: f64,
    /// Median, 90th and 99th percentile from exposure to cloud, milliseconds.
    pub total: Option<[f64; 3]>,
    /// The same percentiles from receiving an item to passing it on, by stage.
    pub stages: BTreeMap<&'static str, Option<[f64; 3]>>,
    /// Mean of each [`Segment`] over the windows, milliseconds.
    pub segments: Option<[f64; Segment::ALL.len()]>,
    /// Items passed per second, by stage.
    pub rates: BTreeMap<&'static str, f64>,
    /// Items lost since the start of the instance, by stage.
    pub dropped: BTreeMap<&'static str, u64>,
    /// Losses since the start of the instance, each counted once.
    pub lost: Losses,
    /// The last window.
    pub window: Option<WindowSample>,
}

/// Figures of a window in a timeline; shares in percent.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct WindowSample {
    /// Standard deviation of δ.
    pub sd_rad: f64,
    /// Mean number of fringe periods on a segment.
    pub n: f64,
    /// Expected false candidates.
    pub efc: f64,
    /// Drift of the calibration, root mean square; `None` if the resolution does not measure it.
    pub drift_rms_rad: Option<f64>,
    /// Standard deviation of δ about the drift.
    pub residual_sd_rad: Option<f64>,
    /// Pixels with one candidate.
    pub unique: f64,
    /// Pixels whose candidates could not be decided.
    pub undecided: f64,
    /// Pixels whose candidates were all rejected.
    pub rejected: f64,
    /// Median of δ.
    pub delta_median_rad: f64,
    /// Fit residual ÷ modulation of both cameras.
    pub residual: [Option<f32>; 2],
    /// Pixels with a correspondence.
    pub points: u64,
    /// Phase motion from image to image that 5 % of the pixels exceed, of both cameras.
    pub fast_motion_rad: [Option<f32>; 2],
    /// Worst state of all health quantities.
    pub health: Option<&'static str>,
}

impl Interval {
    /// Creates an interval that begins at `begin_ns`. The counts of the stages continue those of the interval `before`.
    #[must_use]
    pub fn new(begin_ns: u64, before: Option<&Self>) -> Self {
        let stages = before.map(|before| before.stages.iter().map(|(&stage, span)| (stage, span.next())).collect());
        Self { begin_ns, total: Latencies::coarse(), stages: stages.unwrap_or_default(), ..Self::default() }
    }

    /// Time at which it begins.
    #[must_use]
    pub fn begin_ns(&self) -> u64 {
        self.begin_ns
    }

    /// Adds a report, and the journey that it completed.
    pub fn add(&mut self, report: &StageReport, journey: Option<&Journey>) {
        let Some(stage) = Stage::from_code(report.stage) else { return };
        let span = self.stages.entry(stage).or_insert_with(|| StageSpan::new(report.counts.passed));
        span.counts = report.counts;
        if report.of_item != 0 {
            span.latencies.record(report.taken_ns, report.passed_ns);
        }
        if stage == Stage::Cloud && report.of_item != 0 {
            self.total.record(report.exposure_start_ns, report.passed_ns);
        }
        if let Some(journey) = journey {
            self.journeys += 1;
            for (segment, begin_ns, end_ns) in journey.segments() {
                self.segments_ns[segment as usize] += end_ns - begin_ns;
            }
        }
    }

    /// Adds the figures of a window.
    pub fn add_window(&mut self, report: &WindowReport) {
        self.window = Some(*report);
    }

    /// Merges the following interval, which was created with this one as `before`.
    pub fn merge(&mut self, next: &Self) {
        self.total.merge(&next.total);
        for (&stage, span) in &next.stages {
            self.stages.entry(stage).and_modify(|own| own.merge(span)).or_insert_with(|| span.clone());
        }
        for (sum_ns, next_ns) in self.segments_ns.iter_mut().zip(next.segments_ns) {
            *sum_ns += next_ns;
        }
        self.journeys += next.journeys;
        self.window = next.window.or(self.window);
    }

    /// Returns the point of the timeline for an interval that ends at `end_ns`.
    #[must_use]
    pub fn sample(&self, end_ns: u64, wall_ms: f64) -> Sample {
        let span_s = (end_ns.saturating_sub(self.begin_ns) as f64 * 1e-9).max(1e-3);
        let named = |(stage, span): (&Stage, &StageSpan)| (stage.name(), percentiles(&span.latencies));
        let rate = |span: &StageSpan| span.counts.passed.saturating_sub(span.passed_before) as f64 / span_s;
        Sample {
            wall_ms,
            total: percentiles(&self.total),
            stages: self.stages.iter().map(named).collect(),
            segments: (self.journeys > 0).then(|| self.segments_ns.map(|sum| sum as f64 * 1e-6 / self.journeys as f64)),
            rates: self.stages.iter().map(|(stage, span)| (stage.name(), rate(span))).collect(),
            dropped: self.stages.iter().map(|(stage, span)| (stage.name(), losses(&span.counts))).collect(),
            lost: Losses::from_counts(
                &self.stages.iter().map(|(stage, span)| (*stage, span.counts)).collect::<Vec<_>>(),
            ),
            window: self.window.as_ref().map(WindowSample::from_report),
        }
    }
}

impl StageSpan {
    fn new(passed_before: u64) -> Self {
        Self { passed_before, counts: Counts::default(), latencies: Latencies::coarse() }
    }

    /// Returns the next interval of the stage, still empty.
    fn next(&self) -> Self {
        Self { passed_before: self.counts.passed, counts: self.counts, latencies: Latencies::coarse() }
    }

    fn merge(&mut self, next: &Self) {
        self.counts = next.counts;
        self.latencies.merge(&next.latencies);
    }
}

impl WindowSample {
    fn from_report(report: &WindowReport) -> Self {
        let figures = WindowFigures::from_report(report);
        Self {
            sd_rad: figures.sd_rad,
            n: figures.n,
            efc: figures.efc,
            drift_rms_rad: figures.drift.map(|drift| drift.rms_rad),
            residual_sd_rad: figures.drift.map(|drift| drift.residual_sd_rad),
            unique: figures.outcomes.unique,
            undecided: figures.outcomes.undecided,
            rejected: figures.outcomes.rejected,
            delta_median_rad: figures.delta_median_rad,
            residual: figures.residual,
            points: figures.points,
            fast_motion_rad: figures.cameras.map(|camera| camera.motion.map(|motion| motion.fast_rad)),
            health: figures.health.map(|health| health.state.name()),
        }
    }
}

fn percentiles(latencies: &Latencies) -> Option<[f64; 3]> {
    latencies.brief().map(|Latency { p50_ms, p90_ms, p99_ms, .. }| [p50_ms, p90_ms, p99_ms])
}

fn losses(counts: &Counts) -> u64 {
    counts.losses().map(|(_, n)| n).sum()
}

#[cfg(test)]
mod tests {
    use super::*;
    use fringeflow_message::DropReason;

    const SECOND_NS: u64 = 1_000_000_000;

    fn cloud(passed: u64, taken_ns: u64, passed_ns: u64) -> StageReport {
        let mut counts = Counts { taken: passed + 2, passed, ..Counts::default() };
        counts.drop_one(DropReason::Overrun);
        counts.drop_one(DropReason::EmptyCloud);
        StageReport { stage: Stage::Cloud as u32, of_item: 1, taken_ns, passed_ns, counts, ..StageReport::default() }
    }

    #[test]
    fn rates_count_the_items_of_the_interval() {
        let mut first = Interval::new(0, None);
        for n in 1..=10 {
            first.add(&cloud(n, 0, 5_000_000), None);
        }
        // The first report already counts one.
        assert_eq!(first.sample(SECOND_NS, 0.0).rates["cloud"], 9.0);
        let mut second = Interval::new(SECOND_NS, Some(&first));
        assert_eq!(second.sample(3 * SECOND_NS, 0.0).rates["cloud"], 0.0);
        second.add(&cloud(30, 0, 5_000_000), None);
        let sample = second.sample(3 * SECOND_NS, 7.0);
        assert_eq!((sample.rates["cloud"], sample.dropped["cloud"], sample.wall_ms), (10.0, 1, 7.0));
        assert!((sample.total.unwrap()[0] - 5.0).abs() < 0.3 && sample.segments.is_none() && sample.window.is_none());
    }

    #[test]
    fn merged_intervals_equal_one_interval_with_all_reports() {
        let (mut first, mut both) = (Interval::new(0, None), Interval::new(0, None));
        let journey = |ns: u64| Journey { exposure_start_ns: 0, ends_ns: [ns; 7] };
        let window = |published| WindowReport { published, ..WindowReport::default() };
        for n in 1..=10 {
            first.add(&cloud(n, 0, n * 1_000_000), Some(&journey(n)));
            both.add(&cloud(n, 0, n * 1_000_000), Some(&journey(n)));
        }
        first.add_window(&window(1));
        let mut second = Interval::new(SECOND_NS, Some(&first));
        for n in 11..=30 {
            second.add(&cloud(n, 0, n * 1_000_000), Some(&journey(n)));
            both.add(&cloud(n, 0, n * 1_000_000), Some(&journey(n)));
        }
        let phase = StageReport { stage: Stage::Phase as u32, of_item: 1, ..cloud(5, 0, 3) };
        second.add(&phase, None);
        both.add(&phase, None);
        both.add_window(&window(1));
        first.merge(&second);
        assert_eq!(first.sample(2 * SECOND_NS, 7.0), both.sample(2 * SECOND_NS, 7.0));
        second.add_window(&window(2));
        first.merge(&second);
        assert_eq!(first.window.unwrap().published, 2);
    }

    #[test]
    fn segments_are_means_over_the_windows() {
        let mut interval = Interval::new(0, None);
        for end_ns in [2_000_000, 4_000_000] {
            interval.add(&cloud(1, 0, 1), Some(&Journey { exposure_start_ns: 0, ends_ns: [end_ns; 7] }));
        }
        let segments = interval.sample(SECOND_NS, 0.0).segments.unwrap();
        assert_eq!(segments, [3.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
    }
}
