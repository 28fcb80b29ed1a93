//! Scans an MCAP file from start to end.
//!
//! In: a file. Out: its messages, attachments and metadata, each with its offset, and the faults of the file. A strict
//! scan stops at the first fault. A tolerant scan continues at the next chunk with a correct checksum. The scan checks
//! all checksums and the statistics at the end. Memory: the largest record.
//!
//! The readers of the `mcap` crate are not used: they stop at the first fault, report no byte offsets, and panic on
//! some damaged records.

mod chunk;
mod ending;
mod fault;
mod file;

use std::collections::BTreeMap;
use std::fs::File;

use mcap::MAGIC;
use mcap::records::op;

use crate::fields::Fields;
use crate::recordable::Times;
use crate::{RecordingProblem, Topic};
use chunk::chunk_records;
use fault::damaged;
use file::{RECORD_HEAD_BYTES, Reader};

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
    Attachment { name: &'a str, media_type: &'a str, data: &'a [u8], log_ns: u64, offset: u64 },
    Metadata { name: &'a str, entries: BTreeMap<String, String> },
}

/// A message of a topic of Fringeflow.
#[derive(Clone, Copy, Debug)]
pub(super) struct FoundMessage<'a> {
    pub(super) topic: Topic,
    pub(super) sequence: u32,
    pub(super) times: Times,
    pub(super) data: &'a [u8],
    /// Start of the data in the file.
    pub(super) offset: u64,
}

/// Result of a scan, in addition to the items found.
#[derive(Debug, Default)]
pub(super) struct Scanned {
    /// Faults of the file; empty after a strict scan.
    pub(super) faults: Vec<RecordingProblem>,
    /// Messages of unknown topics, by name.
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
    let mut magic = [0; MAGIC.len()];
    if !reader.fill(&mut magic)? || magic != *MAGIC {
        return Err(RecordingProblem::NotMcap);
    }
    let mut body = Vec::new();
    loop {
        let start = reader.offset;
        reader.has_whole_record = false;
        match scan.step(&mut reader, &mut body) {
            Ok(true) => {}
            Ok(false) => return Ok(scan.scanned),
            Err(ScanError::Visitor(problem) | ScanError::Fault(problem @ RecordingProblem::Unreadable(_))) => {
                return Err(problem);
            }
            Err(ScanError::Fault(problem)) if mode == ScanMode::Strict => return Err(problem),
            Err(ScanError::Fault(problem)) => {
                scan.scanned.faults.push(problem);
                // If the faulty record has a plausible length, continue with the record after it. Otherwise search for
                // the next chunk.
                if !(reader.is_at_record()? || reader.find_chunk(start + 1, &mut body)?) {
                    return Ok(scan.scanned);
                }
            }
        }
    }
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
    topics: BTreeMap<u16, Option<Topic>>,
    names: BTreeMap<u16, String>,
    messages: BTreeMap<u16, u64>,
    attachments: u32,
    metadata: u32,
    chunks: u32,
    has_ended: bool,
    has_statistics: bool,
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
            op::HEADER | op::MESSAGE_INDEX => {}
            _ => self.record(opcode, start, start + RECORD_HEAD_BYTES, body)?,
        }
        Ok(true)
    }

    fn chunk(&mut self, start: u64, body: &[u8]) -> Result<(), ScanError> {
        let (records, _) = chunk_records(body, start)?;
        self.contents.chunks += 1;
        let first_offset = start + RECORD_HEAD_BYTES + (body.len() - records.len()) as u64;
        let mut fields = Fields(records);
        while !fields.0.is_empty() {
            let offset = first_offset + (records.len() - fields.0.len()) as u64;
            let truncated = || damaged(offset, "a record in a chunk states more bytes than the chunk has");
            let opcode = fields.u8().ok_or_else(truncated)?;
            let length = fields.length().ok_or_else(truncated)?;
            let data = fields.bytes(length).ok_or_else(truncated)?;
            self.record(opcode, offset, offset + RECORD_HEAD_BYTES, data)?;
        }
        Ok(())
    }

    /// Reads a record inside or outside of a chunk.
    fn record(&mut self, opcode: u8, start: u64, body_offset: u64, body: &[u8]) -> Result<(), ScanError> {
        match opcode {
            op::SCHEMA => Ok(()),
            op::CHANNEL => Ok(self.channel(body).ok_or_else(|| damaged(start, "a channel is truncated"))?),
            op::MESSAGE => self.message(start, body_offset, body),
            PRIVATE.. => Ok(()),
            _ => Err(damaged(start, format!("a record has the unknown code {opcode:#04x}")).into()),
        }
    }

    fn channel(&mut self, body: &[u8]) -> Option<()> {
        let mut fields = Fields(body);
        let (id, _schema, name) = (fields.u16()?, fields.u16()?, fields.string()?);
        self.contents.topics.insert(id, Topic::from_name(name));
        self.contents.names.insert(id, name.to_owned());
        Some(())
    }

    fn message(&mut self, start: u64, body_offset: u64, body: &[u8]) -> Result<(), ScanError> {
        let mut fields = Fields(body);
        let head = (|| Some((fields.u16()?, fields.u32()?, fields.u64()?, fields.u64()?)))();
        let (id, sequence, log_ns, publish_ns) = head.ok_or_else(|| damaged(start, "a message is truncated"))?;
        *self.contents.messages.entry(id).or_default() += 1;
        let topic = match self.contents.topics.get(&id) {
            Some(topic) => *topic,
            // The channel record was lost with a damaged chunk, but the channels of the known topics are fixed.
            None if !self.scanned.faults.is_empty() => Topic::ALL.into_iter().find(|topic| topic.channel_id() == id),
            None => return Err(damaged(start, format!("a message is of the unknown channel {id}")).into()),
        };
        let Some(topic) = topic else {
            let name = self.contents.names.get(&id).cloned().unwrap_or_else(|| format!("channel {id}"));
            *self.scanned.foreign_messages.entry(name).or_default() += 1;
            return Ok(());
        };
        let offset = body_offset + (body.len() - fields.0.len()) as u64;
        let times = Times { log_ns, publish_ns };
        self.found(Found::Message(FoundMessage { topic, sequence, times, data: fields.0, offset }))
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
        self.found(Found::Attachment { name, media_type, data, log_ns, offset })
    }

    fn metadata(&mut self, start: u64, body: &[u8]) -> Result<(), ScanError> {
        let mut fields = Fields(body);
        let parts = (|| Some((fields.string()?, fields.text_map()?)))();
        let (name, entries) = parts.ok_or_else(|| damaged(start, "metadata state more bytes than they have"))?;
        self.contents.metadata += 1;
        self.found(Found::Metadata { name, entries })
    }
}
