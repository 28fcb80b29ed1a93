//! The input and the outcome of a run, and its errors.

use std::io;
use std::path::PathBuf;

use fringeflow_config::ScannerConfiguration;
use fringeflow_dataset::Setup;
use fringeflow_recording::Origin;
use fringeflow_runtime::{AccountError, ServiceArgs, ServiceKind};
use fringeflow_telemetry::RunReport;
use fringeflow_transport::TransportError;

use crate::{Balance, SourceError};

/// How an instance is run.
#[derive(Debug)]
pub struct Plan {
    /// Configuration of the instance.
    pub configuration: ScannerConfiguration,
    /// Rig, pattern and volume.
    pub setup: Setup,
    /// Services, in pipeline order.
    pub services: Vec<ServiceKind>,
    /// The `fringeflow` executable.
    pub program: PathBuf,
    /// Arguments before `service NAME`.
    pub global_arguments: Vec<String>,
    /// Arguments of the services.
    pub arguments: ServiceArgs,
    /// How long to scan, from the time all services are ready; `None` scans until the instance is stopped.
    pub duration_ns: Option<u64>,
    /// File of the recording that starts with the scan. If it is empty, the file gets a default name. `None` does not
    /// record.
    pub recording: Option<String>,
    /// File for the trace of all items; `None` writes no trace.
    pub trace: Option<PathBuf>,
}

/// Why a run failed.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// A channel failed.
    #[error(transparent)]
    Transport(#[from] TransportError),
    /// An account cannot be read or written.
    #[error(transparent)]
    Account(#[from] AccountError),
    /// The process of a service cannot be started or watched.
    #[error("service {service}: {source}")]
    Service {
        /// Name of the service.
        service: &'static str,
        /// The system error.
        #[source]
        source: io::Error,
    },
    /// A system call failed.
    #[error("{what}: {source}")]
    System {
        /// What failed, as a sentence.
        what: &'static str,
        /// The system error.
        #[source]
        source: io::Error,
    },
    /// The recording cannot be started.
    #[error("recording: {0}")]
    Recording(String),
    /// The source that replaces cameras and projector failed.
    #[error("{0}")]
    Source(SourceError),
    /// A service cannot run with its arguments, configuration or environment. It has logged why.
    #[error("service {service} cannot run ({exit}); see its message above")]
    CannotRun {
        /// Name of the service.
        service: &'static str,
        /// How it ended: `exit code 2`.
        exit: String,
    },
}

/// The outcome of a run.
#[derive(Debug)]
pub struct Outcome {
    /// Final counts of all stages.
    pub balance: Balance,
    /// Reports of all stages.
    pub run: RunReport,
    /// This machine, and its clocks at the start of the run.
    pub origin: Origin,
    /// Services that failed at the end of the run, and how.
    pub failed_services: Vec<(&'static str, String)>,
    /// Number of restarts, of all services together.
    pub restarts: u32,
    /// File of the last recording.
    pub recording: Option<PathBuf>,
    /// File of the trace; `None` if no trace was requested, or it could not be written.
    pub trace: Option<PathBuf>,
}
