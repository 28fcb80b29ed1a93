//! Observes an instance from another process, by its reports.

use std::time::Duration;

use fringeflow_message::{Stage, StageReport};
use fringeflow_runtime::{Account, accounts_folder, clock};
use fringeflow_telemetry::{Tally, TrackingFigures, TrackingWatch, WindowFigures};
use fringeflow_transport::{
    ChannelSizes, Instance, Node, REPORT_STAGE, REPORT_WINDOW, Subscriber, TRACKING_POSE, TransportError, wait_for,
};

/// State of an instance over a span of time.
#[derive(Debug)]
pub struct Observed {
    /// Counts and latencies of the stages.
    pub tally: Tally,
    /// Figures of the last window; `None` if no window was reported in the span.
    pub window: Option<WindowFigures>,
    /// State of the tracking; `None` without tracking.
    pub tracking: Option<TrackingFigures>,
}

/// Collects the reports of a running instance for `span_ns`, nanoseconds. Every live stage reports about twice a second
/// or more often. A stage that does not report appears as silent, with the counts of its account.
///
/// # Errors
/// The instance cannot be joined.
pub fn observe(instance: &Instance, span_ns: u64) -> Result<Observed, TransportError> {
    let node = Node::open(instance, "observer")?;
    // The default sizes will do: the size of a report does not depend on the setup.
    let mut reports = Subscriber::open(&node, REPORT_STAGE, &ChannelSizes::default())?;
    let mut windows = Subscriber::open(&node, REPORT_WINDOW, &ChannelSizes::default())?;
    let mut poses = Subscriber::open(&node, TRACKING_POSE, &ChannelSizes::default())?;
    let (mut tally, mut window, mut watch) = (Tally::default(), None, TrackingWatch::default());
    let end_ns = clock::now_ns() + span_ns;
    loop {
        while let Some(report) = reports.receive()? {
            tally.add(&report);
        }
        while let Some(report) = windows.receive()? {
            window = Some(WindowFigures::from_report(&report));
        }
        while let Some(report) = poses.receive()? {
            watch.add(&report);
        }
        let remaining_ns = end_ns.saturating_sub(clock::now_ns());
        if remaining_ns == 0 {
            break;
        }
        wait_for(&[&reports, &windows, &poses], Duration::from_nanos(remaining_ns))?;
    }
    // A report without times makes a stage silent.
    let accounts = accounts_folder(instance);
    for stage in Stage::ALL.into_iter().filter(|&stage| tally.stage(stage).is_none()).collect::<Vec<_>>() {
        if let Some(counts) = Account::read_counts(&accounts, stage) {
            tally.add(&StageReport { stage: stage as u32, counts, ..StageReport::default() });
        }
    }
    let counts = tally.stage(Stage::Tracking).map(|stage_tally| stage_tally.counts).unwrap_or_default();
    let tracking = watch.figures(&counts, clock::now_ns());
    Ok(Observed { tally, window, tracking })
}
