//! Summarizes a whole run from its reports, in bounded memory. The same type serves live runs and recordings.

use fringeflow_message::{StageReport, WindowReport};

use super::{Cause, HealthRecord, History, Journey, Latencies, Sample, Segment, Tally, WindowFigures, WorstWindows};

/// Number of slowest windows in the report of a run.
pub const WORST_WINDOWS: usize = 20;

/// Whether the exposure times belong to this run.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Exposures {
    /// The exposures took place during the run.
    #[default]
    Live,
    /// The exposures come from a replayed recording. Durations before the window was complete are unknown.
    Replayed,
}

/// The reports of a run: totals, timeline, and the slowest windows.
#[derive(Debug)]
pub struct RunReport {
    exposures: Exposures,
    tally: Tally,
    history: History,
    worst: WorstWindows,
    window: Option<WindowFigures>,
    health: HealthRecord,
}

impl RunReport {
    /// Creates a report of a run without reports. It will keep the `most` slowest windows.
    #[must_use]
    pub fn new(exposures: Exposures, most: usize) -> Self {
        Self {
            exposures,
            tally: Tally::default(),
            history: History::default(),
            worst: WorstWindows::new(most),
            window: None,
            health: HealthRecord::default(),
        }
    }

    /// Adds a report.
    pub fn add(&mut self, report: &StageReport) {
        let journey = self.tally.add(report).map(|journey| self.without_unknown_times(journey));
        self.history.add(report, journey.as_ref());
        if let Some(journey) = &journey {
            self.worst.add(journey);
        }
    }

    /// Adds the figures of a window.
    pub fn add_window(&mut self, report: &WindowReport) {
        self.history.add_window(report);
        self.health.add(report);
        self.window = Some(WindowFigures::from_report(report));
    }

    /// Whether the exposure times belong to this run.
    #[must_use]
    pub fn exposures(&self) -> Exposures {
        self.exposures
    }

    /// Counts and latencies of the stages.
    #[must_use]
    pub fn tally(&self) -> &Tally {
        &self.tally
    }

    /// The timeline.
    #[must_use]
    pub fn history(&self) -> &History {
        &self.history
    }

    /// Returns the points of the timeline, without unknown durations. `wall_ms` is as for [`History::samples`].
    #[must_use]
    pub fn samples(&self, wall_ms: impl Fn(u64) -> f64) -> Vec<Sample> {
        let mut samples = self.history.samples(wall_ms);
        if self.exposures == Exposures::Replayed {
            samples.iter_mut().for_each(|sample| sample.total = None);
        }
        samples
    }

    /// The last window.
    #[must_use]
    pub fn window(&self) -> Option<&WindowFigures> {
        self.window.as_ref()
    }

    /// The health over all windows.
    #[must_use]
    pub fn health(&self) -> &HealthRecord {
        &self.health
    }

    /// Number of windows with reports from exposure to cloud.
    #[must_use]
    pub fn windows(&self) -> u64 {
        self.tally.segment(Segment::Cloud).count()
    }

    /// Number of clouds whose windows lack the report of an earlier stage. They count only in the latencies of the
    /// stages.
    #[must_use]
    pub fn incomplete(&self) -> u64 {
        self.tally.total().count().saturating_sub(self.windows())
    }

    /// Latencies from the start of the last exposure to the published cloud; `None` in a replay.
    #[must_use]
    pub fn exposure_to_cloud(&self) -> Option<&Latencies> {
        (self.exposures == Exposures::Live).then(|| self.tally.total())
    }

