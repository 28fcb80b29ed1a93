//! The correspondence service: phase maps in, correspondences out.

mod searches;

use std::sync::Arc;
use std::time::Duration;

use fringeflow::correspondence::SegmentTable;
use fringeflow::phase::PhaseShifts;
use fringeflow::worker::{CorrespondenceWorker, Correspondences};
use fringeflow_config::ScannerConfiguration;
use fringeflow_dataset::Setup;
use fringeflow_message::{Block, CorrespondenceHeader, DropReason, MapsHeader, Stage, Window, WindowReport};
use fringeflow_runtime::{Dropped, Host, ServiceArgs, ServiceError, Transform, run_transform};
use fringeflow_telemetry::health::{Health, HealthState, Quantity};
use fringeflow_telemetry::{GaugeFigures, HealthFigures};
use fringeflow_transport::{
    CORRESPONDENCE_MAP, Channel, PHASE_MAPS, Publisher, REPORT_WINDOW, Received, TransportError,
};
use fringeflow_wire as wire;
use fringeflow_wire::health::{health_measures, image_measures};
use fringeflow_wire::in_step::InStep;
use fringeflow_wire::window_report::window_report;

use searches::{SearchedWindow, Searches};

use crate::warm_up::WarmUp;

/// Runs the service until it is to stop.
///
/// # Errors
/// [`ServiceError`].
pub fn run(arguments: &ServiceArgs) -> Result<(), ServiceError> {
    let mut host = Host::open(arguments, "correspondence")?;
    let table = Arc::new(arguments.segment_table(&host.configuration, &host.setup)?);
    let mut searches =
        Searches::new(&new_worker(&host.configuration, &host.setup, &table)?, rayon::current_num_threads())?;
    if let Some(warm_up) = WarmUp::of(&host) {
        searches.warm_up(&warm_up.maps()?);
    }
    let stage = CorrespondenceStage {
        searches,
        health: Health::new(&host.configuration.measurement.health),
        in_step: InStep::default(),
        states: [HealthState::NotKnown; Quantity::ALL.len()],
        slip_steps: [0; 2],
        published: 0,
        reports: Publisher::open(&host.node, REPORT_WINDOW, &host.sizes)?,
    };
    run_transform(&mut host, stage)
}

/// Returns a worker for a configuration.
pub(crate) fn new_worker(
    configuration: &ScannerConfiguration,
    setup: &Setup,
    table: &Arc<SegmentTable>,
) -> Result<CorrespondenceWorker, ServiceError> {
    let cycle = PhaseShifts::new(setup.cycle_shifts_rad()).map_err(|e| ServiceError::Unusable(e.to_string()))?;
    Ok(CorrespondenceWorker::new(Arc::clone(table), &cycle, configuration.measurement.settings.matching))
}

struct CorrespondenceStage {
    searches: Searches,
    health: Health,
    in_step: InStep,
    /// Last logged states of all quantities.
    states: [HealthState; Quantity::ALL.len()],
    /// Slip of the previous window, steps.
    slip_steps: [usize; 2],
    /// Number of the last correspondences.
    published: u64,
    reports: Publisher<(), WindowReport>,
}

impl CorrespondenceStage {
    /// Reports on the window that was searched last and has no correspondences: its images may show why.
    fn report_without_result(&mut self) -> Result<(), TransportError> {
        let Some(SearchedWindow { header, .. }) = self.searches.last() else { return Ok(()) };
        self.health.add(header.window.received_ns, &image_measures([&header.cam1, &header.cam2], header.skew_ns));
        let report = window_report(header, &Correspondences::default(), self.published, &self.health);
        self.log_health(HealthFigures::from_report(&report).as_ref());
        self.reports.send_message(&report)
    }

