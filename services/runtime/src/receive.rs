//! Receives messages. A broken connection is logged and opened again; it does not end the service.

use std::path::Path;

use fringeflow_message::Stage;
use fringeflow_transport::{Header, Payload, Received, Subscriber, TransportError};

use crate::account::{Account, sent_messages};

/// Returns the next message of a port, if there is one. Logs an error and returns `None`: the port has lost its
/// connection, and the next [`ensure_connected`] opens it again. Messages missed until then show in the numbers.
pub fn receive<H: Header, P: Payload + ?Sized>(port: &mut Subscriber<H, P>) -> Option<Received<H, P>> {
    port.receive().unwrap_or_else(|error| {
        tracing::warn!("{error}");
        None
    })
}

/// Opens a port again if it lost its connection. A long silence is a sign of that only if the account of the sender
/// shows more than `next` sent messages: an item may take longer than the silence allowed, and messages sent while a
/// port is opened again are lost. If the sender has no account, silence alone decides.
///
/// # Errors
/// As [`Subscriber::ensure_connected`].
pub fn ensure_connected<H: Header, P: Payload + ?Sized>(
    port: &mut Subscriber<H, P>,
    accounts: &Path,
    from: Stage,
    next: u64,
    now_ns: u64,
) -> Result<(), TransportError> {
    if Account::read_counts(accounts, from).is_some_and(|counts| sent_messages(from, &counts) <= next) {
        port.forgive_silence();
    }
    port.ensure_connected(now_ns).map(|_| ())
}
