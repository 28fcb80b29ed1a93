//! Payloads of channels: a message, or a slice with a user header.

use std::fmt::Debug;

use bytemuck::AnyBitPattern;
use iceoryx2::port::ReceiveError;
use iceoryx2::port::publisher::{Publisher, PublisherCreateError};
use iceoryx2::port::subscriber::Subscriber;
use iceoryx2::prelude::{IceoryxSend, ZeroCopySend};
use iceoryx2::sample::Sample;
use iceoryx2::service::builder::publish_subscribe::{Builder, PublishSubscribeOpenOrCreateError};
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;

use fringeflow_message::{Block, PatternEvent, PoseReport, ScanState, StageReport, WindowReport};

use super::Ipc;

/// A user header: one of [`fringeflow_message`], or `()`.
pub trait Header: ZeroCopySend + Debug + Default + Copy + Send + 'static {}

impl<H: ZeroCopySend + Debug + Default + Copy + Send + 'static> Header for H {}

/// A payload: a message without a user header, or a slice with one.
///
/// iceoryx2 has separate functions for the two kinds. This trait unites them, so that one type of port serves both.
pub trait Payload: IceoryxSend + Debug + 'static {
    /// Opens or creates the service.
    #[doc(hidden)]
    fn open<H: Header>(
        builder: Builder<Self, H, Ipc>,
    ) -> Result<PortFactory<Ipc, Self, H>, PublishSubscribeOpenOrCreateError>;

    /// Creates a publisher of payloads with up to `elements` elements.
    #[doc(hidden)]
    fn publisher<H: Header>(
        service: &PortFactory<Ipc, Self, H>,
        elements: usize,
    ) -> Result<Publisher<Ipc, Self, H>, PublisherCreateError>;

    /// Receives the next message.
    #[doc(hidden)]
    fn receive<H: Header>(subscriber: &Subscriber<Ipc, Self, H>) -> Result<Option<Sample<Ipc, Self, H>>, ReceiveError>;

    /// The payload of a message.
    #[doc(hidden)]
    fn payload_of<H: Header>(sample: &Sample<Ipc, Self, H>) -> &Self;
}

/// Elements of slices. Any bytes are valid ones.
pub(super) trait Element: ZeroCopySend + Debug + AnyBitPattern {}

impl Element for u8 {}
impl Element for Block {}

/// Messages without a user header.
pub(super) trait Message: ZeroCopySend + Debug + Copy + 'static {}

impl Message for PatternEvent {}
impl Message for StageReport {}
impl Message for WindowReport {}
impl Message for PoseReport {}
impl Message for ScanState {}

/// Both implementations have the same text but call different functions of iceoryx2.
macro_rules! implement_payload {
    ($($generic:ident: $bound:ident)?, $payload:ty, |$factory:ident, $elements:ident| $builder:expr) => {
        impl<$($generic: $bound)?> Payload for $payload {
            fn open<H: Header>(
                builder: Builder<Self, H, Ipc>,
            ) -> Result<PortFactory<Ipc, Self, H>, PublishSubscribeOpenOrCreateError> {
                builder.open_or_create()
            }

            fn publisher<H: Header>(
                $factory: &PortFactory<Ipc, Self, H>,
                $elements: usize,
            ) -> Result<Publisher<Ipc, Self, H>, PublisherCreateError> {
                $builder.max_loaned_samples(1).create()
            }

            fn receive<H: Header>(
                subscriber: &Subscriber<Ipc, Self, H>,
            ) -> Result<Option<Sample<Ipc, Self, H>>, ReceiveError> {
                subscriber.receive()
            }

            fn payload_of<H: Header>(sample: &Sample<Ipc, Self, H>) -> &Self {
                sample.payload()
            }
        }
    };
}

implement_payload!(E: Element, [E], |service, elements| service.publisher_builder().initial_max_slice_len(elements));
implement_payload!(M: Message, M, |service, _elements| service.publisher_builder());
