//! Gives each image pair its pattern step.
//!
//! In: pairs and pattern events. Out: pairs with their step. An event belongs to the pair whose exposure starts less
//! than half a frame period before or after it. A pair waits until its event or that of a later exposure arrives.
//! Without events, the step is the sequence number of camera 1 modulo N.

use std::collections::VecDeque;

use crate::{Counts, DropReason};

use super::events::{Origin, PatternEvents};
use super::pairing::Pair;
use super::settings::{Settings, StepSource};

/// A pair and its step.
#[derive(Clone, Debug)]
pub(super) struct SteppedPair<F> {
    pub(super) pair: Pair<F>,
    pub(super) step: usize,
    pub(super) origin: Origin,
}

/// Pairs that wait for their steps.
#[derive(Debug)]
pub(super) struct StepAssignment<F> {
    settings: Settings,
    pairs: VecDeque<Pair<F>>,
    events: PatternEvents,
}

impl<F> StepAssignment<F> {
    pub(super) fn new(settings: Settings) -> Self {
        Self { settings, pairs: VecDeque::new(), events: PatternEvents::new(settings) }
    }

    /// The pattern events.
    pub(super) fn events(&mut self) -> &mut PatternEvents {
        &mut self.events
    }

    /// Adds a pair.
    pub(super) fn push(&mut self, pair: Pair<F>) {
        self.pairs.push_back(pair);
    }

    /// Returns the next pair with its step, once the step is known.
    pub(super) fn next_pair(&mut self, pattern: &mut Counts, pairing: &mut Counts) -> Option<SteppedPair<F>> {
        match self.settings.source {
            StepSource::Cycle => self.next_by_counting(pairing),
            StepSource::Events { .. } => self.next_by_events(pattern, pairing),
        }
    }

    /// Number of pairs that wait for their event.
    pub(super) fn waiting(&self) -> usize {
        self.pairs.len()
    }

    /// Drops the oldest pair. Returns `false` if there is none.
    pub(super) fn drop_oldest(&mut self, pairing: &mut Counts) -> bool {
        let is_dropped = self.pairs.pop_front().is_some();
        if is_dropped {
            pairing.drop_many(DropReason::NoPattern, 2);
        }
        is_dropped
    }

    /// Drops all waiting pairs and events as stopped.
    pub(super) fn end(&mut self, pattern: &mut Counts, pairing: &mut Counts) {
        pairing.drop_many(DropReason::Stopped, 2 * self.pairs.drain(..).count() as u64);
        self.events.end(pattern);
    }

    fn next_by_counting(&mut self, pairing: &mut Counts) -> Option<SteppedPair<F>> {
        let pair = self.pairs.pop_front()?;
        let header = pair.0[0].header;
        let step = (header.sequence % self.settings.steps as u64) as usize;
        pairing.passed += 2;
        let origin = Origin { session: header.session, sequence: header.sequence, contradictions: 0 };
        Some(SteppedPair { pair, step, origin })
    }

    fn next_by_events(&mut self, pattern: &mut Counts, pairing: &mut Counts) -> Option<SteppedPair<F>> {
        loop {
            let pair_ns = self.pairs.front()?.exposure_start_ns();
            let event_ns = self.events.next_exposure_ns()?;
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
                // The event of this exposure announces no valid step, so the pair has none.
                self.drop_oldest(pairing);
            } else if event_ns < pair_ns {
                self.events.drop_oldest(pattern);
            } else {
                // The next event is already later, so the event of this pair was lost.
                self.drop_oldest(pairing);
            }
        }
    }
}
