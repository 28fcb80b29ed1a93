//! The pattern events in order: in go events as they come, out comes for each exposure its step, or why it has none.
//!
//! The first event of an exposure counts, and nobody waits for a second one: that would delay every cloud by a period and
//! lose the last window of a scan. A second event that says something else breaks the run of windows behind it instead.

use std::collections::VecDeque;

use crate::{Counts, DropReason, PATTERN_FRINGES, PatternEvent};

use super::lane::{Lane, Place, Placed};
use super::numbering::{Arrival, Numbering};
use super::{Settings, StepSource};

/// Most events that wait for their pair.
const MOST_EVENTS: usize = 64;
/// Events remembered to recognise a second one of the same exposure.
const REMEMBERED: usize = 16;
/// An event is lost when one comes whose number is greater by more than this: well behind where it could still be used.
const PATIENCE: u64 = 8;
/// Sessions of the driver remembered, so that one that comes back is not taken for a new one.
const SESSIONS: usize = 4;
/// A period is the configured one if it differs by less than this share.
const PERIOD_TOLERANCE: f64 = 1e-6;

/// Pattern events in order.
#[derive(Debug)]
pub(super) struct Announcements {
    settings: Settings,
    lane: Lane<Announced>,
    sequence: Numbering,
    /// Sessions so far, the present one last.
    sessions: VecDeque<u64>,
    recent: VecDeque<PatternEvent>,
    contradictions: u64,
}

/// What an event says of its exposure: a step, or why there is none.
#[derive(Clone, Copy, Debug)]
pub(super) struct Announced {
    pub(super) step: Result<usize, DropReason>,
    pub(super) origin: Origin,
}

/// Where a step was announced: what follows in a window was announced next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Origin {
    pub(super) session: u64,
    pub(super) sequence: u64,
    /// Contradictions before it.
    pub(super) contradictions: u64,
}

impl Origin {
    /// Whether this was announced right after `before`.
    pub(super) fn follows(&self, before: &Self) -> bool {
        self.session == before.session
            && self.contradictions == before.contradictions
            && before.sequence.checked_add(1) == Some(self.sequence)
    }
}

impl Announcements {
    pub(super) fn new(settings: Settings) -> Self {
        Self {
            settings,
            lane: Lane::new(),
            sequence: Numbering::new(PATIENCE),
            sessions: VecDeque::new(),
            recent: VecDeque::new(),
            contradictions: 0,
        }
    }

    pub(super) fn expect(&mut self, session: u64, sequence: u64) {
        self.sessions.push_back(session);
        self.sequence.expect(Some(sequence));
    }

    /// Takes an event.
    pub(super) fn admit(&mut self, event: PatternEvent, counts: &mut Counts) {
        let place = Place { session: event.session, sequence: event.sequence, time_ns: event.exposure_start_ns };
        if !self.arrives(&place, counts) {
            return;
        }
        match self.refusal(&event) {
            Some(reason) => counts.drop_one(reason),
            None => self.put_in_order(event, place),
        }
        for (announced, reason) in self.lane.take_dropped() {
            counts.drop_one(announced.step.err().unwrap_or(reason));
        }
        while self.lane.waiting() > MOST_EVENTS && self.drop_first(counts) {}
    }

    /// Start of the next exposure.
    pub(super) fn next_ns(&self) -> Option<u64> {
        self.lane.next_place().map(|place| place.time_ns)
    }

    /// Takes what is said of the next exposure.
    pub(super) fn take_next(&mut self) -> Option<Announced> {
        self.lane.take_next()
    }

    /// Drops the event that has waited longest: no pair belongs to it.
    pub(super) fn drop_first(&mut self, counts: &mut Counts) -> bool {
        let dropped = self.lane.take_next();
        if let Some(announced) = dropped {
            counts.drop_one(announced.step.err().unwrap_or(DropReason::Unpaired));
        }
        dropped.is_some()
    }

    /// Counts everything that waits as stopped.
    pub(super) fn end(&mut self, counts: &mut Counts) {
        for announced in self.lane.take_waiting() {
            counts.drop_one(announced.step.err().unwrap_or(DropReason::Stopped));
        }
        count_lost(self.sequence.give_up(), counts);
    }

    /// Counts the event and those lost before it; `false` if it was itself counted as lost.
    fn arrives(&mut self, place: &Place, counts: &mut Counts) -> bool {
        counts.taken += 1;
        if self.lane.is_stale(place) {
            return true;
        }
        if self.sessions.back() != Some(&place.session) {
            self.begin_session(place.session, counts);
        }
        match self.sequence.arrive(place.sequence) {
            Arrival::New { lost } => count_lost(lost, counts),
            Arrival::CountedAsLost => {
                counts.taken -= 1;
                return false;
            }
        }
        true
    }

    /// A driver that was here before numbers from 0; of one that was not, the first event seen is the first.
    fn begin_session(&mut self, session: u64, counts: &mut Counts) {
        count_lost(self.sequence.give_up(), counts);
        let is_new = !self.sessions.is_empty() && !self.sessions.contains(&session);
        self.sequence.expect(is_new.then_some(0));
        self.sessions.retain(|&known| known != session);
        self.sessions.push_back(session);
        if self.sessions.len() > SESSIONS {
            self.sessions.pop_front();
        }
        self.recent.clear();
    }

    /// Why an event is dropped before it is put in order.
    fn refusal(&mut self, event: &PatternEvent) -> Option<DropReason> {
        if matches!(self.settings.source, StepSource::Cycle) {
            return Some(DropReason::Unpaired);
        }
        if event.exposure_start_ns == 0 {
            return Some(DropReason::BadTime);
        }
        let half_period_ns = self.settings.half_period_ns();
        let twin = self.recent.iter().find(|recent| {
            let apart_ns = recent.exposure_start_ns.abs_diff(event.exposure_start_ns);
            recent.session == event.session && (recent.sequence == event.sequence || apart_ns < half_period_ns)
        })?;
        if says_the_same(twin, event) {
            return Some(DropReason::Duplicate);
        }
        self.contradictions += 1;
        Some(DropReason::PatternConflict)
    }

    fn put_in_order(&mut self, event: PatternEvent, place: Place) {
        self.recent.push_back(event);
        if self.recent.len() > REMEMBERED {
            self.recent.pop_front();
        }
        let (session, sequence) = (event.session, event.sequence);
        let origin = Origin { session, sequence, contradictions: self.contradictions };
        self.lane.admit(Placed { place, item: Announced { step: self.step_of(&event), origin } });
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

fn says_the_same(one: &PatternEvent, other: &PatternEvent) -> bool {
    let content = |event: &PatternEvent| (event.kind, event.steps, event.step, event.period_px.to_bits());
    content(one) == content(other)
}
