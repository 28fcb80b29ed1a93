//! This process in the instance, and the channels as services of iceoryx2.

use std::fmt::Debug;
use std::path::PathBuf;
use std::sync::{Arc, Mutex, Once, PoisonError};
use std::time::Duration;

use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::prelude::{
    LogLevel, Node as IoxNode, NodeBuilder, NodeName, PortFactory as _, ServiceName, SignalHandlingMode, set_log_level,
};
use iceoryx2::service::port_factory::event::PortFactory as EventService;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory;

use super::file_identity::Watched;
use super::{
    CAM1_FRAME, CAM2_FRAME, CLOUD, CORRESPONDENCE_MAP, Channel, ChannelSizes, Header, Instance, Ipc, PHASE_MAPS,
    PROJECTOR_PATTERN, Payload, Quality, REPORT_STAGE, SCAN_STATE, TransportError,
};

/// Processes that may use a channel at once, tools included.
const MAX_NODES: usize = 36;

/// How often opening is tried: another process may just be creating or cleaning the same service.
const ATTEMPTS: u32 = 20;

/// Pause between two attempts.
const PAUSE: Duration = Duration::from_millis(25);

/// This process in an instance; clones share it.
#[derive(Clone, Debug)]
pub struct Node {
    shared: Arc<Shared>,
}

#[derive(Debug)]
struct Shared {
    instance: Instance,
    name: String,
    current: Mutex<Current>,
}

#[derive(Clone, Debug)]
struct Current {
    node: Arc<IoxNode<Ipc>>,
    watched: Watched,
}

/// Keeps every channel in being while no port is open, so that drivers find them whichever process starts first.
#[derive(Debug)]
pub struct Channels {
    node: Node,
    sizes: ChannelSizes,
    held: Held,
}

/// A service that exists as long as it is held.
trait Service: Debug + Send {}

impl<T: Debug + Send> Service for T {}

/// What was opened, and the files it rests on.
#[derive(Debug)]
struct Held {
    services: Vec<Box<dyn Service>>,
    watched: Vec<Watched>,
}

/// A channel as opened: its service, its event service, the files of both.
pub(super) struct Opened<H: Header, P: Payload + ?Sized> {
    pub(super) service: PortFactory<Ipc, P, H>,
    pub(super) event: EventService<Ipc>,
    pub(super) watched: Watched,
}

impl Node {
    /// Joins the instance, under a name that others see.
    ///
    /// # Errors
    /// The folder of the instance cannot be used, or iceoryx2 refuses.
    pub fn open(instance: &Instance, name: &str) -> Result<Self, TransportError> {
        quieten_log();
        let current = Mutex::new(Current::open(instance, name)?);
        Ok(Self { shared: Arc::new(Shared { instance: instance.clone(), name: name.to_owned(), current }) })
    }

    /// The instance.
    #[must_use]
    pub fn instance(&self) -> &Instance {
        &self.shared.instance
    }

    /// The node of iceoryx2; a new one if its files were removed, since nobody could see the old one any more.
    pub(super) fn current(&self) -> Result<Arc<IoxNode<Ipc>>, TransportError> {
        let mut current = self.shared.current.lock().unwrap_or_else(PoisonError::into_inner);
        if !current.watched.unchanged() {
            tracing::warn!(instance = self.instance().name(), "files of the instance were removed; joining it anew");
            *current = Current::open(&self.shared.instance, &self.shared.name)?;
        }
        Ok(Arc::clone(&current.node))
    }

    /// Opens a channel, or creates it.
    pub(super) fn channel<H: Header, P: Payload + ?Sized>(
        &self,
        channel: Channel<H, P>,
        quality: &Quality,
    ) -> Result<Opened<H, P>, TransportError> {
        self.attempt(|node| {
            let name = self.service_name(channel.name())?;
            let builder = node
                .service_builder(&name)
                .publish_subscribe::<P>()
                .user_header::<H>()
                .enable_safe_overflow(true)
                .max_publishers(quality.publishers)
                .max_subscribers(quality.subscribers)
                .subscriber_max_buffer_size(quality.buffer)
                .subscriber_max_borrowed_samples(quality.borrowed)
                .history_size(quality.history)
                .max_nodes(MAX_NODES);
            let service = P::open(builder).map_err(|e| self.channel_error(channel.name(), "open it", e))?;
            let event = self.event_on(node, channel.name())?;
            let hashes = [service.service_hash().as_str(), event.service_hash().as_str()];
            let watched = Watched::new(hashes.map(|hash| self.service_file(hash)));
            Ok(Opened { service, event, watched })
        })
    }

    /// Opens the event service of a channel, or creates it. Its limits are the defaults of iceoryx2, so that programs in
    /// other languages need not state any.
    pub(super) fn event_on(
        &self,
        node: &IoxNode<Ipc>,
        name: &'static str,
    ) -> Result<EventService<Ipc>, TransportError> {
        let service = self.service_name(name)?;
        let event = node.service_builder(&service).event();
        event.open_or_create().map_err(|e| self.channel_error(name, "open its events", e))
    }

