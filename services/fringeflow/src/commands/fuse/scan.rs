//! The clouds of a recording, made and tracked one after the other.

use std::time::{Duration, Instant};

use fringeflow_tracking::TrackedStream;
use fringeflow_tracking::fusion::{Tracked, Tracking};

use crate::failure::Failure;
use crate::input::Input;
use crate::progress;
use crate::proposed::{Images, try_reconstruct_next};

/// One window of images, and what became of it.
pub(crate) struct Looked {
    /// Number of its first image pair.
    pub(crate) first_pair: usize,
    /// Middle of its exposures since the first of the recording, seconds.
    pub(crate) time_s: f64,
    /// The same as a time of the recording, nanoseconds.
    pub(crate) time_ns: u64,
    /// What the tracking says of its cloud, or why it has none.
    pub(crate) tracked: Result<Tracked, String>,
}

impl Looked {
    /// Why it was not merged.
    pub(crate) fn lost(&self) -> Option<String> {
        match &self.tracked {
            Ok(Tracked { tracking: Tracking::Lost(lost), .. }) => Some(lost.to_string()),
            Ok(_) => None,
            Err(why) => Some(why.clone()),
        }
    }

    /// Name of the reason that it was not merged.
    pub(crate) fn reason(&self) -> Option<&'static str> {
        match &self.tracked {
            Ok(Tracked { tracking: Tracking::Lost(lost), .. }) => Some(lost.name()),
            Ok(_) => None,
            Err(_) => Some("no_cloud"),
        }
    }

    /// What the tracking says of a cloud that was merged.
    pub(crate) fn merged(&self) -> Option<&Tracked> {
        self.tracked.as_ref().ok().filter(|tracked| !matches!(tracked.tracking, Tracking::Lost(_)))
    }
}

/// All windows, in their order.
pub(crate) struct Scan {
    pub(crate) looked: Vec<Looked>,
    /// Time that tracking and fusing took.
    pub(crate) tracking: Duration,
}

impl Scan {
    /// Reconstructs the windows and hands their clouds to the tracker.
    pub(crate) fn run(input: &Input, windows: &[Images], stream: &mut TrackedStream) -> Result<Self, Failure> {
        let mut scan = Self { looked: Vec::with_capacity(windows.len()), tracking: Duration::ZERO };
        let bar = progress::bar("clouds", windows.len() as u64);
        for images in windows {
            let times = input.times(&images.numbers);
            let tracked = match try_reconstruct_next(input, stream, images)? {
                Ok(made) => {
                    let begun = Instant::now();
                    let tracked = stream.track(&made, &times);
                    scan.tracking += begun.elapsed();
                    Ok(tracked)
                }
                Err(error) => Err(error.to_string()),
            };
            let first_pair = images.numbers.first().copied().unwrap_or_default();
            let time_ns = times.centre_ns();
            scan.looked.push(Looked { first_pair, time_s: input.seconds_since_first(time_ns), time_ns, tracked });
            bar.inc(1);
        }
        bar.finish_and_clear();
        Ok(scan)
    }
}
