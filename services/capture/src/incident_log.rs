//! Incidents of a camera, on their way to the account and the log.
//!
//! Each incident is counted. Of each kind the first one is logged; further ones are logged at most once every ten
//! seconds.

use fringeflow_message::Incident;
use fringeflow_runtime::{Account, AccountError, clock};

/// Shortest time between two log lines about the same kind of incident, nanoseconds.
const LOG_INTERVAL_NS: u64 = 10_000_000_000;

/// Incidents that wait to be counted and logged.
#[derive(Debug, Default)]
pub(crate) struct IncidentLog {
    /// Kind, count and log text of each.
    waiting: Vec<(Incident, u64, String)>,
    /// Per kind: time of the last log line, and number of incidents since then.
    logged: [Option<(u64, u64)>; Incident::ALL.len()],
}

impl IncidentLog {
    /// Adds an incident and its text for the log.
    pub(crate) fn add(&mut self, incident: Incident, text: impl Into<String>) {
        self.add_many(incident, 1, text);
    }

    /// Adds incidents of the same kind.
    pub(crate) fn add_many(&mut self, incident: Incident, count: u64, text: impl Into<String>) {
        if count > 0 {
            self.waiting.push((incident, count, text.into()));
        }
    }

    /// Counts and logs the waiting incidents.
    ///
    /// # Errors
    /// The account cannot be written.
    pub(crate) fn write(&mut self, account: &mut Account) -> Result<(), AccountError> {
        if self.waiting.is_empty() {
            return Ok(());
        }
        let now_ns = clock::now_ns();
        for (incident, count, text) in self.waiting.drain(..) {
            account.note(incident, count)?;
            let Some(logged) = self.logged.get_mut(incident as usize) else { continue };
            if let Some(line) = log_line(logged, count, &text, now_ns) {
                tracing::warn!(incident = incident.name(), "{line}");
            }
        }
        Ok(())
    }
}

/// Returns the log line for `count` more incidents of a kind; `None` if the last line is too recent.
fn log_line(logged: &mut Option<(u64, u64)>, count: u64, text: &str, now_ns: u64) -> Option<String> {
    match logged {
        Some((last_ns, since)) if now_ns.saturating_sub(*last_ns) < LOG_INTERVAL_NS => {
            *since += count;
            None
        }
        _ => {
            let before = logged.replace((now_ns, 0)).map_or(0, |(_, since)| since);
            Some(if before > 0 {
                format!("{text} (and {before} times since the last message)")
            } else {
                text.to_owned()
            })
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_lasting_fault_is_logged_every_ten_seconds_with_its_count() {
        let mut logged = None;
        let second_ns = 1_000_000_000;
        let lines: Vec<Option<String>> = (0..25).map(|s| log_line(&mut logged, 2, "no image", s * second_ns)).collect();
        let logged_at: Vec<usize> = (0..25).filter(|&s| lines[s].is_some()).collect();
        assert_eq!(logged_at, [0, 10, 20]);
        assert_eq!(lines[0].as_deref(), Some("no image"));
        assert_eq!(lines[10].as_deref(), Some("no image (and 18 times since the last message)"));
    }
}
