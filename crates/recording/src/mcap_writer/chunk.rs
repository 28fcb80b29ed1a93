//! The unfinished chunk: where it starts, its checksum, and the index of its messages.

use std::collections::BTreeMap;

use crc32fast::Hasher;
use mcap::records::{MessageHeader, op};

use super::records::{push_counted, push_record, short};

/// Size of the chunk record before the records in it, bytes: opcode, length, and the fields of [`Chunk::head`].
pub(super) const HEAD_BYTES: usize = 9 + 40;

/// A chunk that is not closed yet.
#[derive(Debug)]
pub(super) struct Chunk {
    /// Start of the chunk record in the file.
    pub(super) start: u64,
    /// Checksum of the records.
    pub(super) crc: Hasher,
    /// Times of the first and the last message.
    bounds_ns: Option<[u64; 2]>,
    /// Time and offset of each message, by channel.
    messages: BTreeMap<u16, Vec<(u64, u64)>>,
}

impl Chunk {
    pub(super) fn new(start: u64) -> Self {
        Self { start, crc: Hasher::new(), bounds_ns: None, messages: BTreeMap::new() }
    }

    /// Size of the records up to `end` in the file, bytes.
    pub(super) fn bytes(&self, end: u64) -> u64 {
        end - self.start - HEAD_BYTES as u64
    }

    /// Times of the first and the last message; 0 without messages.
    pub(super) fn bounds_ns(&self) -> [u64; 2] {
        self.bounds_ns.unwrap_or_default()
    }

    /// Adds a message to the index. Its record starts at `offset` in the file.
    pub(super) fn add_message(&mut self, header: &MessageHeader, offset: u64) {
        let [first, last] = self.bounds_ns.unwrap_or([header.log_time; 2]);
        self.bounds_ns = Some([first.min(header.log_time), last.max(header.log_time)]);
        let message = (header.log_time, self.bytes(offset));
        self.messages.entry(header.channel_id).or_default().push(message);
    }

    /// Returns the start of the chunk record, up to the records, which end at `end` in the file.
    pub(super) fn head(&self, end: u64) -> [u8; HEAD_BYTES] {
        let bytes = self.bytes(end);
        let mut fields = vec![op::CHUNK];
        fields.extend((HEAD_BYTES as u64 - 9 + bytes).to_le_bytes());
        fields.extend(self.bounds_ns().into_iter().flat_map(u64::to_le_bytes));
        fields.extend(bytes.to_le_bytes());
        fields.extend(self.crc.clone().finalize().to_le_bytes());
        // The name of the compression is empty: no compression.
        fields.extend(short(0));
        fields.extend(bytes.to_le_bytes());
        let mut head = [0; HEAD_BYTES];
        head.copy_from_slice(&fields);
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
}
