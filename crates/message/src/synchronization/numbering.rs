//! Gaps in the numbers of a channel: in go the numbers of the messages as they come, out comes how many were lost.
//!
//! Every number is counted once: a message that comes after its number was counted as lost is not counted again.

use std::collections::VecDeque;

/// Missing numbers that are remembered, so that a message that comes late is not counted twice.
const REMEMBERED: u64 = 64;
/// A wider gap is no loss: the publisher has begun to number anew.
const WIDEST_GAP: u64 = 1 << 32;

/// Numbers of one channel.
#[derive(Debug)]
pub(super) struct Numbering {
    /// Later numbers that a missing one is waited for.
    patience: u64,
    next: Option<u64>,
    missing: VecDeque<Missing>,
}

#[derive(Debug)]
struct Missing {
    number: u64,
    counted: bool,
}

/// What a number that has come says.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Arrival {
    /// A message of its own; before it, so many were lost that had not been counted yet.
    New {
        /// Messages lost.
        lost: u64,
    },
    /// A message that was already counted as lost.
    CountedAsLost,
}

impl Numbering {
    /// Waits for a missing number until one comes that is more than `patience` greater.
    pub(super) fn new(patience: u64) -> Self {
        Self { patience, next: None, missing: VecDeque::new() }
    }

    /// Says which number comes next; numbers between it and the one that does come are lost.
    pub(super) fn expect(&mut self, next: Option<u64>) {
        self.next = next;
    }

    /// Takes the number of a message that has come.
    pub(super) fn arrive(&mut self, number: u64) -> Arrival {
        let next = self.next.unwrap_or(number);
        if number >= next {
            let lost = self.advance(next, number);
            return Arrival::New { lost };
        }
        if let Some(index) = self.missing.iter().position(|missing| missing.number == number) {
            let counted = self.missing.remove(index).is_some_and(|missing| missing.counted);
            return if counted { Arrival::CountedAsLost } else { Arrival::New { lost: 0 } };
        }
        if next - number <= REMEMBERED {
            return Arrival::New { lost: 0 };
        }
        let lost = self.give_up();
        self.next = Some(number.saturating_add(1));
        Arrival::New { lost }
    }

    /// Stops waiting: how many numbers are lost that were still waited for.
    pub(super) fn give_up(&mut self) -> u64 {
        let lost = self.missing.iter().filter(|missing| !missing.counted).count() as u64;
        self.missing.clear();
        lost
    }

    fn advance(&mut self, next: u64, number: u64) -> u64 {
        self.next = Some(number.saturating_add(1));
        let gap = number - next;
        if gap > WIDEST_GAP {
            return self.give_up();
        }
        let mut lost = gap.saturating_sub(REMEMBERED);
        self.missing.extend((next + lost..number).map(|number| Missing { number, counted: false }));
        while self.missing.len() as u64 > REMEMBERED {
            lost += u64::from(self.missing.pop_front().is_some_and(|missing| !missing.counted));
        }
        for missing in &mut self.missing {
            if !missing.counted && number.saturating_sub(missing.number) > self.patience {
                missing.counted = true;
                lost += 1;
            }
        }
        lost
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn arrive_all(numbering: &mut Numbering, numbers: &[u64]) -> Vec<Arrival> {
        numbers.iter().map(|&number| numbering.arrive(number)).collect()
    }

    fn new(lost: u64) -> Arrival {
        Arrival::New { lost }
    }

    #[test]
    fn a_gap_is_counted_at_once_without_patience_and_once() {
        let mut numbering = Numbering::new(0);
        let found = arrive_all(&mut numbering, &[7, 8, 11, 9, 12]);
        assert_eq!(found, [new(0), new(0), new(2), Arrival::CountedAsLost, new(0)]);
        assert_eq!(numbering.give_up(), 0);
    }

    #[test]
    fn with_patience_a_swapped_message_is_not_lost() {
        let mut numbering = Numbering::new(2);
        let found = arrive_all(&mut numbering, &[0, 2, 1, 4, 5, 6, 8]);
        assert_eq!(found, [new(0), new(0), new(0), new(0), new(0), new(1), new(0)]);
        assert_eq!(numbering.give_up(), 1);
    }

    #[test]
    fn an_expected_number_makes_the_first_message_tell_losses() {
        let mut numbering = Numbering::new(0);
        numbering.expect(Some(100));
        assert_eq!(numbering.arrive(1100), new(1000));
    }

    #[test]
    fn a_publisher_that_numbers_anew_has_lost_nothing() {
        let mut numbering = Numbering::new(0);
        let found = arrive_all(&mut numbering, &[1 << 40, 3, 4, u64::MAX, u64::MAX, 1, 3]);
        assert_eq!(found, [new(0), new(0), new(0), new(0), new(0), new(0), new(1)]);
    }
}
