//! Finds the images that belong together.
//!
//! In: the images of both cameras and the pattern events, each in the order of its channel. Out: windows, N or more
//! consecutive image pairs that show the pattern steps in turn.
//!
//! ```text
//!  images of C1 ─► reorder ─┐
//!                           ├─► pairing ─┐
//!  images of C2 ─► reorder ─┘            ├─► steps ─► windows
//!  pattern events ─► reorder ────────────┘
//! ```
//!
//! Every window is complete. A lost image costs its windows and never shifts a phase. The windows depend on the content and
//! order of each channel, and not on the interleaving of the channels, as long as the waiting images stay below the limits.
//! Hence a replay makes the same windows. Nothing here reads a clock: an image waits until a later one shows that its
//! partner cannot come any more.
//!
//! Take one message of each channel in turn. Then the number of waiting images stays far below the limits.

mod events;
mod gaps;
mod pairing;
mod reorder;
mod steps;
#[cfg(test)]
mod tests;
mod windows;

use std::collections::VecDeque;

use fringeflow_base::limits::{MAX_IMAGES, MAX_STEPS, MIN_STEPS};

use crate::{Counts, DropReason, FrameHeader, PatternEvent, Skew, Stage, Window};

use pairing::{Image, Pairing};
use steps::StepAssignment;
use windows::WindowBuilder;

/// Lower limit of [`Settings::max_waiting`]: a lost image makes three images of the other camera wait, and one more.
pub const MIN_WAITING: usize = 4;

/// Settings of the synchronization.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Settings {
    /// Number of steps N of the phase shift.
    pub steps: usize,
    /// Image pairs of a window: N, or more if motion is compensated.
    pub images: usize,
    /// Time from one exposure to the next, nanoseconds. An error of some percent is allowed.
    pub frame_period_ns: u64,
    /// Source of the step of a pair.
    pub source: StepSource,
    /// Window stride, pairs: 1 for a window with every pair, N for disjoint windows that end with the last step.
    pub window_stride: usize,
    /// Maximum number of images of a camera that wait for their partner or their step. The images of one window are held in
    /// addition.
    pub max_waiting: usize,
}

/// Source of the step of a pair.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum StepSource {
    /// The driver of the projector announces each pattern.
    Events {
        /// Fringe period that the events must have, projector pixels.
        period_px: f64,
    },
    /// The sequence number of camera 1 modulo N. The projector shows step 0 at the first image of the session.
    Cycle,
}

/// Settings out of range.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SettingsError {
    /// Too few or too many steps.
    #[error("steps is {steps}; a cycle has {MIN_STEPS} to {MAX_STEPS}")]
    Steps {
        /// The value.
        steps: usize,
    },
    /// A window is shorter than a cycle, or too long.
    #[error("a window has {images} image pairs; with {steps} steps it must have {steps} to {MAX_IMAGES}")]
    Images {
        /// The value.
        images: usize,
        /// Number of steps.
        steps: usize,
    },
    /// The frame period is too short.
    #[error("the frame period is {frame_period_ns} ns; give the time from one exposure to the next, at least 1000 ns")]
    FramePeriod {
        /// The value.
        frame_period_ns: u64,
    },
    /// The fringe period is not a positive number.
    #[error("the fringe period is {period_px} px; it must be a finite number above 0")]
    FringePeriod {
        /// The value.
        period_px: f64,
    },
    /// The window stride is 0.
    #[error(
        "the window stride is 0; give 1 for a window with every image pair, or the number of steps for disjoint windows"
    )]
    WindowStride,
    /// The limit of waiting images is too low.
    #[error(
        "max_waiting is {max_waiting}; at least {MIN_WAITING} images of a camera must be able to wait for the other"
    )]
    MaxWaiting {
        /// The value.
        max_waiting: usize,
    },
}

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

/// Makes windows of images. `F` holds the pixels of an image and is cloned into each window of the image.
#[derive(Debug)]
pub struct Synchronizer<F> {
    settings: Settings,
    pairing: Pairing<F>,
    steps: StepAssignment<F>,
    windows: WindowBuilder<F>,
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
        let Self { steps, images, frame_period_ns, source, window_stride, max_waiting } = *self;
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
        if window_stride == 0 {
            return Err(SettingsError::WindowStride);
        }
        if max_waiting < MIN_WAITING {
            return Err(SettingsError::MaxWaiting { max_waiting });
        }
        Ok(())
    }
}

