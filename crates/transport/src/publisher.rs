//! Sending.

use std::fmt;

use bytemuck::Zeroable;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::port::publisher::{Publisher as IoxPublisher, PublisherCreateError};
use iceoryx2::port::update_connections::UpdateConnections;

use super::attached::{Attached, Files};
use super::payload::{Element, Message};
use super::{Channel, ChannelSizes, Header, Ipc, Node, Payload, Quality, TransportError, shared_memory};

/// The sending end of a channel.
///
/// Sending never waits for a subscriber. If it fails, the message is lost: the caller counts it as
/// [`fringeflow_message::DropReason::NoSample`], and the next [`Self::ensure_connected`] opens the port anew.
pub struct Publisher<H: Header, P: Payload + ?Sized> {
    node: Node,
    channel: Channel<H, P>,
    quality: Quality,
    open: Option<Attached<Port<H, P>>>,
}

struct Port<H: Header, P: Payload + ?Sized> {
    publisher: IoxPublisher<Ipc, P, H>,
    notifier: Notifier<Ipc>,
}

impl<H: Header, P: Payload + ?Sized> Publisher<H, P> {
    /// Opens the sending end, and reserves its shared memory for good.
    ///
    /// # Errors
    /// A living publisher has the channel, shared memory does not suffice, or iceoryx2 refuses.
    pub fn open(node: &Node, channel: Channel<H, P>, sizes: &ChannelSizes) -> Result<Self, TransportError> {
        let quality = channel.id().quality(sizes);
        let open = Some(Port::open(node, channel, &quality)?);
        Ok(Self { node: node.clone(), channel, quality, open })
    }

    /// Opens the port again if its files were removed or sending failed; says whether that was so. Called about once a
    /// second; new subscribers get the history of a channel then, or with the next message.
    ///
    /// # Errors
    /// As [`Self::open`]; the next call tries again.
    pub fn ensure_connected(&mut self) -> Result<bool, TransportError> {
        if let Some(open) = self.open.as_ref().filter(|open| open.unchanged()) {
            open.publisher.update_connections().map_err(|e| self.error("connect", e))?;
            return Ok(false);
        }
        // The old one goes first: there is room for one publisher.
        if let Some(open) = self.open.take() {
            open.withdraw();
        }
        self.open = Some(Port::open(&self.node, self.channel, &self.quality)?);
        Ok(true)
    }

    fn error(&self, action: &'static str, reason: impl fmt::Debug) -> TransportError {
        self.node.instance().channel_error(self.channel.name(), action, reason)
    }

    fn opened(&self) -> Result<&Port<H, P>, TransportError> {
        self.open.as_deref().ok_or_else(|| self.error("send", "the port is closed"))
    }

    /// Closes the port if sending failed, and wakes the subscribers otherwise.
    fn sent(&mut self, result: Result<(), TransportError>) -> Result<(), TransportError> {
        match (&result, self.open.as_deref()) {
            // Whoever cannot be notified finds the message at its next look.
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
    /// A payload too long, or no way to send.
    pub fn send(&mut self, header: &H, payload: &[E]) -> Result<(), TransportError> {
        let result = self.try_send(header, payload.len(), |sample| sample.write_from_slice(payload));
        self.sent(result)
    }

    /// Sends what `fill` makes of `len` zeroed elements, in place.
    ///
    /// # Errors
    /// As [`Self::send`].
    pub fn send_filled(&mut self, header: &H, len: usize, fill: impl FnOnce(&mut [E])) -> Result<(), TransportError>
    where
        E: Zeroable,
    {
        let result = self.try_send(header, len, |sample| {
            let mut sample = sample.write_from_fn(|_| E::zeroed());
            fill(sample.payload_mut());
            sample
        });
        self.sent(result)
    }

    /// Sends what `make` writes into `len` zeroed elements, with the header that it returns; nothing where it fails.
    ///
    /// # Errors
    /// As [`Self::send`]; inside, what `make` says.
    pub fn send_made<R>(
        &mut self,
        len: usize,
        make: impl FnOnce(&mut [E]) -> Result<H, R>,
    ) -> Result<Result<(), R>, TransportError>
    where
        E: Zeroable,
    {
        let made = self.loan(len).map(|loan| {
            let mut sample = loan.write_from_fn(|_| E::zeroed());
            let header = make(sample.payload_mut())?;
            *sample.user_header_mut() = header;
            Ok(sample)
        });
        let result = match made {
            Ok(Err(refused)) => return Ok(Err(refused)),
            Ok(Ok(sample)) => sample.send().map(|_| ()).map_err(|e| self.error("send", e)),
            Err(error) => Err(error),
        };
        self.sent(result).map(Ok)
    }

    fn loan(&self, len: usize) -> Result<Uninitialized<H, E>, TransportError> {
        let limit = self.quality.elements;
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

type Uninitialized<H, E> = iceoryx2::sample_mut_uninit::SampleMutUninit<Ipc, [std::mem::MaybeUninit<E>], H>;
type Written<H, E> = iceoryx2::sample_mut::SampleMut<Ipc, [E], H>;

#[allow(private_bounds)]
impl<M: Message> Publisher<(), M> {
    /// Sends a message.
    ///
    /// # Errors
    /// No way to send.
    pub fn send_message(&mut self, message: &M) -> Result<(), TransportError> {
        let result = self.try_send_message(message);
        self.sent(result)
    }

    fn try_send_message(&self, message: &M) -> Result<(), TransportError> {
        let sample = self.opened()?.publisher.loan_uninit().map_err(|e| self.error("loan a message", e))?;
        sample.write_payload(*message).send().map_err(|e| self.error("send", e))?;
        Ok(())
    }
}

impl<H: Header, P: Payload + ?Sized> Port<H, P> {
    fn open(node: &Node, channel: Channel<H, P>, quality: &Quality) -> Result<Attached<Self>, TransportError> {
        shared_memory::check_free(shared_memory::publisher_bytes(quality))?;
        let member = node.member()?;
        let opened = member.channel(channel, quality)?;
        let publisher = member.attempt(|| {
            P::publisher(&opened.service, quality.elements).map_err(|e| match e {
                PublisherCreateError::ExceedsMaxSupportedPublishers => TransportError::Occupied {
                    channel: channel.name(),
                    instance: node.instance().name().to_owned(),
                    role: "publisher",
                    limit: quality.publishers,
                },
                e => node.instance().channel_error(channel.name(), "create a publisher", e),
            })
        })?;
        let notifier = member.notifier(channel.name(), &opened.event)?;
        shared_memory::reserve(node.instance().prefix())?;
        let mut files = opened.files;
        let messages = format!("_{}.data", publisher.id().value());
        files.extend(Files::new([shared_memory::file_ending(node.instance().prefix(), &messages)?]));
        Ok(Attached::new(Self { publisher, notifier }, files))
    }
}

impl<H: Header, P: Payload + ?Sized> fmt::Debug for Publisher<H, P> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Publisher").field("channel", &self.channel).field("open", &self.open.is_some()).finish()
    }
}
