//! The order of one channel: in go images or events as they come, out come the same in the order of their times.
//!
//! What follows its predecessor by number passes at once. What follows a gap is held until the gap is closed or two more
//! have come: so two that were swapped on the way are put in place, and after a loss no window waits longer than it
//! would anyway, since a window has at least three images. Times decide the order; numbers only tell whether something
//! is missing. Everything here depends on the content of this one channel alone.

use std::collections::VecDeque;

use crate::DropReason;

/// Items held while an earlier one may still come.
const HOLD: usize = 2;
/// Places remembered to tell an item that came twice from one that came late.
const REMEMBERED: usize = 16;
/// So many rejected items in a row, each later than the one before, are right, and what they were compared with is wrong.
const RESTART_AFTER: usize = 4;

/// Where an item belongs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Place {
    /// Start of the sender.
    pub(super) session: u64,
    /// Number since then.
    pub(super) sequence: u64,
    /// Start of its exposure.
    pub(super) time_ns: u64,
}

/// An item and its place.
#[derive(Debug)]
pub(super) struct Placed<T> {
    /// Where it belongs.
    pub(super) place: Place,
    /// The item.
    pub(super) item: T,
}

/// Items of one channel.
#[derive(Debug)]
pub(super) struct Lane<T> {
    /// In order, waiting to be taken.
    ordered: VecDeque<Placed<T>>,
    /// Behind a gap, in the order of their times.
    held: Vec<Placed<T>>,
    /// The places put in order last, of this session.
    recent: VecDeque<Place>,
    last_rejected: Option<Place>,
    rejected_in_a_row: usize,
    dropped: Vec<(T, DropReason)>,
}

enum Verdict {
    InOrder,
    NewSession,
    /// What was before cannot be right.
    Anew,
    Dropped(DropReason),
}

impl<T> Lane<T> {
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

    /// Takes an item; what it pushes out, or itself, is found by [`Self::take_dropped`].
    pub(super) fn admit(&mut self, placed: Placed<T>) {
        match self.verdict(&placed.place) {
            Verdict::InOrder => {}
            Verdict::NewSession => self.end_session(),
            Verdict::Anew => self.begin_anew(),
            Verdict::Dropped(reason) => {
                self.dropped.push((placed.item, reason));
                return;
            }
        }
        (self.last_rejected, self.rejected_in_a_row) = (None, 0);
        let index = self.held.partition_point(|held| held.place.time_ns < placed.place.time_ns);
        self.held.insert(index, placed);
        self.release();
    }

    /// Whether the place is of another session, and not later than what came before.
    pub(super) fn is_stale(&self, place: &Place) -> bool {
        let Some(last) = self.recent.back() else { return false };
        let newest = self.held.last().map_or(last, |held| &held.place);
        place.session != last.session && place.time_ns <= newest.time_ns
    }

    /// The next place in order.
    pub(super) fn next_place(&self) -> Option<Place> {
        self.ordered.front().map(|placed| placed.place)
    }

    /// Takes the next item in order.
    pub(super) fn take_next(&mut self) -> Option<T> {
        self.ordered.pop_front().map(|placed| placed.item)
    }

    /// Items waiting, those behind a gap included.
    pub(super) fn waiting(&self) -> usize {
        self.ordered.len() + self.held.len()
    }

    /// Takes what was dropped, with the reasons.
    pub(super) fn take_dropped(&mut self) -> std::vec::Drain<'_, (T, DropReason)> {
        self.dropped.drain(..)
    }

    /// Takes everything that waits.
    pub(super) fn take_waiting(&mut self) -> impl Iterator<Item = T> + '_ {
        self.ordered.drain(..).chain(self.held.drain(..)).map(|placed| placed.item)
    }

    fn verdict(&mut self, place: &Place) -> Verdict {
        let Some(&last) = self.recent.back() else { return Verdict::InOrder };
        if self.is_stale(place) {
            return self.reject(place, DropReason::NewSession);
        }
        if place.session != last.session {
            return Verdict::NewSession;
        }
        if self.knows(place) {
            return Verdict::Dropped(DropReason::Duplicate);
        }
        if place.time_ns > last.time_ns {
            return Verdict::InOrder;
        }
        let runs_back = place.sequence > last.sequence;
        self.reject(place, if runs_back { DropReason::BadTime } else { DropReason::Late })
    }

    fn knows(&self, place: &Place) -> bool {
        let held = self.held.iter().map(|held| &held.place);
        self.recent.iter().chain(held).any(|known| known.sequence == place.sequence || known.time_ns == place.time_ns)
    }

    fn reject(&mut self, place: &Place, reason: DropReason) -> Verdict {
        let goes_on = self.last_rejected.is_some_and(|last| {
            place.session == last.session && place.sequence > last.sequence && place.time_ns > last.time_ns
        });
        self.rejected_in_a_row = if goes_on { self.rejected_in_a_row + 1 } else { 1 };
        self.last_rejected = Some(*place);
        if self.rejected_in_a_row < RESTART_AFTER { Verdict::Dropped(reason) } else { Verdict::Anew }
    }

    fn end_session(&mut self) {
        while !self.held.is_empty() {
            self.release_first();
        }
        self.recent.clear();
    }

    /// Time has gone back: what waits would be later than all that comes.
    fn begin_anew(&mut self) {
        let waiting = self.ordered.drain(..).chain(self.held.drain(..));
        self.dropped.extend(waiting.map(|placed| (placed.item, DropReason::NewSession)));
        self.recent.clear();
    }

    fn release(&mut self) {
        while self.held.first().is_some_and(|first| self.follows(&first.place)) || self.held.len() > HOLD {
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
