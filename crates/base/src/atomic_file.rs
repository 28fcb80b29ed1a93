//! Atomic writes: a file is written under a temporary name, synchronized to the disk, and then renamed.

use std::fs::{File, Permissions};
use std::io::{self, BufWriter, Write};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use tempfile::{NamedTempFile, PersistError};

/// Why a file could not be written. An existing file at the path stays unchanged.
#[derive(Debug, thiserror::Error)]
#[error("{}: {problem}", path.display())]
pub struct WriteError {
    /// The file.
    pub path: PathBuf,
    /// The cause.
    #[source]
    pub problem: WriteProblem,
}

/// Why a file could not be written.
#[derive(Debug, thiserror::Error)]
pub enum WriteProblem {
    /// A file exists that must not be replaced.
    #[error("already exists; choose another name or remove it first")]
    Exists,
    /// The path is a folder.
    #[error("is a folder; a file path is expected")]
    IsAFolder,
    /// The path is a device, a pipe or a socket, which a file must not replace.
    #[error("is a device or a pipe; a file path is expected")]
    IsSpecial,
    /// The parent folder does not exist.
    #[error("cannot be written: the folder {} does not exist; create it first", .0.display())]
    NoFolder(PathBuf),
    /// The disk is full.
    #[error("cannot be written: the disk is full; free some space and try again")]
    DiskFull,
    /// Any other error of the operating system.
    #[error("cannot be written: {0}")]
    Io(#[source] io::Error),
}

/// Writes a file with the function `write`. The file at the path is replaced only after all bytes are on the disk.
///
/// # Errors
/// [`WriteError`]: the path is a folder, its parent folder is missing or not writable, or the disk is full. An existing
/// file at the path stays unchanged.
pub fn write_atomically(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&File>) -> io::Result<()>,
) -> Result<(), WriteError> {
    write_and_name(path, write, |temporary| temporary.persist(path))
}

/// Writes a file as [`write_atomically`] does, but never replaces an existing file.
///
/// # Errors
/// Those of [`write_atomically`], and [`WriteProblem::Exists`].
pub fn write_new(path: &Path, write: impl FnOnce(&mut BufWriter<&File>) -> io::Result<()>) -> Result<(), WriteError> {
    write_and_name(path, write, |temporary| temporary.persist_noclobber(path))
}

fn write_and_name(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&File>) -> io::Result<()>,
    name: impl FnOnce(NamedTempFile) -> Result<File, PersistError>,
) -> Result<(), WriteError> {
    let fail = |problem| WriteError { path: path.to_owned(), problem };
    let folder = check_target(path).map_err(fail)?;
    let write_to_temporary = || {
        let temporary = temporary_in(folder)?;
        let mut out = BufWriter::with_capacity(1 << 20, temporary.as_file());
        write(&mut out)?;
        out.flush()?;
        drop(out);
        temporary.as_file().sync_all()?;
        name(temporary)?;
        Ok(())
    };
    write_to_temporary().map_err(|e| fail(problem_of(e)))
}

/// A file that is written step by step. It appears under its name with [`Self::finish`]; if it is dropped before, it is
/// deleted.
#[derive(Debug)]
pub struct PendingFile {
    path: PathBuf,
    out: BufWriter<NamedTempFile>,
}

impl PendingFile {
    /// Creates the temporary file.
    ///
    /// # Errors
    /// As [`write_atomically`].
    pub fn begin(path: &Path) -> Result<Self, WriteError> {
        let fail = |problem| WriteError { path: path.to_owned(), problem };
        let folder = check_target(path).map_err(fail)?;
        let temporary = temporary_in(folder).map_err(|e| fail(problem_of(e)))?;
        Ok(Self { path: path.to_owned(), out: BufWriter::new(temporary) })
    }

    /// Synchronizes the file to the disk and renames it to its final name.
    ///
    /// # Errors
    /// As [`write_atomically`].
    pub fn finish(self) -> Result<(), WriteError> {
        let Self { path, out } = self;
        let finish = || {
            let temporary = out.into_inner().map_err(io::IntoInnerError::into_error)?;
            temporary.as_file().sync_all()?;
            temporary.persist(&path)?;
            Ok(())
        };
        finish().map_err(|e| WriteError { path: path.clone(), problem: problem_of(e) })
    }

    /// Returns the error for a failed write to `path`.
    #[must_use]
    pub fn error(path: &Path, error: io::Error) -> WriteError {
        WriteError { path: path.to_owned(), problem: problem_of(error) }
    }
}

impl Write for PendingFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.out.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.out.flush()
    }
}

fn temporary_in(folder: &Path) -> io::Result<NamedTempFile> {
    let mut builder = tempfile::Builder::new();
    // The umask still applies. With tempfile's own default, other users could not read the result.
    builder.prefix(".fringeflow-").suffix(".part").permissions(Permissions::from_mode(0o666));
    builder.tempfile_in(folder)
}

/// Checks that a path can be written, before the content is computed.
///
/// # Errors
/// Those of [`write_atomically`] that can be found without writing the content.
pub fn check_writable(path: &Path) -> Result<(), WriteError> {
    let fail = |problem| WriteError { path: path.to_owned(), problem };
    let folder = check_target(path).map_err(fail)?;
    tempfile::tempfile_in(folder).map(drop).map_err(|e| fail(problem_of(e)))
}

/// Returns the folder that will contain the file, or the reason why the file cannot be written.
fn check_target(path: &Path) -> Result<&Path, WriteProblem> {
    if path.is_dir() {
        return Err(WriteProblem::IsAFolder);
    }
    if path.exists() && !path.is_file() {
        return Err(WriteProblem::IsSpecial);
    }
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    if folder.is_dir() { Ok(folder) } else { Err(WriteProblem::NoFolder(folder.to_owned())) }
}

fn problem_of(error: io::Error) -> WriteProblem {
    match error.kind() {
        io::ErrorKind::StorageFull => WriteProblem::DiskFull,
        io::ErrorKind::AlreadyExists => WriteProblem::Exists,
        _ => WriteProblem::Io(error),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cloud.ply");
        std::fs::write(&path, "old").unwrap();
        let result = write_atomically(&path, |out| {
            out.write_all(b"half")?;
            Err(io::Error::from(io::ErrorKind::StorageFull))
        });
        assert!(matches!(result.unwrap_err().problem, WriteProblem::DiskFull));
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "old");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn write_new_never_replaces_a_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("report.html");
        write_new(&path, |out| out.write_all(b"first")).unwrap();
        let again = write_new(&path, |out| out.write_all(b"second"));
        assert!(matches!(again.unwrap_err().problem, WriteProblem::Exists));
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "first");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn a_pending_file_appears_only_when_it_is_finished() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("trace.json");
        let mut pending = PendingFile::begin(&path).unwrap();
        pending.write_all(b"half").unwrap();
        assert!(!path.exists());
        pending.finish().unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "half");
        drop(PendingFile::begin(&path).unwrap());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn folders_and_devices_are_rejected() {
        let folder = tempfile::tempdir().unwrap();
        let problem = |path: &Path| write_atomically(path, |_| Ok(())).unwrap_err().problem;
        assert!(matches!(problem(folder.path()), WriteProblem::IsAFolder));
        // Replacing a device would break it for all programs.
        assert!(matches!(check_writable(Path::new("/dev/null")).unwrap_err().problem, WriteProblem::IsSpecial));
        assert!(matches!(problem(&folder.path().join("missing/cloud.ply")), WriteProblem::NoFolder(_)));
    }
}
