//! The load of a stage in the last seconds: items, work and CPU time.

use fringeflow_message::{DropReason, StageReport};

/// Shortest span of a load, nanoseconds.
const SHORTEST_NS: u64 = 1_000_000_000;
/// Time after which older reports are forgotten, nanoseconds. A load covers once to twice this time.
const SPAN_NS: u64 = 5_000_000_000;

/// Load of a stage.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Load {
    /// Items passed on per second.
    pub passed_hz: f64,
    /// Items per second that were skipped because the next stage was busy.
    pub skipped_hz: f64,
    /// Mean time of work for an item, milliseconds; `None` if no item was passed on.
    pub work_ms: Option<f64>,
    /// CPU time of its process per second, seconds.
    pub cpus: f64,
}

/// Measures the load of a stage by its reports.
#[derive(Clone, Copy, Debug)]
pub(super) struct LoadMeter {
    pid: u32,
    /// Sums at the begin of the load, and some seconds later: the begin of the next load.
    begins: [Sums; 2],
    last: Sums,
}

/// Sums over all reports until a time.
#[derive(Clone, Copy, Debug, Default)]
struct Sums {
    time_ns: u64,
    passed: u64,
    skipped: u64,
    items: u64,
    work_ns: u64,
    cpu_ns: u64,
}

impl LoadMeter {
    /// Begins to measure at the time of a report.
    pub(super) fn new(report: &StageReport) -> Self {
        let first = Sums { items: 0, work_ns: 0, ..Sums::default().after(report) };
        Self { pid: report.pid, begins: [first; 2], last: first }
    }

    /// Adds a report. A new process begins anew, because its CPU time does.
    pub(super) fn add(&mut self, report: &StageReport) {
        if report.pid != self.pid {
            *self = Self::new(report);
            return;
        }
        self.last = self.last.after(report);
        if self.last.time_ns.saturating_sub(self.begins[1].time_ns) >= SPAN_NS {
            self.begins = [self.begins[1], self.last];
        }
    }

    /// Returns the load, or `None` before it has been measured for a second.
    pub(super) fn load(&self) -> Option<Load> {
        let (begin, end) = (&self.begins[0], &self.last);
        let span_ns = end.time_ns.checked_sub(begin.time_ns).filter(|&span_ns| span_ns >= SHORTEST_NS)?;
        let span_s = span_ns as f64 * 1e-9;
        let per_s = |sum: fn(&Sums) -> u64| sum(end).saturating_sub(sum(begin)) as f64 / span_s;
        let (items, work_ns) = (end.items - begin.items, end.work_ns - begin.work_ns);
        Some(Load {
            passed_hz: per_s(|sums| sums.passed),
            skipped_hz: per_s(|sums| sums.skipped),
            work_ms: (items > 0).then(|| work_ns as f64 * 1e-6 / items as f64),
            cpus: per_s(|sums| sums.cpu_ns) * 1e-9,
        })
    }
}

impl Sums {
    fn after(self, report: &StageReport) -> Self {
        Self {
            time_ns: report.time_ns,
            passed: report.counts.passed,
            skipped: report.counts.dropped(DropReason::NextStageBusy),
            items: self.items + u64::from(report.of_item != 0),
            work_ns: self.work_ns.saturating_add(report.work_ns),
            cpu_ns: report.cpu_ns,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fringeflow_message::Counts;

    const MS: u64 = 1_000_000;

    /// Report number `n` of a stage that passes on an item every 100 ms after `work_ms`, on half a processor.
    fn report(n: u64, work_ms: u64) -> StageReport {
        let counts = Counts { passed: n, ..Counts::default() };
        let (time_ns, cpu_ns) = (n * 100 * MS, n * 50 * MS);
        StageReport { pid: 1, of_item: 1, time_ns, cpu_ns, work_ns: work_ms * MS, counts, ..StageReport::default() }
    }

    #[test]
    fn the_load_is_that_of_the_last_seconds() {
        let mut meter = LoadMeter::new(&report(0, 0));
        (1..=9).for_each(|n| meter.add(&report(n, 70)));
        assert_eq!(meter.load(), None);
        (10..=100).for_each(|n| meter.add(&report(n, 70)));
        let load = Load { passed_hz: 10.0, skipped_hz: 0.0, work_ms: Some(70.0), cpus: 0.5 };
        assert_eq!(meter.load(), Some(load));
        (101..=200).for_each(|n| meter.add(&report(n, 20)));
        assert_eq!(meter.load(), Some(Load { work_ms: Some(20.0), ..load }));
    }

    #[test]
    fn a_new_process_is_measured_anew() {
        let mut meter = LoadMeter::new(&report(0, 0));
        (1..=20).for_each(|n| meter.add(&report(n, 70)));
        let restarted = |n: u64| StageReport { pid: 2, cpu_ns: (n - 21) * 10 * MS, ..report(n, 30) };
        meter.add(&restarted(21));
        assert_eq!(meter.load(), None);
        (22..=40).for_each(|n| meter.add(&restarted(n)));
        let load = meter.load().unwrap();
        assert_eq!((load.work_ms, load.passed_hz), (Some(30.0), 10.0));
        assert!((load.cpus - 0.1).abs() < 1e-9, "{load:?}");
    }

    #[test]
    fn heartbeats_count_no_item() {
        let mut meter = LoadMeter::new(&report(0, 0));
        (1..=20).for_each(|n| {
            let mut counts = Counts::default();
            counts.drop_many(DropReason::NextStageBusy, n);
            meter.add(&StageReport { of_item: 0, work_ns: 0, counts, ..report(n, 0) });
        });
        assert_eq!(meter.load(), Some(Load { passed_hz: 0.0, skipped_hz: 10.0, work_ms: None, cpus: 0.5 }));
    }
}
