//! Channels that are open only while their messages are wanted.

use fringeflow_message::{Block, CloudHeader, FrameHeader, MapsHeader, ModelHeader, PatternEvent};
use fringeflow_runtime::{Host, receive};
use fringeflow_transport::{
    CAM1_FRAME, CAM2_FRAME, CLOUD, Channel, Header, PHASE_MAPS, PROJECTOR_PATTERN, Payload, Received, Subscriber,
    TRACKING_MODEL,
};

/// Time from the last read until a channel is closed, nanoseconds.
const IDLE_NS: u64 = 5_000_000_000;

/// The channels of large messages.
#[derive(Debug)]
pub(crate) struct LazySubscribers {
    pub(crate) cameras: [LazySubscriber<FrameHeader, [u8]>; 2],
    pub(crate) maps: LazySubscriber<MapsHeader, [Block]>,
    pub(crate) clouds: LazySubscriber<CloudHeader, [u8]>,
    pub(crate) patterns: LazySubscriber<(), PatternEvent>,
    pub(crate) models: LazySubscriber<ModelHeader, [u8]>,
}

/// A subscriber that is opened by the first read, and closed when it is idle.
#[derive(Debug)]
pub(crate) struct LazySubscriber<H: Header, P: Payload + ?Sized> {
    channel: Channel<H, P>,
    subscriber: Option<Subscriber<H, P>>,
    last_read_ns: u64,
}

impl LazySubscribers {
    pub(crate) fn new() -> Self {
        Self {
            cameras: [LazySubscriber::new(CAM1_FRAME), LazySubscriber::new(CAM2_FRAME)],
            maps: LazySubscriber::new(PHASE_MAPS),
            clouds: LazySubscriber::new(CLOUD),
            patterns: LazySubscriber::new(PROJECTOR_PATTERN),
            models: LazySubscriber::new(TRACKING_MODEL),
        }
    }

    /// Closes idle channels, and opens those again whose connection was lost. Called about once a second.
    pub(crate) fn maintain(&mut self, now_ns: u64) {
        self.cameras.iter_mut().for_each(|camera| camera.maintain(now_ns));
        self.maps.maintain(now_ns);
        self.clouds.maintain(now_ns);
        self.patterns.maintain(now_ns);
        self.models.maintain(now_ns);
    }
}

impl<H: Header, P: Payload + ?Sized> LazySubscriber<H, P> {
    fn new(channel: Channel<H, P>) -> Self {
        Self { channel, subscriber: None, last_read_ns: 0 }
    }

    /// Reads all waiting messages, and returns the newest. Opens the channel if it is closed.
    pub(crate) fn read_newest(&mut self, host: &Host, now_ns: u64) -> Option<Received<H, P>> {
        self.last_read_ns = now_ns;
        if self.subscriber.is_none() {
            let opened = Subscriber::open(&host.node, self.channel, &host.sizes);
            self.subscriber = opened.inspect_err(|error| tracing::warn!("{error}")).ok();
        }
        let subscriber = self.subscriber.as_mut()?;
        let mut newest = None;
        while let Some(message) = receive(subscriber) {
            newest = Some(message);
        }
        newest
    }

    fn maintain(&mut self, now_ns: u64) {
        if now_ns.saturating_sub(self.last_read_ns) > IDLE_NS {
            self.subscriber = None;
        } else if let Some(Err(error)) = self.subscriber.as_mut().map(|open| open.ensure_connected(now_ns)) {
            tracing::warn!("{error}");
        }
    }
}
