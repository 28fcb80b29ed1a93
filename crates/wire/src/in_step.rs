//! Checks from window to window whether the images are in step: whether they show the declared phase shifts.
//!
//! A camera that loses an image without a gap in numbers and times is one step behind from then on. If both cameras are
//! behind, the slip is found and corrected. If only one is behind, the slip may be found, but it may also look like a
//! drift of the calibration or like another scene. However, the start of a slip can be recognized: the images of a
//! window show the fault, or a slip is found, or δ suddenly scatters more than before. From then on, δ is ignored as a
//! measure of the calibration until it is as small again as for an intact scanner.

use fringeflow::correspondence::Drift;
use fringeflow::worker::Correspondences;
use fringeflow_message::MapsHeader;

/// Images are in step if these values are below their limits, rad: rms of the drift, mean of δ, and sd of δ about the
/// drift.
const MAX_DRIFT_RAD: f64 = 0.1;
const MAX_MEAN_RAD: f64 = 0.2;
const MAX_SD_RAD: f64 = 0.03;
/// Images are out of step if two ratios to the usual values exceed their limits: the sd of δ about the drift, and the
/// share of pixels that agree with the drift. If one camera is one step behind, the ratios are 2 to 20 and 0.65 to
/// 0.85. With a calibration error of 0.3 rad, they are 1.0 and 0.92.
const MAX_SD_RATIO: f64 = 1.6;
const MIN_SHARE_RATIO: f64 = 0.92;
/// Minimum number of windows for the usual values, and the weight of each later window.
const MIN_WINDOWS: u32 = 5;
const WEIGHT: f64 = 0.1;

/// State of the check.
#[derive(Clone, Copy, Debug, Default)]
pub struct InStep {
    /// Whether a fault was seen and no window has been in step since.
    is_doubtful: bool,
    /// Windows refused so far because of their images.
    refused_windows: u64,
    usual: Usual,
}

/// Running means over the windows in step: sd of δ about the drift, rad, and share of pixels that agree with the drift.
#[derive(Clone, Copy, Debug, Default)]
struct Usual {
    windows: u32,
    sd_rad: f64,
    share: f64,
}

impl InStep {
    /// Processes the next window: the header of its phase maps, and its correspondences. Returns whether its δ
    /// describes the calibration.
    pub fn update(&mut self, maps: &MapsHeader, found: &Correspondences) -> bool {
        let has_slipped = found.matches.slip_steps != [0; 2];
        let was_refused = maps.refused_windows > std::mem::replace(&mut self.refused_windows, maps.refused_windows);
        let drift = found.matches.drift.as_ref();
        if has_slipped || was_refused || drift.is_some_and(|drift| self.usual.is_out_of_step(drift)) {
            self.is_doubtful = true;
        }
        let is_small = |drift: &&Drift| {
            let is_narrow = drift.residual_sd_rad <= MAX_SD_RAD && !has_slipped;
            is_narrow && drift.rms_rad <= MAX_DRIFT_RAD && found.matches.delta.mean_rad.abs() <= MAX_MEAN_RAD
        };
        if let Some(drift) = drift.filter(is_small).filter(|drift| !self.usual.is_scattered(drift)) {
            self.is_doubtful = false;
            self.usual.add(drift);
        }
        !self.is_doubtful
    }
}

impl Usual {
    /// Whether δ scatters far more than usual, and fewer pixels agree with the drift.
    fn is_out_of_step(&self, drift: &Drift) -> bool {
        self.is_scattered(drift) && drift.share < MIN_SHARE_RATIO * self.share
    }

    /// Whether δ scatters far more than usual.
    fn is_scattered(&self, drift: &Drift) -> bool {
        self.windows >= MIN_WINDOWS && drift.residual_sd_rad > MAX_SD_RATIO * self.sd_rad
    }

    fn add(&mut self, drift: &Drift) {
        self.windows = self.windows.saturating_add(1);
        // First a plain mean, then an exponential moving average.
        let weight = WEIGHT.max(1.0 / f64::from(self.windows));
        self.sd_rad += weight * (drift.residual_sd_rad - self.sd_rad);
        self.share += weight * (drift.share - self.share);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(rms_rad: f64, residual_sd_rad: f64, share: f64, slip_steps: [usize; 2]) -> Correspondences {
        let mut drift = Drift::default();
        (drift.rms_rad, drift.residual_sd_rad, drift.share) = (rms_rad, residual_sd_rad, share);
        let mut found = Correspondences::default();
        (found.matches.drift, found.matches.slip_steps) = (Some(drift), slip_steps);
        found
    }

    fn refused(refused_windows: u64) -> MapsHeader {
        MapsHeader { refused_windows, ..MapsHeader::default() }
    }

    const INTACT: (f64, f64, f64) = (0.04, 0.01, 0.85);

    fn intact() -> Correspondences {
        let (rms_rad, sd_rad, share) = INTACT;
        found(rms_rad, sd_rad, share, [0; 2])
    }

    #[test]
    fn after_a_fault_delta_is_ignored_until_it_is_small_again() {
        let drifted = || found(0.3, 0.02, 0.8, [0; 2]);
        for fault in [(refused(1), drifted()), (refused(0), found(0.1, 0.02, 0.8, [1, 0]))] {
            let mut in_step = InStep::default();
            assert!(in_step.update(&refused(0), &intact()));
            assert!(!in_step.update(&fault.0, &fault.1));
            assert!((0..20).all(|_| !in_step.update(&fault.0, &drifted())));
            assert!(in_step.update(&fault.0, &intact()));
            assert!(in_step.update(&fault.0, &drifted()), "without a preceding fault, the drift is reported");
        }
    }

    #[test]
    fn a_drift_of_the_calibration_is_reported_from_the_start_and_later() {
        let mut in_step = InStep::default();
        assert!((0..9).all(|_| in_step.update(&refused(0), &found(0.25, 0.014, 0.85, [0; 2]))));
        let mut in_step = InStep::default();
        assert!((0..9).all(|_| in_step.update(&refused(0), &intact())));
        assert!((0..9).all(|_| in_step.update(&refused(0), &found(0.25, 0.014, 0.85, [0; 2]))));
    }

    #[test]
    fn a_sudden_scatter_of_delta_shows_a_camera_out_of_step() {
        let mut in_step = InStep::default();
        assert!((0..9).all(|_| in_step.update(&refused(0), &intact())));
        assert!((0..9).all(|_| !in_step.update(&refused(0), &found(0.3, 0.13, 0.6, [0; 2]))));
        // A large scatter does not show that the images are in step, even if most pixels agree.
        assert!((0..9).all(|_| !in_step.update(&refused(0), &found(0.05, 0.02, 0.84, [0; 2]))));
        assert!(in_step.update(&refused(0), &intact()));
    }
}
