//! Whether the images show the steps that are said of them, from window to window.
//!
//! A camera that loses an image without a trace in numbers and times is a step behind from then on. Where both cameras are, the slip
//! is found and taken off; where one is, it may be found, or look like a drift of the calibration, or like a scene elsewhere. But
//! something tells that it came: a window whose images show the fault, a slip that is found, or δ that at once scatters by more
//! than it did. From then on δ tells nothing of the calibration, until it is again as small as that of a scanner in order.

use fringeflow::correspondence::Drift;
use fringeflow::worker::Correspondences;
use fringeflow_message::MapsHeader;

/// Drift, rms, mean of δ, and sd about the drift, rad, up to which images are in step.
const MOST_DRIFT_RAD: f64 = 0.1;
const MOST_MEAN_RAD: f64 = 0.2;
const MOST_SD_RAD: f64 = 0.03;
/// sd of δ about the drift, and share of pixels that agree with it, as shares of what they were, beyond both of which they are not: 2
/// to 20, and 0.65 to 0.85, with a camera a step behind; 1.0 and 0.92 where the calibration is off by 0.3 rad.
const MOST_SD: f64 = 1.6;
const LEAST_SHARE: f64 = 0.92;
/// Windows that make known what is usual, and share of a window in it from then on.
const FEWEST_WINDOWS: u32 = 5;
const PACE: f64 = 0.1;

/// What is known of the steps.
#[derive(Clone, Copy, Debug, Default)]
pub struct InStep {
    /// Whether something told of a fault, and no window since of images in step.
    is_doubtful: bool,
    /// Windows that were refused for their images.
    refused_windows: u64,
    usual: Usual,
}

/// Windows in step: their number, sd of δ about the drift, rad, and share of pixels that agree with it.
#[derive(Clone, Copy, Debug, Default)]
struct Usual {
    windows: u32,
    sd_rad: f64,
    share: f64,
}

impl InStep {
    /// Takes the next window, phase maps with this header, and what was found in them; whether its δ tells of the calibration.
    pub fn take(&mut self, maps: &MapsHeader, found: &Correspondences) -> bool {
        let has_slipped = found.matches.slip_steps != [0; 2];
        let was_refused = maps.refused_windows > std::mem::replace(&mut self.refused_windows, maps.refused_windows);
        let drift = found.matches.drift.as_ref();
        if has_slipped || was_refused || drift.is_some_and(|drift| self.usual.is_unlike(drift)) {
            self.is_doubtful = true;
        }
        let is_small = |drift: &&Drift| {
            let is_narrow = drift.residual_sd_rad <= MOST_SD_RAD && !has_slipped;
            is_narrow && drift.rms_rad <= MOST_DRIFT_RAD && found.matches.delta.mean_rad.abs() <= MOST_MEAN_RAD
        };
        if let Some(drift) = drift.filter(is_small).filter(|drift| !self.usual.is_wide(drift)) {
            self.is_doubtful = false;
            self.usual.take(drift);
        }
        !self.is_doubtful
    }
}

impl Usual {
    /// Whether δ scatters by far more than is usual, and fewer pixels agree.
    fn is_unlike(&self, drift: &Drift) -> bool {
        self.is_wide(drift) && drift.share < LEAST_SHARE * self.share
    }

    /// Whether it scatters by far more, whoever agrees.
    fn is_wide(&self, drift: &Drift) -> bool {
        self.windows >= FEWEST_WINDOWS && drift.residual_sd_rad > MOST_SD * self.sd_rad
    }

    fn take(&mut self, drift: &Drift) {
        self.windows = self.windows.saturating_add(1);
        let pace = PACE.max(1.0 / f64::from(self.windows));
        self.sd_rad += pace * (drift.residual_sd_rad - self.sd_rad);
        self.share += pace * (drift.share - self.share);
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

    const IN_ORDER: (f64, f64, f64) = (0.04, 0.01, 0.85);

    fn in_order() -> Correspondences {
        let (rms_rad, sd_rad, share) = IN_ORDER;
        found(rms_rad, sd_rad, share, [0; 2])
    }

    #[test]
    fn from_a_fault_on_delta_tells_nothing_until_it_is_small_again() {
        let off = || found(0.3, 0.02, 0.8, [0; 2]);
        for fault in [(refused(1), off()), (refused(0), found(0.1, 0.02, 0.8, [1, 0]))] {
            let mut in_step = InStep::default();
            assert!(in_step.take(&refused(0), &in_order()));
            assert!(!in_step.take(&fault.0, &fault.1));
            assert!((0..20).all(|_| !in_step.take(&fault.0, &off())));
            assert!(in_step.take(&fault.0, &in_order()));
            assert!(in_step.take(&fault.0, &off()), "no fault came before this one");
        }
    }

    #[test]
    fn a_calibration_that_moved_is_told_at_once_and_one_that_moves_later_too() {
        let mut in_step = InStep::default();
        assert!((0..9).all(|_| in_step.take(&refused(0), &found(0.25, 0.014, 0.85, [0; 2]))));
        let mut in_step = InStep::default();
        assert!((0..9).all(|_| in_step.take(&refused(0), &in_order())));
        assert!((0..9).all(|_| in_step.take(&refused(0), &found(0.25, 0.014, 0.85, [0; 2]))));
    }

    #[test]
    fn delta_that_scatters_at_once_tells_of_a_camera_out_of_step() {
        let mut in_step = InStep::default();
        assert!((0..9).all(|_| in_step.take(&refused(0), &in_order())));
        assert!((0..9).all(|_| !in_step.take(&refused(0), &found(0.3, 0.13, 0.6, [0; 2]))));
        // What scatters as widely and agrees with most pixels does not say that they are in step again.
        assert!((0..9).all(|_| !in_step.take(&refused(0), &found(0.05, 0.02, 0.84, [0; 2]))));
        assert!(in_step.take(&refused(0), &in_order()));
    }
}
