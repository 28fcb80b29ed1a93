//! Whether the accounts of all stages add up: in each stage, and along each arrow between two.

use fringeflow_message::{Counts, Stage};
use fringeflow_runtime::sources;

/// The accounts of the stages that ran.
#[derive(Clone, Debug, Default)]
pub struct Balance(pub Vec<(Stage, Counts)>);

/// What does not add up.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Imbalance(String);

impl std::fmt::Display for Imbalance {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.0)
    }
}

impl Balance {
    /// The counts of a stage, if it ran.
    #[must_use]
    pub fn of(&self, stage: Stage) -> Option<&Counts> {
        self.0.iter().find(|(s, _)| *s == stage).map(|(_, counts)| counts)
    }

    /// Everything that does not add up after the end of a run: `taken = passed + Σ dropped` in each stage, and what one
    /// put out is what the next took.
    #[must_use]
    pub fn faults(&self) -> Vec<Imbalance> {
        let mut faults: Vec<Imbalance> = self.0.iter().filter_map(|(stage, counts)| in_stage(*stage, counts)).collect();
        faults.extend(self.0.iter().filter_map(|(stage, counts)| self.before(*stage, counts)));
        faults
    }

    /// Compares what a stage took with what the stages before put out; those that ran elsewhere are not compared.
    fn before(&self, stage: Stage, counts: &Counts) -> Option<Imbalance> {
        let sources = sources(stage);
        let passed: Option<u64> = sources.iter().map(|s| self.of(s.from).map(|c| c.passed / s.items)).sum();
        let passed = passed.filter(|_| !sources.is_empty())?;
        let names: Vec<&str> = sources.iter().map(|source| source.from.name()).collect();
        let (from, to, taken) = (names.join(" and "), stage.name(), counts.taken);
        (passed != taken).then(|| Imbalance(format!("{from} put out {passed} items for {to}, which took {taken}")))
    }
}

fn in_stage(stage: Stage, counts: &Counts) -> Option<Imbalance> {
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

    fn sound() -> Balance {
        Balance(vec![
            (Stage::Camera1, counts(10, 9)),
            (Stage::Camera2, counts(10, 10)),
            (Stage::Pairing, counts(19, 18)),
            (Stage::Windowing, counts(9, 6)),
            (Stage::Phase, counts(6, 2)),
        ])
    }

    #[test]
    fn what_adds_up_has_no_fault() {
        assert_eq!(sound().faults(), []);
    }

    #[test]
    fn one_item_too_few_or_too_many_is_found() {
        for (stage, wrong) in [(1, counts(10, 9)), (2, counts(18, 18)), (3, counts(8, 6)), (4, counts(7, 2))] {
            let mut balance = sound();
            balance.0[stage].1 = wrong;
            assert!(!balance.faults().is_empty(), "{stage}");
        }
        let mut lost = sound();
        lost.0[4].1.passed = 1;
        assert!(lost.faults()[0].to_string().contains("1 unaccounted for"), "{:?}", lost.faults());
        lost.0[4].1.passed = 3;
        assert!(lost.faults()[0].to_string().contains("phase took 6, but put out 3 and dropped 4"));
    }
}
