//! Timeline of a run of any length, in bounded memory.

use fringeflow_message::{StageReport, WindowReport};

use super::{Interval, Journey, Sample};

/// Maximum number of intervals: about 15 MB, with all stages active in each.
const MAX_INTERVALS: usize = 600;
/// Initial length of an interval, nanoseconds.
const INITIAL_SPAN_NS: u64 = 1_000_000_000;

/// Adjacent intervals of equal length. When there are too many, every two neighbours become one interval of twice the
/// length. So a run of an hour has intervals of eight seconds, a run of a day intervals of four minutes.
#[derive(Clone, Debug)]
pub struct History {
    span_ns: u64,
    intervals: Vec<Interval>,
    last_ns: u64,
}

impl Default for History {
    fn default() -> Self {
        Self { span_ns: INITIAL_SPAN_NS, intervals: Vec::new(), last_ns: 0 }
    }
}

impl History {
    /// Adds a report, and the journey that it completed. The report counts in the interval of its time; a late report
    /// counts in the last interval. The timeline begins with the first item: services may report for minutes before
    /// the first image arrives.
    pub fn add(&mut self, report: &StageReport, journey: Option<&Journey>) {
        if self.intervals.is_empty() && report.of_item == 0 {
            return;
        }
        self.extend_to(report.time_ns);
        if let Some(interval) = self.intervals.last_mut() {
            interval.add(report, journey);
        }
    }

    /// Adds the figures of a window. They have no time, so they count in the last interval.
    pub fn add_window(&mut self, report: &WindowReport) {
        if let Some(interval) = self.intervals.last_mut() {
            interval.add_window(report);
        }
    }

    /// Length of the intervals, nanoseconds.
    #[must_use]
    pub fn span_ns(&self) -> u64 {
        self.span_ns
    }

    /// Times of the first item and of the last report; `None` before the first item.
    #[must_use]
    pub fn bounds_ns(&self) -> Option<[u64; 2]> {
        Some([self.intervals.first()?.begin_ns(), self.last_ns])
    }

    /// The points of the timeline; `wall_ms` maps a time to the wall clock, Unix milliseconds.
    #[must_use]
    pub fn samples(&self, wall_ms: impl Fn(u64) -> f64) -> Vec<Sample> {
        let mut samples = Vec::with_capacity(self.intervals.len());
        let mut rest = &self.intervals[..];
        while let [interval, next @ ..] = rest {
            let end_ns = next.first().map_or(self.last_ns, Interval::begin_ns);
            // A rate over a short last interval would be arbitrary, so the last two intervals become one point.
            if let [last] = next
                && self.last_ns.saturating_sub(last.begin_ns()) < self.span_ns / 2
            {
                let mut merged = interval.clone();
                merged.merge(last);
                samples.push(merged.sample(self.last_ns, wall_ms(self.last_ns)));
                break;
            }
            samples.push(interval.sample(end_ns, wall_ms(end_ns)));
            rest = next;
        }
        samples
    }

    /// Adds intervals until the last one contains `time_ns`. Does nothing if the time is earlier.
    fn extend_to(&mut self, time_ns: u64) {
        let begin_ns = self.intervals.first().map_or(time_ns, Interval::begin_ns);
        self.last_ns = self.last_ns.max(time_ns);
        let since_ns = time_ns.saturating_sub(begin_ns);
        while since_ns / self.span_ns >= MAX_INTERVALS as u64 {
            self.halve_resolution();
        }
        while self.intervals.len() as u64 <= since_ns / self.span_ns {
            let begin_ns = begin_ns + self.intervals.len() as u64 * self.span_ns;
            self.intervals.push(Interval::new(begin_ns, self.intervals.last()));
        }
    }

