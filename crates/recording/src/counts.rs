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
}

impl RecorderCounts {
    /// Returns the sum over all topics.
    #[must_use]
    pub fn total(&self) -> Counts {
        let mut total = Counts { taken: self.malformed, ..Counts::default() };
        total.drop_many(DropReason::Malformed, self.malformed);
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
