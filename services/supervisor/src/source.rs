//! Interface of a source of images and pattern events that replaces cameras and projector, in the process of the
//! supervisor.

use std::path::Path;

use fringeflow_transport::{ChannelSizes, Node};

/// Why a source failed.
pub type SourceError = Box<dyn std::error::Error + Send + Sync>;

/// Publishes images and pattern events.
pub trait Source {
    /// Joins the instance. `accounts` is the folder of its accounts.
    ///
    /// # Errors
    /// The channels or the accounts cannot be used.
    fn open(&mut self, node: &Node, sizes: &ChannelSizes, accounts: &Path) -> Result<(), SourceError>;

    /// Publishes everything that is due. Called many times per second while the instance scans, and while its services
    /// stop.
    ///
    /// # Errors
    /// The source cannot continue.
    fn publish_due(&mut self) -> Result<Progress, SourceError>;

    /// Leaves the instance.
    fn close(&mut self);
}

/// Progress of a source.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// The next message is due at this time, nanoseconds.
    Next(u64),
    /// The source waits for the pipeline.
    Waiting,
    /// Everything has been published.
    Finished,
}
