//! Losses of a run, each counted once: images lost at their source, and the clouds missing because of them.
//!
//! The counts of the stages contain a lost image several times: as lost by its camera, as an image of the other camera
//! without a partner, and as pairs that complete no window. That is right for a balance of the counts, but a person who
//! asks what went wrong needs one number.

use std::fmt;

use serde::Serialize;

use fringeflow_message::{Counts, DropReason, Stage};

/// Losses since the start.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Losses {
    /// Images that a camera, its driver or its channel lost or damaged. If a camera reports nothing, the images of the
    /// other camera without a partner.
    pub images: u64,
    /// Lost pattern events. If the projector reports nothing, the image pairs without a pattern.
    pub events: u64,
    /// Windows whose images show a fault that the sequence numbers did not show.
    pub refused_windows: u64,
    /// Messages missing in recordings.
    pub messages: u64,
    /// Clouds missing because of these losses: their windows were incomplete, refused, or lost in a later stage.
    pub clouds: u64,
}

/// What the virtual scanner left out on purpose.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Injected {
    images: u64,
    events: u64,
}

impl Injected {
    pub(crate) fn from_counts(counts: &[(Stage, Counts)]) -> Self {
        let of = |stages: &[Stage]| {
            let of_stages = counts.iter().filter(|(stage, _)| stages.contains(stage));
            of_stages.map(|(_, counts)| counts.dropped(DropReason::Injected)).sum()
        };
        Self { images: of(&[Stage::Camera1, Stage::Camera2]), events: of(&[Stage::Projector]) }
    }

    /// Whether a count of a reason is no more than its consequence.
    pub(crate) fn explains(self, reason: DropReason, count: u64) -> bool {
        match reason {
            DropReason::Unpaired => count <= self.images,
            DropReason::NoPattern => count.div_ceil(2) <= self.events,
            _ => false,
        }
    }
}

/// Losses in pairing and pattern matching that are consequences of other losses.
const CONSEQUENTIAL: [DropReason; 4] =
    [DropReason::Unpaired, DropReason::NoPattern, DropReason::PatternConflict, DropReason::NewSession];

impl Losses {
    /// Computes the losses from the counts of the stages.
    #[must_use]
    pub fn from_counts(counts: &[(Stage, Counts)]) -> Self {
        let counts_of = |stage: Stage| {
            counts.iter().find(|(other, _)| *other == stage).map(|(_, counts)| *counts).unwrap_or_default()
        };
        let lost_in = |stage: Stage| counts_of(stage).losses().map(|(_, n)| n).sum::<u64>();
        let originally_lost_in = |stage: Stage| -> u64 {
            counts_of(stage).losses().filter(|(reason, _)| !CONSEQUENTIAL.contains(reason)).map(|(_, n)| n).sum()
        };
        let (pairing, windowing) = (counts_of(Stage::Pairing), counts_of(Stage::Windowing));
        let cameras = [Stage::Camera1, Stage::Camera2].map(lost_in);
        let in_pairing = originally_lost_in(Stage::Pairing);
        let injected = Injected::from_counts(counts);
        let unpaired = pairing.dropped(DropReason::Unpaired).saturating_sub(injected.images);
        let reported = cameras.iter().sum::<u64>() + in_pairing;
        // The count has both images of each pair.
        let pairs_without_pattern = pairing.dropped(DropReason::NoPattern).div_ceil(2).saturating_sub(injected.events);
        let refused_windows = counts_of(Stage::Phase).dropped_for_images();
        let later = [Stage::Phase, Stage::Correspondence, Stage::Cloud].map(lost_in).iter().sum::<u64>();
        let missing_pairs = unpaired.max(cameras[0]).max(cameras[1]).max(in_pairing.div_ceil(2));
        let conflicts = pairing.dropped(DropReason::PatternConflict).div_ceil(2);
        let missing = missing_pairs + pairs_without_pattern + conflicts;
        // What was left out on purpose broke its share of the windows.
        let incomplete = windowing.dropped(DropReason::Incomplete);
        let broken = match injected.images + injected.events {
            0 => incomplete,
            on_purpose => part(incomplete, missing, missing + on_purpose),
        };
        let no_window = missing + broken + windowing.losses().map(|(_, n)| n).sum::<u64>();
        // With a stride, only some of the pairs complete a wanted window.
        let (wanted, unwanted) = (windowing.passed, windowing.dropped(DropReason::BetweenWindows));
        // Round up: any loss costs at least one cloud.
        let windows = part(no_window, wanted.max(1), (wanted + unwanted).max(1));
        Self {
            images: reported.max(unpaired),
            events: (lost_in(Stage::Projector) + originally_lost_in(Stage::Pattern)).max(pairs_without_pattern),
            refused_windows,
            messages: lost_in(Stage::Recorder),
            clouds: windows.saturating_add(later),
        }
    }
}

