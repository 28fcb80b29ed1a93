//! Summary of a recording: sizes, rates and losses.

use std::collections::BTreeMap;

use serde::Serialize;

use fringeflow_message::{Counts, Stage};

use crate::{Content, Losses, Origin, Recording, RecordingError, Topic};

/// Summary of a recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Name of the scene.
    pub name: String,
    /// Size of the file, bytes.
    pub bytes: u64,
    /// Version of fringeflow that wrote the recording.
    pub version: String,
    /// Computer and time at the start of the recording.
    pub origin: Origin,
    /// Width and height of the images, pixels.
    pub image_size_px: [usize; 2],
    /// Format of the images; its name in V4L2.
    pub pixel_format: &'static str,
    /// Number of steps of a cycle.
    pub steps: usize,
    /// Time from the first message to the last, seconds.
    pub duration_s: f64,
    /// Messages by topic.
    pub topics: Vec<TopicSummary>,
    /// Number of points of all clouds.
    pub points: u64,
    /// Marks of the user.
    pub marks: Vec<Remark>,
    /// Messages of the recorder about its losses.
    pub losses: Vec<Remark>,
    /// What was lost.
    #[serde(flatten)]
    pub lost: Losses,
    /// Final counts of the recorder.
    pub account: BTreeMap<String, String>,
    /// Last report of every stage.
    pub stages: Vec<StageSummary>,
    /// Messages of unknown topics.
    pub foreign: BTreeMap<String, u64>,
}

/// Messages of a topic.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TopicSummary {
    /// Name of the topic.
    pub topic: &'static str,
    /// Number of messages.
    pub messages: usize,
    /// Mean rate; `None` for fewer than two messages.
    pub rate_hz: Option<f64>,
}

/// A text with its time.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Remark {
    /// Seconds since the first message.
    pub time_s: f64,
    /// The text.
    pub text: String,
}

/// The last report of a stage.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StageSummary {
    /// Name of the stage.
    pub stage: &'static str,
    /// Items taken.
    pub taken: u64,
    /// Items passed on.
    pub passed: u64,
    /// Items dropped, by reason.
    pub dropped: BTreeMap<&'static str, u64>,
}

impl Recording {
    /// Returns the summary of a recording, without reading the images.
    ///
    /// # Errors
    /// A log message or report cannot be read.
    pub fn summary(&self) -> Result<Summary, RecordingError> {
        let [first_ns, last_ns] = self.span_ns().unwrap_or_default();
        let (mut marks, mut losses) = (Vec::new(), Vec::new());
        for message in self.messages_of(Topic::Log) {
            let message = message?;
            let remark = |text| Remark { time_s: seconds(message.log_ns - first_ns), text };
            match message.content {
                Content::Mark(text) => marks.push(remark(text)),
                Content::Loss(text) => losses.push(remark(text)),
                _ => {}
            }
        }
        let counts = self.stage_counts()?;
        Ok(Summary {
            name: self.setup().name.clone(),
            bytes: self.bytes(),
            version: self.writer_version().to_owned(),
            origin: self.origin(),
            image_size_px: self.setup().image_size_px,
            pixel_format: self.pixel_format().name(),
            steps: self.setup().steps,
            duration_s: seconds(last_ns - first_ns),
            topics: self.topic_summaries(),
            points: self.cloud_headers().fold(0, |sum, header| sum.saturating_add(header.points)),
            marks,
            losses,
            lost: self.losses_of_run(&counts)?,
            account: self.recorder_account().clone(),
            stages: counts.iter().map(StageSummary::new).collect(),
            foreign: self.foreign_messages().clone(),
        })
    }

    fn topic_summaries(&self) -> Vec<TopicSummary> {
        let summary = |topic: Topic| {
            let times: Vec<u64> = self.times_of(topic).collect();
            let span_ns = times.last().zip(times.first()).map_or(0, |(last, first)| last - first);
            let rate_hz = (span_ns > 0).then(|| (times.len() - 1) as f64 / seconds(span_ns));
            TopicSummary { topic: topic.name(), messages: times.len(), rate_hz }
        };
        Topic::ALL.into_iter().map(summary).filter(|summary| summary.messages > 0).collect()
    }
}

impl StageSummary {
    fn new((stage, counts): &(Stage, Counts)) -> Self {
        Self {
            stage: stage.name(),
            taken: counts.taken,
            passed: counts.passed,
            dropped: counts.reasons().map(|(reason, count)| (reason.name(), count)).collect(),
        }
    }
}

fn seconds(time_ns: u64) -> f64 {
    time_ns as f64 * 1e-9
}
