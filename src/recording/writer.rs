//! Writing a recording, message by message, in the caller's thread.
//!
//! In: a setup, a configuration text, then messages. Out: an uncompressed MCAP file in chunks with CRCs. Fringe images
//! are noise to a compressor, so compressing them costs ten times the time and saves nothing.

use std::collections::BTreeMap;
use std::io::BufWriter;
use std::path::{Path, PathBuf};

use mcap::records::{MessageHeader, Metadata};
use mcap::{Attachment, McapError, WriteOptions, Writer};

use crate::dataset::{CALIBRATION_FILE, META_FILE, Setup};

use super::error::{RecordingError, RecordingProblem};
use super::file::{FileEnd, UnfinishedFile};
use super::opening::{Origin, standing_messages};
use super::recordable::{Encoded, Times};
use super::{CONFIGURATION_FILE, METADATA, RECORDER_METADATA, Topic, UNFINISHED};

/// Size from which a chunk is closed.
const CHUNK_BYTES: u64 = 4 << 20;
/// Small writes are gathered to this size.
const BUFFER_BYTES: usize = 1 << 20;

/// What a recording begins with.
#[derive(Clone, Copy, Debug)]
pub struct Opening<'a> {
    /// Rig, pattern and volume.
    pub setup: &'a Setup,
    /// Text of the configuration that is used.
    pub configuration: &'a str,
    /// Where and when it is made.
    pub origin: &'a Origin,
    /// Bytes of the disk that are to stay free.
    pub min_free_bytes: u64,
}

/// A recording in the making.
pub(super) struct RecordingWriter {
    mcap: Writer<BufWriter<FileEnd>>,
    file: UnfinishedFile,
    target: PathBuf,
    channels: BTreeMap<Topic, Channel>,
}

struct Channel {
    id: u16,
    /// MCAP sequence number of the next message.
    sequence: u32,
}

impl RecordingWriter {
    /// Makes the file and writes what a recording begins with.
    pub(super) fn create(target: &Path, opening: &Opening<'_>) -> Result<Self, RecordingError> {
        let mut writer = Self::create_empty(target, UNFINISHED, opening.min_free_bytes)?;
        match writer.open(opening) {
            Ok(()) => Ok(writer),
            Err(problem) => Err(writer.give_up(problem)),
        }
    }

    /// Makes the file and writes nothing but its header.
    pub(super) fn create_empty(target: &Path, suffix: &str, min_free_bytes: u64) -> Result<Self, RecordingError> {
        let file = UnfinishedFile::create(target, suffix, min_free_bytes)?;
        // Chunks are put together in memory, so that the file never holds one whose length is not known yet.
        let options = WriteOptions::new().compression(None).chunk_size(Some(CHUNK_BYTES)).disable_seeking(true);
        let options = options.profile("fringeflow").library(concat!("fringeflow ", env!("CARGO_PKG_VERSION")));
        match options.create(BufWriter::with_capacity(BUFFER_BYTES, file.end())) {
            Ok(mcap) => Ok(Self { mcap, file, target: target.to_owned(), channels: BTreeMap::new() }),
            Err(e) => {
                file.discard();
                Err(problem_of(e).of(target))
            }
        }
    }

    fn open(&mut self, opening: &Opening<'_>) -> Result<(), RecordingProblem> {
        let Opening { setup, configuration, origin, .. } = *opening;
        let time_ns = origin.started_ns;
        self.metadata(METADATA, origin.metadata(setup))?;
        self.attach(CALIBRATION_FILE, "application/yaml", setup.text.calibration.as_bytes(), time_ns)?;
        self.attach(META_FILE, "application/json", setup.text.description.as_bytes(), time_ns)?;
        self.attach(CONFIGURATION_FILE, "application/toml", configuration.as_bytes(), time_ns)?;
        let times = Times { log_ns: time_ns, publish_ns: time_ns };
        for (topic, message) in standing_messages(setup, time_ns) {
            self.write_one(topic, times, &message)?;
        }
        self.flush()
    }

    /// Whether the disk has room for a message of so many bytes.
    pub(super) fn admits(&mut self, message_bytes: usize) -> bool {
        self.file.admits(message_bytes)
    }

    /// Writes a message, and the header before it where its topic has one.
    pub(super) fn write(&mut self, topic: Topic, times: Times, encoded: &Encoded) -> Result<(), RecordingProblem> {
        encoded.parts(topic).try_for_each(|(topic, data)| self.write_one(topic, times, data))
    }

