//! Counts the gaps in the numbers of a channel.
//!
//! In: the numbers of the messages as they arrive. Out: the number of lost messages. Every number is counted once: a
//! message that arrives after it was counted as lost is not counted again.

use std::collections::VecDeque;

/// Maximum number of missing numbers remembered, so that a late message is not counted twice.
const REMEMBERED: u64 = 64;
/// A wider gap is not a loss: the publisher has restarted its numbers.
const WIDEST_GAP: u64 = 1 << 32;

/// Numbers of one channel.
#[derive(Debug)]
pub(super) struct GapCounter {
    /// A missing number counts as lost when a number arrives that is greater by more than this.
    patience: u64,
    next: Option<u64>,
    missing: VecDeque<Missing>,
}

#[derive(Debug)]
struct Missing {
    number: u64,
    is_counted: bool,
}

/// Whether a message is new.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Arrival {
    /// A new message.
    New {
        /// Lost messages before it that had not been counted yet.
        lost: u64,
    },
    /// A message that was already counted as lost.
    CountedAsLost,
}

impl GapCounter {
    /// Creates a counter. A missing number counts as lost when a number arrives that is greater by more than
    /// `patience`.
    pub(super) fn new(patience: u64) -> Self {
        Self { patience, next: None, missing: VecDeque::new() }
    }

    /// Sets the next number. The numbers from it up to that of the next message count as lost.
    pub(super) fn set_next(&mut self, next: Option<u64>) {
        self.next = next;
    }

    /// Processes the number of an arrived message.
    pub(super) fn arrive(&mut self, number: u64) -> Arrival {
        let next = self.next.unwrap_or(number);
        if number >= next {
            let lost = self.advance(next, number);
            return Arrival::New { lost };
        }
        if let Some(index) = self.missing.iter().position(|missing| missing.number == number) {
            let is_counted = self.missing.remove(index).is_some_and(|missing| missing.is_counted);
            return if is_counted { Arrival::CountedAsLost } else { Arrival::New { lost: 0 } };
        }
        // The number of a message that has already arrived.
        if next - number <= REMEMBERED {
            return Arrival::New { lost: 0 };
        }
        // Far below the expected number: the publisher has restarted its numbers.
        let lost = self.give_up();
        self.next = Some(number.saturating_add(1));
        Arrival::New { lost }
    }

    /// Stops waiting for missing numbers. Returns the number of messages newly counted as lost.
    pub(super) fn give_up(&mut self) -> u64 {
        let lost = self.missing.iter().filter(|missing| !missing.is_counted).count() as u64;
        self.missing.clear();
        lost
    }

    fn advance(&mut self, next: u64, number: u64) -> u64 {
        self.next = Some(number.saturating_add(1));
        let gap = number - next;
        if gap > WIDEST_GAP {
            return self.give_up();
        }
        // Numbers that cannot be remembered count as lost at once. The others may still arrive.
        let mut lost = gap.saturating_sub(REMEMBERED);
        self.missing.extend((next + lost..number).map(|number| Missing { number, is_counted: false }));
        // Older numbers are forgotten. They are lost unless they are already counted.
        while self.missing.len() as u64 > REMEMBERED {
            lost += u64::from(self.missing.pop_front().is_some_and(|missing| !missing.is_counted));
        }
        for missing in &mut self.missing {
            if !missing.is_counted && number.saturating_sub(missing.number) > self.patience {
                missing.is_counted = true;
                lost += 1;
            }
        }
        lost
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arrive_all(gaps: &mut GapCounter, numbers: &[u64]) -> Vec<Arrival> {
        numbers.iter().map(|&number| gaps.arrive(number)).collect()
    }

    fn new(lost: u64) -> Arrival {
        Arrival::New { lost }
    }

    #[test]
    fn a_gap_is_counted_at_once_without_patience_and_once() {
        let mut gaps = GapCounter::new(0);
        let found = arrive_all(&mut gaps, &[7, 8, 11, 9, 12]);
        assert_eq!(found, [new(0), new(0), new(2), Arrival::CountedAsLost, new(0)]);
        assert_eq!(gaps.give_up(), 0);
    }

    #[test]
    fn with_patience_a_swapped_message_is_not_lost() {
        let mut gaps = GapCounter::new(2);
        let found = arrive_all(&mut gaps, &[0, 2, 1, 4, 5, 6, 8]);
        assert_eq!(found, [new(0), new(0), new(0), new(0), new(0), new(1), new(0)]);
        assert_eq!(gaps.give_up(), 1);
    }

    #[test]
    fn with_a_known_next_number_the_first_message_shows_losses() {
        let mut gaps = GapCounter::new(0);
        gaps.set_next(Some(100));
        assert_eq!(gaps.arrive(1100), new(1000));
    }

    #[test]
    fn a_publisher_that_restarts_its_numbers_has_lost_nothing() {
        let mut gaps = GapCounter::new(0);
        let found = arrive_all(&mut gaps, &[1 << 40, 3, 4, u64::MAX, u64::MAX, 1, 3]);
        assert_eq!(found, [new(0), new(0), new(0), new(0), new(0), new(0), new(1)]);
    }
}
