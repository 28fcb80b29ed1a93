//! Receives the priors for the next windows.

use fringeflow::prior::{Moment, Prior};
use fringeflow_message::{PriorHeader, Window};
use fringeflow_runtime::{Host, receive};
use fringeflow_transport::{Subscriber, TRACKING_PRIOR, TransportError};
use fringeflow_wire::prior::{Priors, window_times};

/// Number of priors that are kept: a window may need an earlier prior than the last one.
const MAX_KEPT: usize = 16;

/// The last priors of the channel.
pub(crate) struct PriorInput {
    /// `None` if windows are decoded without priors.
    input: Option<Subscriber<PriorHeader, [u8]>>,
    priors: Priors,
}

impl PriorInput {
    pub(crate) fn open(host: &Host) -> Result<Self, TransportError> {
        let takes_priors = host.configuration.measurement.tracking.takes_priors();
        let open = || Subscriber::open(&host.node, TRACKING_PRIOR, &host.sizes);
        Ok(Self { input: takes_priors.then(open).transpose()?, priors: Priors::default() })
    }

    /// Returns the prior for a window, and writes its number into the window. It is the last prior that was settled
    /// when the last image of the window arrived.
    pub(crate) fn for_window(&mut self, window: &mut Window) -> Option<(&Prior, Moment)> {
        self.receive_messages();
        let (number, prior) = self.priors.last_settled(window.received_ns, &window_times(window))?;
        window.prior = number + 1;
        prior
    }

    fn receive_messages(&mut self) {
        let Some(input) = &mut self.input else { return };
        while let Some(message) = receive(input) {
            let header = message.header();
            if let Err(error) = self.priors.push(header, message.payload()) {
                tracing::warn!(prior = header.published, "{error}");
            }
            self.priors.keep_last(MAX_KEPT);
        }
    }

    /// Opens the port again if it lost its connection.
    pub(crate) fn ensure_connected(&mut self, now_ns: u64) -> Result<(), TransportError> {
        self.input.as_mut().map_or(Ok(()), |input| input.ensure_connected(now_ns).map(|_| ()))
    }
}
