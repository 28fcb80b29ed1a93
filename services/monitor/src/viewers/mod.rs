//! The live view of Foxglove, Lichtblick and Rerun: the topics of a recording, as they come.
//!
//! Images and clouds are thinned out to some a second, and nothing is encoded that nobody has subscribed to. The server is that
//! of the Foxglove SDK, which listens where only [`front`] finds it.

mod front;

use std::collections::BTreeMap;
use std::sync::Arc;

use foxglove::{ChannelBuilder, Context, FoxgloveError, PartialMetadata, RawChannel};
use fringeflow::dataset::Setup;
use fringeflow::recording::{Encoded, Recordable, Topic, standing_messages};

pub(crate) use front::serve;

/// Time between two messages that say what does not change: whoever comes later gets them too, nanoseconds.
const STANDING_NS: u64 = 2_000_000_000;
/// Encoding of all messages.
const ENCODING: &str = "protobuf";

/// The topics that viewers are offered.
const TOPICS: [Topic; 13] = [
    Topic::Cam1Frame,
    Topic::Cam1Header,
    Topic::Cam2Frame,
    Topic::Cam2Header,
    Topic::Pattern,
    Topic::Cloud,
    Topic::CloudHeader,
    Topic::Report,
    Topic::WindowReport,
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
            for (topic, bytes) in standing_messages(setup, now_ns) {
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
