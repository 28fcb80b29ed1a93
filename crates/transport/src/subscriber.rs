//! The receiving end of a channel.

use std::fmt;
use std::ops::Deref;
use std::sync::Arc;

use iceoryx2::port::ReceiveError;
use iceoryx2::port::listener::Listener;
use iceoryx2::port::subscriber::{Subscriber as IoxSubscriber, SubscriberCreateError};
use iceoryx2::sample::Sample;

use super::attached::Attached;
use super::wait::{Listening, WaitSource};
use super::{Channel, ChannelLimits, ChannelSizes, Header, Ipc, Node, Payload, TransportError, shared_memory};

/// Time without a message after which a subscriber opens its port again.
const MIN_SILENCE_NS: u64 = 3_000_000_000;

/// Longest time between two such attempts. The time doubles with each attempt, since idle channels are silent for
/// hours.
const MAX_SILENCE_NS: u64 = 60_000_000_000;

/// The receiving end of a channel.
pub struct Subscriber<H: Header, P: Payload + ?Sized> {
    node: Node,
    channel: Channel<H, P>,
    limits: ChannelLimits,
    open: Option<Arc<Attached<Port<H, P>>>>,
    silence: Silence,
}

pub(super) struct Port<H: Header, P: Payload + ?Sized> {
    subscriber: IoxSubscriber<Ipc, P, H>,
    listener: Listener<Ipc>,
}

/// A received message. It stays unchanged in shared memory as long as this value exists.
pub struct Received<H: Header, P: Payload + ?Sized> {
    // Dropped before the port: the publisher reuses this memory as soon as no registered port holds it.
    sample: Sample<Ipc, P, H>,
    _port: Arc<Attached<Port<H, P>>>,
}

/// Time without a message.
#[derive(Clone, Copy, Debug)]
struct Silence {
    has_received: bool,
    since_ns: Option<u64>,
    limit_ns: u64,
}

impl<H: Header, P: Payload + ?Sized> Subscriber<H, P> {
    /// Opens the receiving end.
    ///
    /// # Errors
    /// The channel has its maximum number of subscribers, or iceoryx2 refuses.
    pub fn open(node: &Node, channel: Channel<H, P>, sizes: &ChannelSizes) -> Result<Self, TransportError> {
        let limits = channel.id().limits(sizes);
        let open = Some((channel.ports.subscriber)(node, channel, &limits)?);
        Ok(Self { node: node.clone(), channel, limits, open, silence: Silence::new() })
    }

    /// Returns the oldest waiting message, or `None`. After a wake-up, call it until it returns `None`.
    ///
    /// # Errors
    /// The caller holds as many messages as allowed, or the connection broke. After a broken connection, the next
    /// [`Self::ensure_connected`] opens the port again.
    pub fn receive(&mut self) -> Result<Option<Received<H, P>>, TransportError> {
        let Some(open) = &self.open else { return Ok(None) };
        match P::receive(&open.subscriber) {
            Ok(sample) => {
                self.silence.has_received |= sample.is_some();
                Ok(sample.map(|sample| Received { sample, _port: Arc::clone(open) }))
            }
            Err(reason) => {
                if matches!(reason, ReceiveError::ConnectionFailure(_)) {
                    self.open = None;
                }
                Err(self.node.instance().channel_error(self.channel.name(), "receive", reason))
            }
        }
    }

    /// Declares that the publisher had nothing to send, so the silence up to now does not indicate a lost connection.
    pub fn forgive_silence(&mut self) {
        self.silence.has_received = true;
    }

    /// Opens the port again if its files were removed, or after a long silence. Returns whether it did. Call it about
    /// once a second. Held messages stay valid.
    ///
    /// # Errors
    /// As [`Self::open`]; the next call tries again.
    pub fn ensure_connected(&mut self, now_ns: u64) -> Result<bool, TransportError> {
        let is_silent = self.silence.is_too_long(now_ns);
        let renew = match &self.open {
            None => true,
            Some(open) if !open.is_current() => true,
            // Keep the old port while messages are held: the channel may not allow a second one. A waiting message is
            // no silence: the caller has just not received it yet.
            Some(open) => is_silent && Arc::strong_count(open) == 1 && !open.subscriber.has_samples().unwrap_or(false),
        };
        if renew {
            if let Some(open) = self.open.take() {
                open.remove_unusable_services();
            }
            self.open = Some((self.channel.ports.subscriber)(&self.node, self.channel, &self.limits)?);
        }
        Ok(renew)
    }
}

