//! The folder that a command writes its pictures to.

use std::path::Path;

use crate::failure::Failure;

/// Refuses a folder that is not there, before the work that the pictures show.
pub(crate) fn check(folder: &Path) -> Result<(), Failure> {
    let missing = || Failure::Usage(format!("--preview {}: is not a folder; create it first", folder.display()));
    folder.is_dir().then_some(()).ok_or_else(missing)
}
