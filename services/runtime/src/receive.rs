//! Receiving without dying of it.

use fringeflow::transport::{Header, Payload, Received, Subscriber};

/// The next message of a port, if there is one. A port that fails has lost its other side: it is opened anew at the next look at
/// the connections, and what it missed shows in the numbers.
pub fn receive<H: Header, P: Payload + ?Sized>(port: &mut Subscriber<H, P>) -> Option<Received<H, P>> {
    port.receive().unwrap_or_else(|error| {
        tracing::warn!("{error}");
        None
    })
}
