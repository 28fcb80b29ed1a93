//! Collects what a scan finds, and matches headers with their messages.

use std::collections::BTreeMap;

use fringeflow_dataset::{CALIBRATION_FILE, META_FILE, TRUTH_FILE};

use crate::content::Header;
use crate::entry::{Entry, FileRange};
use crate::scan::{Found, FoundMessage};
use crate::{CONFIGURATION_FILE, FORMAT_VERSION, METADATA, RECORDER_METADATA, RecordingProblem, Topic};

/// What a scan has found so far.
#[derive(Default)]
pub(super) struct Collected {
    pub(super) texts: BTreeMap<&'static str, String>,
    pub(super) metadata: Option<BTreeMap<String, String>>,
    pub(super) recorder_account: BTreeMap<String, String>,
    pub(super) truth: Option<FileRange>,
    pub(super) entries: Vec<Entry>,
    /// Headers whose image or cloud has not been found yet.
    pub(super) headers: BTreeMap<(Topic, u32), (Header, u64)>,
}

impl Collected {
    pub(super) fn add(&mut self, found: Found<'_>) -> Result<(), RecordingProblem> {
        match found {
            Found::Message(message) => self.message(&message),
            Found::Attachment { name, data, offset, .. } => self.attachment(name, data, offset),
            Found::Metadata { name: METADATA, entries } => {
                check_version(&entries)?;
                self.metadata = Some(entries);
                Ok(())
            }
            Found::Metadata { name: RECORDER_METADATA, entries } => {
                self.recorder_account = entries;
                Ok(())
            }
            Found::Metadata { .. } => Ok(()),
        }
    }

    fn attachment(&mut self, name: &str, data: &[u8], offset: u64) -> Result<(), RecordingProblem> {
        if name == TRUTH_FILE {
            self.truth = Some(FileRange { offset, bytes: data.len() });
        }
        let Some(name) = [CALIBRATION_FILE, META_FILE, CONFIGURATION_FILE].into_iter().find(|n| *n == name) else {
            return Ok(());
        };
        let text = std::str::from_utf8(data);
        let no_text = |_| RecordingProblem::Damaged { offset, what: format!("attachment {name} is not UTF-8 text") };
        self.texts.insert(name, text.map_err(no_text)?.to_owned());
        Ok(())
    }

    fn message(&mut self, found: &FoundMessage<'_>) -> Result<(), RecordingProblem> {
        let FoundMessage { topic, sequence, times, data, offset } = *found;
        let range = FileRange { offset, bytes: data.len() };
        let mut entry = Entry { topic, sequence, times, range, header: None };
        if topic.is_header() {
            let header = Header::decode(topic, data).map_err(|what| entry.problem(what))?;
            self.headers.insert((topic, sequence), (header, offset));
            return Ok(());
        }
        if let Some(header) = topic.header() {
            let header = self.headers.remove(&(header, sequence)).map(|(header, _)| header);
            entry.header = Some(header.ok_or_else(|| entry.problem("its header is missing".to_owned()))?);
        }
        self.entries.push(entry);
        Ok(())
    }
}

/// Refuses a newer format, so that nothing is misread.
pub(super) fn check_version(metadata: &BTreeMap<String, String>) -> Result<(), RecordingProblem> {
    let writer = metadata.get("version").cloned().unwrap_or_default();
    match metadata.get("format").and_then(|format| format.parse::<u64>().ok()) {
        Some(found) if found > FORMAT_VERSION => Err(RecordingProblem::NewerFormat { found, writer }),
        Some(1..) => Ok(()),
        Some(0) | None => Err(RecordingProblem::Missing { what: "format version in its metadata fringeflow" }),
    }
}
