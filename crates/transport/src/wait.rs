//! Waiting for messages of several channels at once.

// The number of a descriptor has no safe form in iceoryx2; `descriptor` alone asks for it.
#![allow(unsafe_code)]

use std::os::fd::BorrowedFd;
use std::time::Duration;

use iceoryx2::port::listener::Listener;
use iceoryx2::prelude::FileDescriptorBased;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;

use super::{ControlServer, Header, Ipc, Payload, Subscriber, TransportError};

/// Longest sleep while a port is closed, so that whatever reopens it gets its turn.
const CLOSED_PORT_PAUSE: Duration = Duration::from_millis(100);

/// A port that can be waited for.
#[allow(private_bounds)]
pub trait WaitSource: Listening {}

impl<H: Header, P: Payload + ?Sized> WaitSource for Subscriber<H, P> {}
impl WaitSource for ControlServer {}

/// Gives the listener of a port; none while the port is closed.
pub(super) trait Listening {
    fn listener(&self) -> Option<&Listener<Ipc>>;
}

/// Waits for any of the ports until a message may have come, a signal arrived, or `timeout` is over. Wake-ups do not map one to
/// one to messages: receive until `None` on every port afterwards, and look at the flags that signals set.
///
/// One call of the system, and one or two more for each port that has something: the ports are named anew each time, since any
/// of them may have been opened anew, and a `WaitSet` of iceoryx2 takes eight calls to be told of a port and to forget it.
///
/// # Errors
/// The system refuses to wait.
pub fn wait_for(ports: &[&dyn WaitSource], timeout: Duration) -> Result<(), TransportError> {
    let listeners: Vec<_> = ports.iter().filter_map(|port| port.listener()).collect();
    if listeners.is_empty() {
        std::thread::sleep(timeout.min(CLOSED_PORT_PAUSE));
        return Ok(());
    }
    let mut polled: Vec<_> = listeners.iter().map(|l| PollFd::from_borrowed_fd(descriptor(l), PollFlags::IN)).collect();
    let timeout = Timespec::try_from(timeout).map_err(wait_error)?;
    match poll(&mut polled, Some(&timeout)) {
        Ok(_) | Err(Errno::INTR) => {}
        Err(refused) => return Err(wait_error(refused)),
    }
    for (listener, polled) in listeners.iter().zip(&polled) {
        let told = polled.revents();
        if told.contains(PollFlags::NVAL) {
            return Err(wait_error("a port has no descriptor"));
        }
        if !told.is_empty() {
            // An event that cannot be taken is still there at the next wait.
            let _ = listener.try_wait(|_| {});
        }
    }
    Ok(())
}

/// What the system tells of the events of a listener through.
fn descriptor(listener: &Listener<Ipc>) -> BorrowedFd<'_> {
    // SAFETY: the listener keeps its descriptor open for as long as it lives, and is borrowed for as long as the result; nobody
    // closes it meanwhile, since the number is handed to `poll` alone.
    unsafe { BorrowedFd::borrow_raw(listener.file_descriptor().native_handle()) }
}

fn wait_error(reason: impl std::fmt::Debug) -> TransportError {
    TransportError::Wait { reason: format!("{reason:?}") }
}
