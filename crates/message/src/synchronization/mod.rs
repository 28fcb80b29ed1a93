//! Which images belong together: in go the images of both cameras and the pattern events, each in the order of its
//! channel; out come windows, N or more image pairs in a row that show the pattern steps in turn.
//!
//! ```text
//!  images of C1 ─► order ─┐
//!                         ├─► pairs ─┐
//!  images of C2 ─► order ─┘          ├─► pairs with step ─► windows
//!  pattern events ─► order ──────────┘
//! ```
//!
//! A window is complete or it is not put out: a lost image loses its windows and never shifts a phase. What comes out
//! depends on the content and order of each channel alone, not on how the channels interleave, unless so much waits that
//! the bounds are reached; hence a replay makes the same windows. Nothing here knows a clock: an image waits until
//! another one, later, shows that its partner cannot come any more.
//!
//! Take one message of each channel in turn: then what waits stays far below the bounds.

mod events;
mod lane;
mod numbering;
mod pairing;
mod steps;
#[cfg(test)]
mod tests;
mod windows;

use std::collections::VecDeque;

use fringeflow_base::limits::{MAX_IMAGES, MAX_STEPS, MIN_STEPS};

use crate::{Counts, DropReason, FrameHeader, PatternEvent, Skew, Stage, Window};

use pairing::{Image, Pairing};
use steps::Steps;
use windows::Windows;

/// Fewest images that must be able to wait: what a lost image makes the other camera wait, and one more.
pub const LEAST_WAITING: usize = 4;

/// How images are put together.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Number of steps N of the phase shift.
    pub steps: usize,
    /// Image pairs of a window: N, and more where motion is compensated.
    pub images: usize,
    /// Time from one exposure to the next, nanoseconds; true within some percent.
    pub frame_period_ns: u64,
    /// What tells the step of a pair.
    pub source: StepSource,
    /// Every how many pairs a window is put out: 1 for every one, N for disjoint windows that end with the last step.
    pub every: usize,
    /// Most images of a camera that wait for their partner or their step; with the images of a window more, what is held.
    pub waiting: usize,
}

/// What tells the step of a pair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StepSource {
    /// The driver of the projector announces each pattern.
    Events {
        /// Fringe period that the events must have, projector pixels.
        period_px: f64,
    },
    /// The driver number of camera 1, modulo N: the projector starts with step 0 at the first image of the session.
    Cycle,
}

/// Settings that cannot be followed.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SettingsError {
    /// Too few or too many steps.
    #[error("steps is {steps}; a cycle has {MIN_STEPS} to {MAX_STEPS}")]
    Steps {
        /// The value.
        steps: usize,
    },
    /// A window shorter than a cycle, or too long.
    #[error("a window has {images} image pairs; with {steps} steps it must have {steps} to {MAX_IMAGES}")]
    Images {
        /// The value.
        images: usize,
        /// Number of steps.
        steps: usize,
    },
    /// Too short a frame period.
    #[error("the frame period is {frame_period_ns} ns; give the time from one exposure to the next, at least 1000 ns")]
    FramePeriod {
        /// The value.
        frame_period_ns: u64,
    },
    /// A fringe period that no pattern has.
    #[error("the fringe period is {period_px} px; it must be a finite number above 0")]
    FringePeriod {
        /// The value.
        period_px: f64,
    },
    /// No window at all.
    #[error("every is 0; give 1 for a window with every image pair, or the number of steps for disjoint windows")]
    Every,
    /// Too few images may wait.
    #[error("waiting is {waiting}; at least {LEAST_WAITING} images of a camera must be able to wait for the other")]
    Waiting {
        /// The value.
        waiting: usize,
    },
}

/// The images of one window, in the order of their exposures.
#[derive(Clone, Debug)]
pub struct WindowImages<F> {
    /// Which images they are.
    pub window: Window,
    /// By how much images of camera 2 begin later than those of camera 1, mean over the pairs, nanoseconds.
    pub skew_ns: i64,
    /// Images of camera 1.
    pub cam1: Vec<F>,
    /// Images of camera 2.
    pub cam2: Vec<F>,
}

/// Puts images together; `F` holds the pixels of an image and is cloned into each window it belongs to.
#[derive(Debug)]
pub struct Synchronizer<F> {
    settings: Settings,
    pairing: Pairing<F>,
    steps: Steps<F>,
    windows: Windows<F>,
    ready: VecDeque<WindowImages<F>>,
    counts: StageCounts,
}

#[derive(Debug, Default)]
struct StageCounts {
    pattern: Counts,
    pairing: Counts,
    windowing: Counts,
}

impl Settings {
    fn half_period_ns(&self) -> u64 {
        self.frame_period_ns / 2
    }

