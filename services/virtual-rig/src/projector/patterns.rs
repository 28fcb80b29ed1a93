//! Patterns of the virtual projector and their events.
//!
//! In: the time. Out: during a scan, pattern events on an absolute schedule, step after step.

use fringeflow_dataset::FringeSequence;
use fringeflow_lab::simulation::Faults;
use fringeflow_message::{PATTERN_FRINGES, PatternEvent};

use crate::clock::ScanClock;

/// A projector that shows N-step fringes at a rate.
#[derive(Clone, Debug)]
pub struct VirtualProjector {
    session: u64,
    /// Ticks while patterns are shown.
    clock: ScanClock,
    steps: u32,
    period_px: f64,
    faults: Faults,
    /// Number of patterns shown so far.
    shown: u64,
    /// Number of events so far.
    events: u64,
}

/// A shown pattern.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShownPattern {
    /// Number of patterns before it that this machine was too slow to show.
    pub missed: u64,
    /// Its event; `None` if the event is omitted on purpose.
    pub event: Option<PatternEvent>,
}

impl VirtualProjector {
    /// Creates a stopped projector; `session` identifies this start.
    #[must_use]
    pub fn new(session: u64, rate_hz: f64, sequence: &FringeSequence, faults: Faults) -> Self {
        let (steps, period_px) = (sequence.shifts_rad.len() as u32, sequence.pattern.period_px);
        Self { session, clock: ScanClock::new(rate_hz), steps, period_px, faults, shown: 0, events: 0 }
    }

    /// Starts or stops showing patterns. The steps continue where they stopped.
    pub fn set_scanning(&mut self, scanning: bool, now_ns: u64) {
        self.clock.set_scanning(scanning, now_ns);
    }

    /// Returns the time of the next pattern; `None` while stopped.
    #[must_use]
    pub fn next_ns(&self) -> Option<u64> {
        self.clock.next_ns()
    }

    /// Shows the next pattern if it is due. Call this until it returns `None`.
    pub fn show(&mut self, now_ns: u64) -> Option<ShownPattern> {
        let tick = self.clock.take_tick(now_ns)?;
        let number = self.shown;
        self.shown += 1;
        if self.faults.loses_event(number) {
            return Some(ShownPattern { missed: tick.missed, event: None });
        }
        let event = PatternEvent {
            session: self.session,
            sequence: self.events,
            exposure_start_ns: tick.time_ns,
            duration_ns: (1e9 / self.clock.rate_hz()) as u64,
            period_px: self.period_px,
            step: number.checked_rem(self.steps.into()).unwrap_or(0) as u32,
            steps: self.steps,
            kind: PATTERN_FRINGES,
            reserved: 0,
        };
        self.events += 1;
        Some(ShownPattern { missed: tick.missed, event: Some(event) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fringeflow::geometry::FringePattern;
    use fringeflow_lab::simulation::FaultOptions;

    fn projector(faults: Faults) -> VirtualProjector {
        let pattern = FringePattern { period_px: 16.0, sign: 1.0, offset_rad: 0.0 };
        let sequence = FringeSequence { pattern, shifts_rad: vec![0.0; 4], gray: None };
        VirtualProjector::new(7, 50.0, &sequence, faults)
    }

    /// Shows all patterns up to a time.
    fn show_until(projector: &mut VirtualProjector, until_ns: u64) -> Vec<ShownPattern> {
        let mut all = Vec::new();
        while let Some(next_ns) = projector.next_ns().filter(|&next| next <= until_ns) {
            all.extend(projector.show(next_ns + 200_000));
        }
        all
    }

    #[test]
    fn steps_follow_in_a_cycle_on_an_even_schedule() {
        let mut projector = projector(Faults::default());
        assert!(projector.show(1_000).is_none() && projector.next_ns().is_none());
        projector.set_scanning(true, 1_000);
        for (k, shown) in (0_u64..).zip(show_until(&mut projector, 10_000_000_000)) {
            let event = shown.event.unwrap();
            assert_eq!((event.session, event.sequence, u64::from(event.step)), (7, k, k % 4));
            assert_eq!((event.exposure_start_ns, event.duration_ns), (1_000 + 20_000_000 * k, 20_000_000));
            assert_eq!((event.steps, event.kind, event.period_px), (4, PATTERN_FRINGES, 16.0));
        }
    }

    #[test]
    fn after_a_pause_the_steps_continue() {
        let mut projector = projector(Faults::default());
        projector.set_scanning(true, 0);
        assert_eq!(show_until(&mut projector, 100_000_000).len(), 6);
        projector.set_scanning(false, 110_000_000);
        assert!(projector.show(200_000_000).is_none());
        projector.set_scanning(true, 900_000_000);
        projector.set_scanning(true, 950_000_000);
        let event = projector.show(900_000_000).unwrap().event.unwrap();
        assert_eq!((event.sequence, event.step, event.exposure_start_ns), (6, 2, 900_000_000));
    }

    #[test]
    fn an_omitted_event_leaves_a_gap_in_the_steps_but_not_in_the_numbers() {
        let faults = Faults::new(FaultOptions { events_lost: 0.2, ..FaultOptions::default() }).unwrap();
        let mut projector = projector(faults);
        projector.set_scanning(true, 0);
        let all = show_until(&mut projector, 10_000_000_000);
        let lost = all.iter().filter(|s| s.event.is_none()).count();
        assert!((60..140).contains(&lost), "{lost} of {}", all.len());
        let events: Vec<_> = all.iter().filter_map(|s| s.event).collect();
        for (k, event) in (0_u64..).zip(&events) {
            assert_eq!(event.sequence, k);
            assert_eq!(u64::from(event.step), event.exposure_start_ns / 20_000_000 % 4);
        }
    }

    #[test]
    fn patterns_that_come_too_late_are_counted_as_missed() {
        let mut projector = projector(Faults::default());
        projector.set_scanning(true, 0);
        projector.show(0);
        let late = projector.show(1_000_000_000).unwrap();
        assert_eq!((late.missed, late.event.unwrap().step), (44, 1));
        assert_eq!(late.event.unwrap().exposure_start_ns, 900_000_000);
    }
}
