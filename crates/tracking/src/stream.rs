//! Windows one after the other, each with what those before it tell of it.

use fringeflow::correspondence::Drift;
use fringeflow::prior::{Prior, WindowTimes};
use fringeflow::reconstruction::{Reconstruction, ReconstructionError, Reconstructor};
use fringeflow_base::grey::GreyLevels;

use crate::fusion::{Tracked, Tracker};

/// Reconstructs the windows of a moving scanner and tracks it: what each cloud tells, the next window is given.
#[derive(Clone, Debug)]
pub struct TrackedStream {
    reconstructor: Reconstructor,
    tracker: Tracker,
    /// What the last cloud told, and its time.
    prior: Option<(Prior, u64)>,
    takes_prior: bool,
}

impl TrackedStream {
    /// A stream of which nothing is known.
    #[must_use]
    pub fn new(reconstructor: Reconstructor, tracker: Tracker) -> Self {
        Self { reconstructor, tracker, prior: None, takes_prior: true }
    }

    /// The stream, whose windows are given nothing of those before them where that is not wanted.
    #[must_use]
    pub fn with_priors(self, takes_prior: bool) -> Self {
        Self { takes_prior, ..self }
    }

    /// What tracks the clouds.
    #[must_use]
    pub fn tracker(&self) -> &Tracker {
        &self.tracker
    }

    /// Reconstructs the next window, as [`Reconstructor::reconstruct`] does. What the tracking says of its cloud comes from
    /// [`Self::track`], which the next window waits for.
    ///
    /// # Errors
    /// As [`Reconstructor::reconstruct`]; then the next window knows nothing either.
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

    /// Registers the cloud of a window to those before it.
    pub fn track(&mut self, made: &Reconstruction, times: &WindowTimes) -> Tracked {
        let tracked = self.tracker.step(&made.cloud, times.centre_ns());
        let drift = made.matches.drift.as_ref().map(Drift::to_known);
        self.prior = self.tracker.prior(drift).map(|prior| (prior, times.centre_ns()));
        tracked
    }
}
