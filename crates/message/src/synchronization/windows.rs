//! Creates windows from pairs: N or more consecutive pairs that show the steps in turn.
//!
//! Windows overlap: each pair that has enough predecessors without a gap completes a window. A new run of pairs starts
//! at a gap in the sequence numbers of a camera or of the projector, at a new session, at a pause, and at a step out of
//! turn.

use std::collections::VecDeque;

use fringeflow_base::limits::MAX_IMAGES;

use crate::{Counts, DropReason, Skew, Window};

use super::pairing::Image;
use super::settings::Settings;
use super::steps::SteppedPair;

/// The images of one window, in the order of their exposures.
#[derive(Clone, Debug)]
pub struct WindowImages<F> {
    /// Sessions, numbers and times of the images.
    pub window: Window,
    /// Delay of the images of camera 2 after those of camera 1, mean over the pairs, nanoseconds.
    pub skew_ns: i64,
    /// Images of camera 1.
    pub cam1: Vec<F>,
    /// Images of camera 2.
    pub cam2: Vec<F>,
}

/// The current run of pairs.
#[derive(Debug)]
pub(super) struct WindowBuilder<F> {
    settings: Settings,
    /// The last pairs of the run, at most as many as a window has.
    run: VecDeque<SteppedPair<F>>,
    /// Index of the last pair in the run, offset so that step 0 has a multiple of N.
    index: usize,
    /// Why the first pairs of the run do not complete a window.
    incomplete: DropReason,
}

impl<F: Clone> WindowBuilder<F> {
    pub(super) fn new(settings: Settings) -> Self {
        Self { settings, run: VecDeque::new(), index: 0, incomplete: DropReason::Beginning }
    }

    /// Adds a pair. Returns the window that it completes, if the stride selects that window.
    pub(super) fn push(&mut self, next: SteppedPair<F>, counts: &mut Counts) -> Option<WindowImages<F>> {
        counts.taken += 1;
        let broken = self.run.back().and_then(|last| self.break_between(last, &next));
        if let Some(reason) = broken {
            self.run.clear();
            let is_beginning = reason == DropReason::NewSession;
            self.incomplete = if is_beginning { DropReason::Beginning } else { DropReason::Incomplete };
        }
        self.index = if self.run.is_empty() { next.step } else { self.index + 1 };
        while self.run.len() >= self.settings.images {
            self.run.pop_front();
        }
        self.run.push_back(next);
        if self.run.len() < self.settings.images {
            counts.drop_one(broken.unwrap_or(self.incomplete));
            return None;
        }
        if !(self.index + 1).is_multiple_of(self.settings.window_stride) {
            counts.drop_one(DropReason::BetweenWindows);
            return None;
        }
        counts.passed += 1;
        Some(self.window())
    }

    /// Releases the images of the current run.
    pub(super) fn end(&mut self) {
        self.run.clear();
    }

    /// Reason why no window can contain both pairs.
    fn break_between(&self, last: &SteppedPair<F>, next: &SteppedPair<F>) -> Option<DropReason> {
        if !next.pair.has_same_sessions(&last.pair) || next.origin.session != last.origin.session {
            return Some(DropReason::NewSession);
        }
        let apart_ns = next.pair.exposure_start_ns().checked_sub(last.pair.exposure_start_ns());
        if !next.pair.follows(&last.pair) || !apart_ns.is_some_and(|apart_ns| self.is_one_period(apart_ns)) {
            return Some(DropReason::Incomplete);
        }
        // The times and numbers of the images are consecutive here, so only the pattern can still break the run.
        let in_turn = next.step == (last.step + 1) % self.settings.steps;
        (!in_turn || !next.origin.follows(&last.origin)).then_some(DropReason::PatternConflict)
    }

    fn is_one_period(&self, apart_ns: u64) -> bool {
        let half_ns = self.settings.half_period_ns();
        apart_ns > half_ns && apart_ns < half_ns.saturating_mul(3)
    }

    fn window(&self) -> WindowImages<F> {
        let images = |camera: usize| self.run.iter().map(move |stepped| &stepped.pair.0[camera]);
        let handles = |camera: usize| images(camera).map(|image| image.handle.clone()).collect();
        let sequences = |camera: usize| {
            let mut sequences = [0; MAX_IMAGES];
            sequences.iter_mut().zip(images(camera)).for_each(|(number, image)| *number = image.header.sequence);
            sequences
        };
        let session = |camera: usize| images(camera).next().map_or(0, |image| image.header.session);
        let exposures_ns = || self.run.iter().map(|stepped| stepped.pair.exposure_start_ns());
        let (first_exposure_ns, last_exposure_ns) =
            (exposures_ns().min().unwrap_or(0), exposures_ns().max().unwrap_or(0));
        let received_ns = |image: &Image<F>| image.header.received_ns;
        let window = Window {
            // Set later by the decoder.
            prior: 0,
            cam1_session: session(0),
            cam2_session: session(1),
            cam1_sequence: sequences(0),
            cam2_sequence: sequences(1),
            first_exposure_ns,
            last_exposure_ns,
            centre_ns: first_exposure_ns.midpoint(last_exposure_ns),
            received_ns: images(0).chain(images(1)).map(received_ns).max().unwrap_or(0),
            images: self.run.len() as u32,
            first_step: self.run.front().map_or(0, |first| first.step as u32),
        };
        WindowImages { window, skew_ns: self.skew_ns(), cam1: handles(0), cam2: handles(1) }
    }

    /// Mean over the pairs of the run.
    fn skew_ns(&self) -> i64 {
        let mut skew = Skew::default();
        self.run.iter().for_each(|stepped| skew.add(stepped.pair.skew_ns()));
        skew.mean_ns().unwrap_or(0.0).round() as i64
    }
}
