//! Leaves out events that were logged a moment ago.

use std::collections::HashMap;

/// Time after the line of an event in which repeats are left out, nanoseconds.
const REPEAT_INTERVAL_NS: u64 = 10_000_000_000;
/// Maximum number of events that are remembered.
const MAX_EVENTS: usize = 1024;

/// The last lines of events, by the hash of the event.
#[derive(Debug, Default)]
pub(super) struct RepeatFilter(HashMap<u64, LastLine>);

#[derive(Debug)]
struct LastLine {
    time_ns: u64,
    /// How often the event was left out since.
    left_out: u64,
}

impl RepeatFilter {
    /// Returns how often an event was left out since its last line, or `None` if it is left out now.
    pub(super) fn admit(&mut self, event: u64, now_ns: u64) -> Option<u64> {
        if let Some(last) = self.0.get_mut(&event) {
            if now_ns.saturating_sub(last.time_ns) < REPEAT_INTERVAL_NS {
                last.left_out += 1;
                return None;
            }
            return Some(std::mem::replace(last, LastLine { time_ns: now_ns, left_out: 0 }).left_out);
        }
        if self.0.len() >= MAX_EVENTS {
            self.make_room(now_ns);
        }
        self.0.insert(event, LastLine { time_ns: now_ns, left_out: 0 });
        Some(0)
    }

    /// Forgets the events whose interval has ended or, if there are none, the oldest event.
    fn make_room(&mut self, now_ns: u64) {
        self.0.retain(|_, last| now_ns.saturating_sub(last.time_ns) < REPEAT_INTERVAL_NS);
        if self.0.len() >= MAX_EVENTS {
            let oldest = self.0.iter().min_by_key(|(_, last)| last.time_ns).map(|(&event, _)| event);
            oldest.map(|event| self.0.remove(&event));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND_NS: u64 = 1_000_000_000;

    #[test]
    fn repeats_are_counted_until_the_interval_ends() {
        let mut repeats = RepeatFilter::default();
        let admitted: Vec<_> = (0..25).map(|second| repeats.admit(7, second * SECOND_NS)).collect();
        let expected = (0..25).map(|second| [Some(0), Some(9), Some(9)][second / 10].filter(|_| second % 10 == 0));
        assert_eq!(admitted, expected.collect::<Vec<_>>());
        assert_eq!(repeats.admit(8, 25 * SECOND_NS), Some(0));
    }

    #[test]
    fn the_number_of_remembered_events_is_bounded() {
        let mut repeats = RepeatFilter::default();
        for event in 0..10_000 {
            assert_eq!(repeats.admit(event, event), Some(0));
            assert!(repeats.0.len() <= MAX_EVENTS);
        }
        assert_eq!(repeats.admit(9_999, 10_000), None);
        // Forgotten, although its interval has not ended.
        assert_eq!(repeats.admit(1, 10_001), Some(0));
        assert_eq!(repeats.admit(5, 60 * SECOND_NS), Some(0));
        assert_eq!(repeats.0.len(), 1);
    }
}
