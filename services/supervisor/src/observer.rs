//! An instance seen from outside: its reports, gathered for a while.

use std::time::Duration;

use fringeflow_message::{Stage, StageReport};
use fringeflow_runtime::{Account, accounts_folder, clock};
use fringeflow_telemetry::{Tally, TrackingFigures, TrackingWatch, WindowFigures};
use fringeflow_transport::{
    ChannelSizes, Instance, Node, REPORT_STAGE, REPORT_WINDOW, Subscriber, TRACKING_POSE, TransportError, wait_for,
};

/// What was seen of an instance.
#[derive(Debug)]
pub struct Observed {
    /// Counts and latencies of the stages.
    pub tally: Tally,
    /// Figures of the last window; `None` where none came meanwhile.
    pub window: Option<WindowFigures>,
    /// How the tracking fares, if there is any.
    pub tracking: Option<TrackingFigures>,
}

/// Gathers the reports of a running instance for `span_ns`: half a second brings a sign of life of every stage. One that
/// gives none appears with the counts of its account, as silent.
///
/// # Errors
/// The instance cannot be joined.
pub fn observe(instance: &Instance, span_ns: u64) -> Result<Observed, TransportError> {
    let node = Node::open(instance, "observer")?;
    // Reports have one size, whatever that of the images.
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
        let rest_ns = end_ns.saturating_sub(clock::now_ns());
        if rest_ns == 0 {
            break;
        }
        wait_for(&[&reports, &windows], Duration::from_nanos(rest_ns))?;
    }
    let accounts = accounts_folder(instance);
    for stage in Stage::ALL.into_iter().filter(|&stage| tally.stage(stage).is_none()).collect::<Vec<_>>() {
        if let Some(counts) = Account::read(&accounts, stage) {
            tally.add(&StageReport { stage: stage as u32, counts, ..StageReport::default() });
        }
    }
    let counts = tally.stage(Stage::Tracking).map(|of_stage| of_stage.counts).unwrap_or_default();
    let tracking = watch.figures(&counts, clock::now_ns());
    Ok(Observed { tally, window, tracking })
}
