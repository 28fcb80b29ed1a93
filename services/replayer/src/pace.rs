//! How fast a recording is played.

use std::path::Path;
use std::str::FromStr;

use fringeflow::message::{Counts, Stage};
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
        rate.map(Self::Rate).ok_or_else(|| format!("{text:?} is no speed; give a number from 0.01 to 100, or max"))
    }
}

/// Whether everything that was put out has gone through the whole pipeline, by the accounts in `folder`: `images` and
/// `events` so far, and clouds as far as `clouds_seen`.
///
/// Images may still wait for the ones that decide about them; they are as few as the synchronization holds.
pub(crate) fn is_worked_off(folder: &Path, images: u64, events: u64, clouds_seen: u64) -> bool {
    let counts = |stage| Account::read(folder, stage).unwrap_or_default();
    let (pattern, pairing, windowing) = (counts(Stage::Pattern), counts(Stage::Pairing), counts(Stage::Windowing));
    let (phase, correspondence, cloud) = (counts(Stage::Phase), counts(Stage::Correspondence), counts(Stage::Cloud));
    let has_worked_off = |counts: &Counts, put_out: u64| counts.taken >= put_out && counts.in_work() == Some(0);
    pairing.taken >= images
        && pattern.taken >= events
        && has_worked_off(&phase, windowing.passed)
        && has_worked_off(&correspondence, phase.passed)
        && has_worked_off(&cloud, correspondence.passed)
        && clouds_seen >= cloud.passed
}