    fn halve_resolution(&mut self) {
        self.span_ns = self.span_ns.saturating_mul(2);
        let mut intervals = std::mem::take(&mut self.intervals).into_iter();
        while let Some(mut interval) = intervals.next() {
            if let Some(next) = intervals.next() {
                interval.merge(&next);
            }
            self.intervals.push(interval);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fringeflow_message::{Counts, Stage};

    const SECOND_NS: u64 = 1_000_000_000;

    fn report(passed: u64, time_ns: u64) -> StageReport {
        let counts = Counts { taken: passed, passed, ..Counts::default() };
        let (stage, taken_ns) = (Stage::Cloud as u32, time_ns.saturating_sub(7_000_000));
        StageReport { stage, of_item: 1, time_ns, taken_ns, passed_ns: time_ns, counts, ..StageReport::default() }
    }

    /// A history with ten clouds a second.
    fn history(seconds: u64) -> History {
        let mut history = History::default();
        for n in 0..10 * seconds {
            history.add(&report(n + 1, 5 * SECOND_NS + n * SECOND_NS / 10), None);
        }
        history
    }

    #[test]
    fn rates_do_not_depend_on_the_length_of_the_intervals() {
        for (seconds, spans, span_s) in [(20, 20, 1), (600, 600, 1), (601, 301, 2), (5000, 313, 16)] {
            let history = history(seconds);
            assert_eq!((history.intervals.len(), history.span_ns()), (spans, span_s * SECOND_NS));
            let samples = history.samples(|ns| ns as f64 * 1e-6);
            // The first report of a stage adds nothing to the rate, and the last interval ends with the last report.
            for sample in &samples[1..samples.len() - 1] {
                assert_eq!(sample.rates["cloud"], 10.0);
                assert!((sample.stages["cloud"].unwrap()[0] - 7.0).abs() < 0.5);
            }
            assert!(samples.windows(2).all(|pair| pair[0].wall_ms < pair[1].wall_ms));
            assert_eq!(history.bounds_ns(), Some([5 * SECOND_NS, 5 * SECOND_NS + (10 * seconds - 1) * SECOND_NS / 10]));
            assert_eq!(samples.last().unwrap().wall_ms, history.last_ns as f64 * 1e-6);
        }
    }

    #[test]
    fn impossible_times_and_long_silence_keep_it_bounded() {
        let mut history = history(3);
        history.add(&report(31, 90_000 * SECOND_NS), None);
        assert!(history.intervals.len() <= MAX_INTERVALS);
        // A late report counts in the last interval.
        history.add(&report(32, 0), None);
        history.add(&report(33, u64::MAX), None);
        history.add(&report(34, u64::MAX), None);
        assert!(history.intervals.len() <= MAX_INTERVALS);
        let samples = history.samples(|_| 0.0);
        assert_eq!(samples.iter().filter(|sample| sample.stages["cloud"].is_some()).count(), 2);
    }

    #[test]
    fn a_short_last_interval_is_merged_with_the_one_before() {
        let mut history = history(2);
        history.add(&report(21, 7 * SECOND_NS + 1), None);
        let samples = history.samples(|_| 0.0);
        assert_eq!((history.intervals.len(), samples.len()), (3, 2));
        assert!((samples[1].rates["cloud"] - 11.0).abs() < 1e-6);
        assert!(History::default().samples(|_| 0.0).is_empty());
    }

    #[test]
    fn the_timeline_begins_with_the_first_item() {
        let mut history = History::default();
        (0..100).for_each(|n| history.add(&StageReport { of_item: 0, ..report(0, n * SECOND_NS) }, None));
        assert_eq!((history.bounds_ns(), history.samples(|_| 0.0).len()), (None, 0));
        history.add(&report(1, 100 * SECOND_NS), None);
        history.add(&StageReport { of_item: 0, ..report(1, 103 * SECOND_NS) }, None);
        assert_eq!(history.bounds_ns(), Some([100 * SECOND_NS, 103 * SECOND_NS]));
        assert_eq!(history.samples(|_| 0.0).len(), 3);
    }

    #[test]
    fn windows_count_in_the_last_interval() {
        let mut history = History::default();
        history.add_window(&WindowReport::default());
        history.add(&report(1, 0), None);
        history.add_window(&WindowReport { delta_sd_rad: 0.25, ..WindowReport::default() });
        assert_eq!(history.samples(|_| 0.0)[0].window.unwrap().sd_rad, 0.25);
    }
}
