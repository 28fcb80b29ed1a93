//! A stream of windows, each reconstructed with a prior from those before it.

use fringeflow::correspondence::Drift;
use fringeflow::prior::{Prior, WindowTimes};
use fringeflow::reconstruction::{Reconstruction, ReconstructionError, Reconstructor};
use fringeflow_base::grey::GreyLevels;

use crate::fusion::{Tracked, Tracker};

/// Reconstructs the windows of a moving scanner and tracks it. Each cloud yields the prior of the next window.
#[derive(Clone, Debug)]
pub struct TrackedStream {
    reconstructor: Reconstructor,
    tracker: Tracker,
    /// The prior of the next window, and its time.
    prior: Option<(Prior, u64)>,
    takes_prior: bool,
}

impl TrackedStream {
    /// A stream without any window yet.
    #[must_use]
    pub fn new(reconstructor: Reconstructor, tracker: Tracker) -> Self {
        Self { reconstructor, tracker, prior: None, takes_prior: true }
    }

    /// Switches the priors on or off.
    #[must_use]
    pub fn with_priors(self, takes_prior: bool) -> Self {
        Self { takes_prior, ..self }
    }

    /// The tracker of the clouds.
    #[must_use]
    pub fn tracker(&self) -> &Tracker {
        &self.tracker
    }

    /// Reconstructs the next window as [`Reconstructor::reconstruct`] does. Call [`Self::track`] with its result: the
    /// next window needs the prior.
    ///
    /// # Errors
    /// As [`Reconstructor::reconstruct`]; the next window then has no prior.
    pub fn reconstruct(
        &mut self,
        first_step: usize,
        cam1: &[GreyLevels<'_>],
        cam2: &[GreyLevels<'_>],
        times: &WindowTimes,
    ) -> Result<Reconstruction, ReconstructionError> {
        let prior = self.prior.take().filter(|_| self.takes_prior);
        let known = prior.as_ref().map(|(prior, time_ns)| (prior, times.moment_after(*time_ns)));
        self.reconstructor.reconstruct(first_step, cam1, cam2, known)
    }

    /// Registers the cloud of a window to the model.
    pub fn track(&mut self, made: &Reconstruction, times: &WindowTimes) -> Tracked {
        let tracked = self.tracker.step(&made.cloud, times.centre_ns());
        let drift = made.matches.drift.as_ref().map(Drift::to_known);
        self.prior = self.tracker.prior(drift).map(|prior| (prior, times.centre_ns()));
        tracked
    }
}
