//! Progress of what a service prepares before it can work, in a file beside the accounts. Supervisor, dashboard and
//! `status` read it.

use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use fringeflow_transport::Instance;

use crate::{accounts_folder, status_file};

/// Progress of a preparation.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Preparation {
    /// The task, such as "Rendering images".
    pub what: String,
    /// Number of finished parts.
    pub done: u64,
    /// Number of all parts.
    pub total: u64,
}

/// Writes the progress of a preparation. Dropping it ends the preparation.
#[derive(Debug)]
pub struct PreparationReporter {
    file: PathBuf,
    preparation: Preparation,
}

impl Preparation {
    /// Reads the running preparation of an instance. Returns `None` if there is none.
    #[must_use]
    pub fn read(instance: &Instance) -> Option<Self> {
        status_file::read(&progress_file(&accounts_folder(instance)))
    }
}

impl fmt::Display for Preparation {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {} of {}", self.what, self.done, self.total)
    }
}

impl PreparationReporter {
    /// Begins a preparation of `total` parts. `accounts` is the folder of the accounts.
    pub(crate) fn new(accounts: &Path, what: &str, total: u64) -> Self {
        let preparation = Preparation { what: what.to_owned(), done: 0, total };
        let reporter = Self { file: progress_file(accounts), preparation };
        reporter.publish();
        reporter
    }

    /// Sets the number of finished parts.
    pub fn set_done(&mut self, done: u64) {
        self.preparation.done = done;
        self.publish();
    }

    fn publish(&self) {
        status_file::write(&self.file, &self.preparation);
    }
}

impl Drop for PreparationReporter {
    fn drop(&mut self) {
        // An error is ignored: without a file there is nothing to remove.
        let _ = fs::remove_file(&self.file);
    }
}

fn progress_file(accounts: &Path) -> PathBuf {
    accounts.join("preparation.json")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn progress_is_read_until_the_preparation_ends() {
        let folder = tempfile::tempdir().unwrap();
        let instance = Instance::in_folder(folder.path(), "t").unwrap();
        let mut reporter = PreparationReporter::new(&accounts_folder(&instance), "Rendering images", 360);
        reporter.set_done(120);
        assert_eq!(Preparation::read(&instance).unwrap().to_string(), "Rendering images: 120 of 360");
        drop(reporter);
        assert_eq!(Preparation::read(&instance), None);
    }
}
