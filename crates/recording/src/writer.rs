//! Writes a recording, message by message, in the thread of the caller.
//!
//! In: a setup, a configuration text, then messages. Out: an uncompressed MCAP file in chunks with checksums.
//! Compression of fringe images would take ten times as long and save nothing, because of their noise.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use mcap::records::MessageHeader;

use fringeflow_dataset::{CALIBRATION_FILE, META_FILE, Setup};

use crate::file::UnfinishedFile;
use crate::mcap_writer::{Attachment, McapWriter, Schema};
use crate::recordable::{Encoded, Times};
use crate::{
    CONFIGURATION_FILE, LIBRARY, METADATA, Origin, PROFILE, RECORDER_METADATA, RecordingError, RecordingProblem, Topic,
    UNFINISHED, WallClock, static_messages,
};

/// Options of a new recording, and the content of its start.
#[derive(Clone, Copy, Debug)]
pub struct Opening<'a> {
    /// Rig, pattern and measurement volume.
    pub setup: &'a Setup,
    /// Text of the configuration of the scan.
    pub configuration: &'a str,
    /// Computer and time at the start of the recording.
    pub origin: &'a Origin,
    /// Number of bytes of the disk that must stay free.
    pub min_free_bytes: u64,
}

/// An unfinished recording.
pub(super) struct RecordingWriter {
    mcap: McapWriter,
    file: UnfinishedFile,
    target: PathBuf,
    /// Converts the times of messages and attachments.
    pub(super) clock: WallClock,
    channels: BTreeMap<Topic, Channel>,
}

struct Channel {
    id: u16,
    /// MCAP sequence number of the next message.
    sequence: u32,
}

impl RecordingWriter {
    /// Creates the file and writes the start of a recording.
    pub(super) fn create(target: &Path, opening: &Opening<'_>) -> Result<Self, RecordingError> {
        let mut writer = Self::create_empty(target, UNFINISHED, opening.min_free_bytes)?;
        writer.clock = opening.origin.wall_clock();
        match writer.write_opening(opening) {
            Ok(()) => Ok(writer),
            Err(problem) => Err(writer.abort(problem)),
        }
    }

    /// Creates the file and adds only its header. Times are written as they are given.
    pub(super) fn create_empty(target: &Path, suffix: &str, min_free_bytes: u64) -> Result<Self, RecordingError> {
        let file = UnfinishedFile::create(target, suffix, min_free_bytes)?;
        let library = format!("{LIBRARY}{}", env!("CARGO_PKG_VERSION"));
        let mcap = McapWriter::begin(file.writer(), PROFILE, &library);
        Ok(Self { mcap, file, target: target.to_owned(), clock: WallClock::default(), channels: BTreeMap::new() })
    }

    fn write_opening(&mut self, opening: &Opening<'_>) -> Result<(), RecordingProblem> {
        let Opening { setup, configuration, origin, .. } = *opening;
        let time_ns = origin.started_ns;
        self.metadata(METADATA, &origin.metadata(setup))?;
        self.attach(CALIBRATION_FILE, "application/yaml", setup.text.calibration.as_bytes(), time_ns)?;
        self.attach(META_FILE, "application/json", setup.text.description.as_bytes(), time_ns)?;
        self.attach(CONFIGURATION_FILE, "application/toml", configuration.as_bytes(), time_ns)?;
        let times = Times { log_ns: time_ns, publish_ns: time_ns };
        for (topic, message) in static_messages(setup, self.clock.unix_ns(time_ns)) {
            self.write_one(topic, times, &message)?;
        }
        self.flush()
    }

    /// Reserves disk space for a message. Returns `false` if the disk is full.
    pub(super) fn reserve(&mut self, message_bytes: usize) -> bool {
        self.file.reserve(message_bytes)
    }

    /// Reserves disk space for a message.
    pub(super) fn require_space(&mut self, message_bytes: usize) -> Result<(), RecordingProblem> {
        let has_space = self.reserve(message_bytes);
        has_space.then_some(()).ok_or_else(|| RecordingProblem::Unwritable(std::io::ErrorKind::StorageFull.into()))
    }

