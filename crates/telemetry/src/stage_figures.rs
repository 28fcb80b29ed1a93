//! Figures of a stage, the same in all outputs.

use std::collections::BTreeMap;

use serde::Serialize;

use fringeflow_message::{Counts, Skew, Stage};

use super::{Latency, StageTally};

/// Figures of a stage.
#[derive(Clone, Debug, Serialize)]
pub struct StageFigures {
    /// Its name.
    pub stage: &'static str,
    /// Items that it received.
    pub taken: u64,
    /// Items that it passed on.
    pub passed: u64,
    /// Items that it dropped, by the name of the reason.
    pub dropped: BTreeMap<&'static str, u64>,
    /// Incidents by name. They did not necessarily cost an item.
    pub incidents: BTreeMap<&'static str, u64>,
    /// Time from receiving an item to passing it on; `None` if no item was passed on.
    pub latency: Option<Latency>,
    /// Skew of the image pairs, for the stage that pairs.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub skew: Option<SkewFigures>,
}

/// Start of the images of camera 2 relative to those of camera 1, milliseconds.
#[derive(Clone, Debug, Serialize)]
pub struct SkewFigures {
    /// Mean.
    pub mean_ms: f64,
    /// Minimum.
    pub least_ms: f64,
    /// Maximum.
    pub greatest_ms: f64,
}

impl StageFigures {
    /// Creates the figures of a stage with these counts. `tally` holds its reports, if it sent any.
    #[must_use]
    pub fn new(stage: Stage, counts: &Counts, tally: Option<&StageTally>) -> Self {
        Self {
            stage: stage.name(),
            taken: counts.taken,
            passed: counts.passed,
            dropped: counts.reasons().map(|(reason, n)| (reason.name(), n)).collect(),
            incidents: counts.incidents().map(|(incident, n)| (incident.name(), n)).collect(),
            latency: tally.and_then(|tally| tally.latencies.brief()),
            skew: tally.and_then(|tally| SkewFigures::from_skew(&tally.skew)),
        }
    }
}

impl SkewFigures {
    /// Returns `None` if no images were paired.
    #[must_use]
    pub fn from_skew(skew: &Skew) -> Option<Self> {
        let ms = |ns: i64| ns as f64 * 1e-6;
        let mean_ms = skew.mean_ns()? * 1e-6;
        Some(Self { mean_ms, least_ms: ms(skew.least_ns), greatest_ms: ms(skew.greatest_ns) })
    }
}
