//! Channels that are looked into while somebody watches, and left alone otherwise.

use fringeflow_message::{Block, CloudHeader, FrameHeader, MapsHeader, ModelHeader, PatternEvent};
use fringeflow_runtime::{Host, receive};
use fringeflow_transport::{
    CAM1_FRAME, CAM2_FRAME, CLOUD, Channel, Header, PHASE_MAPS, PROJECTOR_PATTERN, Payload, Received, Subscriber,
    TRACKING_MODEL,
};

/// How long a channel stays open after somebody looked last, nanoseconds.
const IDLE_NS: u64 = 5_000_000_000;

/// The channels that can be looked into.
#[derive(Debug)]
pub(crate) struct Taps {
    pub(crate) cameras: [Tap<FrameHeader, [u8]>; 2],
    pub(crate) maps: Tap<MapsHeader, [Block]>,
    pub(crate) clouds: Tap<CloudHeader, [u8]>,
    pub(crate) patterns: Tap<(), PatternEvent>,
    pub(crate) models: Tap<ModelHeader, [u8]>,
}

/// One channel.
#[derive(Debug)]
pub(crate) struct Tap<H: Header, P: Payload + ?Sized> {
    channel: Channel<H, P>,
    port: Option<Subscriber<H, P>>,
    used_ns: u64,
}

impl Taps {
    pub(crate) fn new() -> Self {
        Self {
            cameras: [Tap::new(CAM1_FRAME), Tap::new(CAM2_FRAME)],
            maps: Tap::new(PHASE_MAPS),
            clouds: Tap::new(CLOUD),
            patterns: Tap::new(PROJECTOR_PATTERN),
            models: Tap::new(TRACKING_MODEL),
        }
    }

    /// Closes what nobody looks into any more, and opens again what lost its other side; about once a second.
    pub(crate) fn tend(&mut self, now_ns: u64) {
        self.cameras.iter_mut().for_each(|camera| camera.tend(now_ns));
        self.maps.tend(now_ns);
        self.clouds.tend(now_ns);
        self.patterns.tend(now_ns);
        self.models.tend(now_ns);
    }
}

impl<H: Header, P: Payload + ?Sized> Tap<H, P> {
    fn new(channel: Channel<H, P>) -> Self {
        Self { channel, port: None, used_ns: 0 }
    }

    /// The newest message that has come since the last look; the others are passed over. Opens the channel at the first look.
    pub(crate) fn newest(&mut self, host: &Host, now_ns: u64) -> Option<Received<H, P>> {
        self.used_ns = now_ns;
        if self.port.is_none() {
            let opened = Subscriber::open(&host.node, self.channel, &host.sizes);
            self.port = opened.inspect_err(|error| tracing::warn!("{error}")).ok();
        }
        let port = self.port.as_mut()?;
        let mut newest = None;
        while let Some(message) = receive(port) {
            newest = Some(message);
        }
        newest
    }

    fn tend(&mut self, now_ns: u64) {
        if now_ns.saturating_sub(self.used_ns) > IDLE_NS {
            self.port = None;
        } else if let Some(Err(error)) = self.port.as_mut().map(|port| port.ensure_connected(now_ns)) {
            tracing::warn!("{error}");
        }
    }
}
