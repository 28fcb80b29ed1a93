//! Where triggers come from: the channel of the projector, or the cameras' clock; only while the scanner scans.

use fringeflow_config::ProjectorDriver;
use fringeflow_message::{DropReason, PatternEvent, ScanState};
use fringeflow_runtime::{Host, ServiceError, clock, receive};
use fringeflow_transport::{PROJECTOR_PATTERN, SCAN_STATE, Subscriber, TransportError, wait_for};

use crate::cameras::capture::Capture;
use crate::cameras::trigger::{CableTriggers, ClockTriggers};

/// The source of triggers.
pub(crate) struct Source {
    states: Subscriber<(), ScanState>,
    scanning: bool,
    kind: Kind,
}

enum Kind {
    Cable(CableTriggers, Box<Subscriber<(), PatternEvent>>),
    Clock(ClockTriggers),
}

impl Source {
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

    /// Triggers the cameras as far as the time has come.
    pub(crate) fn trigger(&mut self, cameras: &mut [Capture; 2]) -> Result<(), ServiceError> {
        while let Some(state) = receive(&mut self.states) {
            self.scanning = state.scanning != 0;
        }
        let now_ns = clock::now_ns();
        match &mut self.kind {
            Kind::Clock(clock) => {
                clock.scan(self.scanning, now_ns);
                while let Some((missed, trigger)) = clock.take(now_ns) {
                    for camera in &mut *cameras {
                        camera.lose(missed, DropReason::CameraLost)?;
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

    /// When the next trigger is due; `None` where events tell.
    pub(crate) fn next_ns(&self) -> Option<u64> {
        match &self.kind {
            Kind::Clock(clock) => clock.next_ns(),
            Kind::Cable(..) => None,
        }
    }

    /// Waits for events and changes of the state.
    pub(crate) fn wait(&self, longest: std::time::Duration) -> Result<(), TransportError> {
        match &self.kind {
            Kind::Clock(_) => wait_for(&[&self.states], longest),
            Kind::Cable(_, events) => wait_for(&[&self.states, events.as_ref()], longest),
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

fn expose_on_event(
    cable: &mut CableTriggers,
    event: &PatternEvent,
    now_ns: u64,
    cameras: &mut [Capture; 2],
) -> Result<(), ServiceError> {
    if !CableTriggers::is_of_now(event, now_ns) {
        for camera in cameras {
            camera.lose(1, DropReason::BadTime)?;
        }
        return Ok(());
    }
    for trigger in cable.of_event(event) {
        for camera in &mut *cameras {
            camera.expose(&trigger)?;
        }
    }
    Ok(())
}
