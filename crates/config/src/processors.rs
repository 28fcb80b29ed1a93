//! `[processors.SERVICE]`: CPUs and memory per service.
//!
//! In: tables by the name of a service. Out: for each service its CPUs, number of threads, priority, and which memory
//! stays in RAM. The operating system decides what a table does not set. The CPU numbers are not checked against the
//! CPUs of this computer, because the file may be read on another one.

use std::collections::BTreeMap;

use super::ConfigurationProblem;
use super::raw::{RawProcessors, checked, one_of};

/// Services that may have a table. The names are those of `fringeflow service`.
pub const SERVICES: [&str; 11] = [
    "virtual-projector",
    "virtual-cameras",
    "camera1",
    "camera2",
    "stereo-camera",
    "phase",
    "correspondence",
    "cloud",
    "tracking",
    "recorder",
    "monitor",
];

/// Upper bound of CPU numbers, exclusive.
const MAX_CPUS: usize = 1024;
/// Maximum number of threads of a service.
const MAX_THREADS: usize = 1024;

/// Settings by the name of the service.
pub type ProcessorsConfiguration = BTreeMap<&'static str, ServiceProcessors>;

/// CPUs, threads, priority and memory of one service.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct ServiceProcessors {
    /// CPUs that the service may run on, in ascending order; `None` for all.
    pub cpus: Option<Vec<usize>>,
    /// Number of worker threads; `None` for one per CPU.
    pub threads: Option<usize>,
    /// Real-time priority, 1 to 99; `None` for an ordinary task.
    pub realtime_priority: Option<u8>,
    /// Which memory stays in RAM.
    pub lock_memory: MemoryLock,
}

/// Which memory of a service stays in RAM.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum MemoryLock {
    /// None: the operating system decides.
    #[default]
    Off,
    /// The pages that have been used.
    Used,
    /// All pages, so that even the first use causes no page fault.
    All,
}

pub(super) fn configuration(
    raw: &BTreeMap<String, RawProcessors>,
) -> Result<ProcessorsConfiguration, ConfigurationProblem> {
    let names = SERVICES.map(|name| (name, name));
    let by_service = |(name, raw): (&String, &RawProcessors)| {
        let name = one_of("processors", name, &names)?;
        let problem = |problem| ConfigurationProblem::Service { service: name, problem: Box::new(problem) };
        Ok((name, service(raw).map_err(problem)?))
    };
    raw.iter().map(by_service).collect()
}

fn service(raw: &RawProcessors) -> Result<ServiceProcessors, ConfigurationProblem> {
    let threads = |n| checked("threads", n, |n| (1..=MAX_THREADS).contains(n), "it must lie between 1 and 1024");
    let priority = |p| checked("realtime_priority", p, |p| (1..=99).contains(p), "it must lie between 1 and 99");
    let locks = [("off", MemoryLock::Off), ("used", MemoryLock::Used), ("all", MemoryLock::All)];
    Ok(ServiceProcessors {
        cpus: raw.cpus.as_deref().map(cpus).transpose()?,
        threads: raw.threads.map(threads).transpose()?,
        realtime_priority: raw.realtime_priority.map(priority).transpose()?,
        lock_memory: one_of("lock_memory", raw.lock_memory.as_deref().unwrap_or("off"), &locks)?,
    })
}

fn cpus(raw: &[usize]) -> Result<Vec<usize>, ConfigurationProblem> {
    let mut cpus = raw.to_vec();
    cpus.sort_unstable();
    let is_repeated = cpus.windows(2).any(|pair| pair[0] == pair[1]);
    if cpus.is_empty() || is_repeated || cpus.iter().any(|&cpu| cpu >= MAX_CPUS) {
        return Err(ConfigurationProblem::Value {
            key: "cpus",
            value: format!("{raw:?}"),
            expected: "it must list at least one CPU, each once, by the numbers that `lscpu --extended` shows; remove \
                       the key to use all CPUs",
        });
    }
    Ok(cpus)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(serde::Deserialize)]
    struct File {
        processors: BTreeMap<String, RawProcessors>,
    }

    fn parse(text: &str) -> Result<ProcessorsConfiguration, String> {
        let file: File = toml::from_str(text).map_err(|e| e.to_string())?;
        configuration(&file.processors).map_err(|e| e.to_string())
    }

    #[test]
    fn absent_keys_stay_unset() {
        let all = parse("[processors.phase]\ncpus = [3, 1]\nthreads = 4\n[processors.camera1]\nrealtime_priority = 20");
        let all = all.unwrap();
        let phase = ServiceProcessors { cpus: Some(vec![1, 3]), threads: Some(4), ..ServiceProcessors::default() };
        assert_eq!((all.len(), &all["phase"]), (2, &phase));
        assert_eq!(all["camera1"].realtime_priority, Some(20));
        let locked = parse("[processors.cloud]\nlock_memory = \"used\"").unwrap();
        assert_eq!(locked["cloud"].lock_memory, MemoryLock::Used);
    }

    #[test]
    fn invalid_values_are_named_with_their_service() {
        let refused = |text: &str| parse(&format!("[processors.phase]\n{text}")).unwrap_err();
        assert!(
            refused("cpus = []").starts_with("in [processors.phase]: key cpus is []; it must list at least one CPU")
        );
        assert!(refused("cpus = [2, 2]").contains("each once"));
        assert!(refused("cpus = [1024]").contains("key cpus is [1024]"));
        assert!(refused("cpus = [-1]").contains("cpus"));
        assert!(refused("threads = 0").contains("key threads is 0; it must lie between"));
        assert!(refused("realtime_priority = 100").contains("key realtime_priority is 100"));
        assert!(
            refused("lock_memory = \"on\"")
                .contains("key lock_memory is \"on\"; it must be one of [\"off\", \"used\", \"all\"]")
        );
        assert!(refused("cpu = [1]").contains("cpu"));
        assert!(
            parse("[processors.fase]\nthreads = 1").unwrap_err().contains("processors is \"fase\"; it must be one of")
        );
    }
}
