//! Reconstructs and tracks the clouds of a recording, one after the other.

use std::time::{Duration, Instant};

use fringeflow_tracking::TrackedStream;
use fringeflow_tracking::fusion::{Tracked, Tracking};

use crate::failure::Failure;
use crate::images::Images;
use crate::input::Input;
use crate::progress;
use crate::proposed::try_reconstruct_next;

/// A window of images, and its result.
pub(crate) struct ScanWindow {
    /// Number of its first image pair.
    pub(crate) first_pair: usize,
    /// Middle of its exposures, seconds since the first exposure of the recording.
    pub(crate) time_s: f64,
    /// The same as a time of the recording, nanoseconds.
    pub(crate) time_ns: u64,
    /// Result of the tracking, or the reason why there is no cloud.
    pub(crate) tracked: Result<Tracked, String>,
}

impl ScanWindow {
    /// Why the cloud was not merged; `None` if it was.
    pub(crate) fn loss_text(&self) -> Option<String> {
        match &self.tracked {
            Ok(Tracked { tracking: Tracking::Lost(lost), .. }) => Some(lost.to_string()),
            Ok(_) => None,
            Err(why) => Some(why.clone()),
        }
    }

    /// Name of the reason why the cloud was not merged; `None` if it was.
    pub(crate) fn loss_name(&self) -> Option<&'static str> {
        match &self.tracked {
            Ok(Tracked { tracking: Tracking::Lost(lost), .. }) => Some(lost.name()),
            Ok(_) => None,
            Err(_) => Some("no_cloud"),
        }
    }

    /// Result of the tracking if the cloud was merged.
    pub(crate) fn merged(&self) -> Option<&Tracked> {
        self.tracked.as_ref().ok().filter(|tracked| !matches!(tracked.tracking, Tracking::Lost(_)))
    }
}

/// All windows of a scan, in their order.
pub(crate) struct Scan {
    pub(crate) windows: Vec<ScanWindow>,
    /// Total duration of tracking and fusing.
    pub(crate) tracking_time: Duration,
}

impl Scan {
    /// Reconstructs the windows and passes their clouds to the tracker.
    pub(crate) fn run(input: &Input, windows: &[Images], stream: &mut TrackedStream) -> Result<Self, Failure> {
        let mut scan = Self { windows: Vec::with_capacity(windows.len()), tracking_time: Duration::ZERO };
        let bar = progress::bar("clouds", windows.len() as u64);
        for images in windows {
            let times = input.times(&images.numbers);
            let tracked = match try_reconstruct_next(input, stream, images)? {
                Ok(reconstruction) => {
                    let start = Instant::now();
                    let tracked = stream.track(&reconstruction, &times);
                    scan.tracking_time += start.elapsed();
                    Ok(tracked)
                }
                Err(error) => Err(error.to_string()),
            };
            let first_pair = images.numbers.first().copied().unwrap_or_default();
            let time_ns = times.centre_ns();
            let time_s = input.seconds_since_first(time_ns);
            scan.windows.push(ScanWindow { first_pair, time_s, time_ns, tracked });
            bar.inc(1);
        }
        bar.finish_and_clear();
        Ok(scan)
    }
}
