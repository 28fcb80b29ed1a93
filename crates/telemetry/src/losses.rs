//! What was lost, each loss told once: images at their source, and what that cost.
//!
//! The accounts of the stages hold a lost image more than once: as lost by its camera, as an image of the other one that has no
//! partner, as pairs that complete no window. That is right for a balance, and too much for a person who asks what went wrong.

use std::fmt;

use serde::Serialize;

use fringeflow_message::{Counts, DropReason, Stage};

/// What was lost since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Losses {
    /// Images that a camera, its driver or its channel lost, or that were damaged; of a camera that tells nothing, the images of the
    /// other one without partner.
    pub images: u64,
    /// Pattern events that were lost; of a projector that tells nothing, the image pairs without pattern.
    pub events: u64,
    /// Windows whose images tell of a fault that no number told.
    pub refused_windows: u64,
    /// Messages that are missing in recordings.
    pub messages: u64,
    /// Clouds that are missing for all this: of windows that are not complete, were refused, or were lost on their way.
    pub clouds: u64,
}

/// Losses of pairing and pattern events that follow from others.
const FOLLOWING: [DropReason; 4] =
    [DropReason::Unpaired, DropReason::NoPattern, DropReason::PatternConflict, DropReason::NewSession];

impl Losses {
    /// The losses in these accounts.
    #[must_use]
    pub fn from_counts(counts: &[(Stage, Counts)]) -> Self {
        let of =
            |stage: Stage| counts.iter().find(|(of, _)| *of == stage).map(|(_, counts)| *counts).unwrap_or_default();
        let lost = |stage: Stage| of(stage).losses().map(|(_, n)| n).sum::<u64>();
        let cameras = [Stage::Camera1, Stage::Camera2].map(lost);
        let (pairing, windowing) = (of(Stage::Pairing), of(Stage::Windowing));
        let own = |stage: Stage| -> u64 {
            of(stage).losses().filter(|(reason, _)| !FOLLOWING.contains(reason)).map(|(_, n)| n).sum()
        };
        let on_the_way = own(Stage::Pairing);
        let unpaired = pairing.dropped(DropReason::Unpaired);
        let told = cameras.iter().sum::<u64>() + on_the_way;
        // Both images of a pair are without pattern.
        let unlit = pairing.dropped(DropReason::NoPattern).div_ceil(2);
        let refused_windows = of(Stage::Phase).dropped_for_images();
        let later = [Stage::Phase, Stage::Correspondence, Stage::Cloud].map(lost).iter().sum::<u64>();
        let missing_pairs = unpaired.max(cameras[0]).max(cameras[1]).max(on_the_way.div_ceil(2));
        let conflicts = pairing.dropped(DropReason::PatternConflict).div_ceil(2);
        let broken = windowing.dropped(DropReason::Incomplete) + windowing.losses().map(|(_, n)| n).sum::<u64>();
        let no_window = missing_pairs + unlit + conflicts + broken;
        // Not every pair completes a window that is wanted.
        let (wanted, unwanted) = (windowing.passed, windowing.dropped(DropReason::BetweenWindows));
        let windows = (no_window * wanted.max(1)).div_ceil((wanted + unwanted).max(1));
        Self {
            images: told.max(unpaired),
            events: (lost(Stage::Projector) + own(Stage::Pattern)).max(unlit),
            refused_windows,
            messages: lost(Stage::Recorder),
            clouds: windows + later,
        }
    }
}

impl fmt::Display for Losses {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { images, events, refused_windows, messages, clouds } = *self;
        let one_or_many = |count: u64, one: &str, many: &str| match count {
            0 => None,
            1 => Some(format!("1 {one}")),
            _ => Some(format!("{count} {many}")),
        };
        let parts = [
            one_or_many(images, "image was lost", "images were lost"),
            one_or_many(events, "pattern event was lost", "pattern events were lost"),
            one_or_many(
                refused_windows,
                "window was refused, whose images tell of a fault",
                "windows were refused, whose images tell of faults",
            ),
            one_or_many(messages, "message is missing in recordings", "messages are missing in recordings"),
        ];
        let parts: Vec<String> = parts.into_iter().flatten().collect();
        let cost = one_or_many(clouds, "cloud", "clouds");
        match (parts.is_empty(), cost) {
            (true, None) => write!(f, "nothing was lost"),
            (true, Some(cost)) => write!(f, "{cost} lost on their way"),
            (false, None) => write!(f, "{}; no cloud is missing for it", parts.join(", ")),
            (false, Some(cost)) => write!(f, "{}; {cost} missing for it", parts.join(", ")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn counts(passed: u64, dropped: &[(DropReason, u64)]) -> Counts {
        let mut counts = Counts { passed, ..Counts::default() };
        dropped.iter().for_each(|&(reason, count)| counts.drop_many(reason, count));
        counts
    }

    #[test]
    fn a_lost_image_is_one_however_many_stages_tell_of_it() {
        // Windows of six, one for every pair: each lost image costs its own window and five more.
        let lost = [
            (Stage::Camera1, counts(594, &[(DropReason::CameraLost, 6)])),
            (Stage::Camera2, counts(596, &[(DropReason::CameraLost, 4)])),
            (Stage::Pattern, counts(590, &[(DropReason::Unpaired, 10)])),
            (Stage::Pairing, counts(1180, &[(DropReason::Unpaired, 10)])),
            (Stage::Windowing, counts(535, &[(DropReason::Beginning, 5), (DropReason::Incomplete, 50)])),
            (Stage::Phase, counts(535, &[])),
        ];
        let losses = Losses::from_counts(&lost);
        assert_eq!((losses.images, losses.clouds), (10, 60));
        assert_eq!(losses.to_string(), "10 images were lost; 60 clouds missing for it");
    }

    #[test]
    fn a_camera_that_tells_nothing_is_seen_by_the_other_one() {
        let silent = [
            (Stage::Pairing, counts(40, &[(DropReason::Unpaired, 30)])),
            (Stage::Windowing, counts(4, &[(DropReason::Beginning, 5), (DropReason::BetweenWindows, 12)])),
        ];
        let losses = Losses::from_counts(&silent);
        assert_eq!((losses.images, losses.clouds), (30, 8));
    }

    #[test]
    fn what_only_images_tell_is_no_count_of_images() {
        let hidden = [(Stage::Phase, counts(100, &[(DropReason::HiddenLoss, 9), (DropReason::NextStageBusy, 50)]))];
        let losses = Losses::from_counts(&hidden);
        assert_eq!((losses.images, losses.refused_windows, losses.clouds), (0, 9, 9));
        assert_eq!(losses.to_string(), "9 windows were refused, whose images tell of faults; 9 clouds missing for it");
        assert_eq!(
            Losses::from_counts(&[(Stage::Windowing, counts(9, &[(DropReason::Beginning, 5)]))]),
            Losses::default()
        );
        assert_eq!(Losses::default().to_string(), "nothing was lost");
    }
}
