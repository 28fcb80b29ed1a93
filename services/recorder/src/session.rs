//! One recording, from the request to the closed file.

use std::path::{Path, PathBuf};

use fringeflow_message::{Counts, ScanState};
use fringeflow_recording::{Opening, Origin, Recordable, Recorder, RecordingError};
use fringeflow_runtime::Host;

use crate::channels::Incoming;

/// Returns the file of a restarted recorder. The previous file keeps its content, for `fringeflow recover`.
fn continuation_file(file: &Path, restarts: u32) -> PathBuf {
    let stem = file.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    file.with_file_name(format!("{stem}-continued-{restarts}.mcap"))
}

/// A running recording.
pub(crate) struct Session {
    recorder: Recorder,
    file: PathBuf,
    /// Whether [`Self::report_early_end`] has reported.
    has_reported_end: bool,
}

impl Session {
    /// Starts the recording that the state requests, or continues it after a restart of the recorder.
    pub(crate) fn start(state: &ScanState, host: &Host, is_continued: bool) -> Result<Self, RecordingError> {
        let file = PathBuf::from(state.recording_file.to_text());
        let file = if is_continued { continuation_file(&file, host.restarts()) } else { file };
        let settings = &host.configuration.recorder;
        let opening = Opening {
            setup: &host.setup,
            configuration: &host.configuration.recorded_text(),
            origin: &Origin::here(),
            min_free_bytes: settings.min_free_bytes,
        };
        let queue_bytes = usize::try_from(settings.queue_bytes).unwrap_or(usize::MAX);
        let recorder = Recorder::create(&file, &opening, queue_bytes)?;
        tracing::info!(file = %file.display(), "recording started");
        Ok(Self { recorder, file, has_reported_end: false })
    }

    /// Counts messages that did not arrive from their channel.
    pub(crate) fn count_missing(&self, missing: u64) {
        self.recorder.count_overrun(missing);
    }

    /// Records a message.
    pub(crate) fn record(&self, message: Incoming<'_>) {
        match message {
            Incoming::Message(message) => self.recorder.push(&message),
            Incoming::Image(image) => {
                self.recorder.push_held(&image.header(), image, |header, image| Recordable::Frame { header, image });
            }
            Incoming::Cloud(cloud) => {
                self.recorder
                    .push_held(&cloud.header(), cloud, |header, records| Recordable::Cloud { header, records });
            }
        }
    }

    pub(crate) fn mark(&self, time_ns: u64, text: &str) {
        self.recorder.push(&Recordable::Mark { time_ns, text });
    }

    pub(crate) fn counts(&self) -> Counts {
        self.recorder.counts().total()
    }

    /// Returns why nothing more is written, once.
    pub(crate) fn report_early_end(&mut self) -> Option<&'static str> {
        let reason = self.recorder.end_reason()?;
        let is_first = !std::mem::replace(&mut self.has_reported_end, true);
        is_first.then_some(reason)
    }

    pub(crate) fn file(&self) -> &Path {
        &self.file
    }

    /// Whether messages are still written.
    pub(crate) fn is_running(&self) -> bool {
        self.recorder.end_reason().is_none()
    }

    /// Closes the file. Returns the counts of its messages, and its path.
    pub(crate) fn finish(self) -> (Counts, Result<PathBuf, RecordingError>) {
        let counts = self.recorder.counts().total();
        match self.recorder.finish() {
            Ok(recorded) => (recorded.counts.total(), Ok(recorded.file)),
            Err(error) => (counts, Err(error)),
        }
    }
}
