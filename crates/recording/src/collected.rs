//! Collects what a scan finds, and matches headers with their messages.

use std::collections::BTreeMap;

use fringeflow_dataset::{CALIBRATION_FILE, META_FILE, TRUTH_FILE};

use crate::content::Header;
use crate::entry::Entry;
use crate::pairing::Pairing;
use crate::place::Place;
use crate::scan::{Found, FoundMessage, Scanned};
use crate::{CONFIGURATION_FILE, FORMAT_VERSION, METADATA, RECORDER_METADATA, RecordingProblem};

/// Metadata and attachments that every recording has.
pub(super) const NEEDED: [&str; 4] = [METADATA, CALIBRATION_FILE, META_FILE, CONFIGURATION_FILE];

/// What a scan has found so far.
#[derive(Default)]
pub(super) struct Collected {
    pub(super) texts: BTreeMap<&'static str, String>,
    pub(super) metadata: Option<BTreeMap<String, String>>,
    pub(super) recorder_account: BTreeMap<String, String>,
    pub(super) truth: Option<Place>,
    pub(super) entries: Vec<Entry>,
    /// Headers and the entries that they describe.
    pairing: Pairing<(Header, u64), usize>,
}

impl Collected {
    pub(super) fn add(&mut self, found: Found<'_>) -> Result<(), RecordingProblem> {
        match found {
            Found::Message(message) => self.message(&message),
            Found::Attachment { name, data, place, .. } => self.attachment(name, data, place),
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

    fn attachment(&mut self, name: &str, data: &[u8], place: Place) -> Result<(), RecordingProblem> {
        if name == TRUTH_FILE {
            self.truth = Some(place);
        }
        let Some(name) = [CALIBRATION_FILE, META_FILE, CONFIGURATION_FILE].into_iter().find(|n| *n == name) else {
            return Ok(());
        };
        let text = std::str::from_utf8(data);
        let no_text = |_| {
            let what = format!("attachment {name} is not UTF-8 text");
            RecordingProblem::Damaged { offset: place.offset, what }
        };
        self.texts.insert(name, text.map_err(no_text)?.to_owned());
        Ok(())
    }

    fn message(&mut self, found: &FoundMessage<'_>) -> Result<(), RecordingProblem> {
        let FoundMessage { topic, sequence, times, data, place } = *found;
        let entry = Entry { topic, sequence, times, place, header: None };
        if topic.is_header() {
            let header = Header::decode(topic, data).map_err(|what| entry.problem(what))?;
            if let Some((number, (header, _))) = self.pairing.add_header((topic, sequence), (header, place.offset)) {
                self.entries[number].header = Some(header);
            }
            return Ok(());
        }
        let number = self.entries.len();
        self.entries.push(entry);
        if let Some(header_topic) = topic.header()
            && let Some((number, (header, _))) = self.pairing.add_message((header_topic, sequence), number)
        {
            self.entries[number].header = Some(header);
        }
        Ok(())
    }

    /// Checks that the file is a recording of Fringeflow, and that every header has its message.
    pub(super) fn check(&self, scanned: &Scanned) -> Result<(), RecordingProblem> {
        if self.metadata.is_none() && self.texts.is_empty() && !scanned.is_of_fringeflow {
            return Err(other_program(scanned));
        }
        if let Some((header_topic, sequence)) = self.pairing.first_message() {
            let entry = self.entries.iter().find(|entry| {
                entry.topic.header() == Some(header_topic) && entry.sequence == sequence && entry.header.is_none()
            });
            return entry.map_or(Ok(()), |entry| Err(entry.problem("its header is missing".to_owned())));
        }
        let Some(((topic, sequence), (_, offset))) = self.pairing.first_header() else { return Ok(()) };
        let (topic, what) = (topic.name(), "the message that it describes is missing".to_owned());
        Err(RecordingProblem::Message { topic, sequence, offset: *offset, what })
    }
}

/// The problem of a file without anything of Fringeflow.
pub(super) fn other_program(scanned: &Scanned) -> RecordingProblem {
    RecordingProblem::OtherProgram { library: scanned.library.clone(), channels: scanned.channels.clone() }
}

/// Refuses a newer format, so that nothing is misread.
pub(super) fn check_version(metadata: &BTreeMap<String, String>) -> Result<(), RecordingProblem> {
    let writer = metadata.get("version").cloned().unwrap_or_default();
    match format_version(metadata) {
        Some(found) if found > FORMAT_VERSION => Err(RecordingProblem::NewerFormat { found, writer }),
        Some(1..) => Ok(()),
        Some(0) | None => Err(RecordingProblem::Missing { what: "format version in its metadata fringeflow" }),
    }
}

/// Version of the format that the metadata of a recording state.
pub(super) fn format_version(metadata: &BTreeMap<String, String>) -> Option<u64> {
    metadata.get("format")?.parse().ok()
}
