//! Writing files so that a name never stands for half a result: written beside, synchronized, renamed.

use std::fs::{File, Permissions};
use std::io::{self, BufWriter, Write};
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

/// Why a file could not be written; what stood at its path before is untouched.
#[derive(Debug, thiserror::Error)]
#[error("{}: {problem}", path.display())]
pub struct WriteError {
    /// The file.
    pub path: PathBuf,
    /// What was in the way.
    #[source]
    pub problem: WriteProblem,
}

/// What was in the way of writing a file.
#[derive(Debug, thiserror::Error)]
pub enum WriteProblem {
    /// The path is a folder.
    #[error("is a folder; give the path of a file")]
    IsAFolder,
    /// The folder it should go to does not exist.
    #[error("cannot be written: the folder {} does not exist; create it first", .0.display())]
    NoFolder(PathBuf),
    /// The disk ran full.
    #[error("cannot be written: the disk is full; free some space and try again")]
    DiskFull,
    /// Anything else that the operating system said.
    #[error("cannot be written: {0}")]
    Io(#[source] io::Error),
}

/// Writes a file through `write`; the path changes only once everything is on the disk.
///
/// # Errors
/// [`WriteError`]: the path is a folder, its folder is missing or not writable, or the disk is full. Whatever stood at
/// the path stays as it was.
pub fn write_atomically(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<&File>) -> io::Result<()>,
) -> Result<(), WriteError> {
    let fail = |problem| WriteError { path: path.to_owned(), problem };
    let folder = check_target(path).map_err(fail)?;
    let mut builder = tempfile::Builder::new();
    // The umask still applies; tempfile's own default would hide the result from everybody else.
    builder.prefix(".fringeflow-").suffix(".part").permissions(Permissions::from_mode(0o666));
    let write_to_temporary = || {
        let temporary = builder.tempfile_in(folder)?;
        let mut out = BufWriter::with_capacity(1 << 20, temporary.as_file());
        write(&mut out)?;
        out.flush()?;
        drop(out);
        temporary.as_file().sync_all()?;
        temporary.persist(path)?;
        Ok(())
    };
    write_to_temporary().map_err(|e| fail(problem_of(e)))
}

/// Checks a path that is to be written, before the work whose result goes there.
///
/// # Errors
/// As [`write_atomically`], as far as it can be known before writing.
pub fn check_writable(path: &Path) -> Result<(), WriteError> {
    let fail = |problem| WriteError { path: path.to_owned(), problem };
    let folder = check_target(path).map_err(fail)?;
    tempfile::tempfile_in(folder).map(drop).map_err(|e| fail(problem_of(e)))
}

/// The folder that a file will stand in.
fn check_target(path: &Path) -> Result<&Path, WriteProblem> {
    if path.is_dir() {
        return Err(WriteProblem::IsAFolder);
    }
    let folder = match path.parent() {
        Some(parent) if !parent.as_os_str().is_empty() => parent,
        _ => Path::new("."),
    };
    if folder.is_dir() { Ok(folder) } else { Err(WriteProblem::NoFolder(folder.to_owned())) }
}

fn problem_of(error: io::Error) -> WriteProblem {
    if error.kind() == io::ErrorKind::StorageFull { WriteProblem::DiskFull } else { WriteProblem::Io(error) }
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
    fn folders_are_no_targets() {
        let folder = tempfile::tempdir().unwrap();
        let problem = |path: &Path| write_atomically(path, |_| Ok(())).unwrap_err().problem;
        assert!(matches!(problem(folder.path()), WriteProblem::IsAFolder));
        assert!(matches!(problem(&folder.path().join("missing/cloud.ply")), WriteProblem::NoFolder(_)));
    }
}
