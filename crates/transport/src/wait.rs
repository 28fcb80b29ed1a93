//! Waiting for messages of several channels at once.

// iceoryx2 has no safe way to borrow a file descriptor. Only the function `descriptor` uses unsafe code.
#![allow(unsafe_code)]

use std::os::fd::BorrowedFd;
use std::time::Duration;

use iceoryx2::port::listener::Listener;
use iceoryx2::prelude::FileDescriptorBased;
use rustix::event::{PollFd, PollFlags, Timespec, poll};
use rustix::io::Errno;

use super::{Ipc, TransportError};

/// Longest sleep while all ports are closed, so that the caller can open them again.
const CLOSED_PORT_PAUSE: Duration = Duration::from_millis(100);

/// A port that can be waited for.
#[allow(private_bounds)]
pub trait WaitSource: Listening {}

/// The listener of a port; `None` while the port is closed.
pub(super) trait Listening {
    fn listener(&self) -> Option<&Listener<Ipc>>;
}

/// Waits until a message may have arrived on any of the ports, a signal arrived, or `timeout` has passed. Wake-ups do
/// not match messages one to one. Afterwards, call `receive` on every port until it returns `None`, and check the flags
/// that signals set.
///
/// The cost is one system call, and one or two more for each port with an event. The ports are passed on each call
/// because any of them may have been opened again, and a `WaitSet` of iceoryx2 needs eight system calls to add and
/// remove a port.
///
/// # Errors
/// The system call fails.
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
        let events = polled.revents();
        if events.contains(PollFlags::NVAL) {
            return Err(wait_error("a port has no descriptor"));
        }
        if !events.is_empty() {
            // If the event cannot be read, it ends the next wait as well.
            let _ = listener.try_wait(|_| {});
        }
    }
    Ok(())
}

/// The descriptor that signals the events of a listener.
fn descriptor(listener: &Listener<Ipc>) -> BorrowedFd<'_> {
    // SAFETY: the listener keeps its descriptor open while it lives, and is borrowed for as long as the result. Nothing
    // closes the descriptor in the meantime, since only `poll` gets the number.
    unsafe { BorrowedFd::borrow_raw(listener.file_descriptor().native_handle()) }
}

fn wait_error(reason: impl std::fmt::Debug) -> TransportError {
    TransportError::Wait { reason: format!("{reason:?}") }
}
