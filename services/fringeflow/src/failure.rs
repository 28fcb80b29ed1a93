//! What can go wrong in a command, and the exit code it ends with.

use std::io::Write as _;
use std::process::ExitCode;

use fringeflow::calibration::CalibrationError;
use fringeflow::cloud::CloudWriteError;
use fringeflow::correspondence::SegmentFileError;
use fringeflow_base::atomic_file::WriteError;
use fringeflow_config::ConfigurationError;
use fringeflow_dataset::{DatasetError, Problem};
use fringeflow_lab::evaluation::GrayReferenceError;
use fringeflow_recording::{ExportError, ImportError, RecordingError, RecordingProblem};
use fringeflow_replay::ReplayError;
use fringeflow_runtime::{ArgumentError, ServiceError};
use fringeflow_supervisor::RunError;
use fringeflow_transport::TransportError;

/// Why a command did not finish.
#[derive(Debug, thiserror::Error)]
pub(crate) enum Failure {
    /// Arguments that cannot be carried out, or an input that can be read but not worked with.
    #[error("{0}")]
    Usage(String),
    /// A dataset folder.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// An instance that could not be run.
    #[error(transparent)]
    Run(#[from] RunError),
    /// What a service was started with.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// A service that ended.
    #[error(transparent)]
    Service(#[from] ServiceError),
    /// The channels.
    #[error(transparent)]
    Transport(#[from] TransportError),
    /// The account of a run does not add up.
    #[error("the balance does not add up, please report this: {0}")]
    Imbalance(String),
    /// A recording.
    #[error(transparent)]
    Recording(#[from] RecordingError),
    /// A recording that was checked and is not whole.
    #[error(transparent)]
    Damaged(RecordingError),
    /// Recorded clouds that are not those of their images, or faults in what was checked.
    #[error("{0}")]
    Refuted(String),
    /// No measurement succeeded.
    #[error("{0}")]
    Unmeasured(String),
    /// All was done, but something had been lost before.
    #[error("{0}")]
    Losses(String),
    /// A recording that cannot be measured with.
    #[error("{0}")]
    NotMeasurable(String),
    /// A calibration file.
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
    /// A configuration file.
    #[error(transparent)]
    Configuration(#[from] ConfigurationError),
    /// The file of a segment table.
    #[error(transparent)]
    SegmentFile(#[from] SegmentFileError),
    /// A cloud that could not be written.
    #[error(transparent)]
    Cloud(#[from] CloudWriteError),
    /// Standard output that went away.
    #[error("standard output: {0}")]
    Output(#[from] std::io::Error),
    /// An output that could not be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

impl Failure {
    /// An input that cannot be worked with, in the words of the module that refused it.
    pub(crate) fn unusable(error: impl std::fmt::Display) -> Self {
        Self::Usage(error.to_string())
    }

    /// 3: done, but something was lost; 2: wrong usage, configuration or input; 1: the work itself failed.
    fn exit_code(&self) -> u8 {
        match self {
            Self::Losses(_) => 3,
            Self::Run(RunError::Transport(error)) | Self::Transport(error) => 1 + u8::from(error.is_lasting()),
            Self::Run(RunError::Hopeless { .. } | RunError::Recording(_)) | Self::Argument(_) => 2,
            Self::Service(error) => 1 + u8::from(error.is_lasting()),
            Self::Run(_) | Self::Imbalance(_) => 1,
            Self::Recording(RecordingError { problem: RecordingProblem::Exists, .. }) => 2,
            Self::Recording(error) if error.problem.is_about_writing() => 1,
            Self::Recording(_) | Self::NotMeasurable(_) => 2,
            Self::Damaged(_) | Self::Refuted(_) | Self::Unmeasured(_) => 1,
            Self::Dataset(DatasetError::Write(_) | DatasetError::File { problem: Problem::Unwritable(_), .. }) => 1,
            Self::Usage(_) | Self::Dataset(_) | Self::Calibration(_) | Self::Configuration(_) => 2,
            Self::SegmentFile(SegmentFileError::Unusable { .. } | SegmentFileError::Table(_)) => 2,
            Self::Cloud(CloudWriteError::UnknownFormat { .. }) => 2,
            Self::Cloud(_) | Self::SegmentFile(_) | Self::Write(_) | Self::Output(_) => 1,
        }
    }

    /// Prints the error and yields the exit code.
    pub(crate) fn report(&self) -> ExitCode {
        // A closed standard error leaves nobody to tell.
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
            error @ ImportError::NotPeriodic { .. } => Self::unusable(error),
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
