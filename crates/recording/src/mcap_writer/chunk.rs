//! The unfinished chunk: small parts that were copied, and held buffers between them.

use std::collections::BTreeMap;
use std::ops::Range;

use crc32fast::Hasher;
use mcap::records::{MessageHeader, op};

use super::records::{push_counted, push_record, short};
use crate::recordable::Encoded;

/// Size of the fields before the content of a message, bytes: channel, sequence number and two times.
const MESSAGE_HEAD_BYTES: u64 = 2 + 4 + 8 + 8;

/// Content of a message.
#[derive(Clone, Debug)]
pub(crate) enum Content<'a> {
    /// Bytes to be copied.
    Copied(&'a [u8]),
    /// A range of a held buffer, by its index.
    Held(usize, Range<usize>),
}

/// Records that are not written yet.
#[derive(Debug, Default)]
pub(super) struct Chunk {
    /// All bytes that are not in held buffers.
    copied: Vec<u8>,
    buffers: Vec<Encoded>,
    /// Held parts: number of `copied` bytes before the part, index of its buffer, and range in the buffer.
    parts: Vec<(usize, usize, Range<usize>)>,
    bytes: u64,
    /// Times of the first and the last message.
    bounds_ns: Option<[u64; 2]>,
    /// Time and offset of each message, by channel.
    messages: BTreeMap<u16, Vec<(u64, u64)>>,
}

impl Chunk {
    pub(super) fn is_empty(&self) -> bool {
        self.bytes == 0
    }

    /// Size of all records, bytes.
    pub(super) fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Times of the first and the last message; 0 without messages.
    pub(super) fn bounds_ns(&self) -> [u64; 2] {
        self.bounds_ns.unwrap_or_default()
    }

    /// Adds a buffer and returns its index.
    pub(super) fn hold(&mut self, buffer: Encoded) -> usize {
        self.buffers.push(buffer);
        self.buffers.len() - 1
    }

    /// Adds a complete record.
    pub(super) fn push_record(&mut self, record: &[u8]) {
        self.copied.extend(record);
        self.bytes += record.len() as u64;
    }

    /// Adds a message.
    pub(super) fn push_message(&mut self, header: &MessageHeader, content: Content<'_>) {
        let length = match &content {
            Content::Copied(bytes) => bytes.len(),
            Content::Held(_, range) => range.len(),
        };
        let [first, last] = self.bounds_ns.unwrap_or([header.log_time; 2]);
        self.bounds_ns = Some([first.min(header.log_time), last.max(header.log_time)]);
        self.messages.entry(header.channel_id).or_default().push((header.log_time, self.bytes));
        let start = self.copied.len();
        self.copied.push(op::MESSAGE);
        self.copied.extend((MESSAGE_HEAD_BYTES + length as u64).to_le_bytes());
        self.copied.extend(header.channel_id.to_le_bytes());
        self.copied.extend(header.sequence.to_le_bytes());
        self.copied.extend(header.log_time.to_le_bytes());
        self.copied.extend(header.publish_time.to_le_bytes());
        self.bytes += (self.copied.len() - start + length) as u64;
        match content {
            Content::Copied(bytes) => self.copied.extend(bytes),
            Content::Held(buffer, range) => self.parts.push((self.copied.len(), buffer, range)),
        }
    }

    /// Returns all bytes of the records in their order.
    pub(super) fn pieces(&self) -> impl Iterator<Item = &[u8]> {
        let starts = std::iter::once(0).chain(self.parts.iter().map(|(before, ..)| *before));
        let ends = self.parts.iter().map(|(before, ..)| *before).chain([self.copied.len()]);
        let copied = starts.zip(ends).map(|(start, end)| &self.copied[start..end]);
        let parts = self.parts.iter().map(|(_, buffer, range)| self.buffers[*buffer].slices(range));
        let parts = parts.chain([Default::default()]);
        copied.zip(parts).flat_map(|(copied, [encoded, held])| [copied, encoded, held])
    }

    /// Returns the checksum of the records.
    pub(super) fn crc(&self) -> Hasher {
        let mut crc = Hasher::new();
        self.pieces().for_each(|piece| crc.update(piece));
        crc
    }

    /// Returns the start of the chunk record, up to the records.
    pub(super) fn head(&self, crc: u32) -> Vec<u8> {
        let mut head = Vec::new();
        push_record(&mut head, op::CHUNK, |out| {
            out.extend(self.bounds_ns().into_iter().flat_map(u64::to_le_bytes));
            out.extend(self.bytes.to_le_bytes());
            out.extend(crc.to_le_bytes());
            // The name of the compression is empty: no compression.
            out.extend(short(0));
            out.extend(self.bytes.to_le_bytes());
        });
        // The length of the chunk record includes the records, which are not part of this head.
        let content = (head.len() - 9) as u64 + self.bytes;
        head[1..9].copy_from_slice(&content.to_le_bytes());
        head
    }

    /// Returns the message indexes after the chunk, which start at `offset` in the file, and the offset of each.
    pub(super) fn indexes(&self, offset: u64) -> (Vec<u8>, BTreeMap<u16, u64>) {
        let mut out = Vec::new();
        let mut offsets = BTreeMap::new();
        for (channel, messages) in &self.messages {
            offsets.insert(*channel, offset + out.len() as u64);
            push_record(&mut out, op::MESSAGE_INDEX, |out| {
                out.extend(channel.to_le_bytes());
                let entries = |out: &mut Vec<u8>| {
                    for (log_ns, message_offset) in messages {
                        out.extend(log_ns.to_le_bytes());
                        out.extend(message_offset.to_le_bytes());
                    }
                };
                push_counted(out, entries, short);
            });
        }
        (out, offsets)
    }

    /// Empties the chunk and returns its buffers. Their held content is dropped.
    pub(super) fn clear(&mut self) -> impl Iterator<Item = Encoded> {
        self.copied.clear();
        self.parts.clear();
        self.messages.clear();
        (self.bytes, self.bounds_ns) = (0, None);
        self.buffers.drain(..).map(|buffer| Encoded { held: None, ..buffer })
    }
}
