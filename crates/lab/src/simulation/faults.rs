//! Decides which faults the virtual scanner injects, to test how the pipeline accounts for them.
//!
//! In: shares. Out: the fault of the image of each exposure. It depends only on seed and number, so a run can be
//! repeated.

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use fringeflow_dataset::CameraId;

use super::{SimulationError, check_range};

/// Shares of the faults among all images of a camera or all pattern events, 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FaultOptions {
    /// Images lost in the camera: the sequence numbers have a gap.
    pub lost: f64,
    /// Images delivered twice.
    pub duplicated: f64,
    /// Images delivered after the next one.
    pub swapped: f64,
    /// Images delivered one frame period late.
    pub late: f64,
    /// Images lost without a trace: the next image takes their number and time.
    pub hidden_lost: f64,
    /// Images delivered again with the number and time of the next one.
    pub hidden_duplicated: f64,
    /// Images that exchange number and time with the next one.
    pub hidden_swapped: f64,
    /// Pattern events not sent.
    pub events_lost: f64,
    /// Numbers of the first exposure with faults and of the first one without faults again; `None` for all exposures.
    pub exposures: Option<[u64; 2]>,
    /// Seed.
    pub seed: u64,
}

/// Fault of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageFault {
    /// Lost in the camera.
    Lost,
    /// Delivered twice.
    Duplicated,
    /// Delivered after the next one.
    Swapped,
    /// Delivered one frame period late.
    Late,
    /// Lost without a trace.
    HiddenLost,
    /// Delivered again in place of the next one.
    HiddenDuplicated,
    /// Exchanged with the next one.
    HiddenSwapped,
}

/// Decides the faults.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Faults {
    options: FaultOptions,
}

impl Faults {
    /// Creates faults with these shares.
    ///
    /// # Errors
    /// [`SimulationError::Range`]: a share is below 0 or above 1, or the shares of images add up to more than 1.
    pub fn new(options: FaultOptions) -> Result<Self, SimulationError> {
        let FaultOptions { lost, duplicated, swapped, late, events_lost, .. } = options;
        let FaultOptions { hidden_lost, hidden_duplicated, hidden_swapped, .. } = options;
        let all = lost + duplicated + swapped + late + hidden_lost + hidden_duplicated + hidden_swapped;
        let named = [
            ("the share of lost images", lost),
            ("the share of duplicated images", duplicated),
            ("the share of swapped images", swapped),
            ("the share of late images", late),
            ("the share of images lost without a trace", hidden_lost),
            ("the share of images duplicated without a trace", hidden_duplicated),
            ("the share of images swapped without a trace", hidden_swapped),
            ("the share of lost pattern events", events_lost),
            ("the sum of the shares of images", all),
        ];
        named.into_iter().try_for_each(|(name, share)| check_range(name, share, 0.0, 1.0, ""))?;
        Ok(Self { options })
    }

    /// Returns the fault of the image of an exposure, if any.
    #[must_use]
    pub fn image_fault(&self, camera: CameraId, exposure: u64) -> Option<ImageFault> {
        if !self.act_at(exposure) {
            return None;
        }
        let FaultOptions { lost, duplicated, swapped, late, .. } = self.options;
        let FaultOptions { hidden_lost, hidden_duplicated, hidden_swapped, .. } = self.options;
        let mut draw = self.draw(1 + camera as u64, exposure);
        let kinds = [
            (lost, ImageFault::Lost),
            (duplicated, ImageFault::Duplicated),
            (swapped, ImageFault::Swapped),
            (late, ImageFault::Late),
            (hidden_lost, ImageFault::HiddenLost),
            (hidden_duplicated, ImageFault::HiddenDuplicated),
            (hidden_swapped, ImageFault::HiddenSwapped),
        ];
        kinds.into_iter().find_map(|(share, fault)| {
            draw -= share;
            (draw < 0.0).then_some(fault)
        })
    }

    /// Whether the event of the pattern of an exposure is lost.
    #[must_use]
    pub fn loses_event(&self, exposure: u64) -> bool {
        self.act_at(exposure) && self.draw(0, exposure) < self.options.events_lost
    }