    /// Writes a message, and its header before it if its topic has one. The buffer is not needed afterwards.
    pub(super) fn write(&mut self, topic: Topic, times: Times, encoded: &Encoded) -> Result<(), RecordingProblem> {
        encoded.ranges(topic).try_for_each(|(topic, range)| self.message(topic, times, encoded.slices(&range)))
    }

    /// Writes one message.
    pub(super) fn write_one(&mut self, topic: Topic, times: Times, data: &[u8]) -> Result<(), RecordingProblem> {
        self.message(topic, times, [data, &[]])
    }

    /// Writes one message with this sequence number. Later messages of the topic are numbered from there.
    pub(super) fn write_numbered(
        &mut self,
        topic: Topic,
        sequence: u32,
        times: Times,
        data: &[u8],
    ) -> Result<(), RecordingProblem> {
        self.channel(topic).sequence = sequence;
        self.write_one(topic, times, data)
    }

    fn message(&mut self, topic: Topic, times: Times, content: [&[u8]; 2]) -> Result<(), RecordingProblem> {
        let Channel { id, sequence } = *self.channel(topic);
        self.channel(topic).sequence = sequence.wrapping_add(1);
        let [log_time, publish_time] = [times.log_ns, times.publish_ns].map(|time_ns| self.clock.unix_ns(time_ns));
        let header = MessageHeader { channel_id: id, sequence, log_time, publish_time };
        self.mcap.message(&header, content).map_err(RecordingProblem::Unwritable)
    }

    fn channel(&mut self, topic: Topic) -> &mut Channel {
        let Self { channels, mcap, .. } = self;
        channels.entry(topic).or_insert_with(|| {
            let schema = topic.schema();
            let named = schema.as_ref().map(|s| Schema { name: &s.name, encoding: &s.encoding, data: &s.data });
            mcap.add_channel(topic.channel_id(), topic.name(), named);
            Channel { id: topic.channel_id(), sequence: 0 }
        })
    }

    /// Writes an attachment.
    pub(super) fn attach(
        &mut self,
        name: &str,
        media_type: &str,
        data: &[u8],
        time_ns: u64,
    ) -> Result<(), RecordingProblem> {
        self.require_space(data.len())?;
        let attachment = Attachment { time_ns: self.clock.unix_ns(time_ns), name, media_type, data };
        self.mcap.attach(&attachment).map_err(RecordingProblem::Unwritable)
    }

    /// Writes metadata.
    pub(super) fn metadata(&mut self, name: &str, entries: &BTreeMap<String, String>) -> Result<(), RecordingProblem> {
        self.mcap.metadata(name, entries).map_err(RecordingProblem::Unwritable)
    }

    /// Closes the chunk and hands everything to the kernel, so that it is kept if the process dies.
    pub(super) fn flush(&mut self) -> Result<(), RecordingProblem> {
        self.mcap.flush().map_err(RecordingProblem::Unwritable)
    }

    /// Synchronizes the flushed data to the disk, so that it is kept if the computer fails.
    pub(super) fn sync(&self) -> Result<(), RecordingProblem> {
        self.file.sync().map_err(RecordingProblem::Unwritable)
    }

    /// Writes the final counts of the recorder and the end of the file, and renames the file to its final name.
    pub(super) fn finish(mut self, account: &BTreeMap<String, String>) -> Result<PathBuf, RecordingError> {
        let written = self.metadata(RECORDER_METADATA, account);
        let finished = written.and_then(|()| self.mcap.finish().map_err(RecordingProblem::Unwritable));
        finished.map_err(|problem| RecordingProblem::Unfinishable(problem.to_string()).in_file(&self.target))?;
        self.file.finish()
    }

    /// Removes the file after a problem at its start, and returns the error.
    pub(super) fn abort(self, problem: RecordingProblem) -> RecordingError {
        let error = problem.in_file(&self.target);
        self.discard();
        error
    }

    /// Removes the file.
    pub(super) fn discard(self) {
        self.file.discard();
    }
}