    /// A notifier of a channel.
    pub(super) fn notifier(
        &self,
        name: &'static str,
        event: &EventService<Ipc>,
    ) -> Result<Notifier<Ipc>, TransportError> {
        event.notifier_builder().create().map_err(|e| self.channel_error(name, "create a notifier", e))
    }

    /// A listener of a channel.
    pub(super) fn listener(
        &self,
        name: &'static str,
        event: &EventService<Ipc>,
    ) -> Result<Listener<Ipc>, TransportError> {
        event.listener_builder().create().map_err(|e| self.channel_error(name, "create a listener", e))
    }

    /// Tries several times, and removes dead processes in between: they may hold what is wanted.
    pub(super) fn attempt<T>(
        &self,
        mut action: impl FnMut(&IoxNode<Ipc>) -> Result<T, TransportError>,
    ) -> Result<T, TransportError> {
        for _ in 1..ATTEMPTS {
            let node = self.current()?;
            if let Ok(done) = action(&node) {
                return Ok(done);
            }
            node.try_cleanup_dead_nodes();
            std::thread::sleep(PAUSE);
        }
        let node = self.current()?;
        action(&node)
    }

    pub(super) fn service_name(&self, name: &'static str) -> Result<ServiceName, TransportError> {
        ServiceName::new(name).map_err(|e| self.channel_error(name, "name it", e))
    }

    /// File that describes a service.
    pub(super) fn service_file(&self, hash: &str) -> PathBuf {
        let instance = self.instance();
        instance.root().join("services").join(format!("{}{hash}.service", instance.prefix()))
    }

    pub(super) fn channel_error(
        &self,
        channel: &'static str,
        action: &'static str,
        reason: impl Debug,
    ) -> TransportError {
        let reason = format!("{reason:?}");
        TransportError::Channel { channel, instance: self.instance().name().to_owned(), action, reason }
    }
}

impl Current {
    fn open(instance: &Instance, name: &str) -> Result<Self, TransportError> {
        instance.prepare()?;
        let node_name = NodeName::new(name).map_err(|e| instance.node_error(e))?;
        let node = NodeBuilder::new()
            .name(&node_name)
            .config(&instance.config()?)
            // Signals belong to the services.
            .signal_handling_mode(SignalHandlingMode::Disabled)
            .create::<Ipc>()
            .map_err(|e| instance.node_error(e))?;
        let monitor = format!("{}{}.node_monitor", instance.prefix(), node.id().value());
        let watched = Watched::new([instance.root().join("nodes").join(monitor)]);
        Ok(Self { node: Arc::new(node), watched })
    }
}

impl Channels {
    /// Opens all channels, or creates them.
    ///
    /// # Errors
    /// One of them exists with other settings.
    pub fn open(node: &Node, sizes: &ChannelSizes) -> Result<Self, TransportError> {
        Ok(Self { node: node.clone(), sizes: *sizes, held: Held::open(node, sizes)? })
    }

    /// Opens them again if their files were removed; says whether that was so.
    ///
    /// # Errors
    /// As [`Self::open`]; the next call tries again.
    pub fn ensure_connected(&mut self) -> Result<bool, TransportError> {
        if self.held.watched.iter().all(Watched::unchanged) {
            return Ok(false);
        }
        self.held = Held::open(&self.node, &self.sizes)?;
        Ok(true)
    }
}

impl Held {
    fn open(node: &Node, sizes: &ChannelSizes) -> Result<Self, TransportError> {
        let mut held = Self { services: Vec::new(), watched: Vec::new() };
        held.add(node, CAM1_FRAME, sizes)?;
        held.add(node, CAM2_FRAME, sizes)?;
        held.add(node, PROJECTOR_PATTERN, sizes)?;
        held.add(node, PHASE_MAPS, sizes)?;
        held.add(node, CORRESPONDENCE_MAP, sizes)?;
        held.add(node, CLOUD, sizes)?;
        held.add(node, REPORT_STAGE, sizes)?;
        held.add(node, SCAN_STATE, sizes)?;
        Ok(held)
    }

    fn add<H: Header, P: Payload + ?Sized>(
        &mut self,
        node: &Node,
        channel: Channel<H, P>,
        sizes: &ChannelSizes,
    ) -> Result<(), TransportError> {
        let opened = node.channel(channel, &channel.id().quality(sizes))?;
        self.watched.push(opened.watched);
        self.services.push(Box::new((opened.service, opened.event)));
        Ok(())
    }
}

/// iceoryx2 reports through its results; what it logs below an error is of no use to an operator.
fn quieten_log() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| set_log_level(LogLevel::Error));
}