impl<F: Clone> Synchronizer<F> {
    /// A synchronizer without any message yet.
    ///
    /// # Errors
    /// [`SettingsError`].
    pub fn new(settings: Settings) -> Result<Self, SettingsError> {
        settings.check()?;
        Ok(Self {
            settings,
            pairing: Pairing::new(settings.half_period_ns()),
            steps: StepAssignment::new(settings),
            windows: WindowBuilder::new(settings),
            ready: VecDeque::new(),
            counts: StageCounts::default(),
        })
    }

    /// Sets the next number that a camera (1 or 2) publishes, so that losses before the first image are counted.
    pub fn expect_frame(&mut self, camera: u32, published: u64) {
        if let Some(camera) = camera_index(camera) {
            self.pairing.set_next(camera, published);
        }
    }

    /// Sets the next event of the projector driver, so that losses before the first event are counted.
    pub fn expect_pattern(&mut self, session: u64, sequence: u64) {
        self.steps.events().set_next(session, sequence);
    }

    /// Takes an image.
    pub fn push_frame(&mut self, header: FrameHeader, handle: F) {
        let Some(camera) = camera_index(header.camera) else {
            self.counts.pairing.taken += 1;
            return self.counts.pairing.drop_one(DropReason::Malformed);
        };
        self.pairing.push(camera, Image { header, handle }, &mut self.counts.pairing);
        self.advance();
        self.limit_waiting(camera);
    }

    /// Counts an image that its receiver refuses. The windows treat it as lost.
    pub fn refuse_frame(&mut self, header: &FrameHeader, reason: DropReason) {
        match camera_index(header.camera) {
            Some(camera) => self.pairing.refuse(camera, header, reason, &mut self.counts.pairing),
            None => {
                self.counts.pairing.taken += 1;
                self.counts.pairing.drop_one(reason);
            }
        }
    }

    /// Takes an event of the projector driver.
    pub fn push_pattern(&mut self, event: PatternEvent) {
        self.steps.events().push(event, &mut self.counts.pattern);
        self.advance();
    }

    /// Takes the next window. Take all windows after each message, so that their images can be freed.
    pub fn next_window(&mut self) -> Option<WindowImages<F>> {
        self.ready.pop_front()
    }

    /// Counts of [`Stage::Pattern`] (events), [`Stage::Pairing`] (images) and [`Stage::Windowing`] (pairs); `None` for other
    /// stages.
    #[must_use]
    pub fn counts(&self, stage: Stage) -> Option<&Counts> {
        match stage {
            Stage::Pattern => Some(&self.counts.pattern),
            Stage::Pairing => Some(&self.counts.pairing),
            Stage::Windowing => Some(&self.counts.windowing),
            _ => None,
        }
    }

    /// Skew of the pairs since the last call.
    pub fn take_skew(&mut self) -> Skew {
        self.pairing.take_skew()
    }

    /// Ends the run. Waiting messages are dropped as stopped; finished windows stay.
    pub fn end(&mut self) {
        self.pairing.end(&mut self.counts.pairing);
        self.steps.end(&mut self.counts.pattern, &mut self.counts.pairing);
        self.windows.end();
    }

    fn advance(&mut self) {
        let StageCounts { pattern, pairing, windowing } = &mut self.counts;
        while let Some(pair) = self.pairing.next_pair(pairing) {
            self.steps.push(pair);
        }
        while let Some(stepped) = self.steps.next_pair(pattern, pairing) {
            self.ready.extend(self.windows.push(stepped, windowing));
        }
    }

    /// Drops the oldest images of a camera while too many wait.
    fn limit_waiting(&mut self, camera: usize) {
        let counts = &mut self.counts.pairing;
        while self.pairing.waiting(camera) + self.steps.waiting() > self.settings.max_waiting {
            if !self.steps.drop_oldest(counts) && !self.pairing.drop_oldest(camera, counts) {
                return;
            }
        }
    }
}

fn camera_index(camera: u32) -> Option<usize> {
    [1, 2].iter().position(|&number| number == camera)
}
