//! The pattern step of each pair: in go pairs and pattern events, out come pairs with their step.
//!
//! An event belongs to the pair whose exposure begins within half a frame period of it. A pair waits for the events until
//! one comes that belongs to it or to a later exposure. Without events, the driver number of camera 1 modulo N is the
//! step.

use std::collections::VecDeque;

use crate::{Counts, DropReason};

use super::events::{Announcements, Origin};
use super::pairing::Pair;
use super::{Settings, StepSource};

/// A pair and its step.
#[derive(Clone, Debug)]
pub(super) struct SteppedPair<F> {
    pub(super) pair: Pair<F>,
    pub(super) step: usize,
    pub(super) origin: Origin,
}

/// Gives pairs their steps.
#[derive(Debug)]
pub(super) struct Steps<F> {
    settings: Settings,
    pairs: VecDeque<Pair<F>>,
    events: Announcements,
}

impl<F> Steps<F> {
    pub(super) fn new(settings: Settings) -> Self {
        Self { settings, pairs: VecDeque::new(), events: Announcements::new(settings) }
    }

    /// The pattern events.
    pub(super) fn events(&mut self) -> &mut Announcements {
        &mut self.events
    }

    pub(super) fn add(&mut self, pair: Pair<F>) {
        self.pairs.push_back(pair);
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
        self.events.end(pattern);
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
            let event_ns = self.events.next_ns()?;
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
                self.events.drop_first(pattern);
            } else {
                self.give_up_first(pairing);
            }
        }
    }
}
