//! Recovers a truncated, damaged or unfinished recording: writes a complete recording with all readable parts.
//!
//! Data with a correct checksum are kept. The rest is skipped and reported: truncated or altered chunks, and headers
//! without their message. The new file states that it was recovered, and counts its messages.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;

use prost::bytes::Bytes;
use serde::Serialize;

use crate::collected::{NEEDED, check_version, other_program};
use crate::content::Header;
use crate::counts::recovered_account;
use crate::pairing::Pairing;
use crate::place::{Place, PlaceReader};
use crate::recordable::Times;
use crate::scan::{Found, FoundMessage, ScanMode, Scanned, scan};
use crate::writer::RecordingWriter;
use crate::{
    Content, Losses, METADATA, RECORDER_METADATA, Recording, RecordingError, RecordingProblem, Topic,
    UNFINISHED_RECOVERY,
};

/// Result of a recovery.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Recovered {
    /// Number of recovered messages, by topic, without headers.
    pub messages: BTreeMap<&'static str, u64>,
    /// Number of messages skipped: headers without their message, messages without their header, and invalid content.
    pub left_out: u64,
    /// Number of messages of other programs, by topic, which are skipped as well.
    pub foreign: BTreeMap<String, u64>,
    /// Missing attachments and metadata that a measurement needs.
    pub missing: Vec<&'static str>,
    /// Faults of the file, in the order of their offsets.
    pub faults: Vec<String>,
    /// Whether a fault is in the data, and not only in the summary after them.
    pub has_data_fault: bool,
    /// What was lost; `None` if it cannot be opened because parts are missing.
    #[serde(flatten)]
    pub losses: Option<Losses>,
}

impl Recovered {
    /// Says what was lost in the run and what the new recording lacks; `None` if nothing is missing.
    #[must_use]
    pub fn loss(&self) -> Option<String> {
        let foreign: u64 = self.foreign.values().sum();
        let losses = self.losses.as_ref().filter(|losses| losses.is_loss());
        let parts = [
            losses.map(Losses::to_string),
            (self.left_out > 0).then(|| format!("{} invalid or incomplete messages were left out", self.left_out)),
            (foreign > 0).then(|| format!("{foreign} messages that Fringeflow does not read were left out")),
        ];
        let parts: Vec<String> = parts.into_iter().flatten().collect();
        match parts.is_empty() {
            true => self.has_data_fault.then(|| "what was at the faults is lost".to_owned()),
            false => Some(parts.join("; ")),
        }
    }
}

/// Writes all readable parts of `damaged` to the new recording `target`.
///
/// # Errors
/// The file cannot be read, is not a recording of Fringeflow, is of a newer version, or has nothing that can be read; or
/// the new file cannot be written.
pub fn recover(damaged: &Path, target: &Path, min_free_bytes: u64) -> Result<Recovered, RecordingError> {
    let unreadable = |e| RecordingProblem::Unreadable(e).in_file(damaged);
    let file = File::open(damaged).map_err(unreadable)?;
    let mut recovery = Recovery {
        source: PlaceReader::new(file.try_clone().map_err(unreadable)?),
        writer: RecordingWriter::create_empty(target, UNFINISHED_RECOVERY, min_free_bytes)?,
        recovered: Recovered::default(),
        found: Vec::new(),
        account: BTreeMap::new(),
        pairing: Pairing::default(),
    };
    let scanned = scan(&file, ScanMode::Tolerant, &mut |found| recovery.add(found));
    match scanned.and_then(|scanned| recovery.check(&scanned).map(|()| scanned)) {
        Ok(scanned) => recovery.finish(scanned, target),
        Err(problem) => {
            let file = if problem.is_about_writing() { target } else { damaged };
            recovery.writer.discard();
            Err(problem.in_file(file))
        }
    }
}

/// Describes a fault without its remedy, since recovery is the remedy.
fn fault_text(problem: &RecordingProblem) -> String {
    match problem {
        RecordingProblem::Unfinished { offset, within } => format!("the file ends at byte {offset} {within}"),
        RecordingProblem::Damaged { offset, what } => format!("byte {offset}: {what}"),
        other => other.to_string(),
    }
}

