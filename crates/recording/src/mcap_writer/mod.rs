//! Writes MCAP files: uncompressed chunks with checksums, indexes, and a summary at the end (mcap.dev/spec).
//!
//! In: messages. Out: the same bytes that the `mcap` crate writes, as verified by the tests. The crate would copy each
//! message twice, into a chunk and out of it, and compute its checksum twice. Here a message is copied and summed once,
//! into the memory from which the disk takes it. The head of a chunk is filled in when the chunk is closed, and nothing
//! of the chunk is written before. So the file never contains a chunk without its length.

mod chunk;
mod records;
mod summary;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;
use std::io;

use crc32fast::Hasher;
use mcap::records::{MessageHeader, op};

use crate::block_writer::BlockWriter;
use chunk::{Chunk, HEAD_BYTES};
use records::{push_map, push_record, push_string};
use summary::Summary;
pub(super) use summary::{Attachment, Schema};

/// A chunk is closed when it is larger than this, bytes.
const CHUNK_BYTES: u64 = 4 << 20;
/// Size of the fields before the content of a message, bytes: channel, sequence number and two times.
const MESSAGE_HEAD_BYTES: u64 = 2 + 4 + 8 + 8;

/// An unfinished file. After an error it must not be used any more.
pub(super) struct McapWriter {
    file: BlockWriter,
    /// Checksum of everything before the chunk.
    crc: Hasher,
    /// `None` between chunks.
    chunk: Option<Chunk>,
    summary: Summary,
}

impl McapWriter {
    /// Starts a file.
    pub(super) fn begin(file: BlockWriter, profile: &str, library: &str) -> Self {
        let mut writer = Self { file, crc: Hasher::new(), chunk: None, summary: Summary::default() };
        let mut start = mcap::MAGIC.to_vec();
        push_record(&mut start, op::HEADER, |out| {
            push_string(out, profile);
            push_string(out, library);
        });
        writer.file.push(&start, &mut writer.crc);
        writer
    }

    /// Adds a channel of protobuf messages, and its schema if it is new.
    pub(super) fn add_channel(&mut self, id: u16, topic: &str, schema: Option<Schema<'_>>) {
        let chunk = open_chunk(&mut self.chunk, &mut self.file);
        let schema_id = schema.map_or(0, |schema| {
            let (id, is_new) = self.summary.schema_id(schema);
            if is_new {
                self.file.push(self.summary.last_schema(), &mut chunk.crc);
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
        self.file.push(&channel, &mut chunk.crc);
        self.summary.channels.insert(id, channel);
    }

    /// Adds a message of a channel that was added before. Its content is in two parts.
    pub(super) fn message(&mut self, header: &MessageHeader, content: [&[u8]; 2]) -> io::Result<()> {
        if self.chunk.as_ref().is_some_and(|chunk| chunk.bytes(self.file.offset()) > CHUNK_BYTES) {
            self.close_chunk()?;
        }
        self.summary.count_message(header);
        let chunk = open_chunk(&mut self.chunk, &mut self.file);
        chunk.add_message(header, self.file.offset());
        let content_bytes: usize = content.iter().map(|part| part.len()).sum();
        let mut head = vec![op::MESSAGE];
        head.extend((MESSAGE_HEAD_BYTES + content_bytes as u64).to_le_bytes());
        head.extend(header.channel_id.to_le_bytes());
        head.extend(header.sequence.to_le_bytes());
        head.extend(header.log_time.to_le_bytes());
        head.extend(header.publish_time.to_le_bytes());
        let [first, second] = content;
        [&head, first, second].into_iter().for_each(|part| self.file.push(part, &mut chunk.crc));
        Ok(())
    }

    /// Adds an attachment after everything added so far.
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
        self.summary.add_attachment(attachment, self.file.offset(), record.len() as u64);
        self.file.push(&record, &mut self.crc);
        self.file.write_blocks()
    }

    /// Adds metadata after everything added so far.
    pub(super) fn metadata(&mut self, name: &str, entries: &BTreeMap<String, String>) -> io::Result<()> {
        self.close_chunk()?;
        let mut record = Vec::new();
        push_record(&mut record, op::METADATA, |out| {
            push_string(out, name);
            push_map(out, entries);
        });
        self.summary.add_metadata(name, self.file.offset(), record.len() as u64);
        self.file.push(&record, &mut self.crc);
        Ok(())
    }

    /// Closes the chunk and hands everything added so far to the kernel, so that it is kept if the process dies.
    pub(super) fn flush(&mut self) -> io::Result<()> {
        self.close_chunk()?;
        self.file.hand_over()
    }

    /// Writes the end of the file.
    pub(super) fn finish(mut self) -> io::Result<()> {
        self.close_chunk()?;
        let crc = self.crc.clone().finalize();
        let mut end = Vec::new();
        push_record(&mut end, op::DATA_END, |out| out.extend(crc.to_le_bytes()));
        let summary_offset = self.file.offset() + end.len() as u64;
        end.extend(self.summary.encode(summary_offset));
        end.extend(mcap::MAGIC);
        self.file.push(&end, &mut self.crc);
        self.file.hand_over()
    }

    /// Closes the chunk and writes its whole blocks.
    fn close_chunk(&mut self) -> io::Result<()> {
        let Some(chunk) = self.chunk.take() else { return Ok(()) };
        let end = self.file.offset();
        let head = chunk.head(end);
        let (indexes, offsets) = chunk.indexes(end);
        self.summary.add_chunk(&chunk, end, &offsets, indexes.len() as u64);
        self.file.replace(chunk.start, &head);
        self.crc.update(&head);
        // The checksum of the records is computed once, for the chunk and for the file.
        self.crc.combine(&chunk.crc);
        self.file.push(&indexes, &mut self.crc);
        self.file.write_blocks()
    }
}

/// Returns the chunk; starts one, with room for its head, if there is none.
fn open_chunk<'a>(chunk: &'a mut Option<Chunk>, file: &mut BlockWriter) -> &'a mut Chunk {
    chunk.get_or_insert_with(|| {
        let start = file.offset();
        file.push(&[0; HEAD_BYTES], &mut Hasher::new());
        Chunk::new(start)
    })
}
