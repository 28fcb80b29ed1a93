//! The live view for Foxglove, Lichtblick and Rerun: the topics of a recording, sent live.
//!
//! Viewers get a few images and clouds per second. A topic is encoded only while a viewer has subscribed to it. The
//! server is that of the Foxglove SDK; clients reach it only through [`front`].

mod proxy;

use std::collections::BTreeMap;
use std::sync::Arc;

use foxglove::{ChannelBuilder, Context, FoxgloveError, PartialMetadata, RawChannel};

use fringeflow_dataset::Setup;
use fringeflow_recording::{Encoded, Recordable, Topic, WallClock, static_messages};

pub(crate) use proxy::serve;

/// Time between two messages on static topics, nanoseconds. Repeating them serves viewers that connect later.
const STATIC_PERIOD_NS: u64 = 2_000_000_000;
/// Encoding of all messages.
const ENCODING: &str = "protobuf";

/// The topics that are offered to viewers.
const TOPICS: [Topic; 15] = [
    Topic::Cam1Frame,
    Topic::Cam1Header,
    Topic::Cam2Frame,
    Topic::Cam2Header,
    Topic::Pattern,
    Topic::Cloud,
    Topic::CloudHeader,
    Topic::Report,
    Topic::WindowReport,
    Topic::Pose,
    Topic::Model,
    Topic::Log,
    Topic::Transforms,
    Topic::Cam1Calibration,
    Topic::Cam2Calibration,
];

/// Sends messages to the viewers.
#[derive(Debug)]
pub(crate) struct Viewers {
    /// Connects the channels with the server of the SDK.
    context: Arc<Context>,
    channels: BTreeMap<Topic, Arc<RawChannel>>,
    encoded: Encoded,
    /// Viewers show times since 1970.
    clock: WallClock,
    /// Time of the last static messages.
    static_sent_ns: u64,
}

impl Viewers {
    pub(crate) fn new() -> Result<Self, FoxgloveError> {
        let context = Context::new();
        let channel = |topic: Topic| {
            let channel = ChannelBuilder::new(topic.name()).context(&context).message_encoding(ENCODING);
            Ok((topic, channel.schema(topic.schema()).build_raw()?))
        };
        let channels = TOPICS.into_iter().map(channel).collect::<Result<_, FoxgloveError>>()?;
        Ok(Self { context, channels, encoded: Encoded::default(), clock: WallClock::here(), static_sent_ns: 0 })
    }

    pub(crate) fn context(&self) -> &Arc<Context> {
        &self.context
    }

    /// Whether a viewer has subscribed to a topic, or to the topic of its headers.
    pub(crate) fn is_wanted(&self, topic: Topic) -> bool {
        let has_subscribers = |topic| self.channels.get(&topic).is_some_and(|channel| channel.has_sinks());
        has_subscribers(topic) || topic.header().is_some_and(has_subscribers)
    }

    /// Sends a message to the viewers that have subscribed to its topic.
    pub(crate) fn send(&mut self, message: &Recordable<'_>) {
        let Some(topic) = message.topic().filter(|&topic| self.is_wanted(topic)) else { return };
        message.encode(self.clock, &mut self.encoded);
        for (topic, bytes) in self.encoded.parts(topic) {
            self.send_bytes(topic, bytes, self.clock.unix_ns(message.log_ns()));
        }
    }

    /// Sends transforms and calibrations if they are due and wanted.
    pub(crate) fn send_static(&mut self, setup: &Setup, now_ns: u64) {
        if now_ns.saturating_sub(self.static_sent_ns) < STATIC_PERIOD_NS {
            return;
        }
        self.static_sent_ns = now_ns;
        if [Topic::Transforms, Topic::Cam1Calibration, Topic::Cam2Calibration]
            .into_iter()
            .any(|topic| self.is_wanted(topic))
        {
            let unix_ns = self.clock.unix_ns(now_ns);
            for (topic, bytes) in static_messages(setup, unix_ns) {
                self.send_bytes(topic, &bytes, unix_ns);
            }
        }
    }

    fn send_bytes(&self, topic: Topic, bytes: &[u8], unix_ns: u64) {
        if let Some(channel) = self.channels.get(&topic) {
            channel.log_with_meta(bytes, PartialMetadata { log_time: Some(unix_ns) });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::Value;

    const LAYOUT: &str = include_str!("../../../../configs/foxglove-layout.json");
    const SCHEMA: &str = include_str!("../../../../crates/recording/src/schema/fringeflow.proto");

    /// All strings of a JSON value that begin with a slash, keys included: topics, and paths into their messages.
    fn paths(value: &Value) -> Vec<String> {
        match value {
            Value::String(text) if text.starts_with('/') => vec![text.clone()],
            Value::Array(values) => values.iter().flat_map(paths).collect(),
            Value::Object(entries) => {
                let keys = entries.keys().filter(|key| key.starts_with('/')).cloned();
                keys.chain(entries.values().flat_map(paths)).collect()
            }
            _ => Vec::new(),
        }
    }

    #[test]
    fn the_layout_shows_topics_and_fields_that_exist() {
        let paths = paths(&serde_json::from_str(LAYOUT).unwrap());
        assert!(paths.len() > 10, "{paths:?}");
        for path in paths {
            let topic = path.split(['.', '{']).next().unwrap();
            let known = Topic::from_name(topic).unwrap_or_else(|| panic!("{topic} is not a topic"));
            assert!(TOPICS.contains(&known), "{topic} is not offered live");
            // The fields follow the conditions in braces.
            let fields = path[topic.len()..].rsplit('}').next().unwrap().split('.').filter(|field| !field.is_empty());
            for field in fields {
                assert!(SCHEMA.contains(&format!(" {field} = ")), "{path}: there is no field {field}");
            }
        }
    }

    #[test]
    fn no_topic_is_wanted_without_viewers() {
        let viewers = Viewers::new().unwrap();
        assert!(TOPICS.into_iter().all(|topic| !viewers.is_wanted(topic)));
    }
}
