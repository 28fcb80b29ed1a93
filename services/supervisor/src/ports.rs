//! The channels of the supervisor. In: reports and control requests. Out: responses and the state of the scan.

use std::path::Path;
use std::time::Duration;

use fringeflow_message::{ScanState, Stage, StageReport, WindowReport};
use fringeflow_runtime::{ensure_connected, receive};
use fringeflow_transport::{
    ChannelSizes, ControlServer, KeptChannels, Node, Publisher, REPORT_STAGE, REPORT_WINDOW, SCAN_STATE, Subscriber,
    TransportError, wait_for,
};

use crate::control::Control;
use crate::reports::Reports;

/// The ports of the supervisor.
pub(crate) struct Ports {
    kept: KeptChannels,
    state: Publisher<(), ScanState>,
    reports: Subscriber<(), StageReport>,
    windows: Subscriber<(), WindowReport>,
    /// Number of the next window report.
    next_window: u64,
    control: ControlServer,
    /// Revision of the last published state.
    published_revision: Option<u64>,
}

impl Ports {
    pub(crate) fn open(node: &Node, sizes: &ChannelSizes) -> Result<Self, TransportError> {
        Ok(Self {
            kept: KeptChannels::open(node, sizes)?,
            state: Publisher::open(node, SCAN_STATE, sizes)?,
            reports: Subscriber::open(node, REPORT_STAGE, sizes)?,
            windows: Subscriber::open(node, REPORT_WINDOW, sizes)?,
            next_window: 0,
            control: ControlServer::open(node)?,
            published_revision: None,
        })
    }

    /// Receives all waiting reports.
    pub(crate) fn receive_reports(&mut self, reports: &mut Reports) {
        while let Some(report) = receive(&mut self.windows) {
            reports.run.add_window(&report);
            self.next_window = report.published + 1;
        }
        while let Some(report) = receive(&mut self.reports) {
            reports.add(&report);
        }
    }

    /// Answers all waiting requests. Publishes the state after each of them, so that subscribers see every mark.
    pub(crate) fn answer_requests(&mut self, control: &mut Control) {
        let Self { control: server, state, published_revision, .. } = self;
        let result = server.answer(|request| {
            let response = control.answer(request);
            publish(state, published_revision, &control.state);
            response
        });
        if let Err(error) = result {
            tracing::warn!("{error}");
        }
    }

    /// Publishes the state if it has changed.
    pub(crate) fn publish_state(&mut self, state: &ScanState) {
        publish(&mut self.state, &mut self.published_revision, state);
    }

    /// Waits for a report or a request, at most for `timeout`.
    pub(crate) fn wait(&self, timeout: Duration) -> Result<(), TransportError> {
        wait_for(&[&self.reports, &self.windows, &self.control], timeout)
    }

    /// Opens ports again that lost their connection.
    pub(crate) fn ensure_connected(&mut self, accounts: &Path, now_ns: u64) -> Result<(), TransportError> {
        self.kept.ensure_connected()?;
        if self.state.ensure_connected()? {
            // Publish the state again: later subscribers get it only from the new port.
            self.published_revision = None;
        }
        self.reports.ensure_connected(now_ns)?;
        ensure_connected(&mut self.windows, accounts, Stage::Correspondence, self.next_window, now_ns)?;
        self.control.ensure_connected()?;
        Ok(())
    }
}

/// Publishes a state with a new revision. After a failure the next call tries again; meanwhile
/// [`Ports::ensure_connected`] opens the port again.
fn publish(port: &mut Publisher<(), ScanState>, published_revision: &mut Option<u64>, state: &ScanState) {
    if *published_revision == Some(state.revision) {
        return;
    }
    match port.send_message(state) {
        Ok(()) => *published_revision = Some(state.revision),
        Err(error) => tracing::warn!("{error}"),
    }
}
