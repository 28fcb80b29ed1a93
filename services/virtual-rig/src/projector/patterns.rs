//! What the virtual projector shows, and what it says of it.
//!
//! In: the time. Out: pattern events on an absolute schedule, step after step, as long as the scanner is to scan.

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
    /// Patterns shown so far.
    shown: u64,
    /// Patterns announced so far.
    announced: u64,
}

/// What became of a pattern.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shown {
    /// Patterns before it that this machine was too slow to show.
    pub missed: u64,
    /// Its announcement; `None` where it is left out on purpose.
    pub event: Option<PatternEvent>,
}

impl VirtualProjector {
    /// A projector that shows nothing yet; `session` tells this start from others.
    #[must_use]
    pub fn new(session: u64, rate_hz: f64, sequence: &FringeSequence, faults: Faults) -> Self {
        let (steps, period_px) = (sequence.shifts_rad.len() as u32, sequence.pattern.period_px);
        Self { session, clock: ScanClock::new(rate_hz), steps, period_px, faults, shown: 0, announced: 0 }
    }

    /// Starts or stops showing patterns; the steps go on where they stopped.
    pub fn scan(&mut self, scanning: bool, now_ns: u64) {
        self.clock.scan(scanning, now_ns);
    }

    /// When there is something to show next; `None` while stopped.
    #[must_use]
    pub fn next_ns(&self) -> Option<u64> {
        self.clock.next_ns()
    }

    /// Shows the next pattern, if its time has come; to be asked until there is none.
    pub fn show(&mut self, now_ns: u64) -> Option<Shown> {
        let tick = self.clock.take(now_ns)?;
        let number = self.shown;
        self.shown += 1;
        if self.faults.loses_event(number) {
            return Some(Shown { missed: tick.missed, event: None });
        }
        let event = PatternEvent {
            session: self.session,
            sequence: self.announced,
            exposure_start_ns: tick.time_ns,
            duration_ns: (1e9 / self.clock.rate_hz()) as u64,
            period_px: self.period_px,
            step: number.checked_rem(self.steps.into()).unwrap_or(0) as u32,
            steps: self.steps,
            kind: PATTERN_FRINGES,
            reserved: 0,
        };
        self.announced += 1;
        Some(Shown { missed: tick.missed, event: Some(event) })
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

    /// Everything shown up to a time.
    fn shown(projector: &mut VirtualProjector, until_ns: u64) -> Vec<Shown> {
        let mut all = Vec::new();
        while let Some(next_ns) = projector.next_ns().filter(|&next| next <= until_ns) {
            all.extend(projector.show(next_ns + 200_000));
        }
        all
    }

    #[test]
    fn steps_go_round_on_an_even_schedule() {
        let mut projector = projector(Faults::default());
        assert!(projector.show(1_000).is_none() && projector.next_ns().is_none());
        projector.scan(true, 1_000);
        for (k, shown) in (0_u64..).zip(shown(&mut projector, 10_000_000_000)) {
            let event = shown.event.unwrap();
            assert_eq!((event.session, event.sequence, u64::from(event.step)), (7, k, k % 4));
            assert_eq!((event.exposure_start_ns, event.duration_ns), (1_000 + 20_000_000 * k, 20_000_000));
            assert_eq!((event.steps, event.kind, event.period_px), (4, PATTERN_FRINGES, 16.0));
        }
    }

    #[test]
    fn after_a_pause_the_steps_go_on() {
        let mut projector = projector(Faults::default());
        projector.scan(true, 0);
        assert_eq!(shown(&mut projector, 100_000_000).len(), 6);
        projector.scan(false, 110_000_000);
        assert!(projector.show(200_000_000).is_none());
        projector.scan(true, 900_000_000);
        projector.scan(true, 950_000_000);
        let event = projector.show(900_000_000).unwrap().event.unwrap();
        assert_eq!((event.sequence, event.step, event.exposure_start_ns), (6, 2, 900_000_000));
    }

    #[test]
    fn an_event_left_out_leaves_no_gap_in_the_numbers_but_one_in_the_steps() {
        let faults = Faults::new(FaultOptions { events_lost: 0.2, ..FaultOptions::default() }).unwrap();
        let mut projector = projector(faults);
        projector.scan(true, 0);
        let all = shown(&mut projector, 10_000_000_000);
        let lost = all.iter().filter(|s| s.event.is_none()).count();
        assert!((60..140).contains(&lost), "{lost} of {}", all.len());
        let events: Vec<_> = all.iter().filter_map(|s| s.event).collect();
        for (k, event) in (0_u64..).zip(&events) {
            assert_eq!(event.sequence, k);
            assert_eq!(u64::from(event.step), event.exposure_start_ns / 20_000_000 % 4);
        }
    }

    #[test]
    fn patterns_that_the_machine_was_too_slow_for_are_counted() {
        let mut projector = projector(Faults::default());
        projector.scan(true, 0);
        projector.show(0);
        let late = projector.show(1_000_000_000).unwrap();
        assert_eq!((late.missed, late.event.unwrap().step), (44, 1));
        assert_eq!(late.event.unwrap().exposure_start_ns, 900_000_000);
    }
}
