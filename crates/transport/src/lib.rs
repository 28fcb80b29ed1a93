//! Channels between processes, and the only place that names the library behind them, iceoryx2.
//!
//! In: the name of an instance. Out: typed ports that the services publish to and receive from, without a copy between
//! processes: [`Publisher`], [`Subscriber`], [`ControlServer`], and [`wait_for`], which waits for any of them.
//!
//! ```text
//!  Instance (name → folder, prefix of shared memory)
//!   ├─ InstanceLock    one supervisor; cleans at start and end
//!   └─ Node            this process in the instance
//!       ├─ Publisher ──► channel ──► Subscriber     latest wins: the publisher never waits
//!       ├─ request() ──► control ──► ControlServer
//!       └─ KeptChannels   keeps all channels while no port is open
//! ```
//!
//! A publisher never waits for a reader: a full buffer loses its oldest message, and the numbers in the headers let the
//! reader count what it missed. Every port can be moved to another thread and used by one thread at a time. Once a
//! second a service calls `ensure_connected` on its ports: they find each other again after files of the instance were
//! removed, or after the other side was restarted.
//!
//! # Drivers in other languages
//! They need iceoryx2 0.10, the configuration [`Instance::external_config`], and the names, types and limits in
//! [`ChannelId`]. After each message they notify the event service that has the name of the channel.

mod attached;
mod channels;
mod control;
mod error;
mod instance;
mod instance_lock;
mod kept_channels;
mod node;
mod payload;
mod publisher;
mod shared_memory;
mod subscriber;
mod wait;

#[cfg(test)]
mod tests;

pub use channels::{
    CAM1_FRAME, CAM2_FRAME, CLOUD, CORRESPONDENCE_MAP, Channel, ChannelId, ChannelSizes, PHASE_MAPS, PROJECTOR_PATTERN,
    Quality, REPORT_STAGE, REPORT_WINDOW, SCAN_STATE, TRACKING_MODEL, TRACKING_POSE, TRACKING_PRIOR,
};
pub use control::{ControlServer, request};
pub use error::TransportError;
pub use instance::{Instance, Participant};
pub use instance_lock::{Begun, InstanceLock};
pub use kept_channels::KeptChannels;
pub use node::Node;
pub use payload::{Header, Payload};
pub use publisher::Publisher;
pub use shared_memory::{check_shared_memory, required_bytes};
pub use subscriber::{Received, Subscriber};
pub use wait::{WaitSource, wait_for};

/// The flavour of iceoryx2's services: between processes, and with ports that may move to another thread.
type Ipc = iceoryx2::prelude::ipc_threadsafe::Service;
