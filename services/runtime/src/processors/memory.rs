//! Locks memory in RAM, so that a page that was used once causes no page fault later.

use rustix::mm::{MlockAllFlags, mlockall};
use rustix::process::{Resource, getrlimit};
use rustix::thread::{CapabilitySet, capabilities};

/// The pages that are locked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Extent {
    /// Pages after their first use.
    Used,
    /// All pages, used or not.
    All,
}

/// Locks the present and future memory of this process.
///
/// # Errors
/// The system refuses; the text states the reason and the remedy.
pub(super) fn lock(extent: Extent) -> Result<(), String> {
    let remedy = "grant it with the line `USER - memlock unlimited` in /etc/security/limits.conf \
                  (`LimitMEMLOCK=infinity` in a systemd unit), then log in again; `ulimit -l` shows the limit";
    // With a limit the lock would succeed now, and allocations would fail later, while the service works.
    if let Some(limit) = getrlimit(Resource::Memlock).current.filter(|_| !may_exceed_limit()) {
        return Err(format!("lock_memory: only {} KiB may be locked; {remedy}", limit / 1024));
    }
    let flags = MlockAllFlags::CURRENT | MlockAllFlags::FUTURE;
    let flags = if extent == Extent::Used { flags | MlockAllFlags::ONFAULT } else { flags };
    mlockall(flags).map_err(|error| format!("lock_memory: {error}; {remedy}"))
}

/// Returns whether the limit does not apply to this process.
fn may_exceed_limit() -> bool {
    capabilities(None).is_ok_and(|sets| sets.effective.contains(CapabilitySet::IPC_LOCK))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Reads the size of the locked memory from `/proc`.
    fn locked_kib() -> u64 {
        let status = std::fs::read_to_string("/proc/self/status").unwrap();
        let line = status.lines().find_map(|line| line.strip_prefix("VmLck:")).unwrap();
        line.trim().trim_end_matches(" kB").trim().parse().unwrap()
    }

    #[test]
    fn memory_is_locked_or_the_error_names_the_remedy() {
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
