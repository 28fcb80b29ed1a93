//! Reading an MCAP file from its beginning to its end, whatever it holds.
//!
//! In: a file. Out: its messages, attachments and metadata, each with its place, and what is wrong with the file. A
//! strict scan ends at the first fault; a tolerant one goes on at the next chunk whose checksum is right. All checksums
//! are compared, and what was found with the statistics at the end. Memory: the largest record.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};

use mcap::MAGIC;
use mcap::records::op;

use super::Topic;
use super::error::RecordingProblem;
use super::fields::Fields;
use super::recordable::Times;

/// Most bytes of one record.
const MAX_RECORD_BYTES: u64 = 1 << 30;
/// Opcode and length before each record.
const RECORD_HEAD_BYTES: u64 = 9;
/// Fields of a chunk before its records, with no compression named.
const CHUNK_HEAD_BYTES: u64 = 40;
/// Opcodes from here on are private: others may have added such records.
const PRIVATE: u8 = 0x80;
/// Bytes searched at a time for the next whole chunk.
const SEARCH_BYTES: usize = 1 << 20;

/// How a scan takes what is wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rigour {
    /// The first fault ends it.
    Strict,
    /// Faults are noted, and everything else is found.
    Tolerant,
}

/// What a scan finds.
#[derive(Debug)]
pub(super) enum Found<'a> {
    Message(FoundMessage<'a>),
    Attachment { name: &'a str, media_type: &'a str, data: &'a [u8], log_ns: u64, offset: u64 },
    Metadata { name: &'a str, entries: BTreeMap<String, String> },
}

/// A message of one of our topics.
#[derive(Clone, Copy, Debug)]
pub(super) struct FoundMessage<'a> {
    pub(super) topic: Topic,
    pub(super) sequence: u32,
    pub(super) times: Times,
    pub(super) data: &'a [u8],
    /// Where the data start in the file.
    pub(super) offset: u64,
}

/// What a scan yields beside what it finds.
#[derive(Debug, Default)]
pub(super) struct Scanned {
    /// What is wrong with the file; empty after a strict scan.
    pub(super) faults: Vec<RecordingProblem>,
    /// Messages of topics that are none of ours, by name.
    pub(super) foreign: BTreeMap<String, u64>,
    /// Bytes of the file.
    pub(super) bytes: u64,
}

/// What takes the finds; its error ends the scan.
pub(super) type Visit<'v> = dyn FnMut(Found<'_>) -> Result<(), RecordingProblem> + 'v;

/// Scans a file.
pub(super) fn scan(file: &File, rigour: Rigour, visit: &mut Visit<'_>) -> Result<Scanned, RecordingProblem> {
    let bytes = file.metadata().map_err(RecordingProblem::Unreadable)?.len();
    let mut reader = Reader {
        file: BufReader::with_capacity(SEARCH_BYTES, file),
        bytes,
        at: 0,
        crc: Default::default(),
        has_whole_record: false,
    };
    reader.seek(0)?;
    let mut scan = Scan { contents: Contents::default(), visit, scanned: Scanned { bytes, ..Scanned::default() } };
    let mut magic = [0; MAGIC.len()];
    if !reader.fill(&mut magic)? || magic != *MAGIC {
        return Err(RecordingProblem::NotMcap);
    }
    let mut body = Vec::new();
    loop {
        let start = reader.at;
        reader.has_whole_record = false;
        match scan.step(&mut reader, &mut body) {
            Ok(true) => {}
            Ok(false) => return Ok(scan.scanned),
            Err(Trouble::Visitor(problem) | Trouble::Fault(problem @ RecordingProblem::Unreadable(_))) => {
                return Err(problem);
            }
            Err(Trouble::Fault(problem)) if rigour == Rigour::Strict => return Err(problem),
            Err(Trouble::Fault(problem)) => {
                scan.scanned.faults.push(problem);
                if !(reader.stands_at_record()? || reader.find_chunk(start + 1, &mut body)?) {
                    return Ok(scan.scanned);
                }
            }
        }
    }
}

