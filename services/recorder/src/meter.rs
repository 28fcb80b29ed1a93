//! How much of the disk a second of recording takes, and how long the disk will last.
//!
//! Every message is counted, recorded or not. So the figure is known before a recording starts.

use std::path::Path;

use fringeflow_message::ScanState;
use fringeflow_runtime::{Host, RecorderStatus, RecordingRate, free_bytes};

/// Time over which the rate is measured, nanoseconds.
const SPAN_NS: u64 = 3_000_000_000;

/// Measures the rate, and keeps the status of the recorder.
pub(crate) struct Meter {
    pub(crate) status: RecorderStatus,
    /// Bytes since the start of the present measurement.
    bytes: u64,
    since_ns: u64,
}

impl Meter {
    pub(crate) fn new(host: &Host, now_ns: u64) -> Self {
        Self { status: RecorderStatus::new(&host.setup, &host.configuration), bytes: 0, since_ns: now_ns }
    }

    pub(crate) fn add(&mut self, bytes: usize) {
        self.bytes += bytes as u64;
    }

    /// Updates the rate if it was measured for long enough. `is_scanning` tells whether images arrive: a pause says
    /// nothing about the rate.
    pub(crate) fn update_rate(&mut self, is_scanning: bool, now_ns: u64) {
        let span_ns = now_ns.saturating_sub(self.since_ns);
        if span_ns < SPAN_NS && is_scanning {
            return;
        }
        if is_scanning {
            self.status.rate = RecordingRate::Measured(self.bytes as f64 / (span_ns as f64 * 1e-3));
        }
        (self.bytes, self.since_ns) = (0, now_ns);
    }

    /// Measures the free space of the disk of `folder`. Logs once when it is nearly used up, and when it is not any
    /// more.
    pub(crate) fn update_room(&mut self, folder: &Path, min_free_bytes: u64, is_recording: bool) {
        let room_mb = free_bytes(folder).map(|free| free.saturating_sub(min_free_bytes) as f64 * 1e-6);
        let was_nearly_full = self.status.is_nearly_full;
        self.status.set_room(room_mb, is_recording);
        match self.status.warning() {
            Some(warning) if !was_nearly_full => tracing::warn!("{warning}"),
            None if was_nearly_full && is_recording => tracing::info!("the disk will last for ten minutes again"),
            _ => {}
        }
    }

    /// Notes that a recording starts, or why it could not.
    pub(crate) fn note_start(&mut self, state: &ScanState, failure: Option<String>) {
        (self.status.recordings, self.status.early_end) = (state.recordings, failure);
    }

    /// Notes that the running recording has ended early.
    pub(crate) fn note_early_end(&mut self, reason: &str) {
        self.status.early_end = Some(reason.to_owned());
    }
}
