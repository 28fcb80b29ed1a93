//! Tries what channels do in a folder of shared memory: creates a file, gives it a size, maps it, and removes it.
//!
//! Free bytes alone do not tell that it works: the folder may be read-only or closed to the user.

// The kernel offers no safe way to map a file. Only the function `map` uses unsafe code.
#![allow(unsafe_code)]

use std::fs::{self, File, OpenOptions};
use std::io;
use std::os::unix::fs::OpenOptionsExt;
use std::path::Path;
use std::ptr;

use rustix::fs::{FallocateFlags, fallocate};
use rustix::mm::{MapFlags, ProtFlags, mmap, munmap};

/// Size of the file, bytes: one page, so the trial takes no memory that an instance may need.
const BYTES: usize = 4096;

/// Creates a file in a folder, reserves its memory, maps it for reading and writing, and removes it.
///
/// # Errors
/// Error of the system call that was refused.
pub(super) fn try_file_in(folder: &Path) -> io::Result<()> {
    let path = folder.join(format!("fringeflow-trial-{}", std::process::id()));
    let file = OpenOptions::new().read(true).write(true).create(true).truncate(true).mode(0o600).open(&path)?;
    let mapped = fallocate(&file, FallocateFlags::empty(), 0, BYTES as u64).map_err(io::Error::from);
    let mapped = mapped.and_then(|()| map(&file));
    // The file is removed whatever happened to it.
    fs::remove_file(&path).and(mapped)
}

/// Maps the file, and unmaps it again.
fn map(file: &File) -> io::Result<()> {
    let (protection, flags) = (ProtFlags::READ | ProtFlags::WRITE, MapFlags::SHARED);
    // SAFETY: a new mapping at an address that the kernel chooses overlaps no memory of this program. Nothing reads or
    // writes it before it is unmapped with the same length.
    unsafe { Ok(munmap(mmap(ptr::null_mut(), BYTES, protection, flags, file, 0)?, BYTES)?) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_that_works_is_left_empty() {
        let folder = tempfile::tempdir_in("/dev/shm").unwrap();
        try_file_in(folder.path()).unwrap();
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    #[test]
    fn a_folder_that_does_not_take_files_is_told() {
        assert_eq!(try_file_in(Path::new("/nowhere")).unwrap_err().kind(), io::ErrorKind::NotFound);
        assert!(try_file_in(Path::new("/proc")).is_err());
    }
}
