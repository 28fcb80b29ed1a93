//! The end of a file: what it says of itself is compared with what was found.

use std::collections::BTreeMap;

use mcap::MAGIC;
use mcap::records::op;

use super::file::Reader;
use super::{PRIVATE, Scan, damaged};
use crate::RecordingProblem;
use crate::fields::Fields;

impl Scan<'_, '_> {
    /// Compares a checksum; faults that were met before make it wrong, and are known already.
    pub(super) fn check_crc(
        &self,
        offset: u64,
        crc: u32,
        of: crc32fast::Hasher,
        what: &str,
    ) -> Result<(), RecordingProblem> {
        if crc == 0 || !self.scanned.faults.is_empty() || crc == of.finalize() {
            return Ok(());
        }
        Err(damaged(offset, format!("the checksum of {what} is wrong")))
    }

    /// A record of the summary: repetitions and indexes, which nobody needs who reads everything, and the statistics.
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

    /// Compares what was found with what the file says it holds.
    fn statistics(&mut self, start: u64, body: &[u8]) -> Result<(), RecordingProblem> {
        let mut fields = Fields(body);
        let parts = (|| {
            let (messages, _schemas, _channels) = (fields.u64()?, fields.u16()?, fields.u32()?);
            let counts = [fields.u32()?, fields.u32()?, fields.u32()?];
            fields.bytes(16)?;
            Some((messages, counts, fields.count_map()?))
        })();
        let (messages, [attachments, metadata, chunks], channels) =
            parts.ok_or_else(|| damaged(start, "the statistics are cut short"))?;
        self.contents.has_statistics = true;
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
        if let Some((what, said, found)) = compared.into_iter().find(|(_, said, found)| said != found) {
            return Err(damaged(start, format!("the statistics say {said} {what}, and {found} are there")));
        }
        let counts =
            |map: &BTreeMap<u16, u64>| map.iter().filter(|(_, n)| **n > 0).map(|(i, n)| (*i, *n)).collect::<Vec<_>>();
        if counts(&channels) != counts(&found.messages) {
            return Err(damaged(start, "the statistics count other messages by channel than are there"));
        }
        Ok(())
    }

    pub(super) fn footer(
        &mut self,
        start: u64,
        body: &[u8],
        mut crc_of: crc32fast::Hasher,
    ) -> Result<(), RecordingProblem> {
        let parts = (|| {
            let mut fields = Fields(body);
            fields.bytes(16)?;
            fields.u32()
        })();
        let crc = parts.ok_or_else(|| damaged(start, "the footer is cut short"))?;
        if !self.contents.has_ended {
            return Err(damaged(start, "the footer stands before the end of the data"));
        }
        // The checksum covers the footer too, up to itself.
        crc_of.update(&[op::FOOTER]);
        crc_of.update(&(body.len() as u64).to_le_bytes());
        crc_of.update(body.get(..16).unwrap_or_default());
        self.check_crc(start, crc, crc_of, "the summary")?;
        if crc != 0 && !self.contents.has_statistics {
            return Err(damaged(start, "the summary has no statistics"));
        }
        Ok(())
    }

    pub(super) fn end(&self, reader: &mut Reader<'_>) -> Result<(), RecordingProblem> {
        let start = reader.at;
        let mut magic = [0; MAGIC.len()];
        if !reader.fill(&mut magic)? {
            return Err(RecordingProblem::Unfinished { offset: reader.bytes, within: "within its last bytes" });
        }
        if magic != *MAGIC || reader.at != reader.bytes {
            return Err(damaged(start, "the last bytes are not those of an MCAP file"));
        }
        Ok(())
    }
}
