//! Settings of the synchronization.

use fringeflow_base::limits::{MAX_IMAGES, MAX_STEPS, MIN_STEPS};

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
    /// Longest time between the starts of both exposures of a pair, nanoseconds. At most half of the frame period.
    pub max_skew_ns: u64,
    /// Source of the step of a pair.
    pub source: StepSource,
    /// Pairs from one window to the next: 1 for a window at every pair, N for disjoint windows that end with the last
    /// step.
    pub window_stride: usize,
    /// Maximum number of images of a camera that wait for their partner or their step. The images of the current window
    /// are held in addition.
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
    /// The limit of the skew is 0, or above half of the frame period.
    #[error(
        "the largest skew is {max_skew_ns} ns; it must lie between 1 ns and half of the frame period, {half_period_ns} ns"
    )]
    MaxSkew {
        /// The value.
        max_skew_ns: u64,
        /// Half of the frame period.
        half_period_ns: u64,
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

impl Settings {
    pub(super) fn half_period_ns(&self) -> u64 {
        self.frame_period_ns / 2
    }

    pub(super) fn check(&self) -> Result<(), SettingsError> {
        let Self { steps, images, frame_period_ns, max_skew_ns, source, window_stride, max_waiting } = *self;
        if !(MIN_STEPS..=MAX_STEPS).contains(&steps) {
            return Err(SettingsError::Steps { steps });
        }
        if !(steps..=MAX_IMAGES).contains(&images) {
            return Err(SettingsError::Images { images, steps });
        }
        if frame_period_ns < 1000 {
            return Err(SettingsError::FramePeriod { frame_period_ns });
        }
        let half_period_ns = self.half_period_ns();
        if !(1..=half_period_ns).contains(&max_skew_ns) {
            return Err(SettingsError::MaxSkew { max_skew_ns, half_period_ns });
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