/// Why a step of a scan failed.
enum Trouble {
    /// The file is at fault.
    Fault(RecordingProblem),
    /// Whoever takes the finds wants no more.
    Visitor(RecordingProblem),
}

impl From<RecordingProblem> for Trouble {
    fn from(problem: RecordingProblem) -> Self {
        Self::Fault(problem)
    }
}

fn damaged(offset: u64, what: impl Into<String>) -> RecordingProblem {
    RecordingProblem::Damaged { offset, what: what.into() }
}

/// The file, read forward, with the checksum of the section it is in.
struct Reader<'f> {
    file: BufReader<&'f File>,
    bytes: u64,
    at: u64,
    crc: crc32fast::Hasher,
    has_whole_record: bool,
}

impl Reader<'_> {
    fn seek(&mut self, to: u64) -> Result<(), RecordingProblem> {
        self.at = to;
        self.file.seek(SeekFrom::Start(to)).map(drop).map_err(RecordingProblem::Unreadable)
    }

    /// Fills a buffer; false if the file ends before.
    fn fill(&mut self, buffer: &mut [u8]) -> Result<bool, RecordingProblem> {
        match self.file.read_exact(buffer) {
            Ok(()) => {
                self.at += buffer.len() as u64;
                self.crc.update(buffer);
                Ok(true)
            }
            Err(e) if e.kind() == io::ErrorKind::UnexpectedEof => Ok(false),
            Err(e) => Err(RecordingProblem::Unreadable(e)),
        }
    }

    /// Opcode and length of the next record.
    fn head(&mut self) -> Result<(u8, u64), RecordingProblem> {
        let start = self.at;
        let unfinished = |within| RecordingProblem::Unfinished { offset: self.bytes, within };
        if start == self.bytes {
            return Err(unfinished("after a whole record"));
        }
        let mut head = [0; RECORD_HEAD_BYTES as usize];
        if !self.fill(&mut head)? {
            return Err(RecordingProblem::Unfinished { offset: self.bytes, within: "within a record" });
        }
        let [opcode, length @ ..] = head;
        let length = u64::from_le_bytes(length);
        if length > self.bytes - self.at {
            return Err(RecordingProblem::Unfinished { offset: self.bytes, within: "within a record" });
        }
        if length > MAX_RECORD_BYTES {
            return Err(damaged(
                start,
                format!("a record claims {length} bytes; no record has over {MAX_RECORD_BYTES}"),
            ));
        }
        Ok((opcode, length))
    }

    /// Content of a record.
    fn body(&mut self, length: u64, body: &mut Vec<u8>) -> Result<(), RecordingProblem> {
        body.clear();
        // Grows with what is read, not with what is claimed.
        let read = (&mut self.file).take(length).read_to_end(body).map_err(RecordingProblem::Unreadable)?;
        self.at += read as u64;
        self.crc.update(body);
        self.has_whole_record = read as u64 == length;
        if self.has_whole_record {
            return Ok(());
        }
        Err(RecordingProblem::Unfinished { offset: self.bytes, within: "within a record" })
    }

    /// Whether the last record was read whole and something that looks like another follows it.
    fn stands_at_record(&mut self) -> Result<bool, RecordingProblem> {
        let here = self.at;
        let follows = self.has_whole_record && matches!(self.head(), Ok((op::HEADER..=op::DATA_END, _)));
        self.seek(here)?;
        Ok(follows)
    }

    /// Goes to the next place from `from` on where a chunk stands whose checksum is right.
    fn find_chunk(&mut self, from: u64, body: &mut Vec<u8>) -> Result<bool, RecordingProblem> {
        let mut place = from;
        let mut window = Vec::new();
        while place + RECORD_HEAD_BYTES + CHUNK_HEAD_BYTES <= self.bytes {
            self.seek(place)?;
            window.clear();
            let mut next = (&mut self.file).take(SEARCH_BYTES as u64);
            next.read_to_end(&mut window).map_err(RecordingProblem::Unreadable)?;
            let head = (RECORD_HEAD_BYTES + CHUNK_HEAD_BYTES) as usize;
            for (i, candidate) in window.windows(head).enumerate() {
                if looks_like_chunk(candidate) && self.is_whole_chunk(place + i as u64, body)? {
                    self.seek(place + i as u64)?;
                    return Ok(true);
                }
            }
            place += (window.len().max(head) - head + 1) as u64;
        }
        Ok(false)
    }

    fn is_whole_chunk(&mut self, place: u64, body: &mut Vec<u8>) -> Result<bool, RecordingProblem> {
        self.seek(place)?;
        let Ok((op::CHUNK, length)) = self.head() else { return Ok(false) };
        match self.body(length, body) {
            Err(problem @ RecordingProblem::Unreadable(_)) => Err(problem),
            read => Ok(read.is_ok() && chunk_records(body, place).is_ok_and(|(_, is_checked)| is_checked)),
        }
    }
}

