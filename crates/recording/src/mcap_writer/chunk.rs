//! The chunk in the making: small things copied one after the other, and buffers between them that lie where they are.

use std::collections::BTreeMap;
use std::ops::Range;

use crc32fast::Hasher;
use mcap::records::{MessageHeader, op};

use super::records::{push_counted, push_record, short};
use crate::recordable::Encoded;

/// Channel, sequence number and two times before the content of a message.
const MESSAGE_HEAD_BYTES: u64 = 2 + 4 + 8 + 8;

/// Where the content of a message is.
#[derive(Clone, Debug)]
pub(crate) enum Content<'a> {
    /// Here; it is copied.
    Copied(&'a [u8]),
    /// In a buffer that the chunk holds, by its number.
    Held(usize, Range<usize>),
}

/// Records that are not in the file yet.
#[derive(Debug, Default)]
pub(super) struct Chunk {
    /// Everything but what lies in buffers.
    small: Vec<u8>,
    buffers: Vec<Encoded>,
    /// Parts of buffers, each with how many bytes of `small` come before it.
    parts: Vec<(usize, usize, Range<usize>)>,
    bytes: u64,
    /// Times of the first and the last message.
    bounds_ns: Option<[u64; 2]>,
    /// Per channel time and place of each message.
    messages: BTreeMap<u16, Vec<(u64, u64)>>,
}

impl Chunk {
    pub(super) fn is_empty(&self) -> bool {
        self.bytes == 0
    }

    /// Bytes of all records.
    pub(super) fn bytes(&self) -> u64 {
        self.bytes
    }

    /// Times of the first and the last message; 0 of a chunk without any.
    pub(super) fn bounds_ns(&self) -> [u64; 2] {
        self.bounds_ns.unwrap_or_default()
    }

    pub(super) fn hold(&mut self, buffer: Encoded) -> usize {
        self.buffers.push(buffer);
        self.buffers.len() - 1
    }

    /// Adds a whole record.
    pub(super) fn push_record(&mut self, record: &[u8]) {
        self.small.extend(record);
        self.bytes += record.len() as u64;
    }

    pub(super) fn push_message(&mut self, header: &MessageHeader, content: Content<'_>) {
        let length = match &content {
            Content::Copied(bytes) => bytes.len(),
            Content::Held(_, range) => range.len(),
        };
        let [first, last] = self.bounds_ns.unwrap_or([header.log_time; 2]);
        self.bounds_ns = Some([first.min(header.log_time), last.max(header.log_time)]);
        self.messages.entry(header.channel_id).or_default().push((header.log_time, self.bytes));
        let start = self.small.len();
        self.small.push(op::MESSAGE);
        self.small.extend((MESSAGE_HEAD_BYTES + length as u64).to_le_bytes());
        self.small.extend(header.channel_id.to_le_bytes());
        self.small.extend(header.sequence.to_le_bytes());
        self.small.extend(header.log_time.to_le_bytes());
        self.small.extend(header.publish_time.to_le_bytes());
        self.bytes += (self.small.len() - start + length) as u64;
        match content {
            Content::Copied(bytes) => self.small.extend(bytes),
            Content::Held(buffer, range) => self.parts.push((self.small.len(), buffer, range)),
        }
    }

    /// All bytes of the records in their order.
    pub(super) fn pieces(&self) -> impl Iterator<Item = &[u8]> {
        let starts = std::iter::once(0).chain(self.parts.iter().map(|(before, ..)| *before));
        let ends = self.parts.iter().map(|(before, ..)| *before).chain([self.small.len()]);
        let copied = starts.zip(ends).map(|(start, end)| &self.small[start..end]);
        let parts = self.parts.iter().map(|(_, buffer, range)| self.buffers[*buffer].slices(range));
        let parts = parts.chain([Default::default()]);
        copied.zip(parts).flat_map(|(copied, [encoded, held])| [copied, encoded, held])
    }

    /// The checksum of the records.
    pub(super) fn crc(&self) -> Hasher {
        let mut crc = Hasher::new();
        self.pieces().for_each(|piece| crc.update(piece));
        crc
    }

    /// What stands before the records.
    pub(super) fn head(&self, crc: u32) -> Vec<u8> {
        let mut head = Vec::new();
        push_record(&mut head, op::CHUNK, |out| {
            out.extend(self.bounds_ns().into_iter().flat_map(u64::to_le_bytes));
            out.extend(self.bytes.to_le_bytes());
            out.extend(crc.to_le_bytes());
            // No compression.
            out.extend(short(0));
            out.extend(self.bytes.to_le_bytes());
        });
        let content = (head.len() - 9) as u64 + self.bytes;
        head[1..9].copy_from_slice(&content.to_le_bytes());
        head
    }

    /// What stands behind the records, at `at` in the file: where each message is; and where each of these indexes is.
    pub(super) fn indexes(&self, at: u64) -> (Vec<u8>, BTreeMap<u16, u64>) {
        let mut out = Vec::new();
        let mut offsets = BTreeMap::new();
        for (channel, messages) in &self.messages {
            offsets.insert(*channel, at + out.len() as u64);
            push_record(&mut out, op::MESSAGE_INDEX, |out| {
                out.extend(channel.to_le_bytes());
                let entries = |out: &mut Vec<u8>| {
                    for (log_ns, offset) in messages {
                        out.extend(log_ns.to_le_bytes());
                        out.extend(offset.to_le_bytes());
                    }
                };
                push_counted(out, entries, short);
            });
        }
        (out, offsets)
    }

    /// Empties the chunk; the buffers that it held, without what these held.
    pub(super) fn clear(&mut self) -> impl Iterator<Item = Encoded> {
        self.small.clear();
        self.parts.clear();
        self.messages.clear();
        (self.bytes, self.bounds_ns) = (0, None);
        self.buffers.drain(..).map(|buffer| Encoded { held: None, ..buffer })
    }
}
