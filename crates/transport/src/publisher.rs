//! The sending end of a channel.

use std::fmt;

use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::publisher::{Publisher as IoxPublisher, PublisherCreateError};
use iceoryx2::port::update_connections::UpdateConnections;

use super::attached::{Attached, Files, ensure_open};
use super::loan::{Uninitialized, Written, initialized};
use super::payload::{Element, Message};
use super::{Channel, ChannelLimits, ChannelSizes, Header, Ipc, Node, Payload, TransportError, shared_memory};

/// The sending end of a channel.
///
/// Sending never waits for a subscriber. If it fails, the message is lost. The caller counts it as
/// [`fringeflow_message::DropReason::NoSample`], and the next [`Self::ensure_connected`] opens the port again.
pub struct Publisher<H: Header, P: Payload + ?Sized> {
    node: Node,
    channel: Channel<H, P>,
    limits: ChannelLimits,
    open: Option<Attached<Port<H, P>>>,
}

pub(super) struct Port<H: Header, P: Payload + ?Sized> {
    publisher: IoxPublisher<Ipc, P, H>,
    notifier: Notifier<Ipc>,
}

impl<H: Header, P: Payload + ?Sized> Publisher<H, P> {
    /// Opens the sending end, and reserves its shared memory.
    ///
    /// # Errors
    /// Another living publisher uses the channel, shared memory is too small, or iceoryx2 refuses.
    pub fn open(node: &Node, channel: Channel<H, P>, sizes: &ChannelSizes) -> Result<Self, TransportError> {
        let limits = channel.id().limits(sizes);
        let open = Some((channel.ports.publisher)(node, channel, &limits)?);
        Ok(Self { node: node.clone(), channel, limits, open })
    }

    /// Opens the port again if its files were removed or sending failed. Returns whether it did. Call it about once a
    /// second: new subscribers receive the history of the channel during this call or with the next message.
    ///
    /// # Errors
    /// As [`Self::open`]; the next call tries again.
    pub fn ensure_connected(&mut self) -> Result<bool, TransportError> {
        if let Some(open) = self.open.as_ref().filter(|open| open.is_current()) {
            open.publisher.update_connections().map_err(|e| self.error("connect", e))?;
        }
        ensure_open(&mut self.open, || (self.channel.ports.publisher)(&self.node, self.channel, &self.limits))
    }

    fn error(&self, action: &'static str, reason: impl fmt::Debug) -> TransportError {
        self.node.instance().channel_error(self.channel.name(), action, reason)
    }

    fn opened(&self) -> Result<&Port<H, P>, TransportError> {
        self.open.as_deref().ok_or_else(|| self.error("send", "the port is closed"))
    }

    /// Closes the port if sending failed, and otherwise wakes the subscribers.
    fn finish_send(&mut self, result: Result<(), TransportError>) -> Result<(), TransportError> {
        match (&result, self.open.as_deref()) {
            // A subscriber that cannot be notified finds the message at its next poll.
            (Ok(()), Some(open)) => {
                let _ = open.notifier.notify();
            }
            (Err(TransportError::TooLong { .. }), _) => {}
            _ => self.open = None,
        }
        result
    }
}

#[allow(private_bounds)]
impl<H: Header, E: Element> Publisher<H, [E]> {
    /// Sends a copy of `payload`.
    ///
    /// # Errors
    /// The payload is too long, or sending failed.
    pub fn send(&mut self, header: &H, payload: &[E]) -> Result<(), TransportError> {
        let result = self.try_send(header, payload.len(), |sample| sample.write_from_slice(payload));
        self.finish_send(result)
    }

    /// Sends `len` elements after `fill` has set them in place. Before, they hold those of an earlier message.
    ///
    /// # Errors
    /// As [`Self::send`].
    pub fn send_filled(&mut self, header: &H, len: usize, fill: impl FnOnce(&mut [E])) -> Result<(), TransportError> {
        let result = self.try_send(header, len, |loan| {
            let mut sample = initialized(loan);
            fill(sample.payload_mut());
            sample
        });
        self.finish_send(result)
    }

