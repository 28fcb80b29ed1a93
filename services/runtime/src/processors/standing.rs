//! What a service was given of the machine, and what it was refused: in its log, and for whoever asks from outside.

use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

/// What came of what a service is to be given.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Standing {
    /// What it has.
    pub granted: Vec<String>,
    /// What it has not, why, and what to do.
    pub refused: Vec<String>,
}

impl Standing {
    /// Adds one thing.
    pub(super) fn note(&mut self, outcome: Result<String, String>) {
        match outcome {
            Ok(granted) => self.granted.push(granted),
            Err(refused) => self.refused.push(refused),
        }
    }

    /// Says it in the log, and leaves it where [`Self::read`] finds it.
    pub(crate) fn tell(&self, accounts: &Path, service: &str) {
        if !self.granted.is_empty() {
            tracing::info!("runs with {}", self.granted.join(", "));
        }
        self.refused.iter().for_each(|refused| tracing::warn!("runs without {refused}"));
        let text = serde_json::to_string(self).map_err(std::io::Error::other);
        let written = fs::create_dir_all(accounts).and(text).and_then(|text| fs::write(file(accounts, service), text));
        // The log has told it.
        if let Err(error) = written {
            tracing::debug!(%error, "`fringeflow status` will not show this");
        }
    }

    /// What a service of an instance has told last, by the folder of its accounts; `None` where nothing was said of it.
    #[must_use]
    pub fn read(accounts: &Path, service: &str) -> Option<Self> {
        serde_json::from_slice(&fs::read(file(accounts, service)).ok()?).ok()
    }
}

impl fmt::Display for Standing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let granted = if self.granted.is_empty() { "the usual rights".to_owned() } else { self.granted.join(", ") };
        write!(f, "runs with {granted}")?;
        self.refused.iter().try_for_each(|refused| write!(f, "; without {refused}"))
    }
}

fn file(accounts: &Path, service: &str) -> PathBuf {
    accounts.join(format!("{service}.processors.json"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_told_can_be_read() {
        let folder = tempfile::tempdir().unwrap();
        let mut standing = Standing::default();
        standing.note(Ok("CPUs 0-1".to_owned()));
        standing.note(Err("realtime_priority = 5: not permitted".to_owned()));
        standing.tell(folder.path(), "phase");
        assert_eq!(Standing::read(folder.path(), "phase"), Some(standing));
        assert_eq!(Standing::read(folder.path(), "cloud"), None);
    }
}
