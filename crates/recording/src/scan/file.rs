//! Reads the file of a scan record by record. After a fault, searches for the next intact chunk.

use std::fs::File;
use std::io::{self, BufReader, Read, Seek, SeekFrom};

use mcap::records::op;

use super::chunk::{CHUNK_HEAD_BYTES, MAX_NAME_BYTES, chunk_records, looks_like_chunk};
use super::fault::damaged;
use crate::RecordingProblem;

/// Size of the opcode and length before each record, bytes.
pub(crate) const RECORD_HEAD_BYTES: u64 = 9;
/// Maximum size of one record.
const MAX_RECORD_BYTES: u64 = 1 << 30;
/// Number of bytes searched at a time for the next intact chunk.
const SEARCH_BYTES: usize = 1 << 20;

/// The file, read sequentially, with the checksum of the current section.
pub(super) struct Reader<'f> {
    file: BufReader<&'f File>,
    pub(super) bytes: u64,
    pub(super) offset: u64,
    pub(super) crc: crc32fast::Hasher,
    /// Whether the last record was complete.
    pub(super) has_whole_record: bool,
}

impl<'f> Reader<'f> {
    /// Creates a reader at the start of a file.
    pub(super) fn new(file: &'f File) -> Result<Self, RecordingProblem> {
        let bytes = file.metadata().map_err(RecordingProblem::Unreadable)?.len();
        let file = BufReader::with_capacity(SEARCH_BYTES, file);
        let mut reader = Self { file, bytes, offset: 0, crc: crc32fast::Hasher::new(), has_whole_record: false };
        reader.seek(0)?;
        Ok(reader)
    }

    fn seek(&mut self, offset: u64) -> Result<(), RecordingProblem> {
        self.offset = offset;
        self.file.seek(SeekFrom::Start(offset)).map(drop).map_err(RecordingProblem::Unreadable)
    }

    /// Returns the first bytes of the file, at most `bytes`, and stays at its start.
    pub(super) fn start(&mut self, bytes: usize) -> Result<Vec<u8>, RecordingProblem> {
        let mut start = Vec::new();
        (&mut self.file).take(bytes as u64).read_to_end(&mut start).map_err(RecordingProblem::Unreadable)?;
        self.seek(0)?;
        Ok(start)
    }

    /// Fills a buffer. Returns `false` if the file ends before.
    pub(super) fn fill(&mut self, buffer: &mut [u8]) -> Result<bool, RecordingProblem> {
        match self.file.read_exact(buffer) {
            Ok(()) => {
                self.offset += buffer.len() as u64;
                self.crc.update(buffer);
                Ok(true)
            }
            Err(e) if e.kind() == io::ErrorKind::UnexpectedEof => Ok(false),
            Err(e) => Err(RecordingProblem::Unreadable(e)),
        }
    }

    /// Reads the opcode and length of the next record.
    pub(super) fn head(&mut self) -> Result<(u8, u64), RecordingProblem> {
        let start = self.offset;
        let unfinished = |within| RecordingProblem::Unfinished { offset: self.bytes, within };
        if start == self.bytes {
            return Err(unfinished("after a complete record"));
        }
        let mut head = [0; RECORD_HEAD_BYTES as usize];
        if !self.fill(&mut head)? {
            return Err(RecordingProblem::Unfinished { offset: self.bytes, within: "within a record" });
        }
        let [opcode, length @ ..] = head;
        let length = u64::from_le_bytes(length);
        if length > self.bytes - self.offset {
            return Err(RecordingProblem::Unfinished { offset: self.bytes, within: "within a record" });
        }
        if length > MAX_RECORD_BYTES {
            return Err(damaged(
                start,
                format!("a record states {length} bytes; a record has at most {MAX_RECORD_BYTES}"),
            ));
        }
        Ok((opcode, length))
    }

    /// Reads the content of a record.
    pub(super) fn body(&mut self, length: u64, body: &mut Vec<u8>) -> Result<(), RecordingProblem> {
        body.clear();
        // The buffer grows with the bytes read, because the stated length may be wrong.
        let read = (&mut self.file).take(length).read_to_end(body).map_err(RecordingProblem::Unreadable)?;
        self.offset += read as u64;
        self.crc.update(body);
        self.has_whole_record = read as u64 == length;
        if self.has_whole_record {
            return Ok(());
        }
        Err(RecordingProblem::Unfinished { offset: self.bytes, within: "within a record" })
    }

    /// Whether the last record was complete and is followed by a plausible record.
    pub(super) fn is_at_record(&mut self) -> Result<bool, RecordingProblem> {
        let offset = self.offset;
        let is_at_record = self.has_whole_record && matches!(self.head(), Ok((op::HEADER..=op::DATA_END, _)));
        self.seek(offset)?;
        Ok(is_at_record)
    }

    /// Seeks the next chunk with a correct checksum, from `from` on. Returns `false` if there is none.
    pub(super) fn find_chunk(&mut self, from: u64, body: &mut Vec<u8>) -> Result<bool, RecordingProblem> {
        let mut start = from;
        let mut window = Vec::new();
        while start + RECORD_HEAD_BYTES + CHUNK_HEAD_BYTES <= self.bytes {
            self.seek(start)?;
            window.clear();
            let mut next = (&mut self.file).take(SEARCH_BYTES as u64);
            next.read_to_end(&mut window).map_err(RecordingProblem::Unreadable)?;
            let head = (RECORD_HEAD_BYTES + CHUNK_HEAD_BYTES) as usize;
            for i in 0..window.len().saturating_sub(head) + 1 {
                let candidate = window.get(i..).unwrap_or_default();
                if looks_like_chunk(candidate) && self.is_intact_chunk(start + i as u64, body)? {
                    self.seek(start + i as u64)?;
                    return Ok(true);
                }
            }
            // The searched blocks overlap by the longest head of a chunk, so that no chunk is missed.
            let longest = head + MAX_NAME_BYTES as usize;
            let is_last = start + window.len() as u64 >= self.bytes;
            start += if is_last { window.len() } else { window.len().max(longest) - longest + 1 } as u64;
        }
        Ok(false)
    }

    fn is_intact_chunk(&mut self, offset: u64, body: &mut Vec<u8>) -> Result<bool, RecordingProblem> {
        self.seek(offset)?;
        let Ok((op::CHUNK, length)) = self.head() else { return Ok(false) };
        match self.body(length, body) {
            Err(problem @ RecordingProblem::Unreadable(_)) => Err(problem),
            read => Ok(read.is_ok() && chunk_records(body, offset).is_ok_and(|records| records.is_checked)),
        }
    }
}
