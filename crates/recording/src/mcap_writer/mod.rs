//! An MCAP file as it is written: uncompressed chunks with checksums, indexes, and a summary at the end (mcap.dev/spec).
//!
//! In: messages, each of bytes that are copied, as small ones are, or of a buffer that is handed over. Out: the same bytes that
//! the crate `mcap` writes, which is what its tests compare them with. The crate copies a message twice, into a chunk and out
//! of it, and sums it twice; here a buffer that was handed over goes from where it lies to the file, and is summed once.
//! The file never holds a chunk whose length is not known yet.

mod chunk;
mod records;
mod summary;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::io::{self, IoSlice, Write};

use crc32fast::Hasher;
use mcap::records::{MessageHeader, op};

use super::recordable::Encoded;
use chunk::Chunk;
use records::{push_map, push_record, push_string};
use summary::Summary;

pub(super) use chunk::Content;

/// Size beyond which a chunk is closed.
const CHUNK_BYTES: u64 = 4 << 20;

/// A schema as a channel names it.
#[derive(Clone, Copy, Debug)]
pub(super) struct Schema<'a> {
    pub(super) name: &'a str,
    pub(super) encoding: &'a str,
    pub(super) data: &'a [u8],
}

/// Something that lies beside the messages.
#[derive(Clone, Copy, Debug)]
pub(super) struct Attachment<'a> {
    pub(super) time_ns: u64,
    pub(super) name: &'a str,
    pub(super) media_type: &'a str,
    pub(super) data: &'a [u8],
}

/// A file that is being written. One that could not be written to is not to be used any more.
pub(super) struct McapWriter<W> {
    file: W,
    /// Bytes written, and the checksum of them.
    at: u64,
    crc: Hasher,
    chunk: Chunk,
    summary: Summary,
    /// Buffers whose content is in the file.
    released: Vec<Encoded>,
}

impl<W: Write> McapWriter<W> {
    /// Begins a file.
    pub(super) fn begin(file: W, profile: &str, library: &str) -> io::Result<Self> {
        let (chunk, summary) = (Chunk::default(), Summary::default());
        let mut writer = Self { file, at: 0, crc: Hasher::new(), chunk, summary, released: Vec::new() };
        let mut start = mcap::MAGIC.to_vec();
        push_record(&mut start, op::HEADER, |out| {
            push_string(out, profile);
            push_string(out, library);
        });
        writer.put(&start)?;
        Ok(writer)
    }

    /// Adds a channel of protobuf messages, and its schema unless another channel has brought it.
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

    /// Takes a buffer over, for messages that name it; it is [`Self::released`] when they are in the file.
    pub(super) fn hold(&mut self, buffer: Encoded) -> io::Result<usize> {
        // Both messages of a buffer stand in one chunk, which is the one that holds it.
        self.close_full_chunk()?;
        Ok(self.chunk.hold(buffer))
    }

    /// Adds a message of a channel that was added.
    pub(super) fn message(&mut self, header: &MessageHeader, content: Content<'_>) -> io::Result<()> {
        if matches!(content, Content::Copied(_)) {
            self.close_full_chunk()?;
        }
        self.summary.count_message(header);
        self.chunk.push_message(header, content);
        Ok(())
    }

    /// Buffers whose content is in the file since this was asked last.
    pub(super) fn released(&mut self) -> impl Iterator<Item = Encoded> {
        self.released.drain(..)
    }

    /// Adds an attachment, behind what came before.
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
        self.summary.add_attachment(attachment, self.at, record.len() as u64);
        self.put(&record)
    }

    /// Adds metadata, behind what came before.
    pub(super) fn metadata(&mut self, name: &str, entries: &BTreeMap<String, String>) -> io::Result<()> {
        self.close_chunk()?;
        let mut record = Vec::new();
        push_record(&mut record, op::METADATA, |out| {
            push_string(out, name);
            push_map(out, entries);
        });
        self.summary.add_metadata(name, self.at, record.len() as u64);
        self.put(&record)
    }

    /// Closes the chunk: everything is in the file that was added.
    pub(super) fn close_chunk(&mut self) -> io::Result<()> {
        if self.chunk.is_empty() {
            return Ok(());
        }
        let crc = self.chunk.crc();
        let head = self.chunk.head(crc.clone().finalize());
        let (indexes, offsets) = self.chunk.indexes(self.at + head.len() as u64 + self.chunk.bytes());
        self.summary.add_chunk(&self.chunk, self.at, head.len() as u64, &offsets, indexes.len() as u64);
        self.crc.update(&head);
        self.crc.combine(&crc);
        self.crc.update(&indexes);
        self.at += head.len() as u64 + self.chunk.bytes() + indexes.len() as u64;
        let mut pieces = vec![IoSlice::new(&head)];
        pieces.extend(self.chunk.pieces().map(IoSlice::new));
        pieces.push(IoSlice::new(&indexes));
        let written = write_all_vectored(&mut self.file, &mut pieces);
        drop(pieces);
        self.released.extend(self.chunk.clear());
        written
    }

    /// Writes what a file ends with; the file.
    pub(super) fn finish(mut self) -> io::Result<W> {
        self.close_chunk()?;
        let crc = self.crc.clone().finalize();
        let mut end = Vec::new();
        push_record(&mut end, op::DATA_END, |out| out.extend(crc.to_le_bytes()));
        let summary_at = self.at + end.len() as u64;
        end.extend(self.summary.written(summary_at));
        end.extend(mcap::MAGIC);
        self.file.write_all(&end)?;
        self.file.flush()?;
        Ok(self.file)
    }

    fn close_full_chunk(&mut self) -> io::Result<()> {
        if self.chunk.bytes() > CHUNK_BYTES { self.close_chunk() } else { Ok(()) }
    }

    /// Writes bytes that belong to the data, outside chunks.
    fn put(&mut self, bytes: &[u8]) -> io::Result<()> {
        self.crc.update(bytes);
        self.at += bytes.len() as u64;
        self.file.write_all(bytes)
    }
}

/// Writes all of the pieces, one after the other, with as few calls as the system lets.
fn write_all_vectored(file: &mut impl Write, mut pieces: &mut [IoSlice<'_>]) -> io::Result<()> {
    // Without those that are empty, of which a write of nothing would look like a full disk.
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
