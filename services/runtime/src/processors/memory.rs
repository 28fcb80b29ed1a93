//! Memory that stays in RAM: what was used once is never waited for again.

use rustix::mm::{MlockAllFlags, mlockall};
use rustix::process::{Resource, getrlimit};
use rustix::thread::{CapabilitySet, capabilities};

/// What is locked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Extent {
    /// Whatever was used once.
    Used,
    /// All, used or not.
    All,
}

/// Locks the memory that this process has and will have.
///
/// # Errors
/// The system does not grant it; why, and what to do.
pub(super) fn lock(extent: Extent) -> Result<(), String> {
    let remedy = "grant it by a line `USER - memlock unlimited` in /etc/security/limits.conf (`LimitMEMLOCK=infinity` in a \
                  systemd unit), then log in again; `ulimit -l` shows the limit";
    // Within a limit the lock would be granted now, and memory refused later, in the middle of the work.
    if let Some(limit) = getrlimit(Resource::Memlock).current.filter(|_| !may_lock_all()) {
        return Err(format!("lock_memory: only {} KiB may be locked; {remedy}", limit / 1024));
    }
    let flags = MlockAllFlags::CURRENT | MlockAllFlags::FUTURE;
    let flags = if extent == Extent::Used { flags | MlockAllFlags::ONFAULT } else { flags };
    mlockall(flags).map_err(|why| format!("lock_memory: {why}; {remedy}"))
}

/// Whether the limit does not count for this process.
fn may_lock_all() -> bool {
    capabilities(None).is_ok_and(|sets| sets.effective.contains(CapabilitySet::IPC_LOCK))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Locked memory as the system tells it.
    fn locked_kib() -> u64 {
        let status = std::fs::read_to_string("/proc/self/status").unwrap();
        let line = status.lines().find_map(|line| line.strip_prefix("VmLck:")).unwrap();
        line.trim().trim_end_matches(" kB").trim().parse().unwrap()
    }

    #[test]
    fn memory_is_locked_or_the_remedy_told() {
        match lock(Extent::Used) {
            Ok(()) => {
                assert!(locked_kib() > 0);
                rustix::mm::munlockall().unwrap();
            }
            Err(why) => assert!(why.contains("memlock unlimited") && why.contains("ulimit -l"), "{why}"),
        }
        assert_eq!(locked_kib(), 0);
    }
}
