//! Clouds per second that the machine can make, where it leaves out windows for lack of time.

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
    /// Factor for the key `window.every` with which no window is left out for lack of time.
    pub every_times: u32,
}

/// Share of the windows that may be left out now and then.
const SLACK: f64 = 0.05;

impl Pace {
    /// The pace at `clouds_hz` clouds per second, given the counts of the phase stage since the start; `None` where
    /// next to no window was left out because the following stage was busy.
    #[must_use]
    pub fn new(clouds_hz: f64, phase: &Counts) -> Option<Self> {
        let (made, left_out) = (phase.passed as f64, phase.dropped(DropReason::NextStageBusy) as f64);
        let times = (made + left_out) / made;
        let every_times = (times - SLACK).ceil() as u32;
        let is_known = clouds_hz > 0.0 && made > 0.0;
        (is_known && every_times > 1).then_some(Self { windows_hz: clouds_hz * times, clouds_hz, every_times })
    }

    /// The pace of a running instance, from the reports of its stages.
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
            "this machine makes {clouds_hz:.1} clouds a second of {windows_hz:.1} windows; the others are left out. A window.every \
             {every_times} times as large would leave them out evenly; cameras.binning = 2 or a smaller cameras.region_px makes more of them"
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_proposed_stride_is_one_that_the_machine_holds() {
        let pace = |clouds_hz, passed, left_out| {
            let mut counts = Counts { passed, ..Counts::default() };
            counts.drop_many(DropReason::NextStageBusy, left_out);
            Pace::new(clouds_hz, &counts)
        };
        let times = |passed, left_out| pace(10.0, passed, left_out).map(|pace| pace.every_times);
        assert_eq!(times(160, 140), Some(2));
        assert_eq!(times(149, 151), Some(2));
        assert_eq!(times(160, 440), Some(4));
        // A few windows at the start, none, or no cloud at all.
        assert_eq!([times(290, 10), times(300, 0), times(0, 300)], [None; 3]);
        assert_eq!(pace(0.0, 160, 140), None);
        assert!(pace(16.0, 160, 140).unwrap().to_string().contains("16.0 clouds a second of 30.0 windows"));
    }
}
