//! The state of each service of the instance.
//!
//! In: the reports of its stages, its process in `/proc`, and the items dropped because of it. Out: its
//! [`ServiceStatus`].

use serde::Serialize;

use fringeflow_message::{Counts, DropReason, Stage};
use fringeflow_telemetry::{StageTally, Tally};

use crate::process::{Process, Usage};

/// Name of the process that starts the services.
const SUPERVISOR: &str = "supervisor";
/// Name of this service.
const MONITOR: &str = "monitor";

/// State of a service, as the dashboard shows it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub(crate) enum ServiceState {
    /// It works.
    Ok,
    /// It works, but receives more than it can process.
    Slow,
    /// It has not reported for three seconds, or never.
    Silent,
    /// Its process has ended; the supervisor starts another.
    Restarting,
}

/// Status of a service at the last update.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct ServiceStatus {
    pub(crate) name: &'static str,
    pub(crate) state: ServiceState,
    /// Why the state is not ok; else empty.
    pub(crate) why: String,
    pub(crate) pid: Option<u32>,
    pub(crate) restarts: u32,
    pub(crate) cpu_percent: Option<f64>,
    pub(crate) memory_mb: Option<f64>,
    #[serde(serialize_with = "serialize_stage_names")]
    pub(crate) stages: Vec<Stage>,
    /// CPU time of all its processes, ended ones included, seconds.
    #[serde(skip)]
    pub(crate) cpu_s: f64,
    #[serde(skip)]
    pub(crate) memory_bytes: u64,
    /// Page faults of the same processes: minor, and major, which wait for a disk.
    #[serde(skip)]
    pub(crate) page_faults: [u64; 2],
}

/// Follows the services of an instance.
#[derive(Debug)]
pub(crate) struct Services {
    watches: Vec<ServiceWatch>,
    updated_ns: u64,
}

#[derive(Debug)]
struct ServiceWatch {
    status: ServiceStatus,
    process: Option<Process>,
    /// CPU time of its earlier processes, seconds.
    earlier_cpu_s: f64,
    /// Page faults of its earlier processes, minor and major.
    earlier_faults: [u64; 2],
    /// Counts of [`held_up_counts`] at the last update.
    last_held_up: Vec<Counts>,
}

impl ServiceStatus {
    pub(crate) fn new(name: &'static str, stages: &[Stage]) -> Self {
        Self {
            name,
            state: ServiceState::Ok,
            why: String::new(),
            pid: None,
            restarts: 0,
            cpu_percent: None,
            memory_mb: None,
            stages: stages.to_vec(),
            cpu_s: 0.0,
            memory_bytes: 0,
            page_faults: [0; 2],
        }
    }

    /// Whether the service does its work.
    pub(crate) fn is_up(&self) -> bool {
        matches!(self.state, ServiceState::Ok | ServiceState::Slow)
    }
}

impl Services {
    /// Follows services given by name, with the stages that each reports on. The state of a service without stages
    /// depends on its process alone. The supervisor is added.
    pub(crate) fn new(services: &[(&'static str, &'static [Stage])]) -> Self {
        let mut watches =
            vec![ServiceWatch::new(SUPERVISOR, &[], rustix::process::getppid().map(|pid| pid.as_raw_pid() as u32))];
        let watch = |&(name, stages): &(&'static str, &'static [Stage])| {
            ServiceWatch::new(name, stages, (name == MONITOR).then(std::process::id))
        };
        watches.extend(services.iter().map(watch));
        Self { watches, updated_ns: 0 }
    }

    /// Returns the statuses at the last update.
    pub(crate) fn statuses(&self) -> Vec<ServiceStatus> {
        self.watches.iter().map(|watch| watch.status.clone()).collect()
    }

    /// Updates all statuses.
    pub(crate) fn update(&mut self, tally: &Tally, now_ns: u64) {
        let span_s = now_ns.saturating_sub(self.updated_ns) as f64 * 1e-9;
        self.updated_ns = now_ns;
        self.watches.iter_mut().for_each(|watch| watch.update(tally, now_ns, span_s));
    }
}

impl ServiceWatch {
    fn new(name: &'static str, stages: &[Stage], pid: Option<u32>) -> Self {
        let status = ServiceStatus::new(name, stages);
        Self {
            status,
            process: pid.map(Process::new),
            earlier_cpu_s: 0.0,
            earlier_faults: [0; 2],
            last_held_up: Vec::new(),
        }
    }

