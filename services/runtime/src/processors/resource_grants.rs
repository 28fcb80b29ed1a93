//! Resources that the system granted or refused a service, in its log and in a file for other processes.

use std::fmt;
use std::fs;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

/// Resources that were granted or refused to a service.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct ResourceGrants {
    /// Granted resources.
    pub granted: Vec<String>,
    /// Refused resources, each with the reason and the remedy.
    pub refused: Vec<String>,
}

impl ResourceGrants {
    /// Adds one resource.
    pub(super) fn add(&mut self, outcome: Result<String, String>) {
        match outcome {
            Ok(granted) => self.granted.push(granted),
            Err(refused) => self.refused.push(refused),
        }
    }

    /// Logs the grants, and writes the file for [`Self::read`].
    pub(crate) fn publish(&self, accounts: &Path, service: &str) {
        if !self.granted.is_empty() {
            tracing::info!("runs with {}", self.granted.join(", "));
        }
        self.refused.iter().for_each(|refused| tracing::warn!("runs without {refused}"));
        let text = serde_json::to_string(self).map_err(std::io::Error::other);
        let written =
            fs::create_dir_all(accounts).and(text).and_then(|text| fs::write(grants_file(accounts, service), text));
        // Only a debug message: the log has the grants already.
        if let Err(error) = written {
            tracing::debug!(%error, "`fringeflow status` will not show these resources");
        }
    }

    /// Reads the last grants of a service. `accounts` is the folder of the accounts. Returns `None` if the service has
    /// no settings.
    #[must_use]
    pub fn read(accounts: &Path, service: &str) -> Option<Self> {
        serde_json::from_slice(&fs::read(grants_file(accounts, service)).ok()?).ok()
    }
}

impl fmt::Display for ResourceGrants {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let granted = if self.granted.is_empty() { "the usual rights".to_owned() } else { self.granted.join(", ") };
        write!(f, "runs with {granted}")?;
        self.refused.iter().try_for_each(|refused| write!(f, "; without {refused}"))
    }
}

fn grants_file(accounts: &Path, service: &str) -> PathBuf {
    accounts.join(format!("{service}.processors.json"))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn published_grants_can_be_read() {
        let folder = tempfile::tempdir().unwrap();
        let mut grants = ResourceGrants::default();
        grants.add(Ok("CPUs 0-1".to_owned()));
        grants.add(Err("realtime_priority = 5: not permitted".to_owned()));
        grants.publish(folder.path(), "phase");
        assert_eq!(ResourceGrants::read(folder.path(), "phase"), Some(grants));
        assert_eq!(ResourceGrants::read(folder.path(), "cloud"), None);
    }
}