    /// Writes one message.
    pub(super) fn write_one(&mut self, topic: Topic, times: Times, data: &[u8]) -> Result<(), RecordingProblem> {
        let sequence = self.channel(topic)?.sequence;
        self.write_numbered(topic, sequence, times, data)
    }

    /// Writes one message with a sequence number of its own; later ones count from there.
    pub(super) fn write_numbered(
        &mut self,
        topic: Topic,
        sequence: u32,
        times: Times,
        data: &[u8],
    ) -> Result<(), RecordingProblem> {
        let channel = self.channel(topic)?;
        let header =
            MessageHeader { channel_id: channel.id, sequence, log_time: times.log_ns, publish_time: times.publish_ns };
        channel.sequence = sequence.wrapping_add(1);
        self.mcap.write_to_known_channel(&header, data).map_err(problem_of)
    }

    fn channel(&mut self, topic: Topic) -> Result<&mut Channel, RecordingProblem> {
        if !self.channels.contains_key(&topic) {
            let schema = match topic.schema() {
                Some(schema) => self.mcap.add_schema(&schema.name, &schema.encoding, &schema.data),
                None => Ok(0),
            };
            let schema = schema.map_err(problem_of)?;
            let id = topic.channel_id();
            let added = self.mcap.add_channel_with_id(id, schema, topic.name(), "protobuf", &BTreeMap::new());
            added.map_err(problem_of)?;
            self.channels.insert(topic, Channel { id, sequence: 0 });
        }
        let missing = || RecordingProblem::Unfinishable(format!("topic {} has no channel", topic.name()));
        self.channels.get_mut(&topic).ok_or_else(missing)
    }

    /// Writes an attachment.
    pub(super) fn attach(
        &mut self,
        name: &str,
        media_type: &str,
        data: &[u8],
        time_ns: u64,
    ) -> Result<(), RecordingProblem> {
        if !self.admits(data.len()) {
            return Err(RecordingProblem::Unwritable(std::io::ErrorKind::StorageFull.into()));
        }
        let attachment = Attachment {
            log_time: time_ns,
            create_time: time_ns,
            name: name.to_owned(),
            media_type: media_type.to_owned(),
            data: data.into(),
        };
        self.mcap.attach(&attachment).map_err(problem_of)
    }

    /// Writes metadata.
    pub(super) fn metadata(&mut self, name: &str, entries: BTreeMap<String, String>) -> Result<(), RecordingProblem> {
        self.mcap.write_metadata(&Metadata { name: name.to_owned(), metadata: entries }).map_err(problem_of)
    }

    /// Closes the chunk and hands everything to the kernel: what is written so far survives the process.
    pub(super) fn flush(&mut self) -> Result<(), RecordingProblem> {
        self.mcap.flush().map_err(problem_of)
    }

    /// Has the disk keep what was flushed: it survives the machine.
    pub(super) fn sync(&self) -> Result<(), RecordingProblem> {
        self.file.sync().map_err(RecordingProblem::Unwritable)
    }

    /// Writes the recorder's account and the end of the file, and gives the file its name.
    pub(super) fn finish(mut self, account: BTreeMap<String, String>) -> Result<PathBuf, RecordingError> {
        let written = self.metadata(RECORDER_METADATA, account);
        // A second call would say that all is well, so the first answer counts.
        let finished = written.and_then(|()| self.mcap.finish().map(drop).map_err(problem_of));
        let flushed = finished.and_then(|()| {
            use std::io::Write as _;
            self.mcap.into_inner().flush().map_err(RecordingProblem::Unwritable)
        });
        flushed.map_err(|problem| RecordingProblem::Unfinishable(problem.to_string()).of(&self.target))?;
        self.file.finish()
    }

    /// Removes a file of which nothing is worth keeping; the error about it.
    pub(super) fn give_up(self, problem: RecordingProblem) -> RecordingError {
        let error = problem.of(&self.target);
        self.discard();
        error
    }

    /// Removes the file.
    pub(super) fn discard(self) {
        drop(self.mcap);
        self.file.discard();
    }
}

fn problem_of(error: McapError) -> RecordingProblem {
    match error {
        McapError::Io(e) => RecordingProblem::Unwritable(e),
        other => RecordingProblem::Unwritable(std::io::Error::other(other)),
    }
}
