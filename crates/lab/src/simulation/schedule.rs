//! Schedule of a projector or of a free-running camera: ticks at a fixed rate.
//!
//! In: the start and the rate. Out: the ticks. Each is computed from the start, so that the schedule does not drift.

/// Longest delay of a served tick, nanoseconds. Later ticks are missed.
const LATEST_NS: u64 = 100_000_000;

/// Evenly spaced ticks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Schedule {
    start_ns: u64,
    rate_hz: f64,
    next: u64,
}

/// A due tick.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Tick {
    /// Its time.
    pub time_ns: u64,
    /// Number of earlier ticks that were not served in time.
    pub missed: u64,
}

impl Schedule {
    /// Creates ticks from `start_ns` on. The rate must be above 0.
    #[must_use]
    pub fn new(start_ns: u64, rate_hz: f64) -> Self {
        Self { start_ns, rate_hz, next: 0 }
    }

    /// Time of the next tick.
    #[must_use]
    pub fn next_ns(&self) -> u64 {
        self.time_ns(self.next)
    }

    /// Takes the next tick if it is due. Call it until it returns `None`.
    pub fn take(&mut self, now_ns: u64) -> Option<Tick> {
        if self.next_ns() > now_ns {
            return None;
        }
        let too_late_ns = now_ns.saturating_sub(LATEST_NS).saturating_sub(self.start_ns);
        let first_in_time = (too_late_ns as f64 * self.rate_hz / 1e9).ceil() as u64;
        // At very low rates the last due tick may be older. It is served nevertheless.
        let latest_due = ((now_ns - self.start_ns) as f64 * self.rate_hz / 1e9) as u64;
        let number = first_in_time.min(latest_due).max(self.next);
        let tick = Tick { time_ns: self.time_ns(number), missed: number - self.next };
        self.next = number + 1;
        Some(tick)
    }

    fn time_ns(&self, number: u64) -> u64 {
        self.start_ns.saturating_add((number as f64 * 1e9 / self.rate_hz).round() as u64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_neither_drift_nor_come_early() {
        let mut schedule = Schedule::new(1_000, 60.0);
        let mut now_ns = 0;
        for number in 0..100_000_u64 {
            assert!(schedule.take(schedule.next_ns() - 1).is_none());
            now_ns = schedule.next_ns() + 3_000_000;
            let tick = schedule.take(now_ns).unwrap();
            assert_eq!(tick.missed, 0);
            assert!(tick.time_ns.abs_diff(1_000 + number * 50_000_000 / 3) <= 1, "tick {number}");
        }
        assert!(schedule.take(now_ns).is_none());
    }

    #[test]
    fn a_delay_misses_ticks_and_counts_them() {
        let mut schedule = Schedule::new(0, 100.0);
        assert_eq!(schedule.take(0), Some(Tick { time_ns: 0, missed: 0 }));
        // Half a second later, the ticks of the last tenth of a second can still be served.
        let mut taken = Vec::new();
        while let Some(tick) = schedule.take(500_000_000) {
            taken.push(tick);
        }
        assert_eq!(taken[0], Tick { time_ns: 400_000_000, missed: 39 });
        assert!(taken[1..].iter().all(|tick| tick.missed == 0));
        assert_eq!(taken.len(), 11);
        assert_eq!(schedule.next_ns(), 510_000_000);
    }

    #[test]
    fn ticks_at_low_rates_are_served_however_late() {
        let mut schedule = Schedule::new(0, 0.1);
        schedule.take(0);
        assert_eq!(schedule.take(19_000_000_000), Some(Tick { time_ns: 10_000_000_000, missed: 0 }));
        assert_eq!(schedule.take(19_000_000_000), None);
    }
}
