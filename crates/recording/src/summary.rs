//! What is in a recording, in figures.

use std::collections::BTreeMap;

use serde::Serialize;

use fringeflow_message::{Stage, StageReport};

use super::content::Content;
use super::error::RecordingError;
use super::{Origin, Recording, Topic};

/// The figures of a recording.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Name of what was measured.
    pub name: String,
    /// Bytes of the file.
    pub bytes: u64,
    /// Version of the fringeflow that wrote it.
    pub version: String,
    /// Where and when it was begun.
    pub origin: Origin,
    /// Width and height of the images, pixels.
    pub image_size_px: [usize; 2],
    /// Format of the images, by V4L2's name.
    pub pixel_format: &'static str,
    /// Steps of the shift cycle.
    pub steps: usize,
    /// From the first message to the last, seconds.
    pub duration_s: f64,
    /// Messages by topic.
    pub topics: Vec<TopicSummary>,
    /// Points of all clouds.
    pub points: u64,
    /// Marks that were set.
    pub marks: Vec<Remark>,
    /// What the recorder said about its losses on the way.
    pub losses: Vec<Remark>,
    /// Messages that the recorder lost; `None` if it did not say, since it was killed.
    pub lost: Option<u64>,
    /// What the recorder said in the end.
    pub account: BTreeMap<String, String>,
    /// Last report of every stage.
    pub stages: Vec<StageSummary>,
    /// Messages of topics that fringeflow does not know.
    pub foreign: BTreeMap<String, u64>,
}

/// Messages of a topic.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct TopicSummary {
    /// Its name.
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
    /// What it says.
    pub text: String,
}

/// What a stage did until its last report.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct StageSummary {
    /// Its name.
    pub stage: &'static str,
    /// Items taken.
    pub taken: u64,
    /// Items passed on.
    pub passed: u64,
    /// Items dropped, by reason.
    pub dropped: BTreeMap<&'static str, u64>,
}

impl Recording {
    /// What is in it; images are not read.
    ///
    /// # Errors
    /// A log message, report or cloud header that cannot be read.
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
            lost: self.lost(),
            account: self.account().clone(),
            stages: self.stage_summaries()?,
            foreign: self.foreign().clone(),
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

    fn stage_summaries(&self) -> Result<Vec<StageSummary>, RecordingError> {
        let mut last: BTreeMap<u32, StageReport> = BTreeMap::new();
        for message in self.messages_of(Topic::Report) {
            if let Content::Report(report) = message?.content {
                last.insert(report.stage, *report);
            }
        }
        let summary = |report: &StageReport| StageSummary {
            stage: Stage::from_code(report.stage).map_or("", Stage::name),
            taken: report.counts.taken,
            passed: report.counts.passed,
            dropped: report.counts.reasons().map(|(reason, count)| (reason.name(), count)).collect(),
        };
        Ok(last.values().map(summary).collect())
    }
}

fn seconds(time_ns: u64) -> f64 {
    time_ns as f64 * 1e-9
}
