//! What a service prepares before it can work, and how far it is: a file beside the accounts, read by supervisor, dashboard and
//! `status`.

use std::fmt;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use fringeflow_transport::Instance;

use crate::accounts_folder;

/// How far a preparation is.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Preparation {
    /// What is done, such as "Rendering images".
    pub what: String,
    /// Parts that are done.
    pub done: u64,
    /// All parts.
    pub total: u64,
}

/// Tells how far a preparation is, and that it has ended when it is dropped.
#[derive(Debug)]
pub struct Preparing {
    file: PathBuf,
    preparation: Preparation,
}

impl Preparation {
    /// The preparation that a service of an instance works on; `None` where all are ready.
    #[must_use]
    pub fn read(instance: &Instance) -> Option<Self> {
        serde_json::from_slice(&fs::read(file(&accounts_folder(instance))).ok()?).ok()
    }
}

impl fmt::Display for Preparation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {} of {}", self.what, self.done, self.total)
    }
}

impl Preparing {
    /// Begins a preparation of `total` parts, by the folder of the accounts.
    pub(crate) fn begin(accounts: &Path, what: &str, total: u64) -> Self {
        let preparation = Preparation { what: what.to_owned(), done: 0, total };
        let preparing = Self { file: file(accounts), preparation };
        preparing.tell();
        preparing
    }

    /// Tells that `done` parts are done.
    pub fn reach(&mut self, done: u64) {
        self.preparation.done = done;
        self.tell();
    }

    fn tell(&self) {
        if let Err(error) = self.write() {
            tracing::debug!(%error, "the progress cannot be shown");
        }
    }

    /// Replaces the file at once, so that nobody reads half of it.
    fn write(&self) -> io::Result<()> {
        let unfinished = self.file.with_extension("part");
        self.file.parent().map_or(Ok(()), fs::create_dir_all)?;
        fs::write(&unfinished, serde_json::to_vec(&self.preparation)?)?;
        fs::rename(&unfinished, &self.file)
    }
}

impl Drop for Preparing {
    fn drop(&mut self) {
        // Without a file there is nothing to remove.
        let _ = fs::remove_file(&self.file);
    }
}

fn file(accounts: &Path) -> PathBuf {
    accounts.join("preparation.json")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn progress_is_read_until_the_preparation_ends() {
        let folder = tempfile::tempdir().unwrap();
        let instance = Instance::in_folder(folder.path(), "t").unwrap();
        let mut preparing = Preparing::begin(&accounts_folder(&instance), "Rendering images", 360);
        preparing.reach(120);
        assert_eq!(Preparation::read(&instance).unwrap().to_string(), "Rendering images: 120 of 360");
        drop(preparing);
        assert_eq!(Preparation::read(&instance), None);
    }
}
