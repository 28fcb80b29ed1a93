//! One recording: from the wish to the closed file.

use std::path::{Path, PathBuf};

use fringeflow_message::{Counts, ScanState};
use fringeflow_recording::{Opening, Origin, Recordable, Recorder, RecordingError};
use fringeflow_runtime::{Host, clock};

use crate::channels::Taken;

/// The file of a recorder that was started again: the one before keeps what it had written, for `fringeflow recover`.
fn continued(file: &Path, restarts: u32) -> PathBuf {
    let stem = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    file.with_file_name(format!("{stem}-continued-{restarts}.mcap"))
}

/// A running recording.
pub(crate) struct Session {
    recorder: Recorder,
    file: PathBuf,
    /// Whether it was said that nothing more is written.
    has_told: bool,
}

impl Session {
    /// Begins a recording, or goes on with that of a recorder that died.
    pub(crate) fn begin(wanted: &ScanState, host: &Host, is_continued: bool) -> Result<Self, RecordingError> {
        let file = PathBuf::from(wanted.recording_file.to_text());
        let file = if is_continued { continued(&file, host.restarts()) } else { file };
        let settings = &host.configuration.recorder;
        let opening = Opening {
            setup: &host.setup,
            configuration: &host.configuration.text,
            origin: &Origin::here(),
            min_free_bytes: settings.min_free_bytes,
        };
        let queue_bytes = usize::try_from(settings.queue_bytes).unwrap_or(usize::MAX);
        let recorder = Recorder::create(&file, &opening, queue_bytes)?;
        tracing::info!(file = %file.display(), "recording");
        Ok(Self { recorder, file, has_told: false })
    }

    /// Takes a message; how many were lost in its channel before it is written down as well.
    pub(crate) fn take(&self, message: Taken<'_>, missing: u64) {
        if missing > 0 {
            let text = format!("{missing} messages were overwritten before the recorder took them");
            let time_ns = clock::now_ns();
            self.recorder.push(&Recordable::Event { time_ns, is_warning: true, source: "recorder", text: &text });
        }
        match message {
            Taken::Message(message) => self.recorder.push(&message),
            Taken::Image(image) => self.recorder.push_held(&image.header(), image),
        }
    }

    pub(crate) fn mark(&self, time_ns: u64, text: &str) {
        self.recorder.push(&Recordable::Mark { time_ns, text });
    }

    pub(crate) fn counts(&self) -> Counts {
        self.recorder.counts().total()
    }

    /// Why nothing more is written; said once.
    pub(crate) fn standstill(&mut self) -> Option<String> {
        let why = self.recorder.end_reason()?;
        let first = !std::mem::replace(&mut self.has_told, true);
        first.then(|| format!("{}: {why}; the scan goes on without a recording", self.file.display()))
    }

    /// Closes the file; what is in it, and its path.
    pub(crate) fn end(self) -> (Counts, Result<PathBuf, RecordingError>) {
        let before = self.recorder.counts().total();
        match self.recorder.finish() {
            Ok(recorded) => (recorded.counts.total(), Ok(recorded.file)),
            Err(error) => (before, Err(error)),
        }
    }
}
