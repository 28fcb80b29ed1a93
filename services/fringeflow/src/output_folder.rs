//! Outputs of the commands: folders, and the kind of a file.

use std::path::Path;

use tempfile::TempDir;

use fringeflow_base::atomic_file::{WriteError, WriteProblem};

/// Creates the folder if it is missing. Call it before the work whose results go there.
pub(crate) fn prepare(folder: &Path) -> Result<(), WriteError> {
    std::fs::create_dir_all(folder).map_err(|e| WriteError { path: folder.to_owned(), problem: WriteProblem::Io(e) })
}

/// Creates a temporary folder, removed when the result is dropped.
pub(crate) fn temporary() -> Result<TempDir, WriteError> {
    tempfile::tempdir().map_err(|e| WriteError { path: std::env::temp_dir(), problem: WriteProblem::Io(e) })
}

/// Whether the name of a file ends in `.wanted`, in upper or lower case.
pub(crate) fn has_extension(path: &Path, wanted: &str) -> bool {
    path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case(wanted))
}
