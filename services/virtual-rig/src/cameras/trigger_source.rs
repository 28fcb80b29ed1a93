//! Source of the triggers: the channel of the projector, or the clock of the cameras. It triggers only during a scan.

use fringeflow_config::ProjectorDriver;
use fringeflow_message::{DropReason, PatternEvent, ScanState};
use fringeflow_runtime::{Host, ServiceError, clock, receive};
use fringeflow_transport::{PROJECTOR_PATTERN, SCAN_STATE, Subscriber, TransportError, wait_for};

use crate::cameras::capture::Capture;
use crate::cameras::trigger::{CableTriggers, ClockTriggers};

/// The source of triggers.
pub(crate) struct TriggerSource {
    states: Subscriber<(), ScanState>,
    scanning: bool,
    kind: Kind,
}

enum Kind {
    /// Each event of the projector is a trigger, as if by cable.
    Cable(CableTriggers, Box<Subscriber<(), PatternEvent>>),
    /// The cameras run free.
    Clock(ClockTriggers),
}

impl TriggerSource {
    pub(crate) fn open(host: &Host) -> Result<Self, ServiceError> {
        let steps = host.setup.sequence.shifts_rad.len() as u32;
        let events = || Subscriber::open(&host.node, PROJECTOR_PATTERN, &host.sizes).map(Box::new);
        let kind = match host.configuration.projector {
            ProjectorDriver::Cycle => Kind::Clock(ClockTriggers::new(host.configuration.rate_hz, steps)),
            ProjectorDriver::External => Kind::Cable(CableTriggers::new(steps, None), events()?),
            ProjectorDriver::Virtual => {
                let period_ns = Some(host.configuration.frame_period_ns());
                Kind::Cable(CableTriggers::new(steps, period_ns), events()?)
            }
        };
        let states = Subscriber::open(&host.node, SCAN_STATE, &host.sizes)?;
        Ok(Self { states, scanning: false, kind })
    }

    /// Exposes both cameras on each trigger that is due.
    pub(crate) fn trigger(&mut self, cameras: &mut [Capture; 2]) -> Result<(), ServiceError> {
        while let Some(state) = receive(&mut self.states) {
            self.scanning = state.scanning != 0;
        }
        let now_ns = clock::now_ns();
        match &mut self.kind {
            Kind::Clock(clock) => {
                clock.set_scanning(self.scanning, now_ns);
                while let Some((missed, trigger)) = clock.take_trigger(now_ns) {
                    for camera in &mut *cameras {
                        camera.count_lost(missed, DropReason::CameraLost)?;
                        camera.expose(&trigger)?;
                    }
                }
            }
            Kind::Cable(cable, events) => {
                while let Some(event) = receive(events) {
                    if self.scanning {
                        expose_on_event(cable, &event, now_ns, cameras)?;
                    }
                }
            }
        }
        Ok(())
    }

    /// Returns the time of the next trigger; `None` if it depends on events, or while stopped.
    pub(crate) fn next_ns(&self) -> Option<u64> {
        match &self.kind {
            Kind::Clock(clock) => clock.next_ns(),
            Kind::Cable(..) => None,
        }
    }

    /// Waits for events and changes of the scan state.
    pub(crate) fn wait(&self, timeout: std::time::Duration) -> Result<(), TransportError> {
        match &self.kind {
            Kind::Clock(_) => wait_for(&[&self.states], timeout),
            Kind::Cable(_, events) => wait_for(&[&self.states, events.as_ref()], timeout),
        }
    }

    pub(crate) fn ensure_connected(&mut self, now_ns: u64) -> Result<(), TransportError> {
        self.states.ensure_connected(now_ns)?;
        if let Kind::Cable(_, events) = &mut self.kind {
            events.ensure_connected(now_ns)?;
        }
        Ok(())
    }
}

/// Exposes both cameras on the triggers of an event. An event with an implausible time counts as a lost image.
fn expose_on_event(
    cable: &mut CableTriggers,
    event: &PatternEvent,
    now_ns: u64,
    cameras: &mut [Capture; 2],
) -> Result<(), ServiceError> {
    if !CableTriggers::is_current(event, now_ns) {
        for camera in cameras {
            camera.count_lost(1, DropReason::BadTime)?;
        }
        return Ok(());
    }
    for trigger in cable.take_event(event) {
        for camera in &mut *cameras {
            camera.expose(&trigger)?;
        }
    }
    Ok(())
}
