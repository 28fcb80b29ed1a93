//! The virtual projector service. During a scan it publishes an event for each pattern that a projector would show.

mod patterns;

use std::time::Duration;

use fringeflow_lab::simulation::{ConfiguredScanner, Faults};
use fringeflow_message::{DropReason, PatternEvent, ScanState, Stage};
use fringeflow_runtime::{Account, AccountError, Host, ItemTimes, MAX_WAIT, ServiceArgs, ServiceError, clock, receive};
use fringeflow_transport::{PROJECTOR_PATTERN, Publisher, SCAN_STATE, Subscriber, wait_for};

pub use patterns::{ShownPattern, VirtualProjector};

/// Runs the service until it is asked to stop.
///
/// # Errors
/// [`ServiceError`].
pub fn run(arguments: &ServiceArgs) -> Result<(), ServiceError> {
    let mut host = Host::open(arguments, "virtual-projector")?;
    let mut service = Service::open(&host)?;
    while !host.stop.is_requested() {
        service.follow_state();
        service.show(&mut host)?;
        if host.is_heartbeat_due() {
            host.report(Stage::Projector, service.account.counts(), None);
        }
        host.check_connections(|_, now_ns| {
            service.output.ensure_connected()?;
            service.states.ensure_connected(now_ns)?;
            Ok(())
        });
        let next_ns = service.projector.next_ns().unwrap_or(u64::MAX);
        wait_for(&[&service.states], Duration::from_nanos(next_ns.saturating_sub(clock::now_ns())).min(MAX_WAIT))?;
    }
    host.report(Stage::Projector, service.account.counts(), None);
    Ok(())
}

struct Service {
    account: Account,
    output: Publisher<(), PatternEvent>,
    states: Subscriber<(), ScanState>,
    projector: VirtualProjector,
}

impl Service {
    fn open(host: &Host) -> Result<Self, ServiceError> {
        let unusable = |what: String| ServiceError::Unusable(what);
        let configured =
            ConfiguredScanner::from_scanner_configuration(&host.configuration).map_err(|e| unusable(e.to_string()))?;
        let faults = configured.map_or(Ok(Faults::default()), |configured| Faults::new(configured.faults));
        let faults = faults.map_err(|e| unusable(e.to_string()))?;
        let (rate_hz, sequence) = (host.configuration.rate_hz, &host.setup.sequence);
        Ok(Self {
            projector: VirtualProjector::new(clock::now_ns(), rate_hz, sequence, faults),
            output: Publisher::open(&host.node, PROJECTOR_PATTERN, &host.sizes)?,
            states: Subscriber::open(&host.node, SCAN_STATE, &host.sizes)?,
            account: host.open_account(Stage::Projector)?,
        })
    }

    fn follow_state(&mut self) {
        while let Some(state) = receive(&mut self.states) {
            self.projector.set_scanning(state.scanning != 0, clock::now_ns());
        }
    }

    fn show(&mut self, host: &mut Host) -> Result<(), ServiceError> {
        while let Some(shown) = self.projector.show(clock::now_ns()) {
            let taken_ns = clock::now_ns();
            self.account.count_taken(shown.missed + 1)?;
            self.account.drop_many(DropReason::Overrun, shown.missed)?;
            match shown.event {
                None => self.account.drop_one(DropReason::Injected)?,
                Some(event) => self.publish(host, &event, taken_ns)?,
            }
        }
        Ok(())
    }

    fn publish(&mut self, host: &mut Host, event: &PatternEvent, taken_ns: u64) -> Result<(), AccountError> {
        self.account.count_passed_item(event.session, event.sequence)?;
        // An event that cannot be sent leaves a gap in the channel, and subscribers count it as lost.
        if let Err(error) = self.output.send_message(event) {
            tracing::warn!("{error}");
        }
        let times = ItemTimes {
            exposure_start_ns: event.exposure_start_ns,
            received_ns: taken_ns,
            taken_ns,
            passed_ns: clock::now_ns(),
            waited_ns: 0,
        };
        host.report(Stage::Projector, self.account.counts(), Some(times));
        Ok(())
    }
}
