//! How many clouds per second the computer can compute, if it skips windows for lack of time.

use std::fmt;

use serde::Serialize;

use fringeflow_message::{Counts, DropReason, Stage};

use super::Tally;

/// Rate of the windows, and of the clouds made from them.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Pace {
    /// Complete windows per second.
    pub windows_hz: f64,
    /// Clouds per second.
    pub clouds_hz: f64,
    /// Factor for the key `window.every` at which no window is skipped for lack of time.
    pub every_times: u32,
}

/// Share of the windows that may be skipped occasionally.
const SLACK: f64 = 0.05;

impl Pace {
    /// Computes the pace at `clouds_hz` clouds per second, given the counts of the phase stage since the start. Returns
    /// `None` if almost no window was skipped because the next stage was busy.
    #[must_use]
    pub fn new(clouds_hz: f64, phase: &Counts) -> Option<Self> {
        let (made, skipped) = (phase.passed as f64, phase.dropped(DropReason::NextStageBusy) as f64);
        let times = (made + skipped) / made;
        let every_times = (times - SLACK).ceil() as u32;
        let is_known = clouds_hz > 0.0 && made > 0.0;
        (is_known && every_times > 1).then_some(Self { windows_hz: clouds_hz * times, clouds_hz, every_times })
    }

    /// Computes the pace of a running instance from the reports of its stages.
    #[must_use]
    pub fn from_tally(tally: &Tally) -> Option<Self> {
        Self::new(tally.stage(Stage::Cloud)?.rate_hz, &tally.stage(Stage::Phase)?.counts)
    }
}

impl fmt::Display for Pace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { windows_hz, clouds_hz, every_times } = self;
        write!(
            f,
            "this computer computes {clouds_hz:.1} clouds per second from {windows_hz:.1} windows, and skips the \
             other windows. To skip them evenly, multiply window.every by {every_times}. To compute more clouds, set \
             cameras.binning = 2 or a smaller cameras.region_px"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_proposed_stride_is_one_that_the_computer_can_sustain() {
        let pace = |clouds_hz, passed, skipped| {
            let mut counts = Counts { passed, ..Counts::default() };
            counts.drop_many(DropReason::NextStageBusy, skipped);
            Pace::new(clouds_hz, &counts)
        };
        let times = |passed, skipped| pace(10.0, passed, skipped).map(|pace| pace.every_times);
        assert_eq!(times(160, 140), Some(2));
        assert_eq!(times(149, 151), Some(2));
        assert_eq!(times(160, 440), Some(4));
        // Only a few skipped windows at the start, none, or no cloud at all.
        assert_eq!([times(290, 10), times(300, 0), times(0, 300)], [None; 3]);
        assert_eq!(pace(0.0, 160, 140), None);
        assert!(pace(16.0, 160, 140).unwrap().to_string().contains("16.0 clouds per second from 30.0 windows"));
    }
}
