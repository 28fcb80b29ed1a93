//! Chunks: recognizes them, unpacks them, and returns the records of a chunk with a correct checksum.
//!
//! Fringeflow writes chunks without compression. Other programs that copy a recording compress them, most often with
//! lz4 or zstd. A chunk states how many bytes it unpacks to. Unpacking stops at that number, and the number is limited,
//! so no file makes the reader take more memory than [`MAX_UNPACKED_BYTES`].

use std::borrow::Cow;
use std::io::Read;

use lz4_flex::frame::FrameDecoder;
use mcap::records::op;
use ruzstd::decoding::StreamingDecoder;

use super::fault::damaged;
use crate::RecordingProblem;
use crate::fields::Fields;

/// Size of a chunk before its records, without the name of its compression, bytes.
pub(super) const CHUNK_HEAD_BYTES: u64 = 40;
/// Longest name of a compression that is read, bytes.
pub(super) const MAX_NAME_BYTES: u64 = 4;
/// Maximum size of the records of a compressed chunk, unpacked. Other programs write chunks of a few megabytes.
const MAX_UNPACKED_BYTES: u64 = 256 << 20;

/// How the records of a chunk are packed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Compression {
    None,
    Lz4,
    Zstd,
}

impl Compression {
    fn from_name(name: &str) -> Option<Self> {
        match name {
            "" => Some(Self::None),
            "lz4" => Some(Self::Lz4),
            "zstd" => Some(Self::Zstd),
            _ => None,
        }
    }
}

/// Fields of a chunk before its records, and the records as they are in the file.
struct ChunkParts<'a> {
    unpacked_bytes: u64,
    crc: u32,
    compression: &'a str,
    packed: &'a [u8],
}

impl<'a> ChunkParts<'a> {
    fn read(body: &'a [u8], start: u64) -> Result<Self, RecordingProblem> {
        let mut fields = Fields(body);
        let parts = (|| {
            fields.bytes(16)?;
            let (unpacked_bytes, crc, compression) = (fields.u64()?, fields.u32()?, fields.string()?);
            let length = fields.length()?;
            Some(Self { unpacked_bytes, crc, compression, packed: fields.bytes(length)? })
        })();
        let parts = parts.ok_or_else(|| damaged(start, "a chunk states more bytes than it has"))?;
        if fields.0.is_empty() {
            Ok(parts)
        } else {
            Err(damaged(start, "the lengths in a chunk contradict each other"))
        }
    }
}

/// Whether these bytes can be the start of a chunk that is read here, with consistent lengths.
pub(super) fn looks_like_chunk(bytes: &[u8]) -> bool {
    let mut fields = Fields(bytes);
    let mut lengths = || {
        fields.u8().filter(|&opcode| opcode == op::CHUNK)?;
        let length = fields.u64()?;
        fields.bytes(16)?;
        let unpacked = fields.u64()?;
        fields.u32()?;
        let name = fields.string()?;
        let packed = fields.u64()?;
        let whole = packed.checked_add(CHUNK_HEAD_BYTES + name.len() as u64)?;
        let is_possible = match Compression::from_name(name)? {
            Compression::None => unpacked == packed,
            Compression::Lz4 | Compression::Zstd => unpacked <= MAX_UNPACKED_BYTES,
        };
        Some(is_possible && whole == length)
    };
    lengths().unwrap_or(false)
}

/// The records of a chunk.
pub(crate) struct ChunkRecords<'a> {
    /// The records: those of the chunk itself, or unpacked ones.
    pub(crate) bytes: Cow<'a, [u8]>,
    /// Whether a checksum was compared.
    pub(super) is_checked: bool,
}

/// Returns the records of a chunk. `start` is the offset of the chunk in the file, for errors.
pub(crate) fn chunk_records(body: &[u8], start: u64) -> Result<ChunkRecords<'_>, RecordingProblem> {
    let parts = ChunkParts::read(body, start)?;
    let compression = Compression::from_name(parts.compression)
        .ok_or_else(|| RecordingProblem::Compressed { offset: start, compression: parts.compression.to_owned() })?;
    let bytes = match compression {
        Compression::None => Cow::Borrowed(parts.packed),
        Compression::Lz4 | Compression::Zstd => Cow::Owned(unpacked(&parts, compression, start)?),
    };
    if parts.unpacked_bytes != bytes.len() as u64 {
        let (stated, found) = (parts.unpacked_bytes, bytes.len());
        return Err(damaged(start, format!("a chunk states {stated} bytes of records, but has {found}")));
    }
    if parts.crc != 0 && parts.crc != crc32fast::hash(&bytes) {
        return Err(damaged(start, "the checksum of a chunk is wrong"));
    }
    Ok(ChunkRecords { bytes, is_checked: parts.crc != 0 })
}

/// Unpacks the records of a chunk, but no more bytes than one beyond what it states.
fn unpacked(parts: &ChunkParts<'_>, compression: Compression, start: u64) -> Result<Vec<u8>, RecordingProblem> {
    let stated = parts.unpacked_bytes;
    if stated > MAX_UNPACKED_BYTES {
        return Err(damaged(
            start,
            format!("a chunk states that it unpacks to {stated} bytes; it may have at most {MAX_UNPACKED_BYTES}"),
        ));
    }
    if stated == 0 && parts.packed.is_empty() {
        return Ok(Vec::new());
    }
    let name = parts.compression;
    let fail = |what: String| damaged(start, format!("a chunk cannot be unpacked ({name}): {what}"));
    // The buffer grows with the unpacked bytes, because the stated size may be wrong.
    let mut records = Vec::new();
    let read = match compression {
        Compression::Zstd => StreamingDecoder::new(parts.packed)
            .map_err(|e| fail(e.to_string()))?
            .take(stated + 1)
            .read_to_end(&mut records),
        Compression::None | Compression::Lz4 => {
            FrameDecoder::new(parts.packed).take(stated + 1).read_to_end(&mut records)
        }
    };
    read.map_err(|e| fail(e.to_string()))?;
    Ok(records)
}
