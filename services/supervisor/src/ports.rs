//! What the supervisor says and hears: the state goes out, reports and requests come in.

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

/// Ports of the supervisor.
pub(crate) struct Ports {
    kept: KeptChannels,
    state: Publisher<(), ScanState>,
    reports: Subscriber<(), StageReport>,
    windows: Subscriber<(), WindowReport>,
    /// Number of the report of a window that comes next.
    next_window: u64,
    control: ControlServer,
    sent: Option<u64>,
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
            sent: None,
        })
    }

    /// Takes what the services have reported.
    pub(crate) fn drain(&mut self, reports: &mut Reports) {
        while let Some(report) = receive(&mut self.windows) {
            reports.run.add_window(&report);
            self.next_window = report.published + 1;
        }
        while let Some(report) = receive(&mut self.reports) {
            reports.add(&report);
        }
    }

    /// Answers what is asked, and publishes the state that each answer tells: who follows it misses no mark.
    pub(crate) fn answer(&mut self, control: &mut Control) {
        let Self { control: server, state, sent, .. } = self;
        let answered = server.answer(|request| {
            let response = control.answer(request);
            publish(state, sent, &control.state);
            response
        });
        if let Err(error) = answered {
            tracing::warn!("{error}");
        }
    }

    /// Publishes the state if it has changed.
    pub(crate) fn publish_state(&mut self, state: &ScanState) {
        publish(&mut self.state, &mut self.sent, state);
    }

    pub(crate) fn wait(&self, rest: Duration) -> Result<(), TransportError> {
        wait_for(&[&self.reports, &self.windows, &self.control], rest)
    }

    pub(crate) fn ensure_connected(&mut self, accounts: &Path, now_ns: u64) -> Result<(), TransportError> {
        self.kept.ensure_connected()?;
        if self.state.ensure_connected()? {
            // Whoever comes now is to hear the state as well.
            self.sent = None;
        }
        self.reports.ensure_connected(now_ns)?;
        ensure_connected(&mut self.windows, accounts, Stage::Correspondence, self.next_window, now_ns)?;
        self.control.ensure_connected()?;
        Ok(())
    }
}

/// Publishes a state that was not yet; if that fails, the port is opened anew at the next look at the connections, and it is
/// tried again.
fn publish(states: &mut Publisher<(), ScanState>, sent: &mut Option<u64>, state: &ScanState) {
    if *sent == Some(state.revision) {
        return;
    }
    match states.send_message(state) {
        Ok(()) => *sent = Some(state.revision),
        Err(error) => tracing::warn!("{error}"),
    }
}
