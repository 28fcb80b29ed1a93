//! What stands in the place of cameras and projector, in the supervisor's own process.

use std::path::Path;

use fringeflow_transport::{ChannelSizes, Node};

/// Why a source cannot go on.
pub type SourceError = Box<dyn std::error::Error + Send + Sync>;

/// Puts out images and pattern events.
pub trait Source {
    /// Joins the instance, whose accounts lie in a folder.
    ///
    /// # Errors
    /// The channels or the accounts cannot be used.
    fn open(&mut self, node: &Node, sizes: &ChannelSizes, accounts: &Path) -> Result<(), SourceError>;

    /// Puts out what is due. Asked many times a second while the instance scans, and while its services end.
    ///
    /// # Errors
    /// It cannot go on.
    fn turn(&mut self) -> Result<Progress, SourceError>;

    /// Leaves the instance.
    fn close(&mut self);
}

/// How far a source is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Progress {
    /// There is something to put out at this time.
    Next(u64),
    /// It waits for the pipeline.
    Waiting,
    /// Everything was put out.
    Finished,
}
