//! What a stage has done, in figures, as `status` and the summary of a run tell them.

use std::collections::BTreeMap;

use fringeflow::message::{Counts, Skew, Stage};
use fringeflow::telemetry::{Latency, StageTally};

/// Figures of a stage.
#[derive(serde::Serialize)]
pub(crate) struct StageFigures {
    pub(crate) stage: &'static str,
    pub(crate) taken: u64,
    pub(crate) passed: u64,
    pub(crate) dropped: BTreeMap<&'static str, u64>,
    /// What happened beside the items.
    pub(crate) incidents: BTreeMap<&'static str, u64>,
    pub(crate) latency: Option<Latency>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) skew: Option<SkewFigures>,
}

/// By how much images of camera 2 begin later than those of camera 1, milliseconds.
#[derive(serde::Serialize)]
pub(crate) struct SkewFigures {
    pub(crate) mean_ms: f64,
    pub(crate) least_ms: f64,
    pub(crate) greatest_ms: f64,
}

impl StageFigures {
    /// Of a stage with these counts; `tally` is what it reported, if it did.
    pub(crate) fn of(stage: Stage, counts: &Counts, tally: Option<&StageTally>) -> Self {
        Self {
            stage: stage.name(),
            taken: counts.taken,
            passed: counts.passed,
            dropped: counts.reasons().map(|(reason, n)| (reason.name(), n)).collect(),
            incidents: counts.incidents().map(|(incident, n)| (incident.name(), n)).collect(),
            latency: tally.and_then(|tally| tally.latencies.brief()),
            skew: tally.and_then(|tally| SkewFigures::of(&tally.skew)),
        }
    }
}

impl SkewFigures {
    fn of(skew: &Skew) -> Option<Self> {
        let ms = |ns: i64| ns as f64 * 1e-6;
        let mean_ms = skew.mean_ns()? * 1e-6;
        Some(Self { mean_ms, least_ms: ms(skew.least_ns), greatest_ms: ms(skew.greatest_ns) })
    }
}
