//! The newest of the large messages, for whoever watches.

use fringeflow_message::{Block, CloudHeader, FrameHeader, MapsHeader, ModelHeader, PatternEvent};
use fringeflow_recording::{Recordable, Topic};
use fringeflow_runtime::Host;
use fringeflow_transport::Received;

use crate::taps::Taps;
use crate::viewers::Viewers;

/// Which messages somebody wants.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Wanted {
    pub(crate) frames: bool,
    pub(crate) maps: bool,
    pub(crate) clouds: bool,
    pub(crate) patterns: bool,
    pub(crate) models: bool,
}

/// What has come since the last look, the newest of each channel.
pub(crate) struct News {
    pub(crate) frames: [Option<Received<FrameHeader, [u8]>>; 2],
    pub(crate) maps: Option<Received<MapsHeader, [Block]>>,
    pub(crate) cloud: Option<Received<CloudHeader, [u8]>>,
    pattern: Option<Received<(), PatternEvent>>,
    pub(crate) model: Option<Received<ModelHeader, [u8]>>,
}

impl Wanted {
    /// What viewers have subscribed to.
    pub(crate) fn by_viewers(viewers: &Viewers) -> Self {
        Self {
            frames: viewers.want(Topic::Cam1Frame) || viewers.want(Topic::Cam2Frame),
            maps: false,
            clouds: viewers.want(Topic::Cloud),
            patterns: viewers.want(Topic::Pattern),
            models: viewers.want(Topic::Model),
        }
    }

    pub(crate) fn or(self, other: Self) -> Self {
        Self {
            frames: self.frames || other.frames,
            maps: self.maps || other.maps,
            clouds: self.clouds || other.clouds,
            patterns: self.patterns || other.patterns,
            models: self.models || other.models,
        }
    }
}

impl News {
    /// Looks into the channels that are wanted.
    pub(crate) fn gather(wanted: Wanted, taps: &mut Taps, host: &Host, now_ns: u64) -> Self {
        let [cam1, cam2] = &mut taps.cameras;
        Self {
            frames: [cam1, cam2].map(|camera| wanted.frames.then(|| camera.newest(host, now_ns)).flatten()),
            maps: wanted.maps.then(|| taps.maps.newest(host, now_ns)).flatten(),
            cloud: wanted.clouds.then(|| taps.clouds.newest(host, now_ns)).flatten(),
            model: wanted.models.then(|| taps.models.newest(host, now_ns)).flatten(),
            pattern: wanted.patterns.then(|| taps.patterns.newest(host, now_ns)).flatten(),
        }
    }

    /// Sends them to the viewers.
    pub(crate) fn send(&self, viewers: &mut Viewers) {
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
