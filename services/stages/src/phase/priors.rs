//! What windows are told of those before them.

use std::collections::VecDeque;

use fringeflow::prior::{Moment, Prior};
use fringeflow_message::{PriorHeader, Window};
use fringeflow_runtime::{Host, receive};
use fringeflow_transport::{Subscriber, TRACKING_PRIOR, TransportError};
use fringeflow_wire as wire;

/// Priors that are kept: a window may have to take one that is not the last.
const KEPT: usize = 16;

/// The last priors.
pub(crate) struct Priors {
    /// `None` where windows are told nothing.
    input: Option<Subscriber<PriorHeader, [u8]>>,
    kept: VecDeque<(PriorHeader, Option<Prior>)>,
}

impl Priors {
    pub(crate) fn open(host: &Host) -> Result<Self, TransportError> {
        let takes = host.configuration.measurement.tracking.takes_priors();
        let open = || Subscriber::open(&host.node, TRACKING_PRIOR, &host.sizes);
        Ok(Self { input: takes.then(open).transpose()?, kept: VecDeque::with_capacity(KEPT) })
    }

    /// What a window is told: the last that was published before its last image came, whatever has come since, so that a replay
    /// tells it the same. Its number is noted in the window.
    pub(crate) fn tell(&mut self, window: &mut Window) -> Option<(&Prior, Moment)> {
        self.take();
        let (header, prior) = self.kept.iter().rev().find(|(header, _)| header.is_settled_at(window.received_ns))?;
        window.prior = header.published + 1;
        let moment = wire::prior::times(window).moment_after(header.centre_ns);
        prior.as_ref().map(|prior| (prior, moment))
    }

    /// Takes what has come.
    fn take(&mut self) {
        let Some(input) = &mut self.input else { return };
        while let Some(message) = receive(input) {
            let (header, relief) = (*message.header(), message.payload());
            if !wire::prior::is_whole(&header, relief) {
                tracing::warn!(prior = header.published, "a prior contradicts itself and is ignored");
                continue;
            }
            if self.kept.iter().any(|(kept, _)| kept.published == header.published) {
                tracing::warn!(prior = header.published, "two priors have the same number; the second is ignored");
                continue;
            }
            if self.kept.len() == KEPT {
                self.kept.pop_front();
            }
            self.kept.push_back((header, wire::prior::read(&header, relief)));
        }
    }

    /// Opens the port again if it lost its other side.
    pub(crate) fn ensure_connected(&mut self, now_ns: u64) -> Result<(), TransportError> {
        self.input.as_mut().map_or(Ok(()), |input| input.ensure_connected(now_ns).map(|_| ()))
    }
}