impl<H: Header, P: Payload + ?Sized> WaitSource for Subscriber<H, P> {}

impl<H: Header, P: Payload + ?Sized> Listening for Subscriber<H, P> {
    fn listener(&self) -> Option<&Listener<Ipc>> {
        self.open.as_ref().map(|open| &open.listener)
    }
}

impl<H: Header, P: Payload + ?Sized> Port<H, P> {
    pub(super) fn open(
        node: &Node,
        channel: Channel<H, P>,
        limits: &ChannelLimits,
    ) -> Result<Arc<Attached<Self>>, TransportError> {
        let member = node.member()?;
        let opened = member.channel(channel, limits)?;
        // The listener comes before the subscriber, so that no message arrives without an event.
        let listener = member.listener(channel.name(), &opened.event)?;
        let subscriber = member.attempt(|| {
            opened.service.subscriber_builder().create().map_err(|e| match e {
                SubscriberCreateError::ExceedsMaxSupportedSubscribers => TransportError::Occupied {
                    channel: channel.name(),
                    instance: node.instance().name().to_owned(),
                    role: "subscriber",
                    limit: limits.subscribers,
                },
                e => node.instance().channel_error(channel.name(), "create a subscriber", e),
            })
        })?;
        shared_memory::reserve(node.instance().prefix())?;
        Ok(Arc::new(Attached::new(Self { subscriber, listener }, opened.files)))
    }
}

impl<H: Header, P: Payload + ?Sized> Received<H, P> {
    /// Its user header.
    #[must_use]
    pub fn header(&self) -> &H {
        self.sample.user_header()
    }

    /// Its payload.
    #[must_use]
    pub fn payload(&self) -> &P {
        P::payload_of(&self.sample)
    }
}

impl<H: Header, P: Payload + ?Sized> Deref for Received<H, P> {
    type Target = P;

    fn deref(&self) -> &P {
        self.payload()
    }
}

impl Silence {
    fn new() -> Self {
        Self { has_received: false, since_ns: None, limit_ns: MIN_SILENCE_NS }
    }

    /// Whether the silence has reached the limit. If so, the limit doubles.
    fn is_too_long(&mut self, now_ns: u64) -> bool {
        if std::mem::take(&mut self.has_received) {
            *self = Self { since_ns: Some(now_ns), ..Self::new() };
        }
        let since_ns = *self.since_ns.get_or_insert(now_ns);
        let too_long = now_ns.saturating_sub(since_ns) >= self.limit_ns;
        if too_long {
            let limit_ns = (2 * self.limit_ns).min(MAX_SILENCE_NS);
            *self = Self { since_ns: Some(now_ns), limit_ns, ..*self };
        }
        too_long
    }
}

impl<H: Header, P: Payload + ?Sized> fmt::Debug for Subscriber<H, P> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Subscriber").field("channel", &self.channel).field("open", &self.open.is_some()).finish()
    }
}

impl<H: Header, P: Payload + ?Sized> fmt::Debug for Received<H, P> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Received").field("header", self.header()).finish_non_exhaustive()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SECOND_NS: u64 = 1_000_000_000;

    #[test]
    fn silence_is_noticed_after_three_seconds_then_at_doubling_intervals() {
        let mut silence = Silence::new();
        let noticed: Vec<u64> = (0..200).filter(|&s| silence.is_too_long(s * SECOND_NS)).collect();
        assert_eq!(noticed, [3, 9, 21, 45, 93, 153]);
    }

    #[test]
    fn a_message_restarts_the_clock() {
        let mut silence = Silence::new();
        let noticed: Vec<u64> = (0..20)
            .filter(|&s| {
                silence.has_received = s < 10;
                silence.is_too_long(s * SECOND_NS)
            })
            .collect();
        assert_eq!(noticed, [12, 18]);
    }
}
