//! Which events were said a moment ago.

use std::collections::HashMap;

/// An event that is said again within this time is left out, nanoseconds.
const AGAIN_NS: u64 = 10_000_000_000;
/// Most events that are remembered.
const MOST: usize = 1024;

/// Events that were said, by their hash.
#[derive(Debug, Default)]
pub(super) struct Repeats(HashMap<u64, Said>);

#[derive(Debug)]
struct Said {
    ns: u64,
    /// How often it was left out since.
    left_out: u64,
}

impl Repeats {
    /// How often an event was left out since it was said last; `None` if it is to be left out now.
    pub(super) fn say(&mut self, event: u64, now_ns: u64) -> Option<u64> {
        if let Some(said) = self.0.get_mut(&event) {
            if now_ns.saturating_sub(said.ns) < AGAIN_NS {
                said.left_out += 1;
                return None;
            }
            return Some(std::mem::replace(said, Said { ns: now_ns, left_out: 0 }).left_out);
        }
        if self.0.len() >= MOST {
            self.make_room(now_ns);
        }
        self.0.insert(event, Said { ns: now_ns, left_out: 0 });
        Some(0)
    }

    /// Forgets what may be said again anyway, or else what was said longest ago.
    fn make_room(&mut self, now_ns: u64) {
        self.0.retain(|_, said| now_ns.saturating_sub(said.ns) < AGAIN_NS);
        if self.0.len() >= MOST {
            let oldest = self.0.iter().min_by_key(|(_, said)| said.ns).map(|(&event, _)| event);
            oldest.map(|event| self.0.remove(&event));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND_NS: u64 = 1_000_000_000;

    #[test]
    fn what_is_said_again_is_counted_until_its_time_has_come() {
        let mut repeats = Repeats::default();
        let said: Vec<_> = (0..25).map(|second| repeats.say(7, second * SECOND_NS)).collect();
        let expected = (0..25).map(|second| [Some(0), Some(9), Some(9)][second / 10].filter(|_| second % 10 == 0));
        assert_eq!(said, expected.collect::<Vec<_>>());
        assert_eq!(repeats.say(8, 25 * SECOND_NS), Some(0));
    }

    #[test]
    fn only_so_many_events_are_remembered() {
        let mut repeats = Repeats::default();
        for event in 0..10_000 {
            assert_eq!(repeats.say(event, event), Some(0));
            assert!(repeats.0.len() <= MOST);
        }
        assert_eq!(repeats.say(9_999, 10_000), None);
        // Forgotten, though it was said within its time.
        assert_eq!(repeats.say(1, 10_001), Some(0));
        assert_eq!(repeats.say(5, 60 * SECOND_NS), Some(0));
        assert_eq!(repeats.0.len(), 1);
    }
}
