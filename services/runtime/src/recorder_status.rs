//! What the recorder does, in a file beside the accounts. Supervisor, dashboard and `status` read it: the state of the
//! instance tells only what was asked of it.

use std::fmt;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use fringeflow_config::ScannerConfiguration;
use fringeflow_dataset::Setup;
use fringeflow_message::{Block, ScanState};
use fringeflow_transport::Instance;

use crate::{accounts_folder, channel_sizes, status_file};

/// The recorder warns if the disk will be full within this time, seconds.
const WARN_BELOW_S: f64 = 600.0;
/// The warning ends above this time, seconds. The rate varies, so the two differ.
const CLEAR_ABOVE_S: f64 = 660.0;

/// What the recorder does, and how long the disk will last.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RecorderStatus {
    /// Number of the last recording, as in [`ScanState::recordings`].
    pub recordings: u64,
    /// Why this recording ended early or could not start; `None` otherwise.
    pub early_end: Option<String>,
    /// Data that a second of recording takes.
    pub rate: RecordingRate,
    /// Free space for recordings, megabytes: that of the disk, without the part that must stay free. `None` if the
    /// system does not tell it.
    pub room_mb: Option<f64>,
    /// Whether a recording runs and the disk will be full within ten minutes.
    pub is_nearly_full: bool,
}

/// Data that a second of recording takes, megabytes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RecordingRate {
    /// Measured on the messages of the last seconds.
    Measured(f64),
    /// Computed from the configuration.
    Computed {
        /// Images.
        images: f64,
        /// Clouds with a point at every pixel, and what else is recorded of a window.
        windows_at_most: f64,
    },
}

impl RecorderStatus {
    /// Returns the status before the first recording.
    #[must_use]
    pub fn new(setup: &Setup, configuration: &ScannerConfiguration) -> Self {
        let rate = RecordingRate::compute(setup, configuration);
        Self { recordings: 0, early_end: None, rate, room_mb: None, is_nearly_full: false }
    }

    /// Reads the status of the recorder of an instance. Returns `None` if it has none.
    #[must_use]
    pub fn read(instance: &Instance) -> Option<Self> {
        status_file::read(&file(&accounts_folder(instance)))
    }

    pub(crate) fn write(&self, accounts: &Path) {
        status_file::write(&file(accounts), self);
    }

    /// Returns why the recording that `state` asks for ended early, if it did.
    #[must_use]
    pub fn early_end_of(&self, state: &ScanState) -> Option<&str> {
        let is_asked = state.recording != 0 && state.recordings == self.recordings;
        self.early_end.as_deref().filter(|_| is_asked)
    }

    /// Sets the free space, and whether it is nearly used up; `is_recording` tells whether a recording runs.
    pub fn set_room(&mut self, room_mb: Option<f64>, is_recording: bool) {
        self.room_mb = room_mb;
        let still_holds = self.is_nearly_full && self.seconds_left().is_some_and(|seconds| seconds < CLEAR_ABOVE_S);
        self.is_nearly_full = is_recording && (self.is_short() || still_holds);
    }

    /// Returns how long a recording can last, seconds; `None` if that is unknown. By a computed rate, it is the
    /// shortest time.
    #[must_use]
    pub fn seconds_left(&self) -> Option<f64> {
        let mb_s = match self.rate {
            RecordingRate::Measured(mb_s) => mb_s,
            RecordingRate::Computed { images, windows_at_most } => images + windows_at_most,
        };
        Some(self.room_mb? / mb_s).filter(|seconds| seconds.is_finite())
    }

    /// Returns whether a recording would fill the disk within ten minutes, by the measured rate.
    #[must_use]
    pub fn is_short(&self) -> bool {
        let is_measured = matches!(self.rate, RecordingRate::Measured(_));
        is_measured && self.seconds_left().is_some_and(|seconds| seconds < WARN_BELOW_S)
    }

    /// Returns in how long the disk will be full, in words; `None` unless it is nearly full.
    #[must_use]
    pub fn full_in(&self) -> Option<String> {
        self.seconds_left().filter(|_| self.is_nearly_full).map(duration)
    }

    /// Returns the warning that the disk is nearly full, or `None` if it is not.
    #[must_use]
    pub fn warning(&self) -> Option<String> {
        Some(format!("the disk will be full in {}; {self}", self.full_in()?))
    }
}

