//! Small files beside the accounts in which a service tells other processes its status.

use std::fs;
use std::io;
use std::path::Path;

use serde::Serialize;
use serde::de::DeserializeOwned;

/// Reads a status. Returns `None` if there is none.
pub(crate) fn read<T: DeserializeOwned>(file: &Path) -> Option<T> {
    serde_json::from_slice(&fs::read(file).ok()?).ok()
}

/// Writes a status. A failure is only logged: the service works without it.
pub(crate) fn write(file: &Path, status: &impl Serialize) {
    if let Err(error) = replace(file, status) {
        tracing::debug!(%error, file = %file.display(), "the status cannot be written");
    }
}

/// Replaces the file in one step, so that readers never see half of it.
fn replace(file: &Path, status: &impl Serialize) -> io::Result<()> {
    let unfinished = file.with_extension("part");
    file.parent().map_or(Ok(()), fs::create_dir_all)?;
    fs::write(&unfinished, serde_json::to_vec(status)?)?;
    fs::rename(&unfinished, file)
}
