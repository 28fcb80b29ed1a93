//! Scans an MCAP file from start to end.
//!
//! In: a file. Out: its messages, attachments and metadata, each with its place, and the faults of the file. A strict
//! scan stops at the first fault. A tolerant scan continues at the next chunk with a correct checksum. The scan checks
//! all checksums and the statistics at the end, as far as the file has them: MCAP leaves them, the indexes and the whole
//! summary to its writer. Memory: the largest record, and the largest chunk unpacked.
//!
//! The readers of the `mcap` crate are not used: they stop at the first fault, report no byte offsets, allocate what a
//! compressed chunk states, and panic on some damaged records.

mod channels;
mod chunk;
mod ending;
mod fault;
mod file;
mod magic;

use std::borrow::Cow;
use std::collections::BTreeMap;
use std::fs::File;

use mcap::MAGIC;
use mcap::records::op;

use crate::fields::Fields;
use crate::place::Place;
use crate::recordable::Times;
use crate::{LIBRARY, PROFILE, RecordingProblem, Topic};
use channels::Channels;
pub(super) use chunk::chunk_records;
use fault::damaged;
pub(super) use file::RECORD_HEAD_BYTES;
use file::Reader;
use magic::check_magic;

/// First opcode of private records, which other programs may add.
const PRIVATE: u8 = 0x80;

/// How a scan handles faults.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum ScanMode {
    /// The first fault ends the scan.
    Strict,
    /// Faults are collected, and the scan continues.
    Tolerant,
}

/// An item found by a scan.
#[derive(Debug)]
pub(super) enum Found<'a> {
    Message(FoundMessage<'a>),
    Attachment { name: &'a str, media_type: &'a str, data: &'a [u8], log_ns: u64, place: Place },
    Metadata { name: &'a str, entries: BTreeMap<String, String> },
}

/// A message of a topic of Fringeflow.
#[derive(Clone, Copy, Debug)]
pub(super) struct FoundMessage<'a> {
    pub(super) topic: Topic,
    pub(super) sequence: u32,
    pub(super) times: Times,
    pub(super) data: &'a [u8],
    /// Place of the data.
    pub(super) place: Place,
}

/// Result of a scan, in addition to the items found.
#[derive(Debug, Default)]
pub(super) struct Scanned {
    /// Faults of the file; empty after a strict scan.
    pub(super) faults: Vec<RecordingProblem>,
    /// Whether a fault is in the data. Faults of the summary lose nothing.
    pub(super) has_data_fault: bool,
    /// Profile that the file states.
    profile: String,
    /// Library that wrote the file.
    pub(super) library: String,
    /// Channels of the file, described by topic, schema and encoding.
    pub(super) channels: Vec<String>,
    /// Whether anything but attachments and metadata tells that Fringeflow made the recording: its profile or a schema.
    pub(super) is_of_fringeflow: bool,
    /// Messages of channels that are not Fringeflow's, by topic.
    pub(super) foreign_messages: BTreeMap<String, u64>,
    /// Size of the file, bytes.
    pub(super) bytes: u64,
}

/// Callback for the items found. If it returns an error, the scan ends.
pub(super) type Visit<'v> = dyn FnMut(Found<'_>) -> Result<(), RecordingProblem> + 'v;

/// Scans a file. Calls `visit` with each item found.
pub(super) fn scan(file: &File, mode: ScanMode, visit: &mut Visit<'_>) -> Result<Scanned, RecordingProblem> {
    let mut reader = Reader::new(file)?;
    let mut scan =
        Scan { contents: Contents::default(), visit, scanned: Scanned { bytes: reader.bytes, ..Scanned::default() } };
    check_magic(&mut reader)?;
    let mut body = Vec::new();
    loop {
        let start = reader.offset;
        reader.has_whole_record = false;
        match scan.step(&mut reader, &mut body) {
            Ok(true) => {}
            Ok(false) => break,
            Err(ScanError::Visitor(problem) | ScanError::Fault(problem @ RecordingProblem::Unreadable(_))) => {
                return Err(problem);
            }
            Err(ScanError::Fault(problem)) if mode == ScanMode::Strict => return Err(problem),
            Err(ScanError::Fault(problem)) => {
                scan.scanned.faults.push(problem);
                // More than the last bytes after the footer are data of another recording.
                let has_more = scan.contents.has_footer && reader.bytes - reader.offset > MAGIC.len() as u64;
                scan.scanned.has_data_fault |= !scan.contents.has_ended || has_more;
                // Nothing after the footer belongs to this recording. If the faulty record has a plausible length,
                // continue with the record after it. Otherwise search for the next chunk.
                let has_next =
                    !scan.contents.has_footer && (reader.is_at_record()? || reader.find_chunk(start + 1, &mut body)?);
                if !has_next {
                    break;
                }
            }
        }
    }
    let Scan { contents, mut scanned, .. } = scan;
    scanned.channels = contents.channels.descriptions();
    scanned.is_of_fringeflow = contents.channels.has_own() || scanned.profile == PROFILE;
    Ok(scanned)
}

