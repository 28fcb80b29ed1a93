//! The wall clock: converts time stamps of `CLOCK_MONOTONIC` to times since 1970, and back.
//!
//! Every time stamp in a message of the channels is one of `CLOCK_MONOTONIC`, because results depend on it, and the
//! wall clock may be set during a scan. The times that other programs show are nanoseconds since 1970: the log and
//! publish times of MCAP, the times of attachments, and the time stamps in messages of Foxglove's schemas.

use std::time::{SystemTime, UNIX_EPOCH};

use rustix::time::ClockId;

/// Relation of `CLOCK_MONOTONIC` to the wall clock, taken once. The default relation leaves every time as it is; it
/// serves simulated time, which begins in 1970.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct WallClock {
    /// Wall clock minus `CLOCK_MONOTONIC`.
    offset_ns: u64,
}

impl WallClock {
    /// Returns the relation of the clocks of this computer.
    #[must_use]
    pub fn here() -> Self {
        let since_1970 = SystemTime::now().duration_since(UNIX_EPOCH).unwrap_or_default();
        Self::from_reading(monotonic_ns(), u64::try_from(since_1970.as_nanos()).unwrap_or(u64::MAX))
    }

    /// Returns the relation of two clocks that were read at the same time. A wall clock that was never set and is
    /// behind counts as equal.
    pub(super) fn from_reading(monotonic_ns: u64, unix_ns: u64) -> Self {
        Self { offset_ns: unix_ns.saturating_sub(monotonic_ns) }
    }

    /// Converts a time of `CLOCK_MONOTONIC` to nanoseconds since 1970.
    #[must_use]
    pub fn unix_ns(self, time_ns: u64) -> u64 {
        time_ns.saturating_add(self.offset_ns)
    }

    /// The inverse of [`Self::unix_ns`].
    pub(super) fn monotonic_ns(self, unix_ns: u64) -> u64 {
        unix_ns.saturating_sub(self.offset_ns)
    }
}

/// The clock of all messages.
pub(super) fn monotonic_ns() -> u64 {
    let now = rustix::time::clock_gettime(ClockId::Monotonic);
    u64::try_from(now.tv_sec).unwrap_or_default() * 1_000_000_000 + u64::try_from(now.tv_nsec).unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_are_converted_there_and_back() {
        let clock = WallClock::from_reading(5_000, 1_700_000_000_000_000_123);
        assert_eq!(clock.unix_ns(5_007), 1_700_000_000_000_000_130);
        for time_ns in [0, 1, 5_000, u64::MAX / 2] {
            assert_eq!(clock.monotonic_ns(clock.unix_ns(time_ns)), time_ns);
            assert_eq!(WallClock::default().unix_ns(time_ns), time_ns);
        }
    }

    #[test]
    fn a_wall_clock_that_was_never_set_changes_no_time() {
        let clock = WallClock::from_reading(9_000, 20);
        assert_eq!(clock.unix_ns(9_001), 9_001);
        assert_eq!((clock.unix_ns(u64::MAX), clock.monotonic_ns(0)), (u64::MAX, 0));
    }

    #[test]
    fn this_computer_is_not_in_1970() {
        let now_ns = SystemTime::now().duration_since(UNIX_EPOCH).unwrap().as_nanos();
        let converted_ns = u128::from(WallClock::here().unix_ns(monotonic_ns()));
        assert!(converted_ns.abs_diff(now_ns) < 3_600_000_000_000, "{converted_ns} {now_ns}");
    }
}
