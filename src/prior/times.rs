//! When the images of a window are taken.

/// When the images of a window are taken, seen from a prior.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Moment {
    /// From the time of the prior to the middle of the window, seconds.
    pub age_s: f64,
    /// From one image to the next, seconds.
    pub spacing_s: f64,
}

/// When the images of a window were taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WindowTimes {
    /// Starts of the first and of the last exposure, nanoseconds.
    pub exposures_ns: [u64; 2],
    /// Images of the window.
    pub images: usize,
}

impl WindowTimes {
    /// Its middle: the time of its cloud, nanoseconds.
    #[must_use]
    pub fn centre_ns(&self) -> u64 {
        let [first, last] = self.exposures_ns;
        first.midpoint(last)
    }

    /// When it was taken, seen from an earlier moment.
    #[must_use]
    pub fn moment_after(&self, time_ns: u64) -> Moment {
        let [first, last] = self.exposures_ns;
        Moment {
            age_s: (self.centre_ns() as f64 - time_ns as f64) * 1e-9,
            spacing_s: last.saturating_sub(first) as f64 * 1e-9 / self.images.saturating_sub(1).max(1) as f64,
        }
    }
}