/// Why a step of a scan failed.
enum ScanError {
    /// The file has a fault.
    Fault(RecordingProblem),
    /// The callback ended the scan.
    Visitor(RecordingProblem),
}

impl From<RecordingProblem> for ScanError {
    fn from(problem: RecordingProblem) -> Self {
        Self::Fault(problem)
    }
}

/// Contents of the file so far, to compare with the statistics at the end.
#[derive(Debug, Default)]
struct Contents {
    channels: Channels,
    messages: BTreeMap<u16, u64>,
    attachments: u32,
    metadata: u32,
    chunks: u32,
    /// Whether the end of the data was read.
    has_ended: bool,
    /// Whether the last record of the file was read.
    has_footer: bool,
}

struct Scan<'v, 'w> {
    contents: Contents,
    visit: &'v mut Visit<'w>,
    scanned: Scanned,
}

impl Scan<'_, '_> {
    /// Reads one record. Returns `false` after the last.
    fn step(&mut self, reader: &mut Reader<'_>, body: &mut Vec<u8>) -> Result<bool, ScanError> {
        let start = reader.offset;
        // Checksums cover everything before the record that states them.
        let crc_before = reader.crc.clone();
        let (opcode, length) = reader.head()?;
        reader.body(length, body)?;
        match opcode {
            op::DATA_END => {
                let crc = Fields(body).u32().ok_or_else(|| damaged(start, "the end-of-data record is truncated"))?;
                self.check_crc(start, crc, crc_before, "the data")?;
                self.contents.has_ended = true;
                reader.crc = crc32fast::Hasher::new();
                return Ok(true);
            }
            op::FOOTER => {
                self.footer(start, body, crc_before)?;
                return self.end(reader).map(|()| false).map_err(ScanError::Fault);
            }
            _ if self.contents.has_ended => self.summary(opcode, start, body)?,
            op::CHUNK => self.chunk(start, body)?,
            op::ATTACHMENT => self.attachment(start, body)?,
            op::METADATA => self.metadata(start, body)?,
            op::HEADER => self.header(start, body)?,
            op::MESSAGE_INDEX => {}
            _ => {
                let place = Place { offset: start + RECORD_HEAD_BYTES, within: None, bytes: body.len() };
                self.record(opcode, start, place, body)?;
            }
        }
        Ok(true)
    }

    fn chunk(&mut self, start: u64, body: &[u8]) -> Result<(), ScanError> {
        let records = chunk_records(body, start)?.bytes;
        self.contents.chunks += 1;
        let whole = match &records {
            Cow::Borrowed(records) => {
                Place { offset: start + RECORD_HEAD_BYTES, within: None, bytes: body.len() }.end(records.len())
            }
            Cow::Owned(records) => Place { offset: start, within: Some(0), bytes: records.len() },
        };
        let mut fields = Fields(&records);
        while !fields.0.is_empty() {
            let offset = whole.end(fields.0.len()).offset;
            let truncated = || damaged(offset, "a record in a chunk states more bytes than the chunk has");
            let opcode = fields.u8().ok_or_else(truncated)?;
            let length = fields.length().ok_or_else(truncated)?;
            let data = fields.bytes(length).ok_or_else(truncated)?;
            self.record(opcode, offset, whole.end(fields.0.len() + length).start(length), data)?;
        }
        Ok(())
    }