    /// Iterates over the segments with known durations, in their order.
    pub fn segments(&self) -> impl Iterator<Item = (Segment, &Latencies)> + '_ {
        let first = match self.exposures {
            Exposures::Live => Segment::Camera,
            Exposures::Replayed => Segment::Phase,
        };
        let known = Segment::ALL.into_iter().filter(move |&segment| segment >= first);
        known.map(|segment| (segment, self.tally.segment(segment)))
    }

    /// The slowest windows by their known durations, the slowest first.
    #[must_use]
    pub fn worst(&self) -> &[Journey] {
        self.worst.journeys()
    }

    /// Returns why a window took long, or `None` if no segment took longer than its median.
    #[must_use]
    pub fn cause(&self, journey: &Journey) -> Option<Cause> {
        let causes = self.segments().filter_map(|(segment, latencies)| {
            let ms = journey.duration_ns(segment) as f64 * 1e-6;
            Some(Cause { segment, ms, median_ms: latencies.brief()?.p50_ms })
        });
        let excess = |cause: &Cause| cause.ms - cause.median_ms;
        causes.filter(|cause| excess(cause) > 0.0).max_by(|a, b| excess(a).total_cmp(&excess(b)))
    }

    fn without_unknown_times(&self, journey: Journey) -> Journey {
        match self.exposures {
            Exposures::Live => journey,
            Exposures::Replayed => journey.since_window_complete(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fringeflow_message::{Counts, Stage};

    const MS: u64 = 1_000_000;

    /// Adds the reports of the three processing stages on a window that takes 10 ms in the camera, waits for
    /// `queue_ms`, and takes `search_ms` in the correspondence stage.
    fn window(run: &mut RunReport, exposure_ms: u64, queue_ms: u64, search_ms: u64) {
        let received_ms = exposure_ms + 10;
        let phase_ms = received_ms + 4;
        let found_ms = phase_ms + queue_ms + search_ms;
        for (stage, taken_ms, passed_ms) in [
            (Stage::Phase, received_ms + 1, phase_ms),
            (Stage::Correspondence, phase_ms + queue_ms, found_ms),
            (Stage::Cloud, found_ms, found_ms + 5),
        ] {
            let passed = run.tally().stage(stage).map_or(0, |of_stage| of_stage.counts.passed) + 1;
            run.add(&StageReport {
                stage: stage as u32,
                of_item: 1,
                time_ns: passed_ms * MS,
                exposure_start_ns: exposure_ms * MS,
                received_ns: received_ms * MS,
                taken_ns: taken_ms * MS,
                passed_ns: passed_ms * MS,
                counts: Counts { taken: passed, passed, ..Counts::default() },
                ..StageReport::default()
            });
        }
    }

    fn run(exposures: Exposures) -> RunReport {
        let mut run = RunReport::new(exposures, 2);
        (0..50).for_each(|n| window(&mut run, 1000 + 100 * n, 0, 30));
        window(&mut run, 7000, 0, 90);
        window(&mut run, 8000, 70, 30);
        run
    }

    #[test]
    fn the_cause_is_what_took_longer_than_usual() {
        let run = run(Exposures::Live);
        let totals: Vec<u64> = run.worst().iter().map(|journey| journey.total_ns() / MS).collect();
        assert_eq!((run.windows(), run.incomplete(), totals), (52, 0, vec![119, 109]));
        let causes: Vec<_> = run.worst().iter().map(|journey| run.cause(journey).unwrap()).collect();
        assert_eq!([causes[0].segment, causes[1].segment], [Segment::CorrespondenceQueue, Segment::Correspondence]);
        assert!((causes[1].ms - 90.0).abs() < 1e-9 && (causes[1].median_ms / 30.0 - 1.0).abs() < 0.02);
        let sums: u64 = run.segments().map(|(_, latencies)| latencies.sum_ns()).sum();
        assert_eq!(sums, run.exposure_to_cloud().unwrap().sum_ns());
        let clouds = run.tally().stage(Stage::Cloud).unwrap();
        assert!((clouds.mean_rate_hz().unwrap() - 51.0 / 7.07).abs() < 1e-2);
    }

    #[test]
    fn a_replay_knows_nothing_before_the_window_was_complete() {
        let run = run(Exposures::Replayed);
        assert!(run.exposure_to_cloud().is_none() && run.samples(|_| 0.0).iter().all(|sample| sample.total.is_none()));
        assert_eq!(run.segments().next().unwrap().0, Segment::Phase);
        assert_eq!(run.worst()[0].total_ns(), 108 * MS);
        assert_eq!(run.samples(|_| 0.0)[0].segments.unwrap()[..3], [0.0, 0.0, 3.0]);
    }

    #[test]
    fn windows_without_their_beginning_are_counted() {
        let mut run = RunReport::new(Exposures::Live, 3);
        run.add(&StageReport { stage: Stage::Cloud as u32, of_item: 1, ..StageReport::default() });
        assert_eq!((run.windows(), run.incomplete(), run.worst().len()), (0, 1, 0));
        assert_eq!(run.tally().stage(Stage::Cloud).unwrap().mean_rate_hz(), None);
    }
}
