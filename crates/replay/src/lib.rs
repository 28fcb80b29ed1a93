//! Recomputes a recording: every cloud from its images, and every pose from the clouds.
//!
//! ```text
//!  recording ─► images, priors ─► Reconstructor ─► cloud ─┐
//!      └──────────────────────────────► recorded cloud ───┴─► the same bytes?
//! ```
//!
//! ```
//! use std::path::Path;
//!
//! use fringeflow_recording::Recording;
//! use fringeflow_replay::{ReplayError, VerifyOutcome, verify};
//!
//! fn is_reproducible(file: &Path) -> Result<bool, ReplayError> {
//!     let clouds = verify(&Recording::open(file)?, |cloud| println!("{}: {:?}", cloud.published, cloud.outcome))?;
//!     Ok(clouds.iter().all(|cloud| cloud.outcome == VerifyOutcome::Same))
//! }
//! assert!(matches!(is_reproducible(Path::new("no.mcap")), Err(ReplayError::Recording(_))));
//! ```

#![forbid(unsafe_code)]

#[cfg(test)]
mod tests;
mod verify;
mod verify_poses;

use std::path::PathBuf;

use fringeflow::correspondence::SegmentTable;
use fringeflow::phase::PhaseShifts;
use fringeflow::reconstruction::Reconstructor;
use fringeflow_config::{Configuration, ConfigurationProblem, recorded_max_skew_ns};
use fringeflow_recording::{ImagePair, Recording, RecordingError};

pub use verify::{VerifiedCloud, VerifyOutcome, verify};
pub use verify_poses::{VerifiedPoses, verify_poses};

/// Why a recording cannot be recomputed.
#[derive(Debug, thiserror::Error)]
pub enum ReplayError {
    /// The file cannot be read.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// The recorded configuration is invalid.
    #[error("{}: attachment configuration.toml: {problem}", file.display())]
    Configuration {
        /// The recording.
        file: PathBuf,
        /// What is wrong with the configuration.
        #[source]
        problem: ConfigurationProblem,
    },
    /// Setup and configuration are valid, but a measurement is not possible with them.
    #[error("{}: cannot be used for a measurement: {problem}", file.display())]
    NotMeasurable {
        /// The recording.
        file: PathBuf,
        /// The reason.
        problem: String,
    },
}

/// Returns the configuration of a recording.
///
/// # Errors
/// The configuration is invalid.
pub fn configuration(recording: &Recording) -> Result<Configuration, ReplayError> {
    Configuration::parse_recorded(recording.configuration_text())
        .map_err(|problem| ReplayError::Configuration { file: recording.path().to_owned(), problem })
}

/// Returns the image pairs of a recording, without those that its limit of the skew refuses.
///
/// # Errors
/// The configuration is invalid, or a pattern event cannot be read.
pub fn pairs(recording: &Recording) -> Result<Vec<ImagePair>, ReplayError> {
    let max_skew_ns = recorded_max_skew_ns(recording.configuration_text())
        .map_err(|problem| ReplayError::Configuration { file: recording.path().to_owned(), problem })?;
    let mut pairs = recording.pairs()?;
    pairs.retain(|pair| max_skew_ns.is_none_or(|max_skew_ns| pair.skew_ns() <= max_skew_ns));
    Ok(pairs)
}

/// Creates a reconstructor with the setup and configuration of a recording.
///
/// # Errors
/// The configuration is invalid, or a measurement is not possible with the rig.
pub fn reconstructor(recording: &Recording) -> Result<Reconstructor, ReplayError> {
    let configuration = configuration(recording)?;
    build_reconstructor(recording, &configuration)
        .map_err(|problem| ReplayError::NotMeasurable { file: recording.path().to_owned(), problem })
}

fn build_reconstructor(recording: &Recording, configuration: &Configuration) -> Result<Reconstructor, String> {
    let setup = recording.setup();
    let volume = configuration.volume.as_ref().or(setup.volume.as_ref());
    let volume = volume.ok_or("neither meta.json nor configuration.toml states a volume")?;
    let pattern = &setup.sequence.pattern;
    let table = SegmentTable::build(&setup.rig, volume, pattern).map_err(|e| e.to_string())?;
    let shifts = PhaseShifts::new(setup.cycle_shifts_rad()).map_err(|e| e.to_string())?;
    Reconstructor::new(&setup.rig, pattern, table, &shifts, configuration.settings).map_err(|e| e.to_string())
}
