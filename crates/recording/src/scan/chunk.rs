//! Chunks: recognizes them, and returns the records of a chunk with a correct checksum.

use mcap::records::op;

use super::fault::damaged;
use crate::RecordingProblem;
use crate::fields::Fields;

/// Size of an uncompressed chunk before its records, bytes.
pub(super) const CHUNK_HEAD_BYTES: u64 = 40;

/// Whether these bytes can be the start of a chunk: uncompressed, with consistent lengths.
pub(super) fn looks_like_chunk(bytes: &[u8]) -> bool {
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

/// Returns the records of a chunk, and whether it has a checksum.
pub(super) fn chunk_records(body: &[u8], start: u64) -> Result<(&[u8], bool), RecordingProblem> {
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
        parts.ok_or_else(|| damaged(start, "a chunk states more bytes than it has"))?;
    if !compression.is_empty() {
        return Err(RecordingProblem::Compressed { offset: start, compression: compression.to_owned() });
    }
    if uncompressed != records.len() || !fields.0.is_empty() {
        return Err(damaged(start, "the lengths in a chunk contradict each other"));
    }
    if crc != 0 && crc != crc32fast::hash(records) {
        return Err(damaged(start, "the checksum of a chunk is wrong"));
    }
    Ok((records, crc != 0))
}
