//! Times of the images of a window. In: time stamps, ns. Out: the middle of the window, age and image spacing.

/// Times of the images of a window relative to a prior.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// Time from the prior to the middle of the window, seconds.
    pub age_s: f64,
    /// Time from one image to the next, seconds.
    pub spacing_s: f64,
}

/// Absolute times of the images of a window.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WindowTimes {
    /// Starts of the first and the last exposure, nanoseconds.
    pub exposures_ns: [u64; 2],
    /// Number of images.
    pub images: usize,
}

impl WindowTimes {
    /// Middle of the window, which is the time of its cloud, nanoseconds.
    #[must_use]
    pub fn centre_ns(&self) -> u64 {
        let [first, last] = self.exposures_ns;
        first.midpoint(last)
    }

    /// Times relative to an earlier time.
    #[must_use]
    pub fn moment_after(&self, time_ns: u64) -> Moment {
        let [first, last] = self.exposures_ns;
        Moment {
            age_s: (self.centre_ns() as f64 - time_ns as f64) * 1e-9,
            spacing_s: last.saturating_sub(first) as f64 * 1e-9 / self.images.saturating_sub(1).max(1) as f64,
        }
    }
}
