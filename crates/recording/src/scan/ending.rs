//! The end of a file: compares its statistics and checksums with the contents.

use std::collections::BTreeMap;

use mcap::MAGIC;
use mcap::records::op;

use super::fault::damaged;
use super::file::Reader;
use super::{PRIVATE, Scan};
use crate::RecordingProblem;
use crate::fields::Fields;

impl Scan<'_, '_> {
    /// Compares a checksum. After an earlier fault, the checksum does not match anyway and is ignored.
    pub(super) fn check_crc(
        &self,
        offset: u64,
        crc: u32,
        computed: crc32fast::Hasher,
        what: &str,
    ) -> Result<(), RecordingProblem> {
        if crc == 0 || !self.scanned.faults.is_empty() || crc == computed.finalize() {
            return Ok(());
        }
        Err(damaged(offset, format!("the checksum of {what} is wrong")))
    }

    /// Reads a record of the summary. Only the statistics are used; a full scan does not need the repeated records and
    /// indexes.
    pub(super) fn summary(&mut self, opcode: u8, start: u64, body: &[u8]) -> Result<(), RecordingProblem> {
        match opcode {
            op::STATISTICS => self.statistics(start, body),
            op::SCHEMA
            | op::CHANNEL
            | op::CHUNK_INDEX
            | op::ATTACHMENT_INDEX
            | op::METADATA_INDEX
            | op::SUMMARY_OFFSET
            | PRIVATE.. => Ok(()),
            _ => Err(damaged(start, format!("the summary has a record with code {opcode:#04x}"))),
        }
    }

    /// Compares the statistics with the contents.
    fn statistics(&mut self, start: u64, body: &[u8]) -> Result<(), RecordingProblem> {
        let mut fields = Fields(body);
        let parts = (|| {
            let (messages, _schemas, _channels) = (fields.u64()?, fields.u16()?, fields.u32()?);
            let counts = [fields.u32()?, fields.u32()?, fields.u32()?];
            fields.bytes(16)?;
            Some((messages, counts, fields.count_map()?))
        })();
        let (messages, [attachments, metadata, chunks], channels) =
            parts.ok_or_else(|| damaged(start, "the statistics are truncated"))?;
        if !self.scanned.faults.is_empty() {
            return Ok(());
        }
        let found = &self.contents;
        let counted: u64 = found.messages.values().sum();
        let compared = [
            ("messages", messages, counted),
            ("attachments", attachments.into(), found.attachments.into()),
            ("metadata records", metadata.into(), found.metadata.into()),
            ("chunks", chunks.into(), found.chunks.into()),
        ];
        if let Some((what, stated, found)) = compared.into_iter().find(|(_, stated, found)| stated != found) {
            return Err(damaged(start, format!("the statistics state {stated} {what}, but the file has {found}")));
        }
        let counts =
            |map: &BTreeMap<u16, u64>| map.iter().filter(|(_, n)| **n > 0).map(|(i, n)| (*i, *n)).collect::<Vec<_>>();
        if counts(&channels) != counts(&found.messages) {
            return Err(damaged(start, "the statistics differ from the messages by channel"));
        }
        Ok(())
    }

    /// Checks the footer and the checksum of the summary.
    pub(super) fn footer(
        &mut self,
        start: u64,
        body: &[u8],
        mut computed: crc32fast::Hasher,
    ) -> Result<(), RecordingProblem> {
        let parts = (|| {
            let mut fields = Fields(body);
            fields.bytes(16)?;
            fields.u32()
        })();
        let crc = parts.ok_or_else(|| damaged(start, "the footer is truncated"))?;
        if !self.contents.has_ended {
            return Err(damaged(start, "the footer is before the end of the data"));
        }
        // The checksum covers the footer up to the checksum itself.
        computed.update(&[op::FOOTER]);
        computed.update(&(body.len() as u64).to_le_bytes());
        computed.update(body.get(..16).unwrap_or_default());
        self.contents.has_footer = true;
        self.check_crc(start, crc, computed, "the summary")
    }

    /// Checks the last bytes of the file.
    pub(super) fn end(&self, reader: &mut Reader<'_>) -> Result<(), RecordingProblem> {
        let start = reader.offset;
        let mut magic = [0; MAGIC.len()];
        if !reader.fill(&mut magic)? {
            return Err(RecordingProblem::Unfinished { offset: reader.bytes, within: "within its last bytes" });
        }
        if magic != *MAGIC {
            return Err(damaged(start, "the last bytes are not those of an MCAP file"));
        }
        let (end, rest) = (reader.offset, reader.bytes - reader.offset);
        if rest == 0 {
            return Ok(());
        }
        let is_recording = reader.fill(&mut magic)? && magic == *MAGIC;
        let what = if is_recording { "another MCAP file" } else { "other data" };
        Err(damaged(end, format!("the recording ends here, but {rest} bytes of {what} follow it; they are not read")))
    }
}
