//! The file of an unfinished recording: its temporary name, its disk space, and its final name.
//!
//! The growing file is called `NAME.mcap.part`, so that a partial recording never has the name of a complete one. If
//! the recorder is killed, this file remains, and `fringeflow recover` reads it. Blocks are allocated ahead of the
//! written data. So a full disk is noticed while there is still space to close the file.

use std::fs::{File, OpenOptions};
use std::io::{self, ErrorKind};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rustix::fs::{CWD, FallocateFlags, RenameFlags};
use rustix::io::Errno;

use crate::block_writer::{BlockWriter, open_direct};
use crate::{RecordingError, RecordingProblem};

/// Number of bytes allocated at a time.
const ALLOCATION_BYTES: u64 = 32 << 20;
/// Space for the end of the file: a fixed part, and 1/4096 of the file for indexes, four times what they need.
const CLOSING_BYTES: u64 = 4 << 20;
const CLOSING_SHARE: u64 = 4096;
/// Generous estimate of the record and index entry of a message.
const MESSAGE_OVERHEAD_BYTES: u64 = 256;

/// The growing file and its space limits.
#[derive(Debug)]
pub(super) struct UnfinishedFile {
    target: PathBuf,
    path: PathBuf,
    file: Arc<File>,
    min_free_bytes: u64,
    reserved_bytes: u64,
    allocated_bytes: u64,
}

impl UnfinishedFile {
    /// Creates the file with its final name plus `suffix`.
    pub(super) fn create(target: &Path, suffix: &str, min_free_bytes: u64) -> Result<Self, RecordingError> {
        let mut path = target.as_os_str().to_owned();
        path.push(suffix);
        let path = PathBuf::from(path);
        if target.symlink_metadata().is_ok() {
            return Err(RecordingProblem::Exists.in_file(target));
        }
        let opened = OpenOptions::new().read(true).write(true).create_new(true).open(&path);
        let file = opened.map_err(|e| match e.kind() {
            ErrorKind::AlreadyExists => RecordingProblem::Exists.in_file(&path),
            _ => RecordingProblem::Unwritable(e).in_file(target),
        })?;
        let mut unfinished = Self {
            target: target.to_owned(),
            path,
            file: Arc::new(file),
            min_free_bytes,
            reserved_bytes: 0,
            allocated_bytes: 0,
        };
        if unfinished.reserve(0) {
            return Ok(unfinished);
        }
        let problem = RecordingProblem::NoSpace { free_bytes: unfinished.free_bytes(), min_free_bytes };
        unfinished.discard();
        Err(problem.in_file(target))
    }

    /// Returns the file for the MCAP writer.
    pub(super) fn writer(&self) -> BlockWriter {
        BlockWriter::new(Arc::clone(&self.file), open_direct(&self.path))
    }

    /// Reserves space for a message and for the end of the file. Returns `false` if the disk is full.
    pub(super) fn reserve(&mut self, message_bytes: usize) -> bool {
        let reserved = self.reserved_bytes + message_bytes as u64 + MESSAGE_OVERHEAD_BYTES;
        let needed = reserved + CLOSING_BYTES + reserved / CLOSING_SHARE;
        while self.allocated_bytes < needed {
            if !self.allocate() {
                return false;
            }
        }
        self.reserved_bytes = reserved;
        true
    }

    fn allocate(&mut self) -> bool {
        if self.free_bytes() < self.min_free_bytes.saturating_add(ALLOCATION_BYTES) {
            return false;
        }
        let result =
            rustix::fs::fallocate(&self.file, FallocateFlags::KEEP_SIZE, self.allocated_bytes, ALLOCATION_BYTES);
        // If the file system does not support allocation, only the free space is checked.
        let is_allocated = matches!(result, Ok(()) | Err(Errno::OPNOTSUPP | Errno::NOSYS));
        if is_allocated {
            self.allocated_bytes += ALLOCATION_BYTES;
        }
        is_allocated
    }

    /// Returns the free bytes of the disk; unlimited if the file system does not report them.
    fn free_bytes(&self) -> u64 {
        rustix::fs::fstatvfs(&self.file).map_or(u64::MAX, |disk| disk.f_bavail.saturating_mul(disk.f_frsize))
    }

    /// Synchronizes the file to the disk.
    pub(super) fn sync(&self) -> io::Result<()> {
        self.file.sync_data()
    }

    /// Releases unused blocks, and renames the file to its final name.
    pub(super) fn finish(self) -> Result<PathBuf, RecordingError> {
        let fail = |e: io::Error| RecordingProblem::Unfinishable(e.to_string()).in_file(&self.target);
        let length = self.file.metadata().map_err(fail)?.len();
        self.file.set_len(length).map_err(fail)?;
        self.file.sync_all().map_err(fail)?;
        match rustix::fs::renameat_with(CWD, &self.path, CWD, &self.target, RenameFlags::NOREPLACE) {
            Ok(()) => Ok(self.target),
            // Not every file system supports this flag. The name was free when the recording started.
            Err(Errno::INVAL | Errno::NOSYS) if self.target.symlink_metadata().is_err() => {
                std::fs::rename(&self.path, &self.target).map_err(fail)?;
                Ok(self.target)
            }
            Err(e) => Err(fail(e.into())),
        }
    }

    /// Removes the file.
    pub(super) fn discard(self) {
        // If removing fails, the file stays; its name marks it as unfinished.
        let _ = std::fs::remove_file(&self.path);
    }
}
