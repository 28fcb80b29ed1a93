//! Lists the dropped items by stage and reason, the most important first.

use serde::Serialize;

use fringeflow_message::{Counts, DropMeaning, DropReason, Stage};

use crate::losses::Injected;

/// Items that a stage dropped for one reason, or incidents of one kind in a stage.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct DropLine {
    /// How much it matters.
    pub kind: DropKind,
    /// Name of the stage.
    pub stage: &'static str,
    /// Name of the reason or the incident.
    pub reason: &'static str,
    /// Explanation of the name.
    pub meaning: &'static str,
    /// Setting that chooses it; `None` unless it is a choice.
    pub setting: Option<&'static str>,
    /// Number of items or incidents.
    pub count: u64,
}

/// How much a line matters, most important first.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum DropKind {
    /// Data is missing that should be there.
    Loss,
    /// The configuration or the user wants it so.
    Choice,
    /// There was nothing to measure, or nothing is missing.
    Unmeasurable,
    /// An incident that did not necessarily cost an item.
    Incident,
}

impl DropKind {
    /// The kind of a reason.
    #[must_use]
    pub fn of(reason: DropReason) -> Self {
        match reason.drop_meaning() {
            DropMeaning::Loss => Self::Loss,
            DropMeaning::Choice(_) => Self::Choice,
            DropMeaning::Unmeasurable => Self::Unmeasurable,
        }
    }

    /// Its name in metrics and pages.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Loss => "loss",
            Self::Choice => "choice",
            Self::Unmeasurable => "unmeasurable",
            Self::Incident => "incident",
        }
    }
}

impl DropLine {
    /// Returns the lines of some stages: losses first, then choices, what could not be measured, and incidents; in each
    /// group the most frequent first.
    #[must_use]
    pub fn from_counts(counts: &[(Stage, Counts)]) -> Vec<Self> {
        let injected = Injected::from_counts(counts);
        let mut lines: Vec<Self> =
            counts.iter().flat_map(|(stage, counts)| Self::lines_of_stage(stage.name(), counts, injected)).collect();
        lines.sort_by(|a, b| a.kind.cmp(&b.kind).then(b.count.cmp(&a.count)));
        lines
    }

    fn lines_of_stage(stage: &'static str, counts: &Counts, injected: Injected) -> impl Iterator<Item = Self> {
        let dropped = counts.reasons().map(move |(reason, count)| Self {
            // What is missing beside an image left out on purpose is counted there.
            kind: if injected.explains(reason, count) { DropKind::Unmeasurable } else { DropKind::of(reason) },
            stage,
            reason: reason.name(),
            meaning: reason.meaning(),
            setting: reason.drop_meaning().setting(),
            count,
        });
        let incidents = counts.incidents().map(move |(incident, count)| Self {
            kind: DropKind::Incident,
            stage,
            reason: incident.name(),
            meaning: incident.meaning(),
            setting: None,
            count,
        });
        dropped.chain(incidents)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use fringeflow_message::Incident;

    #[test]
    fn losses_come_first_then_what_is_frequent() {
        let mut cloud = Counts::default();
        cloud.drop_many(DropReason::EmptyCloud, 9);
        cloud.drop_many(DropReason::Overrun, 1);
        let mut camera = Counts::default();
        camera.drop_many(DropReason::CameraLost, 2);
        camera.incidents[Incident::TimeOut as usize] = 30;
        let lines = DropLine::from_counts(&[(Stage::Camera1, camera), (Stage::Cloud, cloud)]);
        let lines: Vec<_> = lines.iter().map(|line| (line.kind, line.stage, line.reason, line.count)).collect();
        assert_eq!(
            lines,
            [
                (DropKind::Loss, "camera1", "camera_lost", 2),
                (DropKind::Loss, "cloud", "overrun", 1),
                (DropKind::Unmeasurable, "cloud", "empty_cloud", 9),
                (DropKind::Incident, "camera1", "time_out", 30),
            ]
        );
    }
}
