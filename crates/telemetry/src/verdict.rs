//! What a run lost, and what it left out: the one sentence that summary, status, pages and checks of recordings say.

use std::collections::BTreeMap;
use std::fmt;

use serde::Serialize;

use fringeflow_message::{Counts, Stage};

use crate::drop_lines::{DropKind, DropLine};
use crate::losses::Losses;

/// What is missing at the end of a run, or at one time of it.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Verdict {
    /// Losses, each counted once.
    #[serde(flatten)]
    pub losses: Losses,
    /// Whether anything was lost, in any stage: the run then ends with exit code 3.
    pub is_loss: bool,
    /// Items left out by choice, by reason and setting.
    pub choices: Vec<LeftOut>,
    /// Items that could not be measured, by reason.
    pub unmeasurable: Vec<LeftOut>,
}

/// Items left out for one reason, in all stages.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct LeftOut {
    /// Name of the reason.
    pub reason: &'static str,
    /// Setting that chooses it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub setting: Option<&'static str>,
    /// Number of items.
    pub count: u64,
}

impl Verdict {
    /// The verdict on the counts of the stages.
    #[must_use]
    pub fn from_counts(counts: &[(Stage, Counts)]) -> Self {
        let lines = DropLine::from_counts(counts);
        Self {
            losses: Losses::from_counts(counts),
            is_loss: lines.iter().any(|line| line.kind == DropKind::Loss),
            choices: left_out(&lines, DropKind::Choice),
            unmeasurable: left_out(&lines, DropKind::Unmeasurable),
        }
    }
}

impl Verdict {
    /// States how many messages are missing in recordings, if it is more than the stages counted.
    pub fn add_missing_messages(&mut self, count: u64) {
        self.losses.messages = self.losses.messages.max(count);
        self.is_loss |= count > 0;
    }
}

/// The items of a kind by reason, most frequent first.
fn left_out(lines: &[DropLine], kind: DropKind) -> Vec<LeftOut> {
    let mut by_reason: BTreeMap<&'static str, LeftOut> = BTreeMap::new();
    for DropLine { reason, setting, count, .. } in lines.iter().filter(|line| line.kind == kind) {
        let entry = by_reason.entry(reason).or_insert(LeftOut { reason, setting: *setting, count: 0 });
        entry.count += count;
    }
    let mut left_out: Vec<LeftOut> = by_reason.into_values().collect();
    left_out.sort_by_key(|entry| std::cmp::Reverse(entry.count));
    left_out
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.losses.fmt(f)?;
        for (what, entries) in [("left out by choice", &self.choices), ("not measurable", &self.unmeasurable)] {
            if !entries.is_empty() {
                let entries: Vec<String> = entries.iter().map(ToString::to_string).collect();
                write!(f, "; {what}: {}", entries.join(", "))?;
            }
        }
        Ok(())
    }
}

impl fmt::Display for LeftOut {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { reason, setting, count } = self;
        match setting {
            Some(setting) => write!(f, "{reason} {count} ({setting})"),
            None => write!(f, "{reason} {count}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fringeflow_message::{DropMeaning, DropReason};

    #[test]
    fn every_reason_is_told_as_what_it_is() {
        for reason in DropReason::ALL {
            let mut counts = Counts::default();
            counts.drop_many(reason, 7);
            // A stage whose losses cost clouds.
            let verdict = Verdict::from_counts(&[(Stage::Correspondence, counts)]);
            let (text, name) = (verdict.to_string(), reason.name());
            let nothing_lost = text.starts_with("nothing was lost");
            match reason.drop_meaning() {
                DropMeaning::Loss => assert!(verdict.is_loss && !nothing_lost && text.contains("7 clouds"), "{text}"),
                DropMeaning::Choice(setting) => {
                    let expected = format!("; left out by choice: {name} 7 ({setting})");
                    assert!(!verdict.is_loss && nothing_lost && text.ends_with(&expected), "{text}");
                }
                DropMeaning::Unmeasurable => {
                    let expected = format!("; not measurable: {name} 7");
                    assert!(!verdict.is_loss && nothing_lost && text.ends_with(&expected), "{text}");
                }
            }
            assert_eq!(verdict.is_loss, reason.is_loss());
        }
    }
}
