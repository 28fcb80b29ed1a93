//! Puts the items of one channel (images or events) in the order of their times.
//!
//! An item whose number follows that of its predecessor passes at once. After a gap, an item is held until the missing
//! item arrives or two more items have arrived. So two swapped items are put in order. After a loss, no window is
//! delayed more than it would be anyway, since a window has at least three images. The times decide the order; the
//! numbers only show whether an item is missing. The result depends on the content of this channel alone.

use std::collections::VecDeque;

use crate::DropReason;

/// Number of items held while an earlier one may still arrive.
const MAX_HELD: usize = 2;
/// Number of positions remembered to distinguish a repeated item from a late one.
const REMEMBERED: usize = 16;
/// After this many rejected items in a row, each later than the one before, the earlier items must have been wrong.
const RESTART_AFTER: usize = 4;

/// Position of an item in its channel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    /// Identifies the start of the sender.
    pub(super) session: u64,
    /// Number in the session.
    pub(super) sequence: u64,
    /// Start of the exposure.
    pub(super) time_ns: u64,
}

/// An item and its position.
#[derive(Debug)]
pub(super) struct Placed<T> {
    /// Position of the item.
    pub(super) place: Place,
    /// The item.
    pub(super) item: T,
}

/// Items of one channel that wait to be taken in order.
#[derive(Debug)]
pub(super) struct ReorderBuffer<T> {
    /// Items in order, waiting to be taken.
    ordered: VecDeque<Placed<T>>,
    /// Items after a gap, sorted by time.
    held: Vec<Placed<T>>,
    /// Positions of the last items put in order, of this session.
    recent: VecDeque<Place>,
    last_rejected: Option<Place>,
    rejected_in_a_row: usize,
    dropped: Vec<(T, DropReason)>,
}

enum Verdict {
    Accept,
    NewSession,
    /// The times stay earlier: the earlier items were wrong.
    Restart,
    Drop(DropReason),
}

impl<T> ReorderBuffer<T> {
    pub(super) fn new() -> Self {
        Self {
            ordered: VecDeque::new(),
            held: Vec::new(),
            recent: VecDeque::new(),
            last_rejected: None,
            rejected_in_a_row: 0,
            dropped: Vec::new(),
        }
    }

    /// Adds an item. Items dropped because of it are returned by [`Self::take_dropped`].
    pub(super) fn push(&mut self, placed: Placed<T>) {
        match self.verdict(&placed.place) {
            Verdict::Accept => {}
            Verdict::NewSession => self.end_session(),
            Verdict::Restart => self.restart(),
            Verdict::Drop(reason) => {
                self.dropped.push((placed.item, reason));
                return;
            }
        }
        (self.last_rejected, self.rejected_in_a_row) = (None, 0);
        let index = self.held.partition_point(|held| held.place.time_ns < placed.place.time_ns);
        self.held.insert(index, placed);
        self.release();
    }

    /// Whether the position belongs to another session but is not later than the items so far.
    pub(super) fn is_stale(&self, place: &Place) -> bool {
        let Some(last) = self.recent.back() else { return false };
        let newest = self.held.last().map_or(last, |held| &held.place);
        place.session != last.session && place.time_ns <= newest.time_ns
    }

    /// Position of the next item in order.
    pub(super) fn next_place(&self) -> Option<Place> {
        self.ordered.front().map(|placed| placed.place)
    }

    /// Returns the next item in order.
    pub(super) fn take_next(&mut self) -> Option<T> {
        self.ordered.pop_front().map(|placed| placed.item)
    }

    /// Number of waiting items, including those after a gap.
    pub(super) fn waiting(&self) -> usize {
        self.ordered.len() + self.held.len()
    }

    /// Returns the dropped items with the reasons.
    pub(super) fn take_dropped(&mut self) -> std::vec::Drain<'_, (T, DropReason)> {
        self.dropped.drain(..)
    }

    /// Returns all waiting items.
    pub(super) fn take_waiting(&mut self) -> impl Iterator<Item = T> + '_ {
        self.ordered.drain(..).chain(self.held.drain(..)).map(|placed| placed.item)
    }

    fn verdict(&mut self, place: &Place) -> Verdict {
        let Some(&last) = self.recent.back() else { return Verdict::Accept };
        if self.is_stale(place) {
            return self.reject(place, DropReason::NewSession);
        }
        if place.session != last.session {
            return Verdict::NewSession;
        }
        if self.is_known(place) {
            return Verdict::Drop(DropReason::Duplicate);
        }
        if place.time_ns > last.time_ns {
            return Verdict::Accept;
        }
        // The item is earlier than the last one. If its number is later, its time is wrong; otherwise it is late.
        let is_time_wrong = place.sequence > last.sequence;
        self.reject(place, if is_time_wrong { DropReason::BadTime } else { DropReason::Late })
    }

    fn is_known(&self, place: &Place) -> bool {
        let held = self.held.iter().map(|held| &held.place);
        self.recent.iter().chain(held).any(|known| known.sequence == place.sequence || known.time_ns == place.time_ns)
    }

    fn reject(&mut self, place: &Place, reason: DropReason) -> Verdict {
        let is_next = self.last_rejected.is_some_and(|last| {
            place.session == last.session && place.sequence > last.sequence && place.time_ns > last.time_ns
        });
        self.rejected_in_a_row = if is_next { self.rejected_in_a_row + 1 } else { 1 };
        self.last_rejected = Some(*place);
        if self.rejected_in_a_row < RESTART_AFTER { Verdict::Drop(reason) } else { Verdict::Restart }
    }

    fn end_session(&mut self) {
        while !self.held.is_empty() {
            self.release_first();
        }
        self.recent.clear();
    }

    /// Drops all waiting items, because they are later than everything that follows.
    fn restart(&mut self) {
        let waiting = self.ordered.drain(..).chain(self.held.drain(..));
        self.dropped.extend(waiting.map(|placed| (placed.item, DropReason::NewSession)));
        self.recent.clear();
    }

    fn release(&mut self) {
        while self.held.first().is_some_and(|first| self.follows(&first.place)) || self.held.len() > MAX_HELD {
            self.release_first();
        }
    }

    fn follows(&self, place: &Place) -> bool {
        self.recent.back().is_none_or(|last| last.sequence.checked_add(1) == Some(place.sequence))
    }

    fn release_first(&mut self) {
        let placed = self.held.remove(0);
        self.recent.push_back(placed.place);
        if self.recent.len() > REMEMBERED {
            self.recent.pop_front();
        }
        self.ordered.push_back(placed);
    }
}
