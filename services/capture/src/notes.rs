//! What happens to a camera beside its images: counted always, logged when it begins and now and then while it lasts.

use fringeflow_message::Incident;
use fringeflow_runtime::{Account, AccountError, clock};

/// Time between two log lines about the same kind of incident, nanoseconds.
const QUIET_NS: u64 = 10_000_000_000;

/// Incidents on their way to account and log.
#[derive(Debug, Default)]
pub(crate) struct Notes {
    waiting: Vec<(Incident, u64, String)>,
    /// Per kind: when it was logged last, and how often it happened since.
    logged: [Option<(u64, u64)>; Incident::ALL.len()],
}

impl Notes {
    /// Takes an incident, and the words for the log.
    pub(crate) fn add(&mut self, incident: Incident, words: impl Into<String>) {
        self.add_many(incident, 1, words);
    }

    /// Takes incidents of the same kind.
    pub(crate) fn add_many(&mut self, incident: Incident, count: u64, words: impl Into<String>) {
        if count > 0 {
            self.waiting.push((incident, count, words.into()));
        }
    }

    /// Counts and logs what was taken.
    ///
    /// # Errors
    /// The account cannot be written.
    pub(crate) fn write(&mut self, account: &mut Account) -> Result<(), AccountError> {
        if self.waiting.is_empty() {
            return Ok(());
        }
        let now_ns = clock::now_ns();
        for (incident, count, words) in self.waiting.drain(..) {
            account.note(incident, count)?;
            let Some(logged) = self.logged.get_mut(incident as usize) else { continue };
            if let Some(line) = line(logged, count, &words, now_ns) {
                tracing::warn!(incident = incident.name(), "{line}");
            }
        }
        Ok(())
    }
}

/// The log line of `count` more incidents of a kind; `None` while the last one is fresh.
fn line(logged: &mut Option<(u64, u64)>, count: u64, words: &str, now_ns: u64) -> Option<String> {
    match logged {
        Some((last_ns, since)) if now_ns.saturating_sub(*last_ns) < QUIET_NS => {
            *since += count;
            None
        }
        _ => {
            let before = logged.replace((now_ns, 0)).map_or(0, |(_, since)| since);
            Some(if before > 0 {
                format!("{words} (and {before} times since the last message)")
            } else {
                words.to_owned()
            })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lasting_fault_is_said_now_and_then_with_its_number() {
        let mut logged = None;
        let second_ns = 1_000_000_000;
        let lines: Vec<Option<String>> = (0..25).map(|s| line(&mut logged, 2, "no image", s * second_ns)).collect();
        let said: Vec<usize> = (0..25).filter(|&s| lines[s].is_some()).collect();
        assert_eq!(said, [0, 10, 20]);
        assert_eq!(lines[0].as_deref(), Some("no image"));
        assert_eq!(lines[10].as_deref(), Some("no image (and 18 times since the last message)"));
    }
}
