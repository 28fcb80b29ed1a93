//! Puts the pattern events in order.
//!
//! In: events as they arrive. Out: for each exposure, its step or the reason why it has none.
//!
//! The first event of an exposure counts. If the code waited for a possible second event, every cloud would be delayed
//! by a period and the last window of a scan would be lost. Instead, a second event with different content ends the
//! current run of windows.

use std::collections::VecDeque;

use crate::{Counts, DropReason, PATTERN_FRINGES, PatternEvent};

use super::gaps::{Arrival, GapCounter};
use super::reorder::{Place, Placed, ReorderBuffer};
use super::settings::{Settings, StepSource};

/// Maximum number of events that wait for their pair.
const MAX_EVENTS: usize = 64;
/// Number of events remembered to recognize a second event of the same exposure.
const REMEMBERED: usize = 16;
/// A missing event counts as lost when an event arrives whose number is greater by more than this. By then it could not
/// be used any more.
const PATIENCE: u64 = 8;
/// Number of driver sessions remembered, so that an old session is not mistaken for a new one.
const SESSIONS: usize = 4;
/// Relative tolerance of the fringe period.
const PERIOD_TOLERANCE: f64 = 1e-6;

/// Pattern events in order.
#[derive(Debug)]
pub(super) struct PatternEvents {
    settings: Settings,
    reorder: ReorderBuffer<Announcement>,
    gaps: GapCounter,
    /// Sessions so far, the current one last.
    sessions: VecDeque<u64>,
    recent: VecDeque<PatternEvent>,
    contradictions: u64,
}

/// Step announced for an exposure, or the reason why it has none.
#[derive(Clone, Copy, Debug)]
pub(super) struct Announcement {
    pub(super) step: Result<usize, DropReason>,
    pub(super) origin: Origin,
}

/// Position of an event in the stream. Consecutive pairs of a window have consecutive origins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Origin {
    pub(super) session: u64,
    pub(super) sequence: u64,
    /// Number of contradictions before the event.
    pub(super) contradictions: u64,
}

impl Origin {
    /// Whether this event directly follows `before`, without a contradiction in between.
    pub(super) fn follows(&self, before: &Self) -> bool {
        self.session == before.session
            && self.contradictions == before.contradictions
            && before.sequence.checked_add(1) == Some(self.sequence)
    }
}

impl PatternEvents {
    pub(super) fn new(settings: Settings) -> Self {
        Self {
            settings,
            reorder: ReorderBuffer::new(),
            gaps: GapCounter::new(PATIENCE),
            sessions: VecDeque::new(),
            recent: VecDeque::new(),
            contradictions: 0,
        }
    }

    /// Sets the session and number of the next event.
    pub(super) fn set_next(&mut self, session: u64, sequence: u64) {
        self.sessions.push_back(session);
        self.gaps.set_next(Some(sequence));
    }

    /// Adds an event.
    pub(super) fn push(&mut self, event: PatternEvent, counts: &mut Counts) {
        let place = Place { session: event.session, sequence: event.sequence, time_ns: event.exposure_start_ns };
        if !self.count_arrival(&place, counts) {
            return;
        }
        match self.reason_to_drop(&event) {
            Some(reason) => counts.drop_one(reason),
            None => self.reorder(event, place),
        }
        for (announced, reason) in self.reorder.take_dropped() {
            counts.drop_one(announced.step.err().unwrap_or(reason));
        }
        while self.reorder.waiting() > MAX_EVENTS && self.drop_oldest(counts) {}
    }

    /// Start of the exposure of the next event.
    pub(super) fn next_exposure_ns(&self) -> Option<u64> {
        self.reorder.next_place().map(|place| place.time_ns)
    }

    /// Takes the next announcement.
    pub(super) fn take_next(&mut self) -> Option<Announcement> {
        self.reorder.take_next()
    }