/// Whether these bytes can be the beginning of a chunk: its lengths agree, and it is not compressed.
fn looks_like_chunk(bytes: &[u8]) -> bool {
    let mut fields = Fields(bytes);
    let mut lengths = || {
        fields.u8().filter(|&opcode| opcode == op::CHUNK)?;
        let length = fields.u64()?;
        fields.bytes(16)?;
        let uncompressed = fields.u64()?;
        fields.u32()?;
        let name = fields.u32()?;
        let compressed = fields.u64()?;
        let whole = compressed.checked_add(CHUNK_HEAD_BYTES)?;
        Some(name == 0 && uncompressed == compressed && whole == length)
    };
    lengths().unwrap_or(false)
}

/// The records of a chunk, and whether a checksum vouches for them.
fn chunk_records(body: &[u8], start: u64) -> Result<(&[u8], bool), RecordingProblem> {
    let mut fields = Fields(body);
    let parts = (|| {
        fields.bytes(16)?;
        let uncompressed = fields.length()?;
        let crc = fields.u32()?;
        let compression = fields.string()?;
        let compressed = fields.length()?;
        Some((uncompressed, crc, compression, fields.bytes(compressed)?))
    })();
    let (uncompressed, crc, compression, records) =
        parts.ok_or_else(|| damaged(start, "a chunk claims more bytes than it has"))?;
    if !compression.is_empty() {
        return Err(RecordingProblem::Compressed { offset: start, compression: compression.to_owned() });
    }
    if uncompressed != records.len() || !fields.0.is_empty() {
        return Err(damaged(start, "a chunk contradicts itself about its length"));
    }
    if crc != 0 && crc != crc32fast::hash(records) {
        return Err(damaged(start, "the checksum of a chunk is wrong"));
    }
    Ok((records, crc != 0))
}

