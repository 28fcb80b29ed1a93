//! Triggers of the cameras: from the projector, as if by a trigger cable, or from their own clock.
//!
//! In: pattern events, or the time. Out: triggers, numbered without gaps.

use fringeflow_message::{PATTERN_FRINGES, PatternEvent};

use crate::clock::ScanClock;

/// A trigger, on which both cameras expose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Trigger {
    /// Number since the start.
    pub number: u64,
    /// Start of the exposure.
    pub start_ns: u64,
    /// Phase step that the projector shows; `None` for a pattern that cannot be simulated.
    pub step: Option<u32>,
}

/// Maximum number of patterns in a row without an event.
const MAX_UNANNOUNCED: u64 = 8;
/// Greatest time between an exposure and the arrival of its event, nanoseconds.
const MAX_OFFSET_NS: u64 = 1_000_000_000;

/// Triggers from the events of a projector.
#[derive(Clone, Debug)]
pub struct CableTriggers {
    steps: u32,
    /// Time between patterns of the virtual projector: it omits events on purpose, but its cable still triggers.
    period_ns: Option<u64>,
    last: Option<PatternEvent>,
    next: u64,
}

/// Triggers from the clock of the cameras; the steps follow in a cycle.
#[derive(Clone, Debug)]
pub struct ClockTriggers {
    clock: ScanClock,
    steps: u32,
    next: u64,
}

impl CableTriggers {
    /// Creates triggers for sequences of `steps` steps. With `period_ns`, omitted events are restored.
    #[must_use]
    pub fn new(steps: u32, period_ns: Option<u64>) -> Self {
        Self { steps, period_ns, last: None, next: 0 }
    }

    /// Whether the exposure of an event is about now: a cable cannot trigger in the past or far in the future.
    #[must_use]
    pub fn is_current(event: &PatternEvent, now_ns: u64) -> bool {
        event.exposure_start_ns.abs_diff(now_ns) <= MAX_OFFSET_NS
    }

    /// Returns the triggers of an event: first those of patterns without an event since the last one, then its own.
    pub fn take_event(&mut self, event: &PatternEvent) -> Vec<Trigger> {
        let unannounced = self.unannounced(event);
        let last = self.last.replace(*event).unwrap_or(*event);
        let apart_ns = event.exposure_start_ns.saturating_sub(last.exposure_start_ns) / (unannounced + 1);
        let before = (1..=unannounced).map(|k| PatternEvent {
            exposure_start_ns: last.exposure_start_ns + k * apart_ns,
            step: (u64::from(last.step) + k).checked_rem(u64::from(last.steps)).unwrap_or(0) as u32,
            ..last
        });
        let shown: Vec<PatternEvent> = before.chain([*event]).collect();
        shown.iter().map(|event| self.trigger(event)).collect()
    }

    fn trigger(&mut self, event: &PatternEvent) -> Trigger {
        let known = event.kind == PATTERN_FRINGES && event.steps == self.steps && event.step < self.steps;
        let number = self.next;
        self.next += 1;
        Trigger { number, start_ns: event.exposure_start_ns, step: known.then_some(event.step) }
    }

    /// Returns the number of patterns without an event since the last one.
    fn unannounced(&self, event: &PatternEvent) -> u64 {
        let (Some(period_ns), Some(last)) = (self.period_ns, &self.last) else { return 0 };
        let apart_ns = event.exposure_start_ns.saturating_sub(last.exposure_start_ns);
        let periods = (apart_ns + period_ns / 2).checked_div(period_ns).unwrap_or(0);
        let fits = last.session == event.session && (2..=MAX_UNANNOUNCED + 1).contains(&periods);
        // After a pause, or patterns that were not shown, the step does not match the time.
        let matches_step =
            |k: u64| (u64::from(last.step) + k).checked_rem(u64::from(last.steps)) == Some(event.step.into());
        if fits && matches_step(periods) { periods - 1 } else { 0 }
    }
}

impl ClockTriggers {
    /// Creates triggers for sequences of `steps` steps at a rate.
    #[must_use]
    pub fn new(rate_hz: f64, steps: u32) -> Self {
        Self { clock: ScanClock::new(rate_hz), steps, next: 0 }
    }

    /// Starts or stops the clock. The steps continue where they stopped.
    pub fn set_scanning(&mut self, scanning: bool, now_ns: u64) {
        self.clock.set_scanning(scanning, now_ns);
    }

    /// Returns the time of the next trigger; `None` while stopped.
    #[must_use]
    pub fn next_ns(&self) -> Option<u64> {
        self.clock.next_ns()
    }

