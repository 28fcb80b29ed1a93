//! The file of a recording in the making: a name that says so, room on the disk, and its final name in the end.
//!
//! While it grows it is called `NAME.mcap.part`, so that no half of a recording is ever called one; what a killed
//! recorder leaves behind keeps that name, and `fringeflow recover` reads it. Blocks are claimed ahead of what is
//! written: a disk that runs full says so while there is still room to close the file.

use std::fs::{File, OpenOptions};
use std::io::{self, ErrorKind, IoSlice, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rustix::fs::{CWD, FallocateFlags, RenameFlags};
use rustix::io::Errno;

use super::error::{RecordingError, RecordingProblem};

/// What the name of an unfinished recording ends in.
pub const UNFINISHED: &str = ".part";
/// The same for one that is being recovered: `NAME.mcap.part` can become `NAME.mcap`.
pub(super) const UNFINISHED_RECOVERY: &str = ".recovered.part";
/// Blocks are claimed in steps of so many bytes.
const CLAIM_BYTES: u64 = 32 << 20;
/// Scratch for the end of the file: a fixed part, and indexes, of which this share of the file is four times as much as needed.
const CLOSING_BYTES: u64 = 4 << 20;
const CLOSING_SHARE: u64 = 4096;
/// Record and index entry around a message, generously.
const MESSAGE_OVERHEAD_BYTES: u64 = 256;

/// The growing file, and how much of the disk it may take.
#[derive(Debug)]
pub(super) struct UnfinishedFile {
    target: PathBuf,
    path: PathBuf,
    file: Arc<File>,
    min_free_bytes: u64,
    planned_bytes: u64,
    claimed_bytes: u64,
}

/// The end of the file that the MCAP writer writes to.
#[derive(Debug)]
pub(super) struct FileEnd(Arc<File>);

impl UnfinishedFile {
    /// Makes the file beside its final name, to which `suffix` is added until it is finished.
    pub(super) fn create(target: &Path, suffix: &str, min_free_bytes: u64) -> Result<Self, RecordingError> {
        let mut path = target.as_os_str().to_owned();
        path.push(suffix);
        let path = PathBuf::from(path);
        if target.symlink_metadata().is_ok() {
            return Err(RecordingProblem::Exists.of(target));
        }
        let opened = OpenOptions::new().read(true).write(true).create_new(true).open(&path);
        let file = opened.map_err(|e| match e.kind() {
            ErrorKind::AlreadyExists => RecordingProblem::Exists.of(&path),
            _ => RecordingProblem::Unwritable(e).of(target),
        })?;
        let mut unfinished = Self {
            target: target.to_owned(),
            path,
            file: Arc::new(file),
            min_free_bytes,
            planned_bytes: 0,
            claimed_bytes: 0,
        };
        if unfinished.admits(0) {
            return Ok(unfinished);
        }
        let problem = RecordingProblem::NoSpace { free_bytes: unfinished.free_bytes(), min_free_bytes };
        unfinished.discard();
        Err(problem.of(target))
    }

    /// Where the MCAP writer writes to.
    pub(super) fn end(&self) -> FileEnd {
        FileEnd(Arc::clone(&self.file))
    }

    /// Whether the disk takes a message of so many bytes and still has room for the end of the file.
    pub(super) fn admits(&mut self, message_bytes: usize) -> bool {
        let planned = self.planned_bytes + message_bytes as u64 + MESSAGE_OVERHEAD_BYTES;
        let needed = planned + CLOSING_BYTES + planned / CLOSING_SHARE;
        while self.claimed_bytes < needed {
            if !self.claim() {
                return false;
            }
        }
        self.planned_bytes = planned;
        true
    }

    fn claim(&mut self) -> bool {
        if self.free_bytes() < self.min_free_bytes.saturating_add(CLAIM_BYTES) {
            return false;
        }
        let claimed = rustix::fs::fallocate(&self.file, FallocateFlags::KEEP_SIZE, self.claimed_bytes, CLAIM_BYTES);
        // A file system that cannot claim blocks is trusted to have them.
        let granted = matches!(claimed, Ok(()) | Err(Errno::OPNOTSUPP | Errno::NOSYS));
        if granted {
            self.claimed_bytes += CLAIM_BYTES;
        }
        granted
    }

    /// Bytes that are free for us; where the file system does not say, as many as it takes.
    fn free_bytes(&self) -> u64 {
        rustix::fs::fstatvfs(&self.file).map_or(u64::MAX, |disk| disk.f_bavail.saturating_mul(disk.f_frsize))
    }

    /// Has the disk keep what the file holds.
    pub(super) fn sync(&self) -> io::Result<()> {
        self.file.sync_data()
    }

    /// Gives blocks that were not needed back, and the file its final name.
    pub(super) fn finish(self) -> Result<PathBuf, RecordingError> {
        let fail = |e: io::Error| RecordingProblem::Unfinishable(e.to_string()).of(&self.target);
        let length = self.file.metadata().map_err(fail)?.len();
        self.file.set_len(length).map_err(fail)?;
        self.file.sync_all().map_err(fail)?;
        match rustix::fs::renameat_with(CWD, &self.path, CWD, &self.target, RenameFlags::NOREPLACE) {
            Ok(()) => Ok(self.target),
            // Not every file system knows this flag; the name was free when the recording began.
            Err(Errno::INVAL | Errno::NOSYS) if self.target.symlink_metadata().is_err() => {
                std::fs::rename(&self.path, &self.target).map_err(fail)?;
                Ok(self.target)
            }
            Err(e) => Err(fail(e.into())),
        }
    }

    /// Removes the file.
    pub(super) fn discard(self) {
        // Who cannot remove it leaves a file whose name says what it is.
        let _ = std::fs::remove_file(&self.path);
    }
}

impl Write for FileEnd {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        (&*self.0).write(bytes)
    }

    fn write_vectored(&mut self, pieces: &[IoSlice<'_>]) -> io::Result<usize> {
        (&*self.0).write_vectored(pieces)
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}
