//! Whether the accounts of all stages add up: in each stage, and along each arrow between two.

use fringeflow::message::{Counts, Stage};

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
        faults.extend(ARROWS.iter().filter_map(|arrow| self.along(arrow)));
        faults
    }

    fn along(&self, arrow: &Arrow) -> Option<Imbalance> {
        let passed: u64 = arrow.from.iter().map(|&stage| self.of(stage).map(|c| c.passed)).sum::<Option<u64>>()?;
        let taken = self.of(arrow.to)?.taken;
        if passed == taken * arrow.per_item {
            return None;
        }
        let from: Vec<&str> = arrow.from.iter().map(|stage| stage.name()).collect();
        let (from, to) = (from.join(" and "), arrow.to.name());
        Some(Imbalance(format!("{from} put out {passed}, {to} took {taken} (of {} each)", arrow.per_item)))
    }
}

/// What one stage takes from others: `per_item` of theirs make one of its own.
struct Arrow {
    from: &'static [Stage],
    to: Stage,
    per_item: u64,
}

const ARROWS: &[Arrow] = &[
    Arrow { from: &[Stage::Camera1, Stage::Camera2], to: Stage::Pairing, per_item: 1 },
    Arrow { from: &[Stage::Projector], to: Stage::Pattern, per_item: 1 },
    Arrow { from: &[Stage::Pairing], to: Stage::Windowing, per_item: 2 },
    Arrow { from: &[Stage::Windowing], to: Stage::Phase, per_item: 1 },
    Arrow { from: &[Stage::Phase], to: Stage::Correspondence, per_item: 1 },
    Arrow { from: &[Stage::Correspondence], to: Stage::Cloud, per_item: 1 },
];

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
    use fringeflow::message::DropReason;

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
