//! The result of a run: exit code, summary and log.

use std::collections::BTreeMap;

use serde_json::Value;

use fringeflow_message::DropReason;

/// The result of a run that has ended.
#[derive(Debug)]
pub(crate) struct FinishedRun {
    pub(crate) code: Option<i32>,
    pub(crate) summary: Value,
    pub(crate) log: String,
    stages: BTreeMap<String, StageCounts>,
}

/// Counts of a stage in the summary.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct StageCounts {
    pub(crate) taken: u64,
    pub(crate) passed: u64,
    dropped: BTreeMap<String, u64>,
}

impl StageCounts {
    /// Returns the number of items that were dropped for a reason.
    pub(crate) fn dropped(&self, reason: DropReason) -> u64 {
        self.dropped.get(reason.name()).copied().unwrap_or(0)
    }
}

impl FinishedRun {
    /// Parses the JSON summary.
    pub(crate) fn new(code: Option<i32>, summary: &str, log: String) -> Self {
        let summary: Value = serde_json::from_str(summary).unwrap_or_else(|e| panic!("no summary ({e}): {log}"));
        let number = |value: &Value| value.as_u64().unwrap();
        let stage = |stage: &Value| {
            let dropped = stage["dropped"].as_object().unwrap().iter();
            let dropped = dropped.map(|(reason, count)| (reason.clone(), number(count))).collect();
            let counts = StageCounts { taken: number(&stage["taken"]), passed: number(&stage["passed"]), dropped };
            (stage["stage"].as_str().unwrap().to_owned(), counts)
        };
        let stages = summary["stages"].as_array().unwrap().iter().map(stage).collect();
        Self { code, summary, log, stages }
    }

    /// Returns the counts of a stage, which must be in the summary.
    pub(crate) fn stage(&self, name: &str) -> &StageCounts {
        self.stages.get(name).unwrap_or_else(|| panic!("stage {name} is missing: {self:?}"))
    }

    /// Asserts that the counts add up: the summary reports no imbalance, and its numbers show none.
    pub(crate) fn assert_balanced(&self) {
        assert_eq!(self.summary["imbalances"], serde_json::json!([]), "{self:?}");
        for (name, stage) in &self.stages {
            let dropped: u64 = stage.dropped.values().sum();
            assert_eq!(stage.taken, stage.passed + dropped, "{name}: {self:?}");
        }
        let passed = |name: &str| self.stages.get(name).map(|stage| stage.passed);
        let images = passed("camera1").zip(passed("camera2")).map(|(first, second)| first + second);
        let connections = [
            (passed("projector"), "pattern"),
            (images, "pairing"),
            (passed("pairing").map(|images| images / 2), "windowing"),
            (passed("windowing"), "phase"),
            (passed("phase"), "correspondence"),
            (passed("correspondence"), "cloud"),
            (passed("cloud"), "tracking"),
        ];
        for (sent, to) in connections.into_iter().filter(|(_, to)| self.stages.contains_key(*to)) {
            assert!(sent.is_none_or(|sent| sent == self.stage(to).taken), "{sent:?} were sent to {to}: {self:?}");
        }
    }

    /// Asserts that a run is balanced, had no restarts, and ended with the right exit code. It is 3 if the summary has
    /// losses, which a busy machine may cause, else 0.
    pub(crate) fn assert_undisturbed(&self) {
        self.assert_balanced();
        assert_eq!(self.summary["restarts"], 0, "{self:?}");
        let dropped_somewhere = |reason| self.stages.values().any(|stage| stage.dropped(reason) > 0);
        let lost: Vec<DropReason> =
            DropReason::ALL.into_iter().filter(|reason| reason.is_loss() && dropped_somewhere(*reason)).collect();
        // What is missing beside images that were left out on purpose is no loss; more than that is one.
        let may_be_none = dropped_somewhere(DropReason::Injected)
            && lost.iter().all(|reason| matches!(reason, DropReason::Unpaired | DropReason::NoPattern));
        let is_loss = if may_be_none { self.summary["lost"]["is_loss"] == true } else { !lost.is_empty() };
        assert_eq!(self.code, Some(if is_loss { 3 } else { 0 }), "{self:?}");
    }
}
