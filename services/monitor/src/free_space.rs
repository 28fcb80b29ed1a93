//! Free space: shared memory for the channels, disk for the recordings.

use std::path::Path;

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
        let existing = folder.ancestors().find(|folder| folder.exists());
        Self {
            shared_memory_free_mb: free_mb(Path::new(SHARED_MEMORY)),
            disk_free_mb: existing.map_or(f64::NAN, free_mb),
        }
    }
}

fn free_mb(path: &Path) -> f64 {
    rustix::fs::statvfs(path).map_or(f64::NAN, |disk| (disk.f_bavail * disk.f_frsize) as f64 / 1e6)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_folder_has_the_space_of_its_parent() {
        let folder = tempfile::tempdir().unwrap();
        let free = FreeSpace::measure(&folder.path().join("not/yet"));
        assert!(free.disk_free_mb > 0.0 && free.shared_memory_free_mb >= 0.0);
    }
}