    /// Logs the quantities whose state has changed.
    fn log_health(&mut self, health: Option<&HealthFigures>) {
        for gauge in health.into_iter().flat_map(|health| &health.quantities) {
            let before = std::mem::replace(&mut self.states[gauge.quantity as usize], gauge.state);
            if GaugeFigures::is_noteworthy_change(before, gauge.state) {
                if gauge.state > before { tracing::warn!("{gauge}") } else { tracing::info!("{gauge}") }
            }
        }
    }

    /// Logs when the sequence has slipped, and when it is in step again.
    fn log_slip(&mut self, slip_steps: [usize; 2]) {
        if slip_steps == self.slip_steps {
            return;
        }
        self.slip_steps = slip_steps;
        match slip_steps {
            [0, 0] => tracing::info!("the images show the declared phase shifts again"),
            [a, b] if a == b => tracing::warn!(
                "the pattern of both cameras is {a} steps ahead of the declared phase shifts: projector and \
                 cameras are out of step; the phases are corrected"
            ),
            [a, b] => tracing::warn!(
                "the patterns of camera 1 and 2 are {a} and {b} steps ahead of the declared phase shifts: a \
                 camera has lost or repeated images, and its numbers do not show it; the phases are corrected"
            ),
        }
    }
}

impl Transform for CorrespondenceStage {
    type InHeader = MapsHeader;
    type InPayload = [Block];
    type OutHeader = CorrespondenceHeader;
    type OutPayload = [Block];

    const INPUT: Channel<MapsHeader, [Block]> = PHASE_MAPS;
    const OUTPUT: Channel<CorrespondenceHeader, [Block]> = CORRESPONDENCE_MAP;
    const STAGE: Stage = Stage::Correspondence;
    const NEXT: Option<Stage> = Some(Stage::Cloud);

    fn published(header: &MapsHeader) -> u64 {
        header.published
    }

    fn window(header: &MapsHeader) -> Window {
        header.window
    }

    fn at_once(&self) -> usize {
        self.searches.at_once()
    }

    fn begin(&mut self, message: Received<MapsHeader, [Block]>) -> Result<(), Dropped> {
        let read = |window: &mut SearchedWindow| {
            window.header = *message.header();
            let read = wire::maps::read(&window.header, message.payload(), &mut window.maps);
            read.map_err(|e| Dropped::new(DropReason::Malformed, e))
        };
        self.searches.begin(read)
    }

    fn end_oldest(&mut self, timeout: Duration) -> Option<Result<u64, Dropped>> {
        let ended_ns = self.searches.end_oldest(timeout)?;
        if ended_ns.is_err()
            && let Err(error) = self.report_without_result()
        {
            tracing::debug!(%error, "a report was not sent");
        }
        Some(ended_ns.map_err(|e| Dropped::new(DropReason::NoCorrespondence, e)))
    }

    fn send(
        &mut self,
        published: u64,
        output: &mut Publisher<CorrespondenceHeader, [Block]>,
    ) -> Result<(), TransportError> {
        let Some(SearchedWindow { header, correspondences, .. }) = self.searches.last() else { return Ok(()) };
        let header = wire::correspondences::header(correspondences, &header.window, published);
        let blocks = wire::correspondences::blocks(correspondences.mean.len());
        output.send_filled(&header, blocks, |payload| wire::correspondences::write(correspondences, payload))
    }

    fn send_reports(&mut self, published: u64) -> Result<(), TransportError> {
        let Some(SearchedWindow { header, correspondences, .. }) = self.searches.last() else { return Ok(()) };
        let is_in_step = self.in_step.update(header, correspondences);
        self.health.add(
            header.window.received_ns,
            &health_measures([&header.cam1, &header.cam2], header.skew_ns, &correspondences.matches, is_in_step),
        );
        let report = window_report(header, correspondences, published, &self.health);
        self.published = published;
        self.log_slip(correspondences.matches.slip_steps);
        self.log_health(HealthFigures::from_report(&report).as_ref());
        self.reports.send_message(&report)
    }

    fn ensure_connected(&mut self) -> Result<(), TransportError> {
        self.reports.ensure_connected().map(|_| ())
    }
}
