//! Waiting for messages of several channels at once.

use std::time::Duration;

use iceoryx2::port::listener::Listener;
use iceoryx2::prelude::{CallbackProgression, SignalHandlingMode, WaitSet, WaitSetBuilder};

use super::{ControlServer, Header, Ipc, Payload, Subscriber, TransportError};

/// Longest sleep while a port is closed, so that whatever reopens it gets its turn.
const CLOSED_PORT_PAUSE: Duration = Duration::from_millis(100);

/// Waits until a message may have come, a signal arrived, or time is up.
#[derive(Debug)]
pub struct Wake {
    waits: WaitSet<Ipc>,
}

/// A port that can be waited for.
#[allow(private_bounds)]
pub trait WakeSource: Listening {}

impl<H: Header, P: Payload + ?Sized> WakeSource for Subscriber<H, P> {}
impl WakeSource for ControlServer {}

/// Gives the listener of a port; none while the port is closed.
pub(super) trait Listening {
    fn listener(&self) -> Option<&Listener<Ipc>>;
}

impl Wake {
    /// Prepares to wait. Signals are the caller's affair.
    ///
    /// # Errors
    /// The system has no more descriptors.
    pub fn new() -> Result<Self, TransportError> {
        let waits =
            WaitSetBuilder::new().signal_handling_mode(SignalHandlingMode::Disabled).create().map_err(wait_error)?;
        Ok(Self { waits })
    }

    /// Waits for any of the ports, at most for `timeout`. Wake-ups do not map one to one to messages: receive until
    /// `None` on every port afterwards, and look at the flags that signals set.
    ///
    /// # Errors
    /// The system refuses to wait.
    pub fn wait(&self, ports: &[&dyn WakeSource], timeout: Duration) -> Result<(), TransportError> {
        let listeners: Vec<_> = ports.iter().filter_map(|port| port.listener()).collect();
        if listeners.is_empty() {
            std::thread::sleep(timeout.min(CLOSED_PORT_PAUSE));
            return Ok(());
        }
        let attached: Result<Vec<_>, _> = listeners.iter().map(|l| self.waits.attach_notification(*l)).collect();
        let attached = attached.map_err(wait_error)?;
        let all = |_| CallbackProgression::Continue;
        // The result tells an event from a signal; the caller looks for both in any case.
        self.waits.wait_and_process_once_with_timeout(all, timeout).map_err(wait_error)?;
        drop(attached);
        // An event that cannot be taken is still there at the next wait.
        for listener in listeners {
            let _ = listener.try_wait(|_| {});
        }
        Ok(())
    }
}

fn wait_error(reason: impl std::fmt::Debug) -> TransportError {
    TransportError::Wait { reason: format!("{reason:?}") }
}
