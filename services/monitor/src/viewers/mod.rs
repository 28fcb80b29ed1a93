//! The live view of Foxglove, Lichtblick and Rerun: the topics of a recording, as they come.
//!
//! Images and clouds are thinned out to some a second, and nothing is encoded that nobody has subscribed to. The server is that
//! of the Foxglove SDK, which listens where only [`front`] finds it.

mod front;

use std::collections::BTreeMap;
use std::sync::Arc;

use foxglove::{ChannelBuilder, Context, FoxgloveError, PartialMetadata, RawChannel};

use fringeflow_dataset::Setup;
use fringeflow_recording::{Encoded, Recordable, Topic, static_messages};

pub(crate) use front::serve;

/// Time between two messages that say what does not change: whoever comes later gets them too, nanoseconds.
const STANDING_NS: u64 = 2_000_000_000;
/// Encoding of all messages.
const ENCODING: &str = "protobuf";

/// The topics that viewers are offered.
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

/// What viewers are sent.
#[derive(Debug)]
pub(crate) struct Viewers {
    /// Where the server finds the channels.
    context: Arc<Context>,
    channels: BTreeMap<Topic, Arc<RawChannel>>,
    encoded: Encoded,
    standing_ns: u64,
}

impl Viewers {
    pub(crate) fn new() -> Result<Self, FoxgloveError> {
        let context = Context::new();
        let channel = |topic: Topic| {
            let channel = ChannelBuilder::new(topic.name()).context(&context).message_encoding(ENCODING);
            Ok((topic, channel.schema(topic.schema()).build_raw()?))
        };
        let channels = TOPICS.into_iter().map(channel).collect::<Result<_, FoxgloveError>>()?;
        Ok(Self { context, channels, encoded: Encoded::default(), standing_ns: 0 })
    }

    pub(crate) fn context(&self) -> &Arc<Context> {
        &self.context
    }

    /// Whether somebody has subscribed to a topic, or to the headers of it.
    pub(crate) fn want(&self, topic: Topic) -> bool {
        let is_wanted = |topic| self.channels.get(&topic).is_some_and(|channel| channel.has_sinks());
        is_wanted(topic) || topic.header().is_some_and(is_wanted)
    }

    /// Sends a message to whoever wants it.
    pub(crate) fn send(&mut self, message: &Recordable<'_>) {
        let Some(topic) = message.topic().filter(|&topic| self.want(topic)) else { return };
        message.encode(&mut self.encoded);
        for (topic, bytes) in self.encoded.parts(topic) {
            self.send_bytes(topic, bytes, message.log_ns());
        }
    }

    /// Sends what does not change, when it is due.
    pub(crate) fn send_standing(&mut self, setup: &Setup, now_ns: u64) {
        if now_ns.saturating_sub(self.standing_ns) < STANDING_NS {
            return;
        }
        self.standing_ns = now_ns;
        if [Topic::Transforms, Topic::Cam1Calibration, Topic::Cam2Calibration].into_iter().any(|topic| self.want(topic))
        {
            for (topic, bytes) in static_messages(setup, now_ns) {
                self.send_bytes(topic, &bytes, now_ns);
            }
        }
    }

    fn send_bytes(&self, topic: Topic, bytes: &[u8], log_ns: u64) {
        if let Some(channel) = self.channels.get(&topic) {
            channel.log_with_meta(bytes, PartialMetadata { log_time: Some(log_ns) });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::Value;

    const LAYOUT: &str = include_str!("../../../../configs/foxglove-layout.json");
    const SCHEMA: &str = include_str!("../../../../crates/recording/src/schema/fringeflow.proto");

    /// All texts of a JSON value that begin with a slash, keys included: topics, and paths into their messages.
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
    fn the_layout_shows_topics_and_fields_that_there_are() {
        let paths = paths(&serde_json::from_str(LAYOUT).unwrap());
        assert!(paths.len() > 10, "{paths:?}");
        for path in paths {
            let topic = path.split(['.', '{']).next().unwrap();
            let known = Topic::from_name(topic).unwrap_or_else(|| panic!("{topic} is no topic"));
            assert!(TOPICS.contains(&known), "{topic} is not offered live");
            // Behind conditions in braces, the fields.
            let fields = path[topic.len()..].rsplit('}').next().unwrap().split('.').filter(|field| !field.is_empty());
            for field in fields {
                assert!(SCHEMA.contains(&format!(" {field} = ")), "{path}: there is no field {field}");
            }
        }
    }

    #[test]
    fn nothing_is_wanted_without_viewers() {
        let viewers = Viewers::new().unwrap();
        assert!(TOPICS.into_iter().all(|topic| !viewers.want(topic)));
    }
}