    fn check(&self) -> Result<(), SettingsError> {
        let Self { steps, images, frame_period_ns, source, every, waiting } = *self;
        if !(MIN_STEPS..=MAX_STEPS).contains(&steps) {
            return Err(SettingsError::Steps { steps });
        }
        if !(steps..=MAX_IMAGES).contains(&images) {
            return Err(SettingsError::Images { images, steps });
        }
        if frame_period_ns < 1000 {
            return Err(SettingsError::FramePeriod { frame_period_ns });
        }
        if let StepSource::Events { period_px } = source
            && !(period_px.is_finite() && period_px > 0.0)
        {
            return Err(SettingsError::FringePeriod { period_px });
        }
        if every == 0 {
            return Err(SettingsError::Every);
        }
        if waiting < LEAST_WAITING {
            return Err(SettingsError::Waiting { waiting });
        }
        Ok(())
    }
}

impl<F: Clone> Synchronizer<F> {
    /// A synchronizer that has seen nothing.
    ///
    /// # Errors
    /// Settings out of range.
    pub fn new(settings: Settings) -> Result<Self, SettingsError> {
        settings.check()?;
        Ok(Self {
            settings,
            pairing: Pairing::new(settings.half_period_ns()),
            steps: Steps::new(settings),
            windows: Windows::new(settings),
            ready: VecDeque::new(),
            counts: StageCounts::default(),
        })
    }

    /// Says what a camera (1 or 2) publishes next, so that what is lost before the first image is counted.
    pub fn expect_frame(&mut self, camera: u32, published: u64) {
        if let Some(camera) = index_of(camera) {
            self.pairing.expect(camera, published);
        }
    }

    /// Says which event the projector driver publishes next, so that what is lost before the first one is counted.
    pub fn expect_pattern(&mut self, session: u64, sequence: u64) {
        self.steps.events().expect(session, sequence);
    }

    /// Takes an image.
    pub fn frame(&mut self, header: FrameHeader, handle: F) {
        let Some(camera) = index_of(header.camera) else {
            self.counts.pairing.taken += 1;
            return self.counts.pairing.drop_one(DropReason::Malformed);
        };
        self.pairing.admit(camera, Image { header, handle }, &mut self.counts.pairing);
        self.advance();
        self.limit(camera);
    }

    /// Counts an image that its receiver refuses: the pipeline takes it as lost.
    pub fn refuse_frame(&mut self, header: &FrameHeader, reason: DropReason) {
        match index_of(header.camera) {
            Some(camera) => self.pairing.refuse(camera, header, reason, &mut self.counts.pairing),
            None => {
                self.counts.pairing.taken += 1;
                self.counts.pairing.drop_one(reason);
            }
        }
    }

    /// Takes an event of the projector driver.
    pub fn pattern(&mut self, event: PatternEvent) {
        self.steps.events().admit(event, &mut self.counts.pattern);
        self.advance();
    }

    /// The next window; ask until there is none after each message, so that its images are free again.
    pub fn next_window(&mut self) -> Option<WindowImages<F>> {
        self.ready.pop_front()
    }

    /// Counts of [`Stage::Pattern`] (events), [`Stage::Pairing`] (images) and [`Stage::Windowing`] (pairs); `None` of
    /// other stages.
    #[must_use]
    pub fn counts(&self, stage: Stage) -> Option<&Counts> {
        match stage {
            Stage::Pattern => Some(&self.counts.pattern),
            Stage::Pairing => Some(&self.counts.pairing),
            Stage::Windowing => Some(&self.counts.windowing),
            _ => None,
        }
    }

    /// Skew of the pairs since this was asked last.
    pub fn take_skew(&mut self) -> Skew {
        self.pairing.take_skew()
    }

    /// Ends the run: what still waits is dropped as stopped; windows that are ready stay so.
    pub fn end(&mut self) {
        self.pairing.end(&mut self.counts.pairing);
        self.steps.end(&mut self.counts.pattern, &mut self.counts.pairing);
        self.windows.end();
    }

    fn advance(&mut self) {
        let StageCounts { pattern, pairing, windowing } = &mut self.counts;
        while let Some(pair) = self.pairing.next(pairing) {
            self.steps.add(pair);
        }
        while let Some(stepped) = self.steps.next(pattern, pairing) {
            self.ready.extend(self.windows.add(stepped, windowing));
        }
    }

    /// Gives up what has waited longest where more images of a camera wait than may.
    fn limit(&mut self, camera: usize) {
        let counts = &mut self.counts.pairing;
        while self.pairing.waiting(camera) + self.steps.waiting() > self.settings.waiting {
            if !self.steps.give_up_first(counts) && !self.pairing.give_up_first(camera, counts) {
                return;
            }
        }
    }
}

fn index_of(camera: u32) -> Option<usize> {
    [1, 2].iter().position(|&number| number == camera)
}
