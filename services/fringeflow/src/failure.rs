//! Errors of the commands, and their exit codes.

use std::io::Write as _;
use std::process::ExitCode;

use fringeflow::calibration::CalibrationError;
use fringeflow::cloud::CloudWriteError;
use fringeflow::correspondence::SegmentFileError;
use fringeflow_base::atomic_file::WriteError;
use fringeflow_config::ConfigurationError;
use fringeflow_dataset::{DatasetError, Problem};
use fringeflow_lab::evaluation::GrayReferenceError;
use fringeflow_patterns::{PatternError, PatternProblem};
use fringeflow_projector::ProjectorError;
use fringeflow_recording::{ExportError, ImportError, RecordingError, RecordingProblem};
use fringeflow_replay::ReplayError;
use fringeflow_runtime::{ArgumentError, ServiceError};
use fringeflow_supervisor::RunError;
use fringeflow_transport::TransportError;

/// Why a command did not succeed.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Failure {
    /// Invalid arguments, or an input that can be read but not used.
    #[error("{0}")]
    Usage(String),
    /// Error in a dataset folder.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// An instance could not be run.
    #[error(transparent)]
    Run(#[from] RunError),
    /// Invalid arguments of a service.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// Error that ended a service.
    #[error(transparent)]
    Service(#[from] ServiceError),
    /// Error of the channels.
    #[error(transparent)]
    Transport(#[from] TransportError),
    /// The counts of a run do not add up.
    #[error("the balance does not add up, please report this: {0}")]
    Imbalance(String),
    /// Error in a recording.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// A checked recording is damaged.
    #[error(transparent)]
    Damaged(RecordingError),
    /// Recorded clouds or poses differ from those computed again, or a checked recording has faults.
    #[error("{0}")]
    Mismatch(String),
    /// No measurement succeeded.
    #[error("{0}")]
    NothingMeasured(String),
    /// A measured artefact shows errors beyond its limits.
    #[error("{0}")]
    OutsideLimits(String),
    /// The command did its work, but data are missing.
    #[error("{0}")]
    Losses(String),
    /// The recording does not allow a measurement.
    #[error("{0}")]
    NotMeasurable(String),
    /// Error in a calibration file.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
    /// Error in a configuration file.
    #[error(transparent)]
    Configuration(#[from] ConfigurationError),
    /// Error in the file of a segment table.
    #[error(transparent)]
    SegmentFile(#[from] SegmentFileError),
    /// Patterns cannot be read or written.
    #[error(transparent)]
    Patterns(#[from] PatternError),
    /// Patterns cannot be shown.
    #[error(transparent)]
    Projector(ProjectorError),
    /// A cloud could not be written.
    #[error(transparent)]
    Cloud(#[from] CloudWriteError),
    /// Standard output was closed.
    #[error("standard output: {0}")]
    Output(#[from] std::io::Error),
    /// An output could not be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

impl Failure {
    /// The input or the arguments cannot be used; the message is that of `error`.
    pub(crate) fn unusable(error: impl std::fmt::Display) -> Self {
        Self::Usage(error.to_string())
    }

    /// 3: finished, but data are missing; 2: wrong usage, configuration or input; 1: the work itself failed.
    fn exit_code(&self) -> u8 {
        match self {
            Self::Losses(_) => 3,
            Self::Run(RunError::Transport(error)) | Self::Transport(error) => 1 + u8::from(error.is_lasting()),
            Self::Run(RunError::CannotRun { .. } | RunError::Recording(_)) | Self::Argument(_) => 2,
            Self::Service(error) => 1 + u8::from(error.is_lasting()),
            Self::Run(_) | Self::Imbalance(_) => 1,
            Self::Recording(RecordingError { problem: RecordingProblem::Exists, .. }) => 2,
            Self::Recording(error) if error.problem.is_about_writing() => 1,
            Self::Recording(_) | Self::NotMeasurable(_) => 2,
            Self::Damaged(_) | Self::Mismatch(_) | Self::NothingMeasured(_) | Self::OutsideLimits(_) => 1,
            Self::Dataset(DatasetError::Write(_) | DatasetError::File { problem: Problem::Unwritable(_), .. }) => 1,
            Self::Patterns(PatternError { problem: PatternProblem::Unwritable(_), .. }) => 1,
            Self::Patterns(_) => 2,
            Self::Projector(error) => 1 + u8::from(error.is_lasting()),
            Self::Usage(_) | Self::Dataset(_) | Self::Calibration(_) | Self::Configuration(_) => 2,
            Self::SegmentFile(SegmentFileError::Unusable { .. } | SegmentFileError::Table(_)) => 2,
            Self::Cloud(CloudWriteError::UnknownFormat { .. }) => 2,
            Self::Cloud(_) | Self::SegmentFile(_) | Self::Write(_) | Self::Output(_) => 1,
        }
    }

    /// Prints the error to standard error and returns the exit code.
    pub(crate) fn report(&self) -> ExitCode {
        // A failure is ignored: if standard error is closed, there is no other place for the message.
        let _ = writeln!(std::io::stderr(), "fringeflow: {self}");
        ExitCode::from(self.exit_code())
    }
}

impl From<ReplayError> for Failure {
    fn from(error: ReplayError) -> Self {
        match error {
            ReplayError::Recording(error) => Self::Recording(error),
            other => Self::NotMeasurable(other.to_string()),
        }
    }
}

impl From<ImportError> for Failure {
    fn from(error: ImportError) -> Self {
        match error {
            ImportError::Dataset(error) => Self::Dataset(error),
            ImportError::Recording(error) => Self::Recording(error),
            error @ (ImportError::Setup(_) | ImportError::NotPeriodic { .. }) => Self::unusable(error),
        }
    }
}

impl From<ExportError> for Failure {
    fn from(error: ExportError) -> Self {
        match error {
            ExportError::Dataset(error) => Self::Dataset(error),
            ExportError::Recording(error) => Self::Recording(error),
        }
    }
}

impl From<GrayReferenceError> for Failure {
    fn from(error: GrayReferenceError) -> Self {
        match error {
            GrayReferenceError::Dataset(error) => Self::Dataset(error),
            error => Self::unusable(error),
        }
    }
}
