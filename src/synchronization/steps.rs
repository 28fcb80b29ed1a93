//! The pattern step of each pair: in go pairs and pattern events, out come pairs with their step.
//!
//! An event belongs to the pair whose exposure begins within half a frame period of it. A pair waits for the events until
//! one comes that belongs to it or to a later exposure. The first event of an exposure counts, and a pair never waits
//! for a second one: that would delay every cloud by a period and lose the last window of a scan. A second event that
//! says something else breaks the run of windows behind it instead.
//!
//! Without events, the driver number of camera 1 modulo N is the step.

use std::collections::VecDeque;

use crate::message::{Counts, DropReason, PATTERN_FRINGES, PatternEvent};

use super::lane::{Lane, Place, Placed};
use super::numbering::{Arrival, Numbering};
use super::pairing::Pair;
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

/// A pair and its step.
#[derive(Clone, Debug)]
pub(super) struct SteppedPair<F> {
    pub(super) pair: Pair<F>,
    pub(super) step: usize,
    pub(super) origin: Origin,
}

/// Where a step was announced: what follows in a window was announced next.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Origin {
    pub(super) session: u64,
    sequence: u64,
    /// Contradictions before it.
    contradictions: u64,
}

/// Gives pairs their steps.
#[derive(Debug)]
pub(super) struct Steps<F> {
    settings: Settings,
    pairs: VecDeque<Pair<F>>,
    events: Lane<Announced>,
    sequence: Numbering,
    /// Sessions so far, the present one last.
    sessions: VecDeque<u64>,
    recent: VecDeque<PatternEvent>,
    contradictions: u64,
}

/// What an event says of its exposure: a step, or why there is none.
#[derive(Clone, Copy, Debug)]
struct Announced {
    step: Result<usize, DropReason>,
    origin: Origin,
}

impl Origin {
    /// Whether this was announced right after `before`.
    pub(super) fn follows(&self, before: &Self) -> bool {
        self.session == before.session
            && self.contradictions == before.contradictions
            && before.sequence.checked_add(1) == Some(self.sequence)
    }
}

impl<F> Steps<F> {
    pub(super) fn new(settings: Settings) -> Self {
        Self {
            settings,
            pairs: VecDeque::new(),
            events: Lane::new(),
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

    pub(super) fn add(&mut self, pair: Pair<F>) {
        self.pairs.push_back(pair);
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
        for (announced, reason) in self.events.take_dropped() {
            counts.drop_one(announced.step.err().unwrap_or(reason));
        }
        while self.events.waiting() > MOST_EVENTS && self.drop_event(counts) {}
    }

    /// The next pair that has a step, once it is known.
    pub(super) fn next(&mut self, pattern: &mut Counts, pairing: &mut Counts) -> Option<SteppedPair<F>> {
        match self.settings.source {
            StepSource::Cycle => self.next_of_cycle(pairing),
            StepSource::Events { .. } => self.next_of_events(pattern, pairing),
        }
    }

    /// Pairs that wait for their event.
    pub(super) fn waiting(&self) -> usize {
        self.pairs.len()
    }

    /// Gives up the pair that has waited longest; `false` if there is none.
    pub(super) fn give_up_first(&mut self, pairing: &mut Counts) -> bool {
        let given_up = self.pairs.pop_front().is_some();
        if given_up {
            pairing.drop_many(DropReason::NoPattern, 2);
        }
        given_up
    }

    /// Counts everything that waits as stopped.
    pub(super) fn end(&mut self, pattern: &mut Counts, pairing: &mut Counts) {
        pairing.drop_many(DropReason::Stopped, 2 * self.pairs.drain(..).count() as u64);
        for announced in self.events.take_waiting() {
            pattern.drop_one(announced.step.err().unwrap_or(DropReason::Stopped));
        }
        count_lost(self.sequence.give_up(), pattern);
    }

    fn next_of_cycle(&mut self, pairing: &mut Counts) -> Option<SteppedPair<F>> {
        let pair = self.pairs.pop_front()?;
        let header = pair.0[0].header;
        let step = (header.sequence % self.settings.steps as u64) as usize;
        pairing.passed += 2;
        let origin = Origin { session: header.session, sequence: header.sequence, contradictions: 0 };
        Some(SteppedPair { pair, step, origin })
    }

    fn next_of_events(&mut self, pattern: &mut Counts, pairing: &mut Counts) -> Option<SteppedPair<F>> {
        loop {
            let pair_ns = self.pairs.front()?.exposure_start_ns();
            let event_ns = self.events.next_place()?.time_ns;
            if pair_ns.abs_diff(event_ns) < self.settings.half_period_ns() {
                let announced = self.events.take_next()?;
                match announced.step {
                    Ok(step) => {
                        pattern.passed += 1;
                        pairing.passed += 2;
                        return Some(SteppedPair { pair: self.pairs.pop_front()?, step, origin: announced.origin });
                    }
                    Err(reason) => pattern.drop_one(reason),
                }
                self.give_up_first(pairing);
            } else if event_ns < pair_ns {
                self.drop_event(pattern);
            } else {
                self.give_up_first(pairing);
            }
        }
    }

    /// Drops the event that has waited longest: no pair belongs to it.
    fn drop_event(&mut self, pattern: &mut Counts) -> bool {
        let dropped = self.events.take_next();
        if let Some(announced) = dropped {
            pattern.drop_one(announced.step.err().unwrap_or(DropReason::Unpaired));
        }
        dropped.is_some()
    }

    /// Counts the event and those lost before it; `false` if it was itself counted as lost.
    fn arrives(&mut self, place: &Place, counts: &mut Counts) -> bool {
        counts.taken += 1;
        if self.events.is_stale(place) {
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
        self.events.admit(Placed { place, item: Announced { step: self.step_of(&event), origin } });
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