    /// Reads a record inside or outside of a chunk. `start` is its offset, or that of its compressed chunk.
    fn record(&mut self, opcode: u8, start: u64, place: Place, body: &[u8]) -> Result<(), ScanError> {
        match opcode {
            op::SCHEMA => {
                Ok(self.contents.channels.add_schema(body).ok_or_else(|| damaged(start, "a schema is truncated"))?)
            }
            op::CHANNEL => {
                Ok(self.contents.channels.add(body).ok_or_else(|| damaged(start, "a channel is truncated"))?)
            }
            op::MESSAGE => self.message(start, place, body),
            PRIVATE.. => Ok(()),
            _ => Err(damaged(start, format!("a record has the unknown code {opcode:#04x}")).into()),
        }
    }

    fn header(&mut self, start: u64, body: &[u8]) -> Result<(), RecordingProblem> {
        let mut fields = Fields(body);
        let parts = (|| Some((fields.string()?, fields.string()?)))();
        let (profile, library) = parts.ok_or_else(|| damaged(start, "the header is truncated"))?;
        (self.scanned.profile, self.scanned.library) = (profile.to_owned(), library.to_owned());
        Ok(())
    }

    fn message(&mut self, start: u64, place: Place, body: &[u8]) -> Result<(), ScanError> {
        let mut fields = Fields(body);
        let head = (|| Some((fields.u16()?, fields.u32()?, fields.u64()?, fields.u64()?)))();
        let (id, sequence, log_ns, publish_ns) = head.ok_or_else(|| damaged(start, "a message is truncated"))?;
        *self.contents.messages.entry(id).or_default() += 1;
        let known = self.contents.channels.get(id).map(|channel| (channel.topic, channel.name.as_str()));
        let topic = match known {
            Some((topic, _)) => topic,
            None if self.scanned.faults.is_empty() => {
                return Err(damaged(start, format!("a message is of the unknown channel {id}")).into());
            }
            // The channel record was lost with a damaged chunk, but Fringeflow gives its topics fixed channels.
            None => Topic::ALL.into_iter().find(|topic| topic.channel_id() == id && self.is_written_by_fringeflow()),
        };
        let Some(topic) = topic else {
            let name =
                known.map_or_else(|| format!("channel {id} (its description was lost)"), |(_, name)| name.to_owned());
            *self.scanned.foreign_messages.entry(name).or_default() += 1;
            return Ok(());
        };
        let (times, place) = (Times { log_ns, publish_ns }, place.end(fields.0.len()));
        self.found(Found::Message(FoundMessage { topic, sequence, times, data: fields.0, place }))
    }

    fn is_written_by_fringeflow(&self) -> bool {
        self.scanned.library.starts_with(LIBRARY)
    }

    fn found(&mut self, found: Found<'_>) -> Result<(), ScanError> {
        (self.visit)(found).map_err(ScanError::Visitor)
    }

    fn attachment(&mut self, start: u64, body: &[u8]) -> Result<(), ScanError> {
        let mut fields = Fields(body);
        let parts = (|| {
            let (log_ns, _created, name, media_type) =
                (fields.u64()?, fields.u64()?, fields.string()?, fields.string()?);
            let length = fields.length()?;
            let data = fields.bytes(length)?;
            Some((log_ns, name, media_type, data, fields.u32()?))
        })();
        let truncated = || damaged(start, "an attachment states more bytes than it has");
        let (log_ns, name, media_type, data, crc) = parts.ok_or_else(truncated)?;
        if crc != 0 && crc != crc32fast::hash(body.get(..body.len() - 4).unwrap_or_default()) {
            return Err(damaged(start, format!("the checksum of attachment {name:?} is wrong")).into());
        }
        self.contents.attachments += 1;
        let offset = start + RECORD_HEAD_BYTES + (body.len() - 4 - data.len()) as u64;
        let place = Place { offset, within: None, bytes: data.len() };
        self.found(Found::Attachment { name, media_type, data, log_ns, place })
    }

    fn metadata(&mut self, start: u64, body: &[u8]) -> Result<(), ScanError> {
        let mut fields = Fields(body);
        let parts = (|| Some((fields.string()?, fields.text_map()?)))();
        let (name, entries) = parts.ok_or_else(|| damaged(start, "metadata state more bytes than they have"))?;
        self.contents.metadata += 1;
        self.found(Found::Metadata { name, entries })
    }
}
