//! How fast a recording is played.

use std::path::Path;
use std::str::FromStr;

use fringeflow_message::{Counts, Stage};
use fringeflow_runtime::Account;

/// Speed of a replay.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pace {
    /// So many times as fast as it was recorded.
    Rate(f64),
    /// As fast as the slowest stage, losing nothing.
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

/// The accounts of the stages that make clouds, as they stand.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Pipeline {
    pattern: Counts,
    pairing: Counts,
    windowing: Counts,
    phase: Counts,
    correspondence: Counts,
    cloud: Counts,
}

impl Pipeline {
    /// Reads the accounts in a folder.
    pub(crate) fn read(folder: &Path) -> Self {
        let counts = |stage| Account::read(folder, stage).unwrap_or_default();
        Self {
            pattern: counts(Stage::Pattern),
            pairing: counts(Stage::Pairing),
            windowing: counts(Stage::Windowing),
            phase: counts(Stage::Phase),
            correspondence: counts(Stage::Correspondence),
            cloud: counts(Stage::Cloud),
        }
    }

    /// Whether so many images and events have gone through, and their clouds were seen.
    ///
    /// Images may still wait for the ones that decide about them; they are as few as the synchronization holds.
    pub(crate) fn has_worked_off(&self, images: u64, events: u64, clouds_seen: u64) -> bool {
        let has_taken = |counts: &Counts, put_out: u64| counts.taken >= put_out;
        self.is_at_rest()
            && has_taken(&self.pairing, images)
            && has_taken(&self.pattern, events)
            && has_taken(&self.phase, self.windowing.passed)
            && has_taken(&self.correspondence, self.phase.passed)
            && has_taken(&self.cloud, self.correspondence.passed)
            && clouds_seen >= self.cloud.passed
    }

    /// Whether no stage works on anything: what has not gone on by then was lost on the way.
    pub(crate) fn is_at_rest(&self) -> bool {
        [&self.phase, &self.correspondence, &self.cloud].iter().all(|counts| counts.in_work() == Some(0))
    }
}