    fn update(&mut self, tally: &Tally, now_ns: u64, span_s: f64) {
        let reports: Vec<&StageTally> = self.status.stages.iter().filter_map(|&stage| tally.stage(stage)).collect();
        if let Some(last) = reports.iter().max_by_key(|report| report.time_ns) {
            self.status.restarts = last.restarts;
            self.follow_process(last.pid);
        }
        let usage = self.process.as_mut().and_then(Process::usage);
        self.add_usage(usage, span_s);
        let (state, why) = self.find_state(&reports, usage.is_some(), tally, now_ns);
        (self.status.state, self.status.why) = (state, why);
        self.last_held_up = held_up_counts(&self.status.stages, tally);
    }

    /// Continues with the process that reports now.
    fn follow_process(&mut self, pid: u32) {
        if self.process.as_ref().is_none_or(|process| process.pid() != pid) {
            self.earlier_cpu_s = self.status.cpu_s;
            self.earlier_faults = self.status.page_faults;
            self.process = Some(Process::new(pid));
        }
    }

    /// Adds the usage of the current process over `span_s` seconds; `None` if the process has ended.
    fn add_usage(&mut self, usage: Option<Usage>, span_s: f64) {
        self.status.pid = usage.and(self.process.as_ref()).map(Process::pid);
        self.status.cpu_percent = None;
        self.status.memory_mb = usage.map(|usage| usage.memory_bytes as f64 / 1e6);
        self.status.memory_bytes = usage.map_or(0, |usage| usage.memory_bytes);
        if let Some(usage) = usage {
            let cpu_s = self.earlier_cpu_s + usage.cpu_s;
            let is_first = self.status.cpu_s == 0.0;
            let spent_s = cpu_s - self.status.cpu_s;
            self.status.cpu_percent = (!is_first && span_s > 0.0).then(|| 100.0 * spent_s.max(0.0) / span_s);
            self.status.cpu_s = cpu_s;
            let [minor, major] = self.earlier_faults;
            self.status.page_faults = [minor + usage.minor_faults, major + usage.major_faults];
        }
    }

    /// Returns the state of the service, and why it is not ok.
    fn find_state(
        &self,
        reports: &[&StageTally],
        is_alive: bool,
        tally: &Tally,
        now_ns: u64,
    ) -> (ServiceState, String) {
        if self.process.is_some() && !is_alive {
            return (ServiceState::Restarting, "its process has ended".to_owned());
        }
        if self.status.stages.is_empty() {
            return (ServiceState::Ok, String::new());
        }
        if reports.is_empty() {
            return (ServiceState::Silent, "has not reported yet".to_owned());
        }
        let last_ns = reports.iter().map(|report| report.time_ns).max().unwrap_or(0);
        if reports.iter().all(|report| report.is_silent(now_ns)) {
            let silence_s = now_ns.saturating_sub(last_ns) / 1_000_000_000;
            return (ServiceState::Silent, format!("no report for {silence_s} s"));
        }
        match self.describe_backlog(tally) {
            Some(why) => (ServiceState::Slow, why),
            None => (ServiceState::Ok, String::new()),
        }
    }

    /// Describes what was dropped since the last update because this service was too slow; `None` if nothing was.
    fn describe_backlog(&self, tally: &Tally) -> Option<String> {
        let now = held_up_counts(&self.status.stages, tally);
        let new_drops = |reason: DropReason| -> u64 {
            let pairs = now.iter().zip(&self.last_held_up);
            pairs.map(|(now, before)| now.dropped(reason).saturating_sub(before.dropped(reason))).sum()
        };
        let describe = |reason, what| Some(new_drops(reason)).filter(|&n| n > 0).map(|n| format!("{n} {what}"));
        describe(DropReason::Overrun, "items overwritten before it took them")
            .or_else(|| describe(DropReason::QueueFull, "messages dropped because the queue to the disk was full"))
            .or_else(|| describe(DropReason::NoSample, "items dropped because the channel had no free memory"))
            .or_else(|| describe(DropReason::NextStageBusy, "items skipped because it was busy"))
    }
}

