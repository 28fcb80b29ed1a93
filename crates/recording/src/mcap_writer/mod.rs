//! Writes MCAP files: uncompressed chunks with checksums, indexes, and a summary at the end (mcap.dev/spec).
//!
//! In: messages, either as bytes that are copied, or as a buffer that is handed over. Out: the same bytes that the
//! `mcap` crate writes, as verified by the tests. The crate would copy each message twice, into a chunk and out of it,
//! and compute its checksum twice. Here a buffer is written directly, with one checksum. Also, the file never contains
//! a chunk without its length.

mod chunk;
mod records;
mod summary;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::io::{self, IoSlice, Write};

use crc32fast::Hasher;
use mcap::records::{MessageHeader, op};

use crate::recordable::Encoded;
use chunk::Chunk;
use records::{push_map, push_record, push_string};
use summary::Summary;
pub(super) use summary::{Attachment, Schema};

pub(super) use chunk::Content;

/// A chunk is closed when it is larger than this, bytes.
const CHUNK_BYTES: u64 = 4 << 20;

/// An unfinished file. After an error it must not be used any more.
pub(super) struct McapWriter<W> {
    file: W,
    /// Number and checksum of the bytes written.
    offset: u64,
    crc: Hasher,
    chunk: Chunk,
    summary: Summary,
    /// Buffers whose content is in the file.
    released: Vec<Encoded>,
}

impl<W: Write> McapWriter<W> {
    /// Starts a file.
    pub(super) fn begin(file: W, profile: &str, library: &str) -> io::Result<Self> {
        let (chunk, summary) = (Chunk::default(), Summary::default());
        let mut writer = Self { file, offset: 0, crc: Hasher::new(), chunk, summary, released: Vec::new() };
        let mut start = mcap::MAGIC.to_vec();
        push_record(&mut start, op::HEADER, |out| {
            push_string(out, profile);
            push_string(out, library);
        });
        writer.write(&start)?;
        Ok(writer)
    }

    /// Adds a channel of protobuf messages, and its schema if it is new.
    pub(super) fn add_channel(&mut self, id: u16, topic: &str, schema: Option<Schema<'_>>) {
        let schema_id = schema.map_or(0, |schema| {
            let (id, is_new) = self.summary.schema_id(schema);
            if is_new {
                self.chunk.push_record(self.summary.last_schema());
            }
            id
        });
        let mut channel = Vec::new();
        push_record(&mut channel, op::CHANNEL, |out| {
            out.extend(id.to_le_bytes());
            out.extend(schema_id.to_le_bytes());
            push_string(out, topic);
            push_string(out, "protobuf");
            push_map(out, &BTreeMap::new());
        });
        self.chunk.push_record(&channel);
        self.summary.channels.insert(id, channel);
    }

    /// Adds a buffer for the next messages and returns its index. The buffer is [`Self::released`] once the messages
    /// are in the file.
    pub(super) fn hold(&mut self, buffer: Encoded) -> io::Result<usize> {
        // Both messages of a buffer must be in the same chunk, which holds the buffer.
        self.close_full_chunk()?;
        Ok(self.chunk.hold(buffer))
    }

    /// Adds a message of a channel that was added before.
    pub(super) fn message(&mut self, header: &MessageHeader, content: Content<'_>) -> io::Result<()> {
        if matches!(content, Content::Copied(_)) {
            self.close_full_chunk()?;
        }
        self.summary.count_message(header);
        self.chunk.push_message(header, content);
        Ok(())
    }

    /// Returns the buffers whose content was written to the file since the last call.
    pub(super) fn released(&mut self) -> impl Iterator<Item = Encoded> {
        self.released.drain(..)
    }

    /// Adds an attachment after everything written so far.
    pub(super) fn attach(&mut self, attachment: &Attachment<'_>) -> io::Result<()> {
        self.close_chunk()?;
        let mut record = Vec::with_capacity(attachment.data.len() + 256);
        push_record(&mut record, op::ATTACHMENT, |out| {
            let start = out.len();
            out.extend(attachment.time_ns.to_le_bytes());
            out.extend(attachment.time_ns.to_le_bytes());
            push_string(out, attachment.name);
            push_string(out, attachment.media_type);
            out.extend((attachment.data.len() as u64).to_le_bytes());
            out.extend(attachment.data);
            let crc = crc32fast::hash(&out[start..]);
            out.extend(crc.to_le_bytes());
        });
        self.summary.add_attachment(attachment, self.offset, record.len() as u64);
        self.write(&record)
    }

    /// Adds metadata after everything written so far.
    pub(super) fn metadata(&mut self, name: &str, entries: &BTreeMap<String, String>) -> io::Result<()> {
        self.close_chunk()?;
        let mut record = Vec::new();
        push_record(&mut record, op::METADATA, |out| {
            push_string(out, name);
            push_map(out, entries);
        });
        self.summary.add_metadata(name, self.offset, record.len() as u64);
        self.write(&record)
    }

    /// Closes the chunk, so that everything added so far is in the file.
    pub(super) fn close_chunk(&mut self) -> io::Result<()> {
        if self.chunk.is_empty() {
            return Ok(());
        }
        // The checksum of the records is computed once, for the chunk and for the file.
        let crc = self.chunk.crc();
        let head = self.chunk.head(crc.clone().finalize());
        let (indexes, offsets) = self.chunk.indexes(self.offset + head.len() as u64 + self.chunk.bytes());
        self.summary.add_chunk(&self.chunk, self.offset, head.len() as u64, &offsets, indexes.len() as u64);
        self.crc.update(&head);
        self.crc.combine(&crc);
        self.crc.update(&indexes);
        self.offset += head.len() as u64 + self.chunk.bytes() + indexes.len() as u64;
        let mut pieces = vec![IoSlice::new(&head)];
        pieces.extend(self.chunk.pieces().map(IoSlice::new));
        pieces.push(IoSlice::new(&indexes));
        let written = write_all_vectored(&mut self.file, &mut pieces);
        drop(pieces);
        self.released.extend(self.chunk.clear());
        written
    }

    /// Writes the end of the file and returns the file.
    pub(super) fn finish(mut self) -> io::Result<W> {
        self.close_chunk()?;
        let crc = self.crc.clone().finalize();
        let mut end = Vec::new();
        push_record(&mut end, op::DATA_END, |out| out.extend(crc.to_le_bytes()));
        let summary_offset = self.offset + end.len() as u64;
        end.extend(self.summary.encode(summary_offset));
        end.extend(mcap::MAGIC);
        self.file.write_all(&end)?;
        self.file.flush()?;
        Ok(self.file)
    }

    fn close_full_chunk(&mut self) -> io::Result<()> {
        if self.chunk.bytes() > CHUNK_BYTES { self.close_chunk() } else { Ok(()) }
    }

    /// Writes data outside of chunks.
    fn write(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.crc.update(bytes);
        self.offset += bytes.len() as u64;
        self.file.write_all(bytes)
    }
}

/// Writes all pieces in sequence, with as few system calls as possible.
fn write_all_vectored(file: &mut impl Write, mut pieces: &mut [IoSlice<'_>]) -> io::Result<()> {
    // Empty pieces are skipped first, because writing zero bytes would look like a full disk.
    IoSlice::advance_slices(&mut pieces, 0);
    while !pieces.is_empty() {
        match file.write_vectored(pieces) {
            Ok(0) => return Err(io::ErrorKind::WriteZero.into()),
            Ok(written) => IoSlice::advance_slices(&mut pieces, written),
            Err(e) if e.kind() == io::ErrorKind::Interrupted => {}
            Err(e) => return Err(e),
        }
    }
    Ok(())
}
