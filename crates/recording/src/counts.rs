//! Numbers of messages that a recorder took, wrote and lost.

use std::collections::BTreeMap;

use fringeflow_message::{Counts, DropReason};

use crate::Topic;

/// Numbers of messages taken, written and lost, by topic.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct RecorderCounts {
    /// Counts by topic. An image and its header count as one message. Messages that contradict themselves have no
    /// topic.
    pub topics: BTreeMap<Topic, Counts>,
    /// Number of messages that contradict themselves.
    pub malformed: u64,
    /// Number of messages that were overwritten in their channel before the recorder could take them.
    pub overrun: u64,
}

impl RecorderCounts {
    /// Returns the sum over all topics.
    #[must_use]
    pub fn total(&self) -> Counts {
        let mut total = Counts { taken: self.malformed + self.overrun, ..Counts::default() };
        total.drop_many(DropReason::Malformed, self.malformed);
        total.drop_many(DropReason::Overrun, self.overrun);
        for counts in self.topics.values() {
            total.taken += counts.taken;
            total.passed += counts.passed;
            counts.reasons().for_each(|(reason, count)| total.drop_many(reason, count));
        }
        total
    }

    pub(super) fn for_topic(&mut self, topic: Topic) -> &mut Counts {
        self.topics.entry(topic).or_default()
    }

    /// Returns the metadata of a recording that ended for this reason.
    pub(super) fn metadata(&self, end_reason: &str) -> BTreeMap<String, String> {
        let mut entries = BTreeMap::from([("ended".to_owned(), end_reason.to_owned())]);
        let total = self.total();
        entries.insert("taken".to_owned(), total.taken.to_string());
        entries.insert("written".to_owned(), total.passed.to_string());
        // If the disk is full, messages remain in the queue; they are lost as well.
        if let Some(waiting) = total.in_work().filter(|&waiting| waiting > 0) {
            entries.insert("lost.in_queue".to_owned(), waiting.to_string());
        }
        for (reason, count) in total.reasons() {
            entries.insert(format!("lost.{}", reason.name()), count.to_string());
        }
        for (topic, counts) in &self.topics {
            entries.insert(format!("written{}", topic.name()), counts.passed.to_string());
            for (reason, count) in counts.reasons() {
                entries.insert(format!("lost.{}{}", reason.name(), topic.name()), count.to_string());
            }
        }
        entries
    }
}

/// Returns the metadata of a recovered recording. `account` are those of the damaged file; they are empty if the
/// recorder was killed, and then the number of lost messages stays unknown. Messages that the recorder wrote, but that
/// are not among the `recovered` ones, are lost as `damaged`.
pub(super) fn recovered_account(
    mut account: BTreeMap<String, String>,
    recovered: &BTreeMap<&'static str, u64>,
    faults: usize,
) -> BTreeMap<String, String> {
    let number = |account: &BTreeMap<String, String>, key: &str| account.get(key).and_then(|text| text.parse().ok());
    let is_counted = account.contains_key("taken");
    let (mut all_written, mut all_damaged) = (0, number(&account, "lost.damaged").unwrap_or(0_u64));
    for name in Topic::ALL.map(Topic::name) {
        let (written_key, damaged_key) = (format!("written{name}"), format!("lost.damaged{name}"));
        let found = recovered.get(name).copied().unwrap_or(0);
        // A recorder writes some messages that it does not count: those for viewers, and its log of losses.
        let stated = if is_counted { number(&account, &written_key).unwrap_or(0) } else { found };
        let (written, damaged) = (found.min(stated), stated.saturating_sub(found));
        if damaged > 0 {
            let before: u64 = number(&account, &damaged_key).unwrap_or(0);
            account.insert(damaged_key, before.saturating_add(damaged).to_string());
        }
        if written > 0 || account.contains_key(&written_key) {
            account.insert(written_key, written.to_string());
        }
        all_written += written;
        all_damaged = all_damaged.saturating_add(damaged);
    }
    if all_damaged > 0 {
        account.insert("lost.damaged".to_owned(), all_damaged.to_string());
    }
    account.insert("ended".to_owned(), "recovered".to_owned());
    account.insert("written".to_owned(), all_written.to_string());
    account.insert("recovered.faults".to_owned(), faults.to_string());
    account
}
