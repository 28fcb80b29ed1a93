//! Clock of the virtual projector and of free-running virtual cameras: it ticks while the scanner scans.

use fringeflow_lab::simulation::{Schedule, Tick};

/// Ticks at a fixed rate, from each start of the scan on.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ScanClock {
    rate_hz: f64,
    /// Exists while the scanner scans.
    schedule: Option<Schedule>,
}

impl ScanClock {
    /// A clock that is stopped.
    pub(crate) fn new(rate_hz: f64) -> Self {
        Self { rate_hz, schedule: None }
    }

    pub(crate) fn rate_hz(&self) -> f64 {
        self.rate_hz
    }

    /// Starts or stops the clock. A clock that ticks already goes on as it does.
    pub(crate) fn scan(&mut self, scanning: bool, now_ns: u64) {
        match (scanning, &self.schedule) {
            (true, None) => self.schedule = Some(Schedule::new(now_ns, self.rate_hz)),
            (false, Some(_)) => self.schedule = None,
            _ => (),
        }
    }

    /// Time of the next tick; `None` while stopped.
    pub(crate) fn next_ns(&self) -> Option<u64> {
        self.schedule.map(|schedule| schedule.next_ns())
    }

    /// Takes the next tick if it is due; to be called until there is none.
    pub(crate) fn take(&mut self, now_ns: u64) -> Option<Tick> {
        self.schedule.as_mut()?.take(now_ns)
    }
}
