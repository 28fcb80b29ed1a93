//! Channels between processes. Only this crate depends on iceoryx2, the library behind them.
//!
//! In: the name of an instance. Out: typed ports that exchange messages between processes without copying:
//! [`Publisher`], [`Subscriber`], [`ControlServer`], and [`wait_for`], which waits for several ports.
//!
//! ```text
//!  Instance (name → folder, prefix in shared memory)
//!   ├─ InstanceLock    one supervisor; cleans up at start and end
//!   └─ Node            this process in the instance
//!       ├─ Publisher ──► channel ──► Subscriber     the publisher never waits
//!       ├─ request() ──► control ──► ControlServer
//!       └─ KeptChannels   keeps all channels open while no port uses them
//! ```
//!
//! A publisher never waits for a subscriber. If a buffer is full, its oldest message is dropped, and the subscriber
//! counts its losses by the sequence numbers in the headers. A port may move to another thread, and is used by one
//! thread at a time. A service calls `ensure_connected` on its ports once a second. This reconnects them after files of
//! the instance were removed or the other process was restarted.
//!
//! ```
//! use fringeflow_message::FrameHeader;
//! use fringeflow_transport::{CAM1_FRAME, ChannelSizes, Instance, InstanceLock, Node, Publisher, Subscriber};
//!
//! let folder = tempfile::tempdir_in("/tmp")?;
//! let instance = Instance::in_folder(folder.path(), "example")?;
//! let _lock = InstanceLock::take(&instance)?;
//! let node = Node::open(&instance, "example")?;
//! let sizes = ChannelSizes { frame_bytes: 4, window: 3, ..ChannelSizes::default() };
//! let mut publisher = Publisher::open(&node, CAM1_FRAME, &sizes)?;
//! let mut subscriber = Subscriber::open(&node, CAM1_FRAME, &sizes)?;
//!
//! publisher.send(&FrameHeader { published: 7, ..FrameHeader::default() }, &[1, 2, 3, 4])?;
//! let frame = subscriber.receive()?.ok_or("no message")?;
//! assert_eq!((frame.header().published, frame.payload()), (7, &[1, 2, 3, 4][..]));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Drivers in other languages
//! A driver needs iceoryx2 0.10, the configuration from [`Instance::external_config`], and the names, types and limits
//! in [`ChannelId`]. After each message it notifies the event service with the name of the channel.

mod attached;
mod channels;
mod control;
mod error;
mod instance;
mod instance_lock;
mod kept_channels;
mod loan;
mod node;
mod payload;
mod publisher;
mod shared_memory;
mod subscriber;
mod trial_file;
mod wait;

#[cfg(test)]
mod tests;

pub use channels::{
    CAM1_FRAME, CAM2_FRAME, CLOUD, CORRESPONDENCE_MAP, Channel, ChannelId, ChannelLimits, ChannelSizes, PHASE_MAPS,
    PROJECTOR_PATTERN, REPORT_STAGE, REPORT_WINDOW, SCAN_STATE, TRACKING_MODEL, TRACKING_POSE, TRACKING_PRIOR,
};
pub use control::{ControlServer, request};
pub use error::TransportError;
pub use instance::{Instance, Participant};
pub use instance_lock::{InstanceLock, StartedInstance};
pub use kept_channels::KeptChannels;
pub use node::Node;
pub use payload::{Header, Payload};
pub use publisher::Publisher;
pub use shared_memory::{check_shared_memory, required_bytes};
pub use subscriber::{Received, Subscriber};
pub use wait::{WaitSource, wait_for};

/// Variant of the iceoryx2 services: between processes, with ports that may move to another thread.
type Ipc = iceoryx2::prelude::ipc_threadsafe::Service;
