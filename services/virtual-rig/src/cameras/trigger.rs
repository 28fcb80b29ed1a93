//! What makes the cameras expose: the projector, as if by a trigger cable, or their own clock.
//!
//! In: pattern events, or the time. Out: triggers, numbered without gaps.

use fringeflow_message::{PATTERN_FRINGES, PatternEvent};

use crate::clock::ScanClock;

/// Both cameras expose.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Trigger {
    /// Number since the start.
    pub number: u64,
    /// Start of the exposure.
    pub start_ns: u64,
    /// Step that the projector shows; `None` for no fringes that could be simulated.
    pub step: Option<u32>,
}

/// Most patterns that may be shown unannounced in a row.
const MAX_UNANNOUNCED: u64 = 8;
/// Furthest that an exposure may be away from the arrival of its event, nanoseconds.
const MAX_AWAY_NS: u64 = 1_000_000_000;

/// Triggers by the events of a projector.
#[derive(Clone, Debug)]
pub struct CableTriggers {
    steps: u32,
    /// Time from pattern to pattern of the virtual projector: it leaves out events on purpose, and its cable does not.
    period_ns: Option<u64>,
    last: Option<PatternEvent>,
    next: u64,
}

/// Triggers by a clock of the cameras, while the steps go round.
#[derive(Clone, Debug)]
pub struct ClockTriggers {
    clock: ScanClock,
    steps: u32,
    next: u64,
}

impl CableTriggers {
    /// Triggers for images of `steps` steps.
    #[must_use]
    pub fn new(steps: u32, period_ns: Option<u64>) -> Self {
        Self { steps, period_ns, last: None, next: 0 }
    }

    /// Whether an event tells of an exposure of about now: no cable reaches into the past or far into the future.
    #[must_use]
    pub fn is_of_now(event: &PatternEvent, now_ns: u64) -> bool {
        event.exposure_start_ns.abs_diff(now_ns) <= MAX_AWAY_NS
    }

    /// The triggers of an event: its own, after those of patterns that were shown since the last event unannounced.
    pub fn of_event(&mut self, event: &PatternEvent) -> Vec<Trigger> {
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

    fn unannounced(&self, event: &PatternEvent) -> u64 {
        let (Some(period_ns), Some(last)) = (self.period_ns, &self.last) else { return 0 };
        let apart_ns = event.exposure_start_ns.saturating_sub(last.exposure_start_ns);
        let periods = (apart_ns + period_ns / 2).checked_div(period_ns).unwrap_or(0);
        let fits = last.session == event.session && (2..=MAX_UNANNOUNCED + 1).contains(&periods);
        // After a pause, or patterns that nobody showed, the steps have not moved with the time.
        let moved = |k: u64| (u64::from(last.step) + k).checked_rem(u64::from(last.steps)) == Some(event.step.into());
        if fits && moved(periods) { periods - 1 } else { 0 }
    }
}

impl ClockTriggers {
    /// Triggers for images of `steps` steps at a rate.
    #[must_use]
    pub fn new(rate_hz: f64, steps: u32) -> Self {
        Self { clock: ScanClock::new(rate_hz), steps, next: 0 }
    }

    /// Starts or stops the clock; the steps go on where they stopped.
    pub fn scan(&mut self, scanning: bool, now_ns: u64) {
        self.clock.scan(scanning, now_ns);
    }

    /// When the next trigger is due; `None` while stopped.
    #[must_use]
    pub fn next_ns(&self) -> Option<u64> {
        self.clock.next_ns()
    }

    /// The next trigger, if its time has come, and how many before it nobody served; to be asked until there is none.
    pub fn take(&mut self, now_ns: u64) -> Option<(u64, Trigger)> {
        let tick = self.clock.take(now_ns)?;
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
            assert_eq!(triggers.of_event(&event(k)), [expected]);
        }
        // Of another driver nobody knows what it did in between.
        assert_eq!(triggers.of_event(&event(12)).len(), 1);
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
            assert_eq!(steps(&triggers.of_event(&odd)), [None]);
        }
    }

    #[test]
    fn an_event_of_another_time_is_no_trigger() {
        let now_ns = 50_000_000_000;
        let of = |exposure_start_ns| PatternEvent { exposure_start_ns, ..event(0) };
        for near_ns in [now_ns - 1_000_000_000, now_ns, now_ns + 1_000_000_000] {
            assert!(CableTriggers::is_of_now(&of(near_ns), now_ns));
        }
        for far_ns in [0, now_ns - 1_000_000_001, now_ns + 1_000_000_001, u64::MAX] {
            assert!(!CableTriggers::is_of_now(&of(far_ns), now_ns));
        }
    }

    #[test]
    fn the_cable_does_not_lose_what_the_channel_leaves_out() {
        let mut triggers = CableTriggers::new(4, Some(PERIOD_NS));
        triggers.of_event(&event(0));
        let after = triggers.of_event(&event(3));
        assert_eq!(steps(&after), [Some(1), Some(2), Some(3)]);
        assert_eq!(
            after.iter().map(|t| (t.number, t.start_ns)).collect::<Vec<_>>(),
            [(1, 1_000 + PERIOD_NS), (2, 1_000 + 2 * PERIOD_NS), (3, 1_000 + 3 * PERIOD_NS),]
        );
    }

    #[test]
    fn a_pause_is_no_row_of_patterns() {
        let mut triggers = CableTriggers::new(4, Some(PERIOD_NS));
        triggers.of_event(&event(0));
        let after_pause = PatternEvent { step: 1, ..event(4) };
        assert_eq!(triggers.of_event(&after_pause).len(), 1);
        assert_eq!(triggers.of_event(&event(1_000)).len(), 1);
        assert_eq!(triggers.of_event(&event(2)).len(), 1);
        assert_eq!(triggers.of_event(&PatternEvent { session: 1, ..event(4) }).len(), 1);
        assert_eq!(triggers.of_event(&PatternEvent { exposure_start_ns: u64::MAX, ..event(4) }).len(), 1);
    }

    #[test]
    fn the_clock_goes_through_the_steps_and_skips_what_it_missed() {
        let mut triggers = ClockTriggers::new(50.0, 4);
        assert!(triggers.take(5).is_none());
        triggers.scan(true, 0);
        assert_eq!(triggers.take(0), Some((0, Trigger { number: 0, start_ns: 0, step: Some(0) })));
        assert_eq!(triggers.take(0), None);
        let late = Trigger { number: 45, start_ns: 900_000_000, step: Some(1) };
        assert_eq!(triggers.take(1_000_000_000), Some((44, late)));
        triggers.scan(false, 1_000_000_000);
        triggers.scan(true, 2_000_000_000);
        let (missed, trigger) = triggers.take(2_000_000_000).unwrap();
        assert_eq!((missed, trigger.number, trigger.start_ns), (0, 46, 2_000_000_000));
    }
}
