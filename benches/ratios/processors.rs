//! Which processors a thread may run on.

use rustix::thread::{CpuSet, sched_getaffinity, sched_setaffinity};

/// The processors that this program was given, seen before anything is pinned.
pub(crate) fn all() -> Vec<usize> {
    use std::sync::OnceLock;
    static ALL: OnceLock<Vec<usize>> = OnceLock::new();
    ALL.get_or_init(|| {
        let set = sched_getaffinity(None).unwrap();
        (0..CpuSet::MAX_CPU).filter(|&cpu| set.is_set(cpu)).collect()
    })
    .clone()
}

/// Keeps this thread, and what it starts from now on, on the last processor: the first serves interrupts.
pub(crate) fn pin_to_one() {
    let last = all().last().copied().unwrap_or_default();
    pin(&[last]);
}

/// Keeps this thread, and what it starts from now on, on some processors.
pub(crate) fn pin(cpus: &[usize]) {
    all();
    let mut set = CpuSet::new();
    cpus.iter().for_each(|&cpu| set.set(cpu));
    sched_setaffinity(None, &set).unwrap();
}
