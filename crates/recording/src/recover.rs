//! Recovers a truncated, damaged or unfinished recording: writes a complete recording with all readable parts.
//!
//! Data with a correct checksum are kept. The rest is skipped and reported: truncated or altered chunks, and headers
//! without their message. The new file states that it was recovered, and counts its messages.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;

use prost::bytes::Bytes;
use serde::Serialize;

use fringeflow_dataset::{CALIBRATION_FILE, META_FILE};

use crate::collected::check_version;
use crate::content::Header;
use crate::recordable::Times;
use crate::scan::{Found, FoundMessage, ScanMode, scan};
use crate::writer::RecordingWriter;
use crate::{
    CONFIGURATION_FILE, Content, METADATA, RECORDER_METADATA, RecordingError, RecordingProblem, Topic,
    UNFINISHED_RECOVERY,
};

/// Result of a recovery.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Recovered {
    /// Number of recovered messages, by topic, without headers.
    pub messages: BTreeMap<&'static str, u64>,
    /// Number of messages skipped: headers without their message, messages without their header, and invalid content.
    pub left_out: u64,
    /// Number of messages of unknown topics, which are skipped as well.
    pub foreign: BTreeMap<String, u64>,
    /// Missing attachments and metadata that a measurement needs.
    pub missing: Vec<&'static str>,
    /// Faults of the file, in the order of their offsets.
    pub faults: Vec<String>,
}

/// Writes all readable parts of `damaged` to the new recording `target`.
///
/// # Errors
/// The file cannot be read, is not an MCAP file, or is of a newer version; or the new file cannot be written.
pub fn recover(damaged: &Path, target: &Path, min_free_bytes: u64) -> Result<Recovered, RecordingError> {
    let file = File::open(damaged).map_err(|e| RecordingProblem::Unreadable(e).in_file(damaged))?;
    let mut recovery = Recovery {
        writer: RecordingWriter::create_empty(target, UNFINISHED_RECOVERY, min_free_bytes)?,
        recovered: Recovered::default(),
        found: Vec::new(),
        account: BTreeMap::new(),
        written: 0,
        headers: BTreeMap::new(),
    };
    let scanned = match scan(&file, ScanMode::Tolerant, &mut |found| recovery.add(found)) {
        Ok(scanned) => scanned,
        Err(problem) => {
            let file = if problem.is_about_writing() { target } else { damaged };
            recovery.writer.discard();
            return Err(problem.in_file(file));
        }
    };
    let Recovery { writer, mut recovered, found, mut account, written, headers } = recovery;
    recovered.left_out += headers.len() as u64;
    recovered.foreign = scanned.foreign_messages;
    recovered.faults = scanned.faults.iter().map(fault_text).collect();
    let needed = [METADATA, CALIBRATION_FILE, META_FILE, CONFIGURATION_FILE];
    recovered.missing = needed.into_iter().filter(|name| !found.iter().any(|f| f == name)).collect();
    account.insert("ended".to_owned(), "recovered".to_owned());
    account.insert("written".to_owned(), written.to_string());
    account.insert("recovered.faults".to_owned(), recovered.faults.len().to_string());
    writer.finish(&account)?;
    Ok(recovered)
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
    writer: RecordingWriter,
    recovered: Recovered,
    /// Names of the attachments and metadata found.
    found: Vec<String>,
    /// Final counts of the recorder, if the file contains them.
    account: BTreeMap<String, String>,
    /// Number of recovered messages that the recorder had counted.
    written: u64,
    /// Headers whose image or cloud has not been found yet.
    headers: BTreeMap<(Topic, u32), (Header, Times, Vec<u8>)>,
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
        let FoundMessage { topic, sequence, times, data, .. } = *message;
        if topic.is_header() {
            match Header::decode(topic, data) {
                Ok(header) => drop(self.headers.insert((topic, sequence), (header, times, data.to_vec()))),
                Err(_) => self.recovered.left_out += 1,
            }
            return Ok(());
        }
        let header = topic.header().and_then(|topic| self.headers.remove(&(topic, sequence)));
        let content = Content::decode(topic, header.as_ref().map(|(h, ..)| h), Bytes::copy_from_slice(data));
        let Ok(content) = content else {
            self.recovered.left_out += 1;
            return Ok(());
        };
        self.writer.require_space(data.len())?;
        if let Some((header_topic, (_, times, bytes))) = topic.header().zip(header) {
            self.writer.write_numbered(header_topic, sequence, times, &bytes)?;
        }
        self.writer.write_numbered(topic, sequence, times, data)?;
        self.written += u64::from(!matches!(content, Content::ForViewers | Content::Loss(_)));
        *self.recovered.messages.entry(topic.name()).or_default() += 1;
        Ok(())
    }
}
