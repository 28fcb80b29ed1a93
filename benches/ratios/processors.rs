//! CPUs on which a thread may run.

use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};

/// CPUs on which this program may run, as determined before any thread is pinned.
pub(crate) fn all() -> Vec<usize> {
    use std::sync::OnceLock;
    static ALL: OnceLock<Vec<usize>> = OnceLock::new();
    ALL.get_or_init(|| {
        let set = sched_getaffinity(None).unwrap();
        (0..CpuSet::MAX_CPU).filter(|&cpu| set.is_set(cpu)).collect()
    })
    .clone()
}

/// Pins this thread, and threads and processes that it starts later, to the last CPU: the first one serves interrupts.
pub(crate) fn pin_to_one() {
    let last = all().last().copied().unwrap_or_default();
    pin(&[last]);
}

/// Pins this thread, and threads and processes that it starts later, to some CPUs.
pub(crate) fn pin(cpus: &[usize]) {
    // Determine all CPUs before this thread is limited.
    all();
    let mut set = CpuSet::new();
    cpus.iter().for_each(|&cpu| set.set(cpu));
    sched_setaffinity(None, &set).unwrap();
}