    fn act_at(&self, exposure: u64) -> bool {
        self.options.exposures.is_none_or(|[first, end]| (first..end).contains(&exposure))
    }

    /// Returns a random number from 0 to below 1 for an item of a source.
    fn draw(&self, source: u64, number: u64) -> f64 {
        let mut key = [0; 32];
        for (bytes, value) in key.chunks_exact_mut(8).zip([self.options.seed, source, number]) {
            bytes.copy_from_slice(&value.to_le_bytes());
        }
        ChaCha8Rng::from_seed(key).random()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const OPTIONS: FaultOptions = FaultOptions {
        lost: 0.02,
        duplicated: 0.01,
        swapped: 0.03,
        late: 0.04,
        hidden_lost: 0.02,
        hidden_duplicated: 0.03,
        hidden_swapped: 0.01,
        events_lost: 0.05,
        exposures: None,
        seed: 3,
    };

    #[test]
    fn shares_are_met_and_cameras_are_independent() {
        let faults = Faults::new(OPTIONS).unwrap();
        let count = |camera, fault| (0..20_000).filter(|&k| faults.image_fault(camera, k) == Some(fault)).count();
        for camera in CameraId::BOTH {
            let faults = [
                ImageFault::Lost,
                ImageFault::Duplicated,
                ImageFault::Swapped,
                ImageFault::Late,
                ImageFault::HiddenLost,
                ImageFault::HiddenDuplicated,
                ImageFault::HiddenSwapped,
            ];
            let counts = faults.map(|fault| count(camera, fault));
            for (count, expected) in counts.into_iter().zip([400_usize, 200, 600, 800, 400, 600, 200]) {
                assert!(count.abs_diff(expected) < 100, "{camera:?}: {counts:?}");
            }
        }
        let events = (0..20_000).filter(|&k| faults.loses_event(k)).count();
        assert!(events.abs_diff(1000) < 100, "{events}");
        let both = (0..20_000)
            .filter(|&k| CameraId::BOTH.into_iter().all(|c| faults.image_fault(c, k) == Some(ImageFault::Lost)))
            .count();
        assert!(both < 30, "{both} images lost by both");
    }

    #[test]
    fn the_same_seed_gives_the_same_faults() {
        let faults = |seed| {
            let faults = Faults::new(FaultOptions { seed, ..OPTIONS }).unwrap();
            (0..500).map(|k| faults.image_fault(CameraId::Cam1, k)).collect::<Vec<_>>()
        };
        assert_eq!(faults(3), faults(3));
        assert_ne!(faults(3), faults(4));
    }

    #[test]
    fn faults_of_a_limited_time_are_those_of_an_unlimited_one() {
        let always = Faults::new(OPTIONS).unwrap();
        let limited = Faults::new(FaultOptions { exposures: Some([200, 500]), ..OPTIONS }).unwrap();
        for k in 0..1000 {
            let acts = (200..500).contains(&k);
            let expected = always.image_fault(CameraId::Cam1, k).filter(|_| acts);
            assert_eq!(limited.image_fault(CameraId::Cam1, k), expected, "exposure {k}");
            assert_eq!(limited.loses_event(k), acts && always.loses_event(k), "exposure {k}");
        }
    }

    #[test]
    fn without_shares_there_are_no_faults() {
        let faults = Faults::default();
        assert!((0..1000).all(|k| faults.image_fault(CameraId::Cam2, k).is_none() && !faults.loses_event(k)));
    }

    #[test]
    fn invalid_shares_are_refused() {
        let refused = |options| Faults::new(options).unwrap_err().to_string();
        assert!(refused(FaultOptions { lost: -0.1, ..OPTIONS }).contains("lost images is -0.1"));
        assert!(refused(FaultOptions { events_lost: f64::NAN, ..OPTIONS }).contains("pattern events"));
        assert!(refused(FaultOptions { lost: 0.6, late: 0.6, ..OPTIONS }).contains("sum"));
    }
}
