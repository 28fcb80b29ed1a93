//! Room that is left: shared memory for the channels, disk for the recordings.

use std::path::Path;

use serde::Serialize;

/// Where shared memory is.
const SHARED_MEMORY: &str = "/dev/shm";

/// Free bytes; not a number where the system does not say.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(crate) struct Room {
    pub(crate) shared_memory_free_mb: f64,
    pub(crate) disk_free_mb: f64,
}

impl Room {
    /// Of this machine, with the disk of a folder.
    pub(crate) fn of(folder: &Path) -> Self {
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
    fn a_folder_that_is_yet_to_be_made_has_the_room_of_the_one_above() {
        let folder = tempfile::tempdir().unwrap();
        let room = Room::of(&folder.path().join("not/yet"));
        assert!(room.disk_free_mb > 0.0 && room.shared_memory_free_mb >= 0.0);
    }
}