    /// Drops the oldest event, because it belongs to no pair. Returns `false` if there is none.
    pub(super) fn drop_oldest(&mut self, counts: &mut Counts) -> bool {
        let dropped = self.reorder.take_next();
        if let Some(announced) = dropped {
            counts.drop_one(announced.step.err().unwrap_or(DropReason::Unpaired));
        }
        dropped.is_some()
    }

    /// Drops all waiting events as stopped.
    pub(super) fn end(&mut self, counts: &mut Counts) {
        for announced in self.reorder.take_waiting() {
            counts.drop_one(announced.step.err().unwrap_or(DropReason::Stopped));
        }
        count_lost(self.gaps.give_up(), counts);
    }

    /// Counts the event and the lost events before it. Returns `false` if the event itself was already counted as lost.
    fn count_arrival(&mut self, place: &Place, counts: &mut Counts) -> bool {
        counts.taken += 1;
        if self.reorder.is_stale(place) {
            return true;
        }
        if self.sessions.back() != Some(&place.session) {
            self.begin_session(place.session, counts);
        }
        match self.gaps.arrive(place.sequence) {
            Arrival::New { lost } => count_lost(lost, counts),
            Arrival::CountedAsLost => {
                counts.taken -= 1;
                return false;
            }
        }
        true
    }

    /// A restarted driver numbers its events from 0. For the first driver, the number of its first event is unknown.
    fn begin_session(&mut self, session: u64, counts: &mut Counts) {
        count_lost(self.gaps.give_up(), counts);
        let is_new = !self.sessions.is_empty() && !self.sessions.contains(&session);
        self.gaps.set_next(is_new.then_some(0));
        self.sessions.retain(|&known| known != session);
        self.sessions.push_back(session);
        if self.sessions.len() > SESSIONS {
            self.sessions.pop_front();
        }
        self.recent.clear();
    }

    /// Reason to drop an event before it is put in order, if any.
    fn reason_to_drop(&mut self, event: &PatternEvent) -> Option<DropReason> {
        if matches!(self.settings.source, StepSource::Cycle) {
            return Some(DropReason::Unpaired);
        }
        if event.exposure_start_ns == 0 {
            return Some(DropReason::BadTime);
        }
        let half_period_ns = self.settings.half_period_ns();
        // An event with the same number, or for the same exposure within half a period.
        let twin = self.recent.iter().find(|recent| {
            let apart_ns = recent.exposure_start_ns.abs_diff(event.exposure_start_ns);
            recent.session == event.session && (recent.sequence == event.sequence || apart_ns < half_period_ns)
        })?;
        if has_same_content(twin, event) {
            return Some(DropReason::Duplicate);
        }
        self.contradictions += 1;
        Some(DropReason::PatternConflict)
    }

    fn reorder(&mut self, event: PatternEvent, place: Place) {
        self.recent.push_back(event);
        if self.recent.len() > REMEMBERED {
            self.recent.pop_front();
        }
        let (session, sequence) = (event.session, event.sequence);
        let origin = Origin { session, sequence, contradictions: self.contradictions };
        self.reorder.push(Placed { place, item: Announcement { step: self.step_of(&event), origin } });
    }

    fn step_of(&self, event: &PatternEvent) -> Result<usize, DropReason> {
        let StepSource::Events { period_px } = self.settings.source else { return Err(DropReason::Unpaired) };
        if event.kind != PATTERN_FRINGES {
            return Err(DropReason::NoPattern);
        }
        let is_period = (event.period_px - period_px).abs() <= PERIOD_TOLERANCE * period_px;
        let step = event.step as usize;
        if is_period && event.steps as usize == self.settings.steps && step < self.settings.steps {
            Ok(step)
        } else {
            Err(DropReason::PatternConflict)
        }
    }
}

fn count_lost(lost: u64, counts: &mut Counts) {
    counts.taken += lost;
    counts.drop_many(DropReason::Overrun, lost);
}

fn has_same_content(one: &PatternEvent, other: &PatternEvent) -> bool {
    let content = |event: &PatternEvent| (event.kind, event.steps, event.step, event.period_px.to_bits());
    content(one) == content(other)
}
