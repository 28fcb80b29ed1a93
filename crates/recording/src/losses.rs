//! What was lost in a run, and what its recording lacks. `info`, `check` and `recover` count it here, and say it in the
//! words of the run itself.

use std::collections::BTreeMap;
use std::fmt;

use serde::Serialize;

use fringeflow_message::{Counts, Stage};
use fringeflow_telemetry::Verdict;

use crate::{Content, Recording, RecordingError, Topic};

/// What was lost before, while or after a recording was made.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Losses {
    /// The verdict on the run, by the last recorded report of each stage and the final account of the recorder.
    pub run: Verdict,
    /// Messages that the recorder took, but that are not in the file; `None` if the recorder was killed and could not
    /// count them.
    pub lost: Option<u64>,
    /// Gaps in the sequence numbers of camera 1 and 2: missing images.
    pub missing_images: [u64; 2],
    /// Missing images of camera 1 and 2 that no stage of the run counts.
    pub uncounted_images: [u64; 2],
    /// Gaps in the numbers of the pattern events: missing events.
    pub missing_patterns: u64,
    /// Missing pattern events that no stage of the run counts.
    pub uncounted_patterns: u64,
    /// Clouds with a missing image, although their window started within the recording.
    pub clouds_without_images: u64,
}

impl Losses {
    /// Whether the run lost anything, or the recording lacks anything that the run did not leave out.
    #[must_use]
    pub fn is_loss(&self) -> bool {
        self.run.is_loss || self.lost.is_none() || !self.lacks().is_empty()
    }

    /// What the file lacks and no stage counts.
    fn lacks(&self) -> Vec<String> {
        let counted = |count: u64, one: &str, many: &str| match count {
            0 => None,
            1 => Some(format!("1 {one}")),
            count => Some(format!("{count} {many}")),
        };
        let [cam1, cam2] = self.uncounted_images;
        let parts = [
            counted(cam1, "image of camera 1", "images of camera 1"),
            counted(cam2, "image of camera 2", "images of camera 2"),
            counted(self.uncounted_patterns, "pattern event", "pattern events"),
            counted(self.clouds_without_images, "cloud", "clouds").map(|clouds| format!("images of {clouds}")),
        ];
        parts.into_iter().flatten().collect()
    }
}

impl fmt::Display for Losses {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let lacks = self.lacks();
        if !lacks.is_empty() {
            write!(f, "the recording lacks {}; ", lacks.join(", "))?;
        }
        if self.lost.is_none() {
            f.write_str("how many messages the recorder lost is unknown, because it was not shut down properly; ")?;
        }
        if !lacks.is_empty() || self.lost.is_none() {
            f.write_str("in the run, ")?;
        }
        self.run.fmt(f)
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
        self.losses_of_run(&self.stage_counts()?)
    }

    /// [`Self::losses`] of a run whose stages ended with these counts.
    pub(super) fn losses_of_run(&self, counts: &[(Stage, Counts)]) -> Result<Losses, RecordingError> {
        let Numbering { missing_images, missing_patterns, .. } = self.numbering()?;
        let has_all =
            |header: &&fringeflow_message::CloudHeader| self.has_window(header) || self.begins_after(&header.window);
        let dropped_in = |stage: Stage| {
            counts.iter().filter(|(other, _)| *other == stage).map(|(_, counts)| counts.all_dropped()).sum::<u64>()
        };
        let lost = self.lost_messages();
        let mut run = Verdict::from_counts(counts);
        run.add_missing_messages(lost.unwrap_or(0));
        let [cam1, cam2] = missing_images;
        Ok(Losses {
            run,
            lost,
            missing_images,
            uncounted_images: [
                cam1.saturating_sub(dropped_in(Stage::Camera1)),
                cam2.saturating_sub(dropped_in(Stage::Camera2)),
            ],
            missing_patterns,
            uncounted_patterns: missing_patterns.saturating_sub(dropped_in(Stage::Projector)),
            clouds_without_images: self.cloud_headers().filter(|header| !has_all(header)).count() as u64,
        })
    }

    /// The last recorded counts of each stage.
    pub(super) fn stage_counts(&self) -> Result<Vec<(Stage, Counts)>, RecordingError> {
        let mut last: BTreeMap<u32, Counts> = BTreeMap::new();
        for message in self.messages_of(Topic::Report) {
            if let Content::Report(report) = message?.content {
                last.insert(report.stage, report.counts);
            }
        }
        Ok(last.into_iter().filter_map(|(code, counts)| Some((Stage::from_code(code)?, counts))).collect())
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
        assert_eq!((losses.is_loss(), losses.to_string().as_str()), (false, "nothing was lost"));
        // What the run left out on purpose also leaves gaps in the numbers.
        let losses = Losses { missing_images: [3, 0], ..losses };
        assert_eq!((losses.is_loss(), losses.to_string().as_str()), (false, "nothing was lost"));
        let losses = Losses { uncounted_images: [0, 1], uncounted_patterns: 2, clouds_without_images: 4, ..losses };
        let lacks = "1 image of camera 2, 2 pattern events, images of 4 clouds";
        assert!(losses.is_loss());
        assert_eq!(losses.to_string(), format!("the recording lacks {lacks}; in the run, nothing was lost"));
        let killed = Losses::default();
        assert!(killed.is_loss() && killed.to_string().contains("is unknown"));
    }
}
