//! What a recording lacks. `info`, `check` and `recover` count it here, and say it in the same words.

use std::collections::BTreeMap;
use std::fmt;

use serde::Serialize;

use crate::{Content, Recording, RecordingError, Topic};

/// What was lost before, while or after a recording was made.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Losses {
    /// Messages that the recorder took, but that are not in the file; `None` if the recorder was killed and could not
    /// count them.
    pub lost: Option<u64>,
    /// Gaps in the sequence numbers of camera 1 and 2: missing images.
    pub missing_images: [u64; 2],
    /// Gaps in the numbers of the pattern events: missing events.
    pub missing_patterns: u64,
    /// Clouds with a missing image, although their window started within the recording.
    pub clouds_without_images: u64,
}

impl Losses {
    /// Whether nothing was lost.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        *self == Self { lost: Some(0), ..Self::default() }
    }
}

impl fmt::Display for Losses {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let counted = |count: u64, one: &str, many: &str| match count {
            0 => None,
            1 => Some(format!("1 {one}")),
            count => Some(format!("{count} {many}")),
        };
        let recorder = match self.lost {
            Some(lost) => counted(lost, "message of the recorder", "messages of the recorder"),
            None => {
                Some("messages of the recorder (unknown how many, because it was not shut down properly)".to_owned())
            }
        };
        let [cam1, cam2] = self.missing_images;
        let parts = [
            recorder,
            counted(cam1, "image of camera 1", "images of camera 1"),
            counted(cam2, "image of camera 2", "images of camera 2"),
            counted(self.missing_patterns, "pattern event", "pattern events"),
            counted(self.clouds_without_images, "cloud", "clouds").map(|clouds| format!("images of {clouds}")),
        ];
        let parts: Vec<String> = parts.into_iter().flatten().collect();
        f.write_str(&if parts.is_empty() { "nothing".to_owned() } else { parts.join(", ") })
    }
}

/// Gaps and repetitions in the numbers of the images and events of a recording.
pub(super) struct Numbering {
    pub(super) missing_images: [u64; 2],
    pub(super) repeated_images: [u64; 2],
    missing_patterns: u64,
}

impl Recording {
    /// Counts what the recording lacks.
    ///
    /// # Errors
    /// The file can no longer be read. A pattern event with invalid content is left out.
    pub fn losses(&self) -> Result<Losses, RecordingError> {
        let Numbering { missing_images, missing_patterns, .. } = self.numbering()?;
        let has_all =
            |header: &&fringeflow_message::CloudHeader| self.has_window(header) || self.begins_after(&header.window);
        let clouds_without_images = self.cloud_headers().filter(|header| !has_all(header)).count() as u64;
        Ok(Losses { lost: self.lost_messages(), missing_images, missing_patterns, clouds_without_images })
    }

    /// Finds gaps and repetitions in the numbers of images and events.
    pub(super) fn numbering(&self) -> Result<Numbering, RecordingError> {
        let mut patterns: BTreeMap<u64, Vec<u64>> = BTreeMap::new();
        for message in self.messages_of(Topic::Pattern) {
            match message.map(|message| message.content) {
                Ok(Content::Pattern(event)) => patterns.entry(event.session).or_default().push(event.sequence),
                Ok(_) => {}
                Err(error) if error.problem.is_content() => {}
                Err(error) => return Err(error),
            }
        }
        let (missing_patterns, _) = gaps_of(patterns);
        let [(missing1, repeated1), (missing2, repeated2)] = [1, 2].map(|camera| {
            let mut sessions: BTreeMap<u64, Vec<u64>> = BTreeMap::new();
            for header in self.frame_headers(camera) {
                sessions.entry(header.session).or_default().push(header.sequence);
            }
            gaps_of(sessions)
        });
        Ok(Numbering {
            missing_images: [missing1, missing2],
            repeated_images: [repeated1, repeated2],
            missing_patterns,
        })
    }
}

/// Returns the number of gaps and the number of repetitions in the numbers of all sessions.
fn gaps_of(sessions: BTreeMap<u64, Vec<u64>>) -> (u64, u64) {
    sessions
        .into_values()
        .map(gaps)
        .fold((0, 0), |(missing, repeated): (u64, u64), (more, again)| (missing.saturating_add(more), repeated + again))
}

/// Returns the number of gaps in the numbers, and the number of repetitions.
fn gaps(mut numbers: Vec<u64>) -> (u64, u64) {
    numbers.sort_unstable();
    let all = numbers.len() as u64;
    numbers.dedup();
    let distinct = numbers.len() as u64;
    let span = numbers.last().zip(numbers.first()).map_or(0, |(last, first)| (last - first).saturating_add(1));
    (span.saturating_sub(distinct), all - distinct)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn gaps_and_repetitions_are_counted() {
        assert_eq!(gaps(vec![]), (0, 0));
        assert_eq!(gaps(vec![7, 5, 9, 9, 6]), (1, 1));
        assert_eq!(gaps(vec![0, u64::MAX]), (u64::MAX - 2, 0));
    }

    #[test]
    fn each_loss_is_named_with_its_number() {
        let losses = Losses { lost: Some(0), ..Losses::default() };
        assert!(losses.is_empty());
        assert_eq!(losses.to_string(), "nothing");
        let losses = Losses { lost: Some(3), missing_images: [0, 1], missing_patterns: 2, clouds_without_images: 4 };
        assert!(!losses.is_empty());
        let text = losses.to_string();
        assert_eq!(text, "3 messages of the recorder, 1 image of camera 2, 2 pattern events, images of 4 clouds");
        assert!(Losses::default().to_string().contains("unknown how many"));
    }
}
