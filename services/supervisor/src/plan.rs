//! What is to run, what came of it, and why it could not.

use std::io;
use std::path::PathBuf;

use fringeflow_config::ScannerConfiguration;
use fringeflow_dataset::Setup;
use fringeflow_recording::Origin;
use fringeflow_runtime::{AccountError, ServiceKind};
use fringeflow_telemetry::RunReport;
use fringeflow_transport::TransportError;

use crate::{Balance, SourceError};

/// What is to run.
#[derive(Debug)]
pub struct Plan {
    /// Configuration of the instance.
    pub configuration: ScannerConfiguration,
    /// Rig, pattern and volume.
    pub setup: Setup,
    /// Services in the order of the pipeline.
    pub services: Vec<ServiceKind>,
    /// The `fringeflow` command.
    pub program: PathBuf,
    /// Its arguments before `service`.
    pub before: Vec<String>,
    /// Arguments of every service.
    pub arguments: Vec<String>,
    /// How long to scan, once all services are ready; without end if `None`.
    pub duration_ns: Option<u64>,
    /// Whether a recording is wanted from the start, and its file; an empty one is named by the time.
    pub recording: Option<String>,
    /// Where a trace of all items goes, if one is wanted.
    pub trace: Option<PathBuf>,
}

/// Why an instance could not be run.
#[derive(Debug, thiserror::Error)]
pub enum RunError {
    /// The channels.
    #[error(transparent)]
    Transport(#[from] TransportError),
    /// An account.
    #[error(transparent)]
    Account(#[from] AccountError),
    /// A service cannot be started or watched.
    #[error("service {service}: {source}")]
    Service {
        /// Its name.
        service: &'static str,
        /// What the system said.
        #[source]
        source: io::Error,
    },
    /// Something of the system.
    #[error("{what}: {source}")]
    System {
        /// What was tried.
        what: &'static str,
        /// What the system said.
        #[source]
        source: io::Error,
    },
    /// The recording cannot be begun.
    #[error("recording: {0}")]
    Recording(String),
    /// What stands in the place of the cameras.
    #[error("{0}")]
    Source(SourceError),
    /// A service found that it cannot run as configured; it has said why.
    #[error("service {service} cannot run ({how}); see its message above")]
    Hopeless {
        /// Its name.
        service: &'static str,
        /// How it ended.
        how: String,
    },
}

/// What came of a run.
#[derive(Debug)]
pub struct Outcome {
    /// Accounts of all stages.
    pub balance: Balance,
    /// Reports of all stages.
    pub run: RunReport,
    /// This machine, and its clocks when the run began.
    pub origin: Origin,
    /// Services that did not end well at the stop, and how.
    pub ended_badly: Vec<(&'static str, String)>,
    /// Restarts of all services.
    pub restarts: u32,
    /// The last recording.
    pub recording: Option<PathBuf>,
    /// The trace, if one was wanted and could be written.
    pub trace: Option<PathBuf>,
}
