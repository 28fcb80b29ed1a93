//! The newest large messages, for dashboard pages and viewers.

use fringeflow_message::{Block, CloudHeader, FrameHeader, MapsHeader, ModelHeader, PatternEvent};
use fringeflow_recording::{Recordable, Topic};
use fringeflow_runtime::Host;
use fringeflow_transport::Received;

use crate::lazy_subscribers::LazySubscribers;
use crate::viewers::Viewers;

/// The channels whose messages a page or a viewer wants.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct WantedChannels {
    pub(crate) frames: bool,
    pub(crate) maps: bool,
    pub(crate) clouds: bool,
    pub(crate) patterns: bool,
    pub(crate) models: bool,
}

/// The newest message of each channel since the last read.
pub(crate) struct NewestMessages {
    pub(crate) frames: [Option<Received<FrameHeader, [u8]>>; 2],
    pub(crate) maps: Option<Received<MapsHeader, [Block]>>,
    pub(crate) cloud: Option<Received<CloudHeader, [u8]>>,
    pattern: Option<Received<(), PatternEvent>>,
    pub(crate) model: Option<Received<ModelHeader, [u8]>>,
}

impl WantedChannels {
    /// Returns the channels that viewers have subscribed to.
    pub(crate) fn from_viewers(viewers: &Viewers) -> Self {
        Self {
            frames: viewers.is_wanted(Topic::Cam1Frame) || viewers.is_wanted(Topic::Cam2Frame),
            maps: false,
            clouds: viewers.is_wanted(Topic::Cloud),
            patterns: viewers.is_wanted(Topic::Pattern),
            models: viewers.is_wanted(Topic::Model),
        }
    }

    /// Returns the channels that are in either set.
    pub(crate) fn union(self, other: Self) -> Self {
        Self {
            frames: self.frames || other.frames,
            maps: self.maps || other.maps,
            clouds: self.clouds || other.clouds,
            patterns: self.patterns || other.patterns,
            models: self.models || other.models,
        }
    }
}

impl NewestMessages {
    /// Reads the channels that are wanted.
    pub(crate) fn read(wanted: WantedChannels, subscribers: &mut LazySubscribers, host: &Host, now_ns: u64) -> Self {
        let [cam1, cam2] = &mut subscribers.cameras;
        Self {
            frames: [cam1, cam2].map(|camera| wanted.frames.then(|| camera.read_newest(host, now_ns)).flatten()),
            maps: wanted.maps.then(|| subscribers.maps.read_newest(host, now_ns)).flatten(),
            cloud: wanted.clouds.then(|| subscribers.clouds.read_newest(host, now_ns)).flatten(),
            model: wanted.models.then(|| subscribers.models.read_newest(host, now_ns)).flatten(),
            pattern: wanted.patterns.then(|| subscribers.patterns.read_newest(host, now_ns)).flatten(),
        }
    }

    /// Sends the messages to the viewers.
    pub(crate) fn send_to(&self, viewers: &mut Viewers) {
        for frame in self.frames.iter().flatten() {
            viewers.send(&Recordable::Frame { header: frame.header(), image: frame.payload() });
        }
        if let Some(cloud) = &self.cloud {
            viewers.send(&Recordable::Cloud { header: cloud.header(), records: cloud.payload() });
        }
        if let Some(model) = &self.model {
            viewers.send(&Recordable::Model { header: model.header(), points: model.payload() });
        }
        if let Some(pattern) = &self.pattern {
            viewers.send(&Recordable::Pattern(pattern.payload()));
        }
    }
}
