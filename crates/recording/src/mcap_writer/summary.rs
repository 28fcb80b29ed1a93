//! The summary at the end of a file: its contents and their offsets.

use std::collections::BTreeMap;

use mcap::records::{MessageHeader, op};

use super::chunk::Chunk;
use super::records::{push_numbers, push_record, push_string, short};

/// Schema of a channel.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Schema<'a> {
    pub(crate) name: &'a str,
    pub(crate) encoding: &'a str,
    pub(crate) data: &'a [u8],
}

/// An attachment.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Attachment<'a> {
    pub(crate) time_ns: u64,
    pub(crate) name: &'a str,
    pub(crate) media_type: &'a str,
    pub(crate) data: &'a [u8],
}

/// The summary so far. The records are already encoded.
#[derive(Debug, Default)]
pub(super) struct Summary {
    schemas: Vec<Vec<u8>>,
    pub(super) channels: BTreeMap<u16, Vec<u8>>,
    messages: BTreeMap<u16, u64>,
    bounds_ns: Option<[u64; 2]>,
    chunks: u32,
    chunk_indexes: Vec<u8>,
    attachments: u32,
    attachment_indexes: Vec<u8>,
    metadata: u32,
    metadata_indexes: Vec<u8>,
}

impl Summary {
    /// Returns the id of a schema, and whether the schema is new.
    pub(super) fn schema_id(&mut self, schema: Schema<'_>) -> (u16, bool) {
        let record = |id: u16| {
            let mut record = Vec::new();
            push_record(&mut record, op::SCHEMA, |out| {
                out.extend(id.to_le_bytes());
                push_string(out, schema.name);
                push_string(out, schema.encoding);
                out.extend(short(schema.data.len() as u64));
                out.extend(schema.data);
            });
            record
        };
        let known = (1..).zip(&self.schemas).find_map(|(id, known)| (*known == record(id)).then_some(id));
        known.map_or_else(
            || {
                let id = self.schemas.len() as u16 + 1;
                self.schemas.push(record(id));
                (id, true)
            },
            |id| (id, false),
        )
    }

    /// Returns the record of the newest schema.
    pub(super) fn last_schema(&self) -> &[u8] {
        self.schemas.last().map_or(&[], Vec::as_slice)
    }

    /// Counts a message.
    pub(super) fn count_message(&mut self, header: &MessageHeader) {
        *self.messages.entry(header.channel_id).or_default() += 1;
        let [first, last] = self.bounds_ns.unwrap_or([header.log_time; 2]);
        self.bounds_ns = Some([first.min(header.log_time), last.max(header.log_time)]);
    }

    /// Adds a chunk that ends at `end` in the file, and the message indexes after it.
    pub(super) fn add_chunk(&mut self, chunk: &Chunk, end: u64, index_offsets: &BTreeMap<u16, u64>, index_bytes: u64) {
        self.chunks += 1;
        push_record(&mut self.chunk_indexes, op::CHUNK_INDEX, |out| {
            out.extend(chunk.bounds_ns().into_iter().flat_map(u64::to_le_bytes));
            out.extend(chunk.start.to_le_bytes());
            out.extend((end - chunk.start).to_le_bytes());
            push_numbers(out, index_offsets);
            out.extend(index_bytes.to_le_bytes());
            push_string(out, "");
            out.extend(chunk.bytes(end).to_le_bytes());
            out.extend(chunk.bytes(end).to_le_bytes());
        });
    }

    /// Adds an attachment of `bytes` at `offset`.
    pub(super) fn add_attachment(&mut self, attachment: &Attachment<'_>, offset: u64, bytes: u64) {
        self.attachments += 1;
        push_record(&mut self.attachment_indexes, op::ATTACHMENT_INDEX, |out| {
            let data_bytes = attachment.data.len() as u64;
            let numbers = [offset, bytes, attachment.time_ns, attachment.time_ns, data_bytes];
            out.extend(numbers.into_iter().flat_map(u64::to_le_bytes));
            push_string(out, attachment.name);
            push_string(out, attachment.media_type);
        });
    }

    /// Adds metadata of `bytes` at `offset`.
    pub(super) fn add_metadata(&mut self, name: &str, offset: u64, bytes: u64) {
        self.metadata += 1;
        push_record(&mut self.metadata_indexes, op::METADATA_INDEX, |out| {
            out.extend([offset, bytes].into_iter().flat_map(u64::to_le_bytes));
            push_string(out, name);
        });
    }

    /// Encodes the summary and the footer, which start at `offset`.
    pub(super) fn encode(&self, offset: u64) -> Vec<u8> {
        let groups = [
            (op::SCHEMA, self.schemas.concat()),
            (op::CHANNEL, self.channels.values().flatten().copied().collect()),
            (op::STATISTICS, self.statistics()),
            (op::CHUNK_INDEX, self.chunk_indexes.clone()),
            (op::ATTACHMENT_INDEX, self.attachment_indexes.clone()),
            (op::METADATA_INDEX, self.metadata_indexes.clone()),
        ];
        let (mut out, mut offsets) = (Vec::new(), Vec::new());
        for (opcode, records) in groups.into_iter().filter(|(_, records)| !records.is_empty()) {
            push_record(&mut offsets, op::SUMMARY_OFFSET, |record| {
                record.push(opcode);
                record.extend((offset + out.len() as u64).to_le_bytes());
                record.extend((records.len() as u64).to_le_bytes());
            });
            out.extend(records);
        }
        let offsets_start = offset + out.len() as u64;
        out.extend(offsets);
        out.push(op::FOOTER);
        // The checksum covers the footer up to the checksum itself.
        out.extend((8_u64 + 8 + 4).to_le_bytes());
        out.extend([offset, offsets_start].into_iter().flat_map(u64::to_le_bytes));
        let crc = crc32fast::hash(&out);
        out.extend(crc.to_le_bytes());
        out
    }

    fn statistics(&self) -> Vec<u8> {
        let mut record = Vec::new();
        push_record(&mut record, op::STATISTICS, |out| {
            out.extend(self.messages.values().sum::<u64>().to_le_bytes());
            out.extend((self.schemas.len() as u16).to_le_bytes());
            let counts = [self.channels.len() as u32, self.attachments, self.metadata, self.chunks];
            out.extend(counts.into_iter().flat_map(u32::to_le_bytes));
            out.extend(self.bounds_ns.unwrap_or_default().into_iter().flat_map(u64::to_le_bytes));
            push_numbers(out, &self.messages);
        });
        record
    }
}
