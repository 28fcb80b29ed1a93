//! From a cut, damaged or unfinished recording to a whole one, with all that can still be read.
//!
//! What a checksum vouches for is taken, the rest is left out and named: chunks that are cut or altered, and headers
//! without what they describe. The new file says that it was recovered, and counts what it holds.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;

use prost::bytes::Bytes;
use serde::Serialize;

use fringeflow_dataset::{CALIBRATION_FILE, META_FILE};

use super::collect::check_version;
use super::content::{Content, Header};
use super::error::{RecordingError, RecordingProblem};
use super::file::UNFINISHED_RECOVERY;
use super::recordable::Times;
use super::scan::{Found, FoundMessage, Rigour, scan};
use super::writer::RecordingWriter;
use super::{CONFIGURATION_FILE, METADATA, RECORDER_METADATA, Topic};

/// What a recovery saved, and what it could not.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Recovered {
    /// Messages saved, by topic; headers are not counted.
    pub messages: BTreeMap<&'static str, u64>,
    /// Messages left out: a header without what it describes or the reverse, or content that cannot be.
    pub left_out: u64,
    /// Messages of topics that fringeflow does not know; left out too.
    pub foreign: BTreeMap<String, u64>,
    /// Attachments and metadata that every recording has and this one lacks; without them nothing can be measured.
    pub missing: Vec<&'static str>,
    /// What was wrong with the file, by place.
    pub faults: Vec<String>,
}

/// Writes all that can be read of `damaged` to the new recording `target`.
///
/// # Errors
/// [`RecordingError`]: the file cannot be read, is no MCAP file or one of a newer version, or the new one cannot be
/// written.
pub fn recover(damaged: &Path, target: &Path, min_free_bytes: u64) -> Result<Recovered, RecordingError> {
    let file = File::open(damaged).map_err(|e| RecordingProblem::Unreadable(e).of(damaged))?;
    let mut recovery = Recovery {
        writer: RecordingWriter::create_empty(target, UNFINISHED_RECOVERY, min_free_bytes)?,
        recovered: Recovered::default(),
        found: Vec::new(),
        account: BTreeMap::new(),
        written: 0,
        headers: BTreeMap::new(),
    };
    let scanned = match scan(&file, Rigour::Tolerant, &mut |found| recovery.take(found)) {
        Ok(scanned) => scanned,
        Err(problem) => {
            let file = if problem.is_about_writing() { target } else { damaged };
            recovery.writer.discard();
            return Err(problem.of(file));
        }
    };
    let Recovery { writer, mut recovered, found, mut account, written, headers } = recovery;
    recovered.left_out += headers.len() as u64;
    recovered.foreign = scanned.foreign;
    recovered.faults = scanned.faults.iter().map(fault).collect();
    let needed = [METADATA, CALIBRATION_FILE, META_FILE, CONFIGURATION_FILE];
    recovered.missing = needed.into_iter().filter(|name| !found.iter().any(|f| f == name)).collect();
    account.insert("ended".to_owned(), "recovered".to_owned());
    account.insert("written".to_owned(), written.to_string());
    account.insert("recovered.faults".to_owned(), recovered.faults.len().to_string());
    writer.finish(&account)?;
    Ok(recovered)
}

/// A fault without the remedy, which this is.
fn fault(problem: &RecordingProblem) -> String {
    match problem {
        RecordingProblem::Unfinished { offset, within } => format!("the file ends at byte {offset} {within}"),
        RecordingProblem::Damaged { offset, what } => format!("byte {offset}: {what}"),
        other => other.to_string(),
    }
}

struct Recovery {
    writer: RecordingWriter,
    recovered: Recovered,
    /// Names of attachments and metadata that were found.
    found: Vec<String>,
    /// What the recorder said in the end, if it came so far.
    account: BTreeMap<String, String>,
    /// Messages saved that the recorder had counted.
    written: u64,
    /// Headers whose image or cloud has not come yet.
    headers: BTreeMap<(Topic, u32), (Header, Times, Vec<u8>)>,
}

impl Recovery {
    fn take(&mut self, found: Found<'_>) -> Result<(), RecordingProblem> {
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
        if !self.writer.admits(data.len()) {
            return Err(RecordingProblem::Unwritable(std::io::ErrorKind::StorageFull.into()));
        }
        if let Some((of, (_, times, bytes))) = topic.header().zip(header) {
            self.writer.write_numbered(of, sequence, times, &bytes)?;
        }
        self.writer.write_numbered(topic, sequence, times, data)?;
        self.written += u64::from(!matches!(content, Content::ForViewers | Content::Loss(_)));
        *self.recovered.messages.entry(topic.name()).or_default() += 1;
        Ok(())
    }
}