/// Counts the items dropped because a service was too slow: by its own stages, and by the previous stage if that found
/// it busy.
fn held_up_counts(stages: &[Stage], tally: &Tally) -> Vec<Counts> {
    let counts = |stage| tally.stage(stage).map(|of_stage: &StageTally| of_stage.counts).unwrap_or_default();
    let only = |counts: Counts, reasons: &[DropReason]| {
        let mut only = Counts::default();
        reasons.iter().for_each(|&reason| only.drop_many(reason, counts.dropped(reason)));
        only
    };
    let own = stages
        .iter()
        .map(|&stage| only(counts(stage), &[DropReason::Overrun, DropReason::QueueFull, DropReason::NoSample]));
    // Only correspondence has a previous stage that skips items while it is busy.
    let before =
        stages.contains(&Stage::Correspondence).then(|| only(counts(Stage::Phase), &[DropReason::NextStageBusy]));
    own.chain(before).collect()
}

fn serialize_stage_names<S: serde::Serializer>(stages: &[Stage], serializer: S) -> Result<S::Ok, S::Error> {
    serializer.collect_seq(stages.iter().map(|stage| stage.name()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use fringeflow_message::StageReport;

    const SECOND_NS: u64 = 1_000_000_000;

    fn tally(pid: u32, time_ns: u64, busy: u64) -> Tally {
        let mut tally = Tally::default();
        let mut counts = Counts::default();
        counts.drop_many(DropReason::NextStageBusy, busy);
        tally.add(&StageReport { stage: Stage::Phase as u32, pid, time_ns, counts, ..StageReport::default() });
        tally.add(&StageReport { stage: Stage::Correspondence as u32, pid, time_ns, ..StageReport::default() });
        tally
    }

    /// Updates the services and returns state and reason of each, without the supervisor.
    fn update(services: &mut Services, tally: &Tally, now_ns: u64) -> Vec<(ServiceState, String)> {
        services.update(tally, now_ns);
        services.statuses().into_iter().skip(1).map(|status| (status.state, status.why)).collect()
    }

    #[test]
    fn states_follow_reports_and_processes() {
        let own = std::process::id();
        let mut services = Services::new(&[
            ("phase", &[Stage::Phase]),
            ("correspondence", &[Stage::Correspondence]),
            ("monitor", &[]),
        ]);
        let states = update(&mut services, &Tally::default(), SECOND_NS);
        assert_eq!(states[0], (ServiceState::Silent, "has not reported yet".to_owned()));
        assert_eq!(states[2].0, ServiceState::Ok);
        let states = update(&mut services, &tally(own, SECOND_NS, 0), 2 * SECOND_NS);
        assert_eq!([states[0].0, states[1].0], [ServiceState::Ok; 2]);
        // If the phase stage skips windows because correspondence is busy, correspondence is slow.
        let states = update(&mut services, &tally(own, 2 * SECOND_NS, 8), 3 * SECOND_NS);
        assert_eq!(states[0].0, ServiceState::Ok);
        assert_eq!(states[1], (ServiceState::Slow, "8 items skipped because it was busy".to_owned()));
        let states = update(&mut services, &tally(own, 2 * SECOND_NS, 8), 9 * SECOND_NS);
        assert_eq!(states[1], (ServiceState::Silent, "no report for 7 s".to_owned()));
        // No process has this id: it exceeds the largest that Linux assigns.
        let states = update(&mut services, &tally(1 << 23, 9 * SECOND_NS, 8), 9 * SECOND_NS);
        assert_eq!(states[0], (ServiceState::Restarting, "its process has ended".to_owned()));
    }

    #[test]
    fn cpu_time_and_page_faults_add_up_over_the_processes_of_a_service() {
        let mut services = Services::new(&[("phase", &[Stage::Phase])]);
        let usage = |cpu_s| Some(Usage { cpu_s, memory_bytes: 5_000_000, minor_faults: 40, major_faults: 3 });
        let watch = &mut services.watches[1];
        watch.follow_process(7);
        watch.add_usage(usage(1.0), 1.0);
        watch.add_usage(usage(1.5), 1.0);
        assert_eq!((watch.status.cpu_percent, watch.status.memory_mb), (Some(50.0), Some(5.0)));
        watch.follow_process(8);
        watch.add_usage(usage(0.25), 1.0);
        assert_eq!((watch.status.cpu_s, watch.status.cpu_percent), (1.75, Some(25.0)));
        assert_eq!(watch.status.page_faults, [80, 6]);
    }
}
