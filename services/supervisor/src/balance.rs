//! Checks that the counts of a finished run add up.
//!
//! In: the counts of every stage that ran. Out: the imbalances, within a stage and between a stage and its sources.

use fringeflow_message::{Counts, Stage};
use fringeflow_runtime::sources;

/// Counts of the stages that ran.
#[derive(Clone, Debug, Default)]
pub struct Balance(pub Vec<(Stage, Counts)>);

/// Counts that do not add up, as one sentence.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Imbalance(String);

impl std::fmt::Display for Imbalance {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl Balance {
    /// Returns the counts of a stage, or `None` if it did not run.
    #[must_use]
    pub fn counts(&self, stage: Stage) -> Option<&Counts> {
        self.0.iter().find(|(s, _)| *s == stage).map(|(_, counts)| counts)
    }

    /// Returns all imbalances after the end of a run. A run is balanced if `taken = passed + Σ dropped` holds in each
    /// stage, and each stage took as many items as its sources passed on.
    #[must_use]
    pub fn imbalances(&self) -> Vec<Imbalance> {
        let stages = || self.0.iter();
        let mut found: Vec<Imbalance> = stages().filter_map(|(stage, counts)| within_stage(*stage, counts)).collect();
        found.extend(stages().filter_map(|(stage, counts)| self.before_stage(*stage, counts)));
        found
    }

    /// Compares the items that a stage took with those that its sources passed on. Compares nothing if a source did not
    /// run in this instance.
    fn before_stage(&self, stage: Stage, counts: &Counts) -> Option<Imbalance> {
        let sources = sources(stage);
        let passed: Option<u64> = sources.iter().map(|s| self.counts(s.from).map(|c| c.passed / s.items)).sum();
        let passed = passed.filter(|_| !sources.is_empty())?;
        let names: Vec<&str> = sources.iter().map(|source| source.from.name()).collect();
        let (from, to, taken) = (names.join(" and "), stage.name(), counts.taken);
        (passed != taken).then(|| Imbalance(format!("{from} put out {passed} items for {to}, which took {taken}")))
    }
}

/// Checks `taken = passed + Σ dropped`.
fn within_stage(stage: Stage, counts: &Counts) -> Option<Imbalance> {
    let (name, taken, passed, dropped) = (stage.name(), counts.taken, counts.passed, counts.all_dropped());
    match counts.in_work() {
        Some(0) => None,
        Some(rest) => {
            Some(Imbalance(format!("{name} took {taken}, put out {passed}, dropped {dropped}: {rest} unaccounted for")))
        }
        None => Some(Imbalance(format!("{name} took {taken}, but put out {passed} and dropped {dropped}"))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fringeflow_message::DropReason;

    fn counts(taken: u64, passed: u64) -> Counts {
        let mut counts = Counts { taken, passed, ..Counts::default() };
        counts.drop_many(DropReason::Overrun, taken - passed);
        counts
    }

    fn balanced() -> Balance {
        Balance(vec![
            (Stage::Camera1, counts(10, 9)),
            (Stage::Camera2, counts(10, 10)),
            (Stage::Pairing, counts(19, 18)),
            (Stage::Windowing, counts(9, 6)),
            (Stage::Phase, counts(6, 2)),
        ])
    }

    #[test]
    fn a_balanced_run_has_no_imbalances() {
        assert_eq!(balanced().imbalances(), []);
    }

    #[test]
    fn one_item_too_few_or_too_many_is_found() {
        for (stage, wrong) in [(1, counts(10, 9)), (2, counts(18, 18)), (3, counts(8, 6)), (4, counts(7, 2))] {
            let mut balance = balanced();
            balance.0[stage].1 = wrong;
            assert!(!balance.imbalances().is_empty(), "{stage}");
        }
        let mut lost = balanced();
        lost.0[4].1.passed = 1;
        assert!(lost.imbalances()[0].to_string().contains("1 unaccounted for"), "{:?}", lost.imbalances());
        lost.0[4].1.passed = 3;
        assert!(lost.imbalances()[0].to_string().contains("phase took 6, but put out 3 and dropped 4"));
    }
}