/// `count · of / all`, rounded up.
fn part(count: u64, of: u64, all: u64) -> u64 {
    let part = (u128::from(count) * u128::from(of)).div_ceil(u128::from(all));
    u64::try_from(part).unwrap_or(u64::MAX)
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
                "window was refused because its images show a fault",
                "windows were refused because their images show faults",
            ),
            one_or_many(messages, "message is missing in recordings", "messages are missing in recordings"),
        ];
        let parts: Vec<String> = parts.into_iter().flatten().collect();
        let cost = one_or_many(clouds, "cloud is", "clouds are");
        match (parts.is_empty(), cost) {
            (true, None) => write!(f, "nothing was lost"),
            (true, Some(cost)) => write!(f, "{cost} lost in later stages"),
            (false, None) => write!(f, "{}; no cloud is missing because of this", parts.join(", ")),
            (false, Some(cost)) => write!(f, "{}; {cost} missing because of this", parts.join(", ")),
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
    fn a_lost_image_counts_once_however_many_stages_report_it() {
        // Windows of six images, one for every pair: each lost image costs its own window and five more.
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
        assert_eq!(losses.to_string(), "10 images were lost; 60 clouds are missing because of this");
    }

    #[test]
    fn what_was_left_out_on_purpose_is_no_loss() {
        let on_purpose = |camera_lost| {
            [
                (Stage::Camera1, counts(592, &[(DropReason::Injected, 8), (DropReason::CameraLost, camera_lost)])),
                (Stage::Camera2, counts(594, &[(DropReason::Injected, 6)])),
                (Stage::Pattern, counts(586, &[(DropReason::Unpaired, 14 + camera_lost)])),
                (Stage::Pairing, counts(1172, &[(DropReason::Unpaired, 14 + camera_lost)])),
                (Stage::Windowing, counts(535, &[(DropReason::Incomplete, 48)])),
            ]
        };
        assert_eq!(Losses::from_counts(&on_purpose(0)), Losses::default());
        // Two of sixteen images: an eighth of the broken windows.
        let losses = Losses::from_counts(&on_purpose(2));
        assert_eq!((losses.images, losses.clouds), (2, 2 + 6));
    }

    #[test]
    fn losses_of_a_silent_camera_are_inferred_from_the_other() {
        let silent = [
            (Stage::Pairing, counts(40, &[(DropReason::Unpaired, 30)])),
            (Stage::Windowing, counts(4, &[(DropReason::Beginning, 5), (DropReason::BetweenWindows, 12)])),
        ];
        let losses = Losses::from_counts(&silent);
        assert_eq!((losses.images, losses.clouds), (30, 8));
    }

    #[test]
    fn faults_in_images_are_refused_windows_and_not_lost_images() {
        let hidden = [(Stage::Phase, counts(100, &[(DropReason::HiddenLoss, 9), (DropReason::NextStageBusy, 50)]))];
        let losses = Losses::from_counts(&hidden);
        assert_eq!((losses.images, losses.refused_windows, losses.clouds), (0, 9, 9));
        assert_eq!(
            losses.to_string(),
            "9 windows were refused because their images show faults; 9 clouds are missing because of this"
        );
        assert_eq!(
            Losses::from_counts(&[(Stage::Windowing, counts(9, &[(DropReason::Beginning, 5)]))]),
            Losses::default()
        );
        assert_eq!(Losses::default().to_string(), "nothing was lost");
    }
}