    /// Like [`Self::send_filled`], with the header that `fill` returns. Sends nothing if `fill` fails.
    ///
    /// # Errors
    /// As [`Self::send`]. The inner error is that of `fill`.
    pub fn try_send_filled<R>(
        &mut self,
        len: usize,
        fill: impl FnOnce(&mut [E]) -> Result<H, R>,
    ) -> Result<Result<(), R>, TransportError> {
        let filled = self.loan(len).map(|loan| {
            let mut sample = initialized(loan);
            let header = fill(sample.payload_mut())?;
            *sample.user_header_mut() = header;
            Ok(sample)
        });
        let result = match filled {
            Ok(Err(refused)) => return Ok(Err(refused)),
            Ok(Ok(sample)) => sample.send().map(|_| ()).map_err(|e| self.error("send", e)),
            Err(error) => Err(error),
        };
        self.finish_send(result).map(Ok)
    }

    fn loan(&self, len: usize) -> Result<Uninitialized<H, E>, TransportError> {
        let limit = self.limits.elements;
        if len > limit {
            return Err(TransportError::TooLong { channel: self.channel.name(), len, limit });
        }
        self.opened()?.publisher.loan_slice_uninit(len).map_err(|e| self.error("loan a message", e))
    }

    fn try_send(
        &self,
        header: &H,
        len: usize,
        write: impl FnOnce(Uninitialized<H, E>) -> Written<H, E>,
    ) -> Result<(), TransportError> {
        let mut sample = write(self.loan(len)?);
        *sample.user_header_mut() = *header;
        sample.send().map_err(|e| self.error("send", e))?;
        Ok(())
    }
}

#[allow(private_bounds)]
impl<M: Message> Publisher<(), M> {
    /// Sends a message.
    ///
    /// # Errors
    /// Sending failed.
    pub fn send_message(&mut self, message: &M) -> Result<(), TransportError> {
        let result = self.try_send_message(message);
        self.finish_send(result)
    }

    fn try_send_message(&self, message: &M) -> Result<(), TransportError> {
        let sample = self.opened()?.publisher.loan_uninit().map_err(|e| self.error("loan a message", e))?;
        sample.write_payload(*message).send().map_err(|e| self.error("send", e))?;
        Ok(())
    }
}

impl<H: Header, P: Payload + ?Sized> Port<H, P> {
    pub(super) fn open(
        node: &Node,
        channel: Channel<H, P>,
        limits: &ChannelLimits,
    ) -> Result<Attached<Self>, TransportError> {
        shared_memory::check_free(shared_memory::publisher_bytes(limits))?;
        let member = node.member()?;
        let opened = member.channel(channel, limits)?;
        let publisher = member.attempt(|| {
            P::publisher(&opened.service, limits.elements).map_err(|e| match e {
                PublisherCreateError::ExceedsMaxSupportedPublishers => TransportError::Occupied {
                    channel: channel.name(),
                    instance: node.instance().name().to_owned(),
                    role: "publisher",
                    limit: limits.publishers,
                },
                e => node.instance().channel_error(channel.name(), "create a publisher", e),
            })
        })?;
        let notifier = member.notifier(channel.name(), &opened.event)?;
        shared_memory::reserve(node.instance().prefix())?;
        let mut files = opened.files;
        let messages = format!("_{}.data", publisher.id().value());
        files.extend(Files::new([shared_memory::file_with_suffix(node.instance().prefix(), &messages)?]));
        Ok(Attached::new(Self { publisher, notifier }, files))
    }
}

impl<H: Header, P: Payload + ?Sized> fmt::Debug for Publisher<H, P> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Publisher").field("channel", &self.channel).field("open", &self.open.is_some()).finish()
    }
}
