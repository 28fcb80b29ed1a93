//! Speed of a replay, and how far the pipeline has followed it.

use std::path::Path;
use std::str::FromStr;

use fringeflow_message::{Counts, Stage};
use fringeflow_runtime::Account;

/// Speed of a replay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pace {
    /// Multiple of the recorded speed.
    Rate(f64),
    /// As fast as the slowest stage allows, without losses.
    Fastest,
}

impl FromStr for Pace {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        if text == "max" {
            return Ok(Self::Fastest);
        }
        let rate = text.parse::<f64>().ok().filter(|rate| (0.01..=100.0).contains(rate));
        rate.map(Self::Rate).ok_or_else(|| format!("{text:?} is not a speed; give a number from 0.01 to 100, or max"))
    }
}

/// Present counts of the stages from images to clouds.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct PipelineCounts {
    pattern: Counts,
    pairing: Counts,
    windowing: Counts,
    phase: Counts,
    correspondence: Counts,
    cloud: Counts,
}

impl PipelineCounts {
    /// Reads the accounts in a folder. A missing account counts as zero.
    pub(crate) fn read(folder: &Path) -> Self {
        let counts = |stage| Account::read_counts(folder, stage).unwrap_or_default();
        Self {
            pattern: counts(Stage::Pattern),
            pairing: counts(Stage::Pairing),
            windowing: counts(Stage::Windowing),
            phase: counts(Stage::Phase),
            correspondence: counts(Stage::Correspondence),
            cloud: counts(Stage::Cloud),
        }
    }

    /// Returns whether the pipeline has processed so many images and events, and all clouds were received.
    ///
    /// Some images may still wait for later images that complete a pair or a window; the synchronization limits their
    /// number.
    pub(crate) fn has_processed(&self, images: u64, events: u64, received_clouds: u64) -> bool {
        let has_taken = |counts: &Counts, sent: u64| counts.taken >= sent;
        self.is_idle()
            && has_taken(&self.pairing, images)
            && has_taken(&self.pattern, events)
            && has_taken(&self.phase, self.windowing.passed)
            && has_taken(&self.correspondence, self.phase.passed)
            && has_taken(&self.cloud, self.correspondence.passed)
            && received_clouds >= self.cloud.passed
    }

    /// Returns whether no stage has an item in work. Items that have not reached the next stage then may be lost.
    pub(crate) fn is_idle(&self) -> bool {
        [&self.phase, &self.correspondence, &self.cloud].iter().all(|counts| counts.in_work() == Some(0))
    }
}