/// What the file has been found to hold, to be compared with what it says of itself at the end.
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
    /// Takes one record; false after the last.
    fn step(&mut self, reader: &mut Reader<'_>, body: &mut Vec<u8>) -> Result<bool, Trouble> {
        let start = reader.at;
        let before = reader.crc.clone();
        let (opcode, length) = reader.head()?;
        reader.body(length, body)?;
        match opcode {
            op::DATA_END => {
                let crc = Fields(body).u32().ok_or_else(|| damaged(start, "the end of the data is cut short"))?;
                self.check_crc(start, crc, before, "the data")?;
                self.contents.has_ended = true;
                reader.crc = crc32fast::Hasher::new();
                return Ok(true);
            }
            op::FOOTER => {
                self.footer(start, body, before)?;
                return self.end(reader).map(|()| false).map_err(Trouble::Fault);
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

    /// Compares a checksum; faults that were met before make it wrong, and are known already.
    fn check_crc(&self, offset: u64, crc: u32, of: crc32fast::Hasher, what: &str) -> Result<(), RecordingProblem> {
        if crc == 0 || !self.scanned.faults.is_empty() || crc == of.finalize() {
            return Ok(());
        }
        Err(damaged(offset, format!("the checksum of {what} is wrong")))
    }

    fn chunk(&mut self, start: u64, body: &[u8]) -> Result<(), Trouble> {
        let (records, _) = chunk_records(body, start)?;
        self.contents.chunks += 1;
        let first = start + RECORD_HEAD_BYTES + (body.len() - records.len()) as u64;
        let mut fields = Fields(records);
        while !fields.0.is_empty() {
            let place = first + (records.len() - fields.0.len()) as u64;
            let cut = || damaged(place, "a record in a chunk claims more bytes than the chunk has");
            let opcode = fields.u8().ok_or_else(cut)?;
            let length = fields.length().ok_or_else(cut)?;
            let data = fields.bytes(length).ok_or_else(cut)?;
            self.record(opcode, place, place + RECORD_HEAD_BYTES, data)?;
        }
        Ok(())
    }

    /// A record that may stand in a chunk or outside.
    fn record(&mut self, opcode: u8, start: u64, data_at: u64, body: &[u8]) -> Result<(), Trouble> {
        match opcode {
            op::SCHEMA => Ok(()),
            op::CHANNEL => Ok(self.channel(body).ok_or_else(|| damaged(start, "a channel is cut short"))?),
            op::MESSAGE => self.message(start, data_at, body),
            PRIVATE.. => Ok(()),
            _ => Err(damaged(start, format!("a record has the unknown code {opcode:#04x}")).into()),
        }
    }

    fn channel(&mut self, body: &[u8]) -> Option<()> {
        let mut fields = Fields(body);
        let (id, _schema, name) = (fields.u16()?, fields.u16()?, fields.string()?);
        self.contents.topics.insert(id, Topic::of(name));
        self.contents.names.insert(id, name.to_owned());
        Some(())
    }

    fn message(&mut self, start: u64, data_at: u64, body: &[u8]) -> Result<(), Trouble> {
        let mut fields = Fields(body);
        let head = (|| Some((fields.u16()?, fields.u32()?, fields.u64()?, fields.u64()?)))();
        let (id, sequence, log_ns, publish_ns) = head.ok_or_else(|| damaged(start, "a message is cut short"))?;
        *self.contents.messages.entry(id).or_default() += 1;
        let topic = match self.contents.topics.get(&id) {
            Some(topic) => *topic,
            // Its channel was lost with a damaged chunk.
            None if !self.scanned.faults.is_empty() => Topic::ALL.into_iter().find(|topic| topic.channel_id() == id),
            None => return Err(damaged(start, format!("a message is of the unknown channel {id}")).into()),
        };
        let Some(topic) = topic else {
            let name = self.contents.names.get(&id).cloned().unwrap_or_else(|| format!("channel {id}"));
            *self.scanned.foreign.entry(name).or_default() += 1;
            return Ok(());
        };
        let offset = data_at + (body.len() - fields.0.len()) as u64;
        let times = Times { log_ns, publish_ns };
        self.found(Found::Message(FoundMessage { topic, sequence, times, data: fields.0, offset }))
    }

    fn found(&mut self, found: Found<'_>) -> Result<(), Trouble> {
        (self.visit)(found).map_err(Trouble::Visitor)
    }

    fn attachment(&mut self, start: u64, body: &[u8]) -> Result<(), Trouble> {
        let mut fields = Fields(body);
        let parts = (|| {
            let (log_ns, _created, name, media_type) =
                (fields.u64()?, fields.u64()?, fields.string()?, fields.string()?);
            let length = fields.length()?;
            let data = fields.bytes(length)?;
            Some((log_ns, name, media_type, data, fields.u32()?))
        })();
        let cut = || damaged(start, "an attachment claims more bytes than it has");
        let (log_ns, name, media_type, data, crc) = parts.ok_or_else(cut)?;
        if crc != 0 && crc != crc32fast::hash(body.get(..body.len() - 4).unwrap_or_default()) {
            return Err(damaged(start, format!("the checksum of attachment {name:?} is wrong")).into());
        }
        self.contents.attachments += 1;
        let offset = start + RECORD_HEAD_BYTES + (body.len() - 4 - data.len()) as u64;
        self.found(Found::Attachment { name, media_type, data, log_ns, offset })
    }

    fn metadata(&mut self, start: u64, body: &[u8]) -> Result<(), Trouble> {
        let mut fields = Fields(body);
        let parts = (|| Some((fields.string()?, fields.text_map()?)))();
        let (name, entries) = parts.ok_or_else(|| damaged(start, "metadata claim more bytes than they have"))?;
        self.contents.metadata += 1;
        self.found(Found::Metadata { name, entries })
    }

    /// A record of the summary: repetitions and indexes, which nobody needs who reads everything, and the statistics.
    fn summary(&mut self, opcode: u8, start: u64, body: &[u8]) -> Result<(), RecordingProblem> {
        match opcode {
            op::STATISTICS => self.statistics(start, body),
            op::SCHEMA
            | op::CHANNEL
            | op::CHUNK_INDEX
            | op::ATTACHMENT_INDEX
            | op::METADATA_INDEX
            | op::SUMMARY_OFFSET
            | PRIVATE.. => Ok(()),
            _ => Err(damaged(start, format!("the summary has a record with code {opcode:#04x}"))),
        }
    }

    /// Compares what was found with what the file says it holds.
    fn statistics(&mut self, start: u64, body: &[u8]) -> Result<(), RecordingProblem> {
        let mut fields = Fields(body);
        let parts = (|| {
            let (messages, _schemas, _channels) = (fields.u64()?, fields.u16()?, fields.u32()?);
            let counts = [fields.u32()?, fields.u32()?, fields.u32()?];
            fields.bytes(16)?;
            Some((messages, counts, fields.count_map()?))
        })();
        let (messages, [attachments, metadata, chunks], channels) =
            parts.ok_or_else(|| damaged(start, "the statistics are cut short"))?;
        self.contents.has_statistics = true;
        if !self.scanned.faults.is_empty() {
            return Ok(());
        }
        let found = &self.contents;
        let counted: u64 = found.messages.values().sum();
        let compared = [
            ("messages", messages, counted),
            ("attachments", attachments.into(), found.attachments.into()),
            ("metadata records", metadata.into(), found.metadata.into()),
            ("chunks", chunks.into(), found.chunks.into()),
        ];
        if let Some((what, said, found)) = compared.into_iter().find(|(_, said, found)| said != found) {
            return Err(damaged(start, format!("the statistics say {said} {what}, and {found} are there")));
        }
        let counts =
            |map: &BTreeMap<u16, u64>| map.iter().filter(|(_, n)| **n > 0).map(|(i, n)| (*i, *n)).collect::<Vec<_>>();
        if counts(&channels) != counts(&found.messages) {
            return Err(damaged(start, "the statistics count other messages by channel than are there"));
        }
        Ok(())
    }

    fn footer(&mut self, start: u64, body: &[u8], mut crc_of: crc32fast::Hasher) -> Result<(), RecordingProblem> {
        let parts = (|| {
            let mut fields = Fields(body);
            fields.bytes(16)?;
            fields.u32()
        })();
        let crc = parts.ok_or_else(|| damaged(start, "the footer is cut short"))?;
        if !self.contents.has_ended {
            return Err(damaged(start, "the footer stands before the end of the data"));
        }
        // The checksum covers the footer too, up to itself.
        crc_of.update(&[op::FOOTER]);
        crc_of.update(&(body.len() as u64).to_le_bytes());
        crc_of.update(body.get(..16).unwrap_or_default());
        self.check_crc(start, crc, crc_of, "the summary")?;
        if crc != 0 && !self.contents.has_statistics {
            return Err(damaged(start, "the summary has no statistics"));
        }
        Ok(())
    }

    fn end(&self, reader: &mut Reader<'_>) -> Result<(), RecordingProblem> {
        let start = reader.at;
        let mut magic = [0; MAGIC.len()];
        if !reader.fill(&mut magic)? {
            return Err(RecordingProblem::Unfinished { offset: reader.bytes, within: "within its last bytes" });
        }
        if magic != *MAGIC || reader.at != reader.bytes {
            return Err(damaged(start, "the last bytes are not those of an MCAP file"));
        }
        Ok(())
    }
}
