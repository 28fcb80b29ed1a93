//! Reconstructs a stream of windows, each with a prior from the windows before it.

use fringeflow::correspondence::Drift;
use fringeflow::prior::{Prior, WindowTimes};
use fringeflow::reconstruction::{Reconstruction, ReconstructionError, Reconstructor};
use fringeflow_base::grey::GreyLevels;

use crate::fusion::{Tracked, Tracker};

/// Reconstructs the windows of a moving scanner, and tracks it. Each cloud yields the prior of the next window.
#[derive(Debug)]
pub struct TrackedStream {
    reconstructor: Reconstructor,
    tracker: Tracker,
    /// The prior of the next window, and its time.
    prior: Option<(Prior, u64)>,
    uses_priors: bool,
}

impl TrackedStream {
    /// Creates a stream without windows.
    #[must_use]
    pub fn new(reconstructor: Reconstructor, tracker: Tracker) -> Self {
        Self { reconstructor, tracker, prior: None, uses_priors: true }
    }

    /// Switches the priors on or off.
    #[must_use]
    pub fn with_priors(self, uses_priors: bool) -> Self {
        Self { uses_priors, ..self }
    }

    /// The tracker of the clouds.
    #[must_use]
    pub fn tracker(&self) -> &Tracker {
        &self.tracker
    }

    /// Reconstructs the next window as [`Reconstructor::reconstruct`] does. Then call [`Self::track`] with the result,
    /// to get the prior of the next window.
    ///
    /// # Errors
    /// As [`Reconstructor::reconstruct`]. The next window then has no prior.
    pub fn reconstruct(
        &mut self,
        first_step: usize,
        cam1: &[GreyLevels<'_>],
        cam2: &[GreyLevels<'_>],
        times: &WindowTimes,
    ) -> Result<Reconstruction, ReconstructionError> {
        let prior = self.prior.take().filter(|_| self.uses_priors);
        let known = prior.as_ref().map(|(prior, time_ns)| (prior, times.moment_after(*time_ns)));
        self.reconstructor.reconstruct(first_step, cam1, cam2, known)
    }

    /// Registers the cloud of a window to the model.
    pub fn track(&mut self, reconstruction: &Reconstruction, times: &WindowTimes) -> Tracked {
        let tracked = self.tracker.step(&reconstruction.cloud.points, times.centre_ns());
        let drift = reconstruction.matches.drift.as_ref().map(Drift::to_known);
        self.prior = self.tracker.prior(drift).map(|prior| (prior, times.centre_ns()));
        tracked
    }
}
