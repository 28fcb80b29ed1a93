//! Free space: shared memory for the channels, disk for the recordings.

use std::path::Path;

use fringeflow_runtime::free_bytes;
use serde::Serialize;

/// Mount point of the shared memory.
const SHARED_MEMORY: &str = "/dev/shm";

/// Free space; NaN if the system does not tell it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct FreeSpace {
    pub(crate) shared_memory_free_mb: f64,
    pub(crate) disk_free_mb: f64,
}

impl FreeSpace {
    /// Measures the shared memory of this machine, and the disk that holds a folder or will hold it.
    pub(crate) fn measure(folder: &Path) -> Self {
        let free_mb = |folder| free_bytes(folder).map_or(f64::NAN, |bytes| bytes as f64 / 1e6);
        Self { shared_memory_free_mb: free_mb(Path::new(SHARED_MEMORY)), disk_free_mb: free_mb(folder) }
    }
}
