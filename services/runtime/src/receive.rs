//! Receiving without dying of it.

use std::path::Path;

use fringeflow_message::Stage;
use fringeflow_transport::{Header, Payload, Received, Subscriber, TransportError};

use crate::account::{Account, messages};

/// The next message of a port, if there is one. A port that fails has lost its other side: it is opened anew at the next look at
/// the connections, and what it missed shows in the numbers.
pub fn receive<H: Header, P: Payload + ?Sized>(port: &mut Subscriber<H, P>) -> Option<Received<H, P>> {
    port.receive().unwrap_or_else(|error| {
        tracing::warn!("{error}");
        None
    })
}

/// Opens a port again if it lost its other side. Silence is a sign of that only while its sender, by its account in a folder, has
/// put out more than the items below number `next`: what is sent during the change is lost, and an item may well take longer
/// than a silence is borne. Where the sender keeps no account, silence is all that tells.
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
    if Account::read(accounts, from).is_some_and(|counts| messages(from, &counts) <= next) {
        port.forgive_silence();
    }
    port.ensure_connected(now_ns).map(|_| ())
}
