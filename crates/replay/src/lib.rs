//! Recordings computed again: every cloud from its images, every pose from its clouds.
//!
//! ```text
//!  recording ─► images, priors ─► Reconstructor ─► cloud ─┐
//!      └──────────────────────────────► recorded cloud ───┴─► the same bytes?
//! ```

#![forbid(unsafe_code)]

#[cfg(test)]
mod tests;
mod verify;
mod verify_poses;

use std::path::{Path, PathBuf};

use fringeflow::correspondence::SegmentTable;
use fringeflow::phase::PhaseShifts;
use fringeflow::reconstruction::Reconstructor;
use fringeflow_config::{Configuration, ConfigurationProblem};
use fringeflow_recording::{Recording, RecordingError};

pub use verify::{VerifiedCloud, VerifyOutcome, verify};
pub use verify_poses::{VerifiedPoses, verify_poses};

/// Why a recording cannot be computed again.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// The file.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// The recorded configuration cannot be used.
    #[error("{}: attachment configuration.toml: {problem}", file.display())]
    Configuration {
        /// The recording.
        file: PathBuf,
        /// What is wrong with its configuration.
        #[source]
        problem: ConfigurationProblem,
    },
    /// Setup or configuration can be read, but not measured with.
    #[error("{}: cannot be measured with: {problem}", file.display())]
    NotMeasurable {
        /// The recording.
        file: PathBuf,
        /// What is wrong.
        problem: String,
    },
}

/// The configuration that a recording was made with.
///
/// # Errors
/// The text is no configuration.
pub fn configuration(recording: &Recording) -> Result<Configuration, ReplayError> {
    Configuration::parse_recorded(recording.configuration_text())
        .map_err(|problem| ReplayError::Configuration { file: recording.path().to_owned(), problem })
}

/// Turns the images of the windows of a recording into clouds, by the recorded setup and configuration.
///
/// # Errors
/// The configuration cannot be read, or the rig cannot be measured with.
pub fn reconstructor(recording: &Recording) -> Result<Reconstructor, ReplayError> {
    let configuration = configuration(recording)?;
    measurable(recording, &configuration).map_err(|problem| not_measurable(recording.path(), problem))
}

fn measurable(recording: &Recording, configuration: &Configuration) -> Result<Reconstructor, String> {
    let setup = recording.setup();
    let volume = configuration.volume.as_ref().or(setup.volume.as_ref());
    let volume = volume.ok_or("neither meta.json nor configuration.toml states a volume")?;
    let pattern = &setup.sequence.pattern;
    let table = SegmentTable::build(&setup.rig, volume, pattern).map_err(|e| e.to_string())?;
    let shifts = PhaseShifts::new(setup.cycle_shifts_rad()).map_err(|e| e.to_string())?;
    Reconstructor::new(&setup.rig, pattern, table, &shifts, configuration.settings).map_err(|e| e.to_string())
}

fn not_measurable(file: &Path, problem: String) -> ReplayError {
    ReplayError::NotMeasurable { file: file.to_owned(), problem }
}