struct Recovery {
    /// The damaged file.
    source: PlaceReader,
    writer: RecordingWriter,
    recovered: Recovered,
    /// Names of the attachments and metadata found.
    found: Vec<String>,
    /// Final counts of the recorder, if the file contains them.
    account: BTreeMap<String, String>,
    /// Headers, and the messages that they describe.
    pairing: Pairing<WaitingHeader, WaitingMessage>,
}

/// A header that waits for its message.
struct WaitingHeader {
    header: Header,
    times: Times,
    bytes: Vec<u8>,
}

/// A message that waits for its header. Its data are read again when the header is found.
struct WaitingMessage {
    topic: Topic,
    times: Times,
    place: Place,
}

impl Recovery {
    fn add(&mut self, found: Found<'_>) -> Result<(), RecordingProblem> {
        match found {
            Found::Message(message) => self.message(&message),
            Found::Attachment { name, media_type, data, log_ns, .. } => {
                self.found.push(name.to_owned());
                self.writer.attach(name, media_type, data, log_ns)
            }
            Found::Metadata { name: RECORDER_METADATA, entries } => {
                self.account = entries;
                Ok(())
            }
            Found::Metadata { name, entries } => {
                if name == METADATA {
                    check_version(&entries)?;
                }
                self.found.push(name.to_owned());
                self.writer.metadata(name, &entries)
            }
        }
    }

    fn message(&mut self, message: &FoundMessage<'_>) -> Result<(), RecordingProblem> {
        let FoundMessage { topic, sequence, times, data, place } = *message;
        if topic.is_header() {
            let Ok(header) = Header::decode(topic, data) else {
                self.recovered.left_out += 1;
                return Ok(());
            };
            let header = WaitingHeader { header, times, bytes: data.to_vec() };
            let Some((message, header)) = self.pairing.add_header((topic, sequence), header) else { return Ok(()) };
            let data = self.source.read(message.place)?;
            return self.write(message.topic, sequence, message.times, &data, Some(&header));
        }
        let Some(header_topic) = topic.header() else { return self.write(topic, sequence, times, data, None) };
        match self.pairing.add_message((header_topic, sequence), WaitingMessage { topic, times, place }) {
            Some((_, header)) => self.write(topic, sequence, times, data, Some(&header)),
            None => Ok(()),
        }
    }

    /// Writes a message, and its header before it.
    fn write(
        &mut self,
        topic: Topic,
        sequence: u32,
        times: Times,
        data: &[u8],
        header: Option<&WaitingHeader>,
    ) -> Result<(), RecordingProblem> {
        let content = Content::decode(topic, header.map(|header| &header.header), Bytes::copy_from_slice(data));
        if content.is_err() {
            self.recovered.left_out += 1;
            return Ok(());
        }
        self.writer.require_space(data.len())?;
        if let Some((header_topic, header)) = topic.header().zip(header) {
            self.writer.write_numbered(header_topic, sequence, header.times, &header.bytes)?;
        }
        self.writer.write_numbered(topic, sequence, times, data)?;
        *self.recovered.messages.entry(topic.name()).or_default() += 1;
        Ok(())
    }

    /// Checks that anything of a recording was found.
    fn check(&self, scanned: &Scanned) -> Result<(), RecordingProblem> {
        let has_parts = NEEDED.iter().any(|name| self.found.iter().any(|found| found == name));
        if has_parts || (scanned.is_of_fringeflow && !self.recovered.messages.is_empty()) {
            return Ok(());
        }
        match scanned.faults.first() {
            Some(fault) if scanned.channels.is_empty() => Err(RecordingProblem::NothingReadable(fault_text(fault))),
            _ => Err(other_program(scanned)),
        }
    }

    /// Writes the end of the new recording, and counts what it lacks.
    fn finish(self, scanned: Scanned, target: &Path) -> Result<Recovered, RecordingError> {
        let Self { writer, mut recovered, found, account, pairing, .. } = self;
        recovered.left_out += pairing.count();
        recovered.foreign = scanned.foreign_messages;
        recovered.faults = scanned.faults.iter().map(fault_text).collect();
        recovered.has_data_fault = scanned.has_data_fault;
        recovered.missing = NEEDED.into_iter().filter(|name| !found.iter().any(|f| f == name)).collect();
        writer.finish(&recovered_account(account, &recovered.messages, recovered.faults.len()))?;
        if recovered.missing.is_empty() {
            recovered.losses = Some(Recording::open(target)?.losses()?);
        }
        Ok(recovered)
    }
}
