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
//! Every window is complete. A lost image costs its windows and never shifts a phase. The windows depend only on the
//! content and order of each channel, not on the interleaving of the channels, as long as the number of waiting images
//! stays below the limits. Hence a replay produces the same windows. The code reads no clock: an image waits until a
//! later one shows that its partner cannot come any more.
//!
//! Callers should take one message from each channel in turn. Then the number of waiting images stays far below the
//! limits.

mod events;
mod gaps;
mod pairing;
mod reorder;
mod settings;
mod skew_limit;
mod steps;
#[cfg(test)]
mod tests;
mod windows;

use std::collections::VecDeque;

use crate::{Counts, DropReason, FrameHeader, PatternEvent, Skew, Stage};

use pairing::{Image, Pairing};
use steps::StepAssignment;
use windows::WindowBuilder;

pub use settings::{MIN_WAITING, Settings, SettingsError, StepSource};
pub use skew_limit::SkewNotice;
pub use windows::WindowImages;

/// Creates windows from images. `F` is the handle of the pixels of an image; it is cloned into each window that
/// contains the image.
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

impl<F: Clone> Synchronizer<F> {
    /// Creates a synchronizer that has received no message yet.
    ///
    /// # Errors
    /// [`SettingsError`].
    pub fn new(settings: Settings) -> Result<Self, SettingsError> {
        settings.check()?;
        Ok(Self {
            settings,
            pairing: Pairing::new(&settings),
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

    /// Adds an image.
    pub fn push_frame(&mut self, header: FrameHeader, handle: F) {
        let Some(camera) = camera_index(header.camera) else {
            self.counts.pairing.taken += 1;
            return self.counts.pairing.drop_one(DropReason::Malformed);
        };
        self.pairing.push(camera, Image { header, handle }, &mut self.counts.pairing);
        self.advance();
        self.limit_waiting(camera);
    }

    /// Counts an image that the receiver refuses. The windows treat it as lost.
    pub fn refuse_frame(&mut self, header: &FrameHeader, reason: DropReason) {
        match camera_index(header.camera) {
            Some(camera) => self.pairing.refuse(camera, header, reason, &mut self.counts.pairing),
            None => {
                self.counts.pairing.taken += 1;
                self.counts.pairing.drop_one(reason);
            }
        }
    }

    /// Adds an event of the projector driver.
    pub fn push_pattern(&mut self, event: PatternEvent) {
        self.steps.events().push(event, &mut self.counts.pattern);
        self.advance();
    }

    /// Returns the next window. Call this after each message until it returns `None`, so that images can be released.
    pub fn next_window(&mut self) -> Option<WindowImages<F>> {
        self.ready.pop_front()
    }

    /// Returns the counts of [`Stage::Pattern`] (events), [`Stage::Pairing`] (images) and [`Stage::Windowing`] (pairs);
    /// `None` for other stages.
    #[must_use]
    pub fn counts(&self, stage: Stage) -> Option<&Counts> {
        match stage {
            Stage::Pattern => Some(&self.counts.pattern),
            Stage::Pairing => Some(&self.counts.pairing),
            Stage::Windowing => Some(&self.counts.windowing),
            _ => None,
        }
    }

    /// Returns the next notice that the skew of the cameras began or ceased to exceed its limit.
    pub fn next_skew_notice(&mut self) -> Option<SkewNotice> {
        self.pairing.next_skew_notice()
    }

    /// Returns the skew of the pairs since the last call, including the refused ones.
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

    /// Drops the oldest images of a camera while too many are waiting.
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
