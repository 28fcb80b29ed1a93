//! Collects the finds of a scan to an opened recording. Matches headers with their messages and checks that every required
//! part exists.

use std::collections::BTreeMap;
use std::fs::File;
use std::path::Path;

use fringeflow_dataset::{CALIBRATION_FILE, META_FILE, Setup, SetupText, TRUTH_FILE};

use crate::content::Header;
use crate::reader::{Entry, FileRange};
use crate::scan::{Found, FoundMessage, Scanned};
use crate::{CONFIGURATION_FILE, FORMAT_VERSION, METADATA, RECORDER_METADATA, Recording, RecordingProblem, Topic};

/// The finds of a scan so far.
#[derive(Default)]
pub(super) struct Collected {
    texts: BTreeMap<&'static str, String>,
    metadata: Option<BTreeMap<String, String>>,
    recorder_account: BTreeMap<String, String>,
    truth: Option<FileRange>,
    entries: Vec<Entry>,
    /// Headers whose image or cloud is not found yet.
    headers: BTreeMap<(Topic, u32), (Header, u64)>,
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
        let no_text = |_| RecordingProblem::Damaged { offset, what: format!("attachment {name} is no UTF-8 text") };
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

    /// The recording, after the whole file is scanned.
    pub(super) fn into_recording(
        mut self,
        path: &Path,
        file: File,
        scanned: Scanned,
    ) -> Result<Recording, RecordingProblem> {
        let metadata = self.metadata.ok_or(RecordingProblem::Missing { what: "metadata fringeflow" })?;
        if let Some(((topic, sequence), (_, offset))) = self.headers.pop_first() {
            let (topic, what) = (topic.name(), "the message that it describes is missing".to_owned());
            return Err(RecordingProblem::Message { topic, sequence, offset, what });
        }
        let mut text = |name, what| self.texts.remove(name).ok_or(RecordingProblem::Missing { what });
        let calibration = text(CALIBRATION_FILE, "attachment calibration.yml")?;
        let description = text(META_FILE, "attachment meta.json")?;
        let configuration = text(CONFIGURATION_FILE, "attachment configuration.toml")?;
        let setup = Setup::parse(SetupText { description, calibration }, None)?;
        // A stable sort: messages of the same time stay in the order of the file.
        self.entries.sort_by_key(|entry| entry.times.log_ns);
        let frames = self.entries.iter().enumerate().filter_map(|(i, entry)| match &entry.header {
            Some(Header::Frame(header)) => Some(((header.camera, header.session, header.sequence), i)),
            _ => None,
        });
        let frames = frames.collect();
        Ok(Recording {
            path: path.to_owned(),
            file,
            setup,
            configuration,
            metadata,
            recorder_account: self.recorder_account,
            truth: self.truth,
            entries: self.entries,
            frames,
            foreign_messages: scanned.foreign_messages,
            bytes: scanned.bytes,
        })
    }
}

/// Refuses a newer format, before anything in it is misread.
pub(super) fn check_version(metadata: &BTreeMap<String, String>) -> Result<(), RecordingProblem> {
    let writer = metadata.get("version").cloned().unwrap_or_default();
    match metadata.get("format").and_then(|format| format.parse::<u64>().ok()) {
        Some(found) if found > FORMAT_VERSION => Err(RecordingProblem::NewerFormat { found, writer }),
        Some(1..) => Ok(()),
        Some(0) | None => Err(RecordingProblem::Missing { what: "format version in its metadata fringeflow" }),
    }
}