impl RecordingRate {
    fn compute(setup: &Setup, configuration: &ScannerConfiguration) -> Self {
        let (sizes, recorder) = (channel_sizes(setup, configuration), &configuration.recorder);
        let if_recorded = |is_recorded: bool, blocks: usize| if is_recorded { blocks * size_of::<Block>() } else { 0 };
        let window_bytes = sizes.cloud_bytes
            + if_recorded(recorder.phase_maps, sizes.map_blocks)
            + if_recorded(recorder.correspondences, sizes.correspondence_blocks);
        let windows_hz = configuration.rate_hz / configuration.window_every as f64;
        Self::Computed {
            images: 2.0 * sizes.frame_bytes as f64 * configuration.rate_hz * 1e-6,
            windows_at_most: window_bytes as f64 * windows_hz * 1e-6,
        }
    }
}

impl fmt::Display for RecordingRate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Measured(mb_s) => write!(f, "a second of recording takes {mb_s:.1} MB"),
            Self::Computed { images, windows_at_most } => {
                write!(
                    f,
                    "a second of recording takes {images:.1} MB of images and at most {windows_at_most:.1} MB of results"
                )
            }
        }
    }
}

impl fmt::Display for RecorderStatus {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.rate)?;
        let (Some(room_mb), Some(seconds)) = (self.room_mb, self.seconds_left()) else { return Ok(()) };
        let at_least = if matches!(self.rate, RecordingRate::Measured(_)) { "" } else { "at least " };
        write!(f, "; the disk has room for {}, {at_least}{}", megabytes(room_mb), duration(seconds))
    }
}

fn megabytes(mb: f64) -> String {
    if mb < 1000.0 { format!("{mb:.0} MB") } else { format!("{:.1} GB", mb * 1e-3) }
}

/// A duration in the unit that suits it, rounded down.
fn duration(seconds: f64) -> String {
    let (count, unit) = match seconds {
        s if s < 120.0 => (s, "s"),
        s if s < 7200.0 => (s / 60.0, "min"),
        s => (s / 3600.0, "h"),
    };
    format!("{:.0} {unit}", count.floor())
}

/// Returns the free bytes of the disk that holds a folder or will hold it; `None` if the system does not tell them.
#[must_use]
pub fn free_bytes(folder: &Path) -> Option<u64> {
    let existing = folder.ancestors().find(|folder| folder.exists())?;
    rustix::fs::statvfs(existing).ok().map(|disk| disk.f_bavail.saturating_mul(disk.f_frsize))
}

fn file(accounts: &Path) -> PathBuf {
    accounts.join("recorder.json")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn status(rate: RecordingRate) -> RecorderStatus {
        RecorderStatus { recordings: 2, early_end: None, rate, room_mb: None, is_nearly_full: false }
    }

    #[test]
    fn the_warning_begins_below_ten_minutes_and_ends_when_it_no_longer_holds() {
        let mut status = status(RecordingRate::Measured(50.0));
        let mut warns = |room_mb: f64, is_recording| {
            status.set_room(Some(room_mb), is_recording);
            status.warning()
        };
        assert_eq!(warns(29_000.0, false), None);
        assert_eq!(warns(30_500.0, true), None);
        assert_eq!(
            warns(29_000.0, true).unwrap(),
            "the disk will be full in 9 min; a second of recording takes 50.0 MB; the disk has room for 29.0 GB, 9 min"
        );
        assert!(warns(31_000.0, true).is_some());
        assert_eq!(warns(34_000.0, true), None);
        assert_eq!(warns(31_000.0, true), None);
        assert!(warns(29_000.0, true).is_some());
        assert_eq!(warns(29_000.0, false), None);
    }

    #[test]
    fn what_is_unknown_is_left_out() {
        let mut status = status(RecordingRate::Computed { images: 20.0, windows_at_most: 80.0 });
        let rate = "a second of recording takes 20.0 MB of images and at most 80.0 MB of results";
        assert_eq!(status.to_string(), rate);
        status.set_room(Some(12_000.0), false);
        assert_eq!(status.to_string(), format!("{rate}; the disk has room for 12.0 GB, at least 2 min"));
        status.set_room(Some(600.0), false);
        assert_eq!(status.to_string(), format!("{rate}; the disk has room for 600 MB, at least 6 s"));
        status.rate = RecordingRate::Measured(0.0);
        assert_eq!(status.seconds_left(), None);
    }

    #[test]
    fn an_early_end_is_about_one_recording() {
        let ended =
            RecorderStatus { early_end: Some("the disk is full".to_owned()), ..status(RecordingRate::Measured(1.0)) };
        let state = |recording, recordings| ScanState { recording, recordings, ..ScanState::default() };
        assert_eq!(ended.early_end_of(&state(1, 2)), Some("the disk is full"));
        assert_eq!((ended.early_end_of(&state(0, 2)), ended.early_end_of(&state(1, 3))), (None, None));
    }

    #[test]
    fn a_missing_folder_has_the_space_of_its_parent() {
        let folder = tempfile::tempdir().unwrap();
        assert!(free_bytes(&folder.path().join("not/yet")).unwrap() > 0);
    }
}