    /// Takes the next trigger if it is due, and the number of triggers missed before it. Call this until it returns
    /// `None`.
    pub fn take_trigger(&mut self, now_ns: u64) -> Option<(u64, Trigger)> {
        let tick = self.clock.take_tick(now_ns)?;
        let number = self.next + tick.missed;
        self.next = number + 1;
        let step = number.checked_rem(self.steps.into()).map(|step| step as u32);
        Some((tick.missed, Trigger { number, start_ns: tick.time_ns, step }))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const PERIOD_NS: u64 = 20_000_000;

    fn event(shown: u64) -> PatternEvent {
        PatternEvent {
            exposure_start_ns: 1_000 + shown * PERIOD_NS,
            step: (shown % 4) as u32,
            steps: 4,
            kind: PATTERN_FRINGES,
            ..PatternEvent::default()
        }
    }

    fn steps(triggers: &[Trigger]) -> Vec<Option<u32>> {
        triggers.iter().map(|trigger| trigger.step).collect()
    }

    #[test]
    fn an_event_is_a_trigger() {
        let mut triggers = CableTriggers::new(4, None);
        for k in 0..10 {
            let expected = Trigger { number: k, start_ns: event(k).exposure_start_ns, step: Some((k % 4) as u32) };
            assert_eq!(triggers.take_event(&event(k)), [expected]);
        }
        // Without a period, nothing is known about patterns between events.
        assert_eq!(triggers.take_event(&event(12)).len(), 1);
    }

    #[test]
    fn patterns_that_cannot_be_simulated_trigger_too() {
        let mut triggers = CableTriggers::new(4, None);
        for odd in [
            PatternEvent { kind: 9, ..event(0) },
            PatternEvent { steps: 8, ..event(0) },
            PatternEvent { step: u32::MAX, ..event(0) },
            PatternEvent { steps: 0, ..event(0) },
        ] {
            assert_eq!(steps(&triggers.take_event(&odd)), [None]);
        }
    }

    #[test]
    fn an_event_far_from_now_is_not_current() {
        let now_ns = 50_000_000_000;
        let event_at = |exposure_start_ns| PatternEvent { exposure_start_ns, ..event(0) };
        for near_ns in [now_ns - 1_000_000_000, now_ns, now_ns + 1_000_000_000] {
            assert!(CableTriggers::is_current(&event_at(near_ns), now_ns));
        }
        for far_ns in [0, now_ns - 1_000_000_001, now_ns + 1_000_000_001, u64::MAX] {
            assert!(!CableTriggers::is_current(&event_at(far_ns), now_ns));
        }
    }

    #[test]
    fn the_cable_triggers_on_omitted_events_too() {
        let mut triggers = CableTriggers::new(4, Some(PERIOD_NS));
        triggers.take_event(&event(0));
        let after = triggers.take_event(&event(3));
        assert_eq!(steps(&after), [Some(1), Some(2), Some(3)]);
        assert_eq!(
            after.iter().map(|t| (t.number, t.start_ns)).collect::<Vec<_>>(),
            [(1, 1_000 + PERIOD_NS), (2, 1_000 + 2 * PERIOD_NS), (3, 1_000 + 3 * PERIOD_NS),]
        );
    }

    #[test]
    fn a_pause_adds_no_triggers() {
        let mut triggers = CableTriggers::new(4, Some(PERIOD_NS));
        triggers.take_event(&event(0));
        let after_pause = PatternEvent { step: 1, ..event(4) };
        assert_eq!(triggers.take_event(&after_pause).len(), 1);
        assert_eq!(triggers.take_event(&event(1_000)).len(), 1);
        assert_eq!(triggers.take_event(&event(2)).len(), 1);
        assert_eq!(triggers.take_event(&PatternEvent { session: 1, ..event(4) }).len(), 1);
        assert_eq!(triggers.take_event(&PatternEvent { exposure_start_ns: u64::MAX, ..event(4) }).len(), 1);
    }

    #[test]
    fn the_clock_cycles_through_the_steps_and_skips_missed_ones() {
        let mut triggers = ClockTriggers::new(50.0, 4);
        assert!(triggers.take_trigger(5).is_none());
        triggers.set_scanning(true, 0);
        assert_eq!(triggers.take_trigger(0), Some((0, Trigger { number: 0, start_ns: 0, step: Some(0) })));
        assert_eq!(triggers.take_trigger(0), None);
        let late = Trigger { number: 45, start_ns: 900_000_000, step: Some(1) };
        assert_eq!(triggers.take_trigger(1_000_000_000), Some((44, late)));
        triggers.set_scanning(false, 1_000_000_000);
        triggers.set_scanning(true, 2_000_000_000);
        let (missed, trigger) = triggers.take_trigger(2_000_000_000).unwrap();
        assert_eq!((missed, trigger.number, trigger.start_ns), (0, 46, 2_000_000_000));
    }
}
