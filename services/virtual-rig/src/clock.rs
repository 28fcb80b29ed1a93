//! Clock of the virtual projector and of free-running virtual cameras. It ticks while the scanner scans.

use fringeflow_lab::simulation::{Schedule, Tick};

/// A clock that ticks at a fixed rate, from each start of a scan.
#[derive(Clone, Copy, Debug)]
pub(crate) struct ScanClock {
    rate_hz: f64,
    /// `None` while stopped.
    schedule: Option<Schedule>,
}

impl ScanClock {
    /// Creates a stopped clock.
    pub(crate) fn new(rate_hz: f64) -> Self {
        Self { rate_hz, schedule: None }
    }

    pub(crate) fn rate_hz(&self) -> f64 {
        self.rate_hz
    }

    /// Starts or stops the clock. A running clock is not started again.
    pub(crate) fn set_scanning(&mut self, scanning: bool, now_ns: u64) {
        match (scanning, &self.schedule) {
            (true, None) => self.schedule = Some(Schedule::new(now_ns, self.rate_hz)),
            (false, Some(_)) => self.schedule = None,
            _ => (),
        }
    }

    /// Returns the time of the next tick; `None` while stopped.
    pub(crate) fn next_ns(&self) -> Option<u64> {
        self.schedule.map(|schedule| schedule.next_ns())
    }

    /// Takes the next tick if it is due. Call this until it returns `None`.
    pub(crate) fn take_tick(&mut self, now_ns: u64) -> Option<Tick> {
        self.schedule.as_mut()?.take(now_ns)
    }
}
