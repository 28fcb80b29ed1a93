//! Which pattern appears at which refresh. In: the refreshes at which the server showed them. Out: requests, and what was
//! shown. It knows no clock and no server.
//!
//! Time is cut into slots of some refreshes, one for each pattern. A slot in which the server showed nothing new is
//! missed: the cameras then see the pattern before it, of which no event tells.

use std::collections::VecDeque;

/// Distance of the first slot from now, refreshes: time to hand over the first image.
const AHEAD: u64 = 2;

/// The order and the slots of patterns.
#[derive(Clone, Debug)]
pub(crate) struct Schedule {
    /// Number of patterns in the cycle.
    patterns: usize,
    /// Refreshes of a slot.
    refreshes: u64,
    /// First refresh of slot 0; `None` while nothing is shown.
    origin: Option<u64>,
    /// Next slot to be asked for.
    next_slot: u64,
    /// Slots that are accounted for.
    past_slots: u64,
    next_pattern: usize,
    next_serial: u32,
    asked: VecDeque<Request>,
}

/// A request to show a pattern.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Request {
    /// Its number.
    pub(crate) serial: u32,
    /// The pattern.
    pub(crate) pattern: usize,
    /// The refresh from which on it is to be seen.
    pub(crate) refresh: u64,
}

/// A pattern that was shown.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Shown {
    /// The pattern.
    pub(crate) pattern: usize,
    /// Slots before it in which nothing new was shown.
    pub(crate) missed: u64,
    /// Refreshes by which it came too late.
    pub(crate) late_refreshes: u64,
    /// Whether its slot was free. If an earlier pattern lit a part of it, no event may tell of it.
    pub(crate) has_slot: bool,
}

impl Schedule {
    /// Creates a schedule that shows nothing yet.
    pub(crate) fn new(patterns: usize, refreshes: u64) -> Self {
        Self {
            patterns: patterns.max(1),
            refreshes: refreshes.max(1),
            origin: None,
            next_slot: 0,
            past_slots: 0,
            next_pattern: 0,
            // 0 is the number of requests for the time.
            next_serial: 1,
            asked: VecDeque::new(),
        }
    }

    /// Whether all that was asked for was shown or skipped.
    pub(crate) fn is_idle(&self) -> bool {
        self.asked.is_empty()
    }

    /// Ends the slots; the next request begins new ones. The patterns go on in their order.
    pub(crate) fn pause(&mut self) {
        (self.origin, self.next_slot, self.past_slots) = (None, 0, 0);
    }

    /// Returns the next request, if one is to be made now.
    pub(crate) fn next(&mut self, now_refresh: u64) -> Option<Request> {
        // Where each refresh shows another pattern, the next one is handed over before the last one is confirmed.
        let at_once = if self.refreshes == 1 { 2 } else { 1 };
        if self.asked.len() >= at_once {
            return None;
        }
        let origin = *self.origin.get_or_insert(now_refresh + AHEAD);
        let not_past = now_refresh.checked_sub(origin).map_or(0, |past| past / self.refreshes + 1);
        let slot = self.next_slot.max(not_past);
        let refresh = origin + slot * self.refreshes;
        let request = Request { serial: self.next_serial, pattern: self.next_pattern, refresh };
        self.next_slot = slot + 1;
        self.next_pattern = (self.next_pattern + 1) % self.patterns;
        self.next_serial = self.next_serial.checked_add(1).unwrap_or(1);
        self.asked.push_back(request);
        Some(request)
    }

    /// Takes the answer to a request. Returns what was shown at this refresh; `None` if it was skipped.
    pub(crate) fn complete(&mut self, serial: u32, refresh: u64, is_shown: bool) -> Option<Shown> {
        let place = self.asked.iter().position(|request| request.serial == serial)?;
        let request = self.asked.remove(place)?;
        if !is_shown {
            return None;
        }
        let slot = refresh.saturating_sub(self.origin?) / self.refreshes;
        let has_slot = slot >= self.past_slots;
        let missed = slot.saturating_sub(self.past_slots);
        self.past_slots = self.past_slots.max(slot + 1);
        let late_refreshes = refresh.saturating_sub(request.refresh);
        Some(Shown { pattern: request.pattern, missed, late_refreshes, has_slot })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_follow_at_their_refreshes() {
        for refreshes in [1, 2, 3] {
            let mut schedule = Schedule::new(4, refreshes);
            let mut now = 100;
            let mut asked = VecDeque::new();
            for k in 0..40 {
                asked.extend(std::iter::from_fn(|| schedule.next(now)));
                let request: Request = asked.pop_front().unwrap();
                assert_eq!((request.pattern, request.refresh), (k % 4, 102 + k as u64 * refreshes));
                now = request.refresh;
                let shown = schedule.complete(request.serial, now, true).unwrap();
                let expected = Shown { pattern: k % 4, missed: 0, late_refreshes: 0, has_slot: true };
                assert_eq!(shown, expected, "{refreshes} {k}");
            }
        }
    }

    #[test]
    fn a_late_image_leaves_missed_slots_and_the_next_one_keeps_to_the_slots() {
        let mut schedule = Schedule::new(4, 2);
        let first = schedule.next(100).unwrap();
        assert_eq!(schedule.next(100), None);
        // Slot 0 begins at 102, slot 2 at 106.
        let shown = schedule.complete(first.serial, 107, true).unwrap();
        assert_eq!(shown, Shown { pattern: 0, missed: 2, late_refreshes: 5, has_slot: true });
        assert_eq!(schedule.next(107).unwrap(), Request { serial: 2, pattern: 1, refresh: 108 });
        let shown = schedule.complete(2, 109, true).unwrap();
        assert_eq!((shown.missed, shown.late_refreshes), (0, 1));
    }

    #[test]
    fn a_skipped_image_is_a_missed_slot() {
        let mut schedule = Schedule::new(4, 1);
        let [a, b] = [schedule.next(10), schedule.next(10)].map(Option::unwrap);
        assert_eq!(schedule.complete(a.serial, 13, false), None);
        let shown = schedule.complete(b.serial, 13, true).unwrap();
        assert_eq!((shown.pattern, shown.missed, shown.late_refreshes), (1, 1, 0));
        assert_eq!(schedule.complete(a.serial, 13, true), None);
    }

    #[test]
    fn two_images_in_a_slot_are_told() {
        let mut schedule = Schedule::new(4, 1);
        let [a, b] = [schedule.next(10), schedule.next(10)].map(Option::unwrap);
        assert!(schedule.complete(a.serial, 13, true).unwrap().has_slot);
        assert!(!schedule.complete(b.serial, 13, true).unwrap().has_slot);
    }

    #[test]
    fn after_a_pause_new_slots_begin_and_the_patterns_go_on() {
        let mut schedule = Schedule::new(4, 2);
        let first = schedule.next(100).unwrap();
        assert!(!schedule.is_idle());
        schedule.complete(first.serial, 102, true);
        assert!(schedule.is_idle());
        schedule.pause();
        let next = schedule.next(500).unwrap();
        assert_eq!((next.pattern, next.refresh), (1, 502));
        assert_eq!(schedule.complete(next.serial, 502, true).unwrap().missed, 0);
    }
}
