//! This process in the instance.

use std::fmt::Debug;
use std::sync::Once;
use std::time::{Duration, Instant};

use iceoryx2::port::listener::Listener;
use iceoryx2::port::notifier::Notifier;
use iceoryx2::prelude::{
    LogLevel, Node as IoxNode, NodeBuilder, NodeName, PortFactory, ServiceName, SignalHandlingMode, set_log_level,
};
use iceoryx2::service::port_factory::event::PortFactory as EventService;
use iceoryx2::service::port_factory::publish_subscribe::PortFactory as ChannelService;

use super::attached::{Files, Service};
use super::{Channel, Header, Instance, Ipc, Payload, Quality, TransportError, shared_memory};

/// Ports and tools that may use a channel at once; iceoryx2's own number for event services.
const MAX_NODES: usize = 36;

/// How long opening is tried: another process may just be creating or cleaning the same service.
const PATIENCE: Duration = Duration::from_millis(500);

/// Pause between two attempts.
const PAUSE: Duration = Duration::from_millis(25);

/// This process in an instance.
#[derive(Clone, Debug)]
pub struct Node {
    instance: Instance,
    name: String,
}

/// A node of iceoryx2, one a port.
///
/// A node that still knows a service panics when that service is created again after its files were removed, as happens
/// while messages of the old port are held. So each port has a node, and opens anew with a new one.
#[derive(Debug)]
pub(super) struct Member {
    instance: Instance,
    node: IoxNode<Ipc>,
}

/// A channel as opened: its service, its event service, the files that they rest on.
#[derive(Debug)]
pub(super) struct Opened<H: Header, P: Payload + ?Sized> {
    pub(super) service: ChannelService<Ipc, P, H>,
    pub(super) event: EventService<Ipc>,
    pub(super) files: Files,
}

impl Node {
    /// Joins the instance, under a name that others see.
    ///
    /// # Errors
    /// The folder of the instance cannot be used, or the name is none for iceoryx2.
    pub fn open(instance: &Instance, name: &str) -> Result<Self, TransportError> {
        quieten_log();
        instance.prepare()?;
        NodeName::new(name).map_err(|e| instance.node_error(e))?;
        Ok(Self { instance: instance.clone(), name: name.to_owned() })
    }

    /// The instance.
    #[must_use]
    pub fn instance(&self) -> &Instance {
        &self.instance
    }

    pub(super) fn member(&self) -> Result<Member, TransportError> {
        let name = NodeName::new(&self.name).map_err(|e| self.instance.node_error(e))?;
        let builder = NodeBuilder::new()
            .name(&name)
            .config(&self.instance.config()?)
            // Signals belong to the services.
            .signal_handling_mode(SignalHandlingMode::Disabled);
        // A supervisor that starts may just be removing the folder.
        let create = || {
            self.instance.prepare()?;
            builder.clone().create::<Ipc>().map_err(|e| self.instance.node_error(e))
        };
        let node = patiently(create, || {})?;
        Ok(Member { instance: self.instance.clone(), node })
    }
}

impl Member {
    pub(super) fn node(&self) -> &IoxNode<Ipc> {
        &self.node
    }

    /// Opens a channel, or creates it.
    pub(super) fn channel<H: Header, P: Payload + ?Sized>(
        &self,
        channel: Channel<H, P>,
        quality: &Quality,
    ) -> Result<Opened<H, P>, TransportError> {
        let name = self.service_name(channel.name())?;
        let service = self.attempt(|| {
            let builder = self
                .node
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
            P::open(builder).map_err(|e| self.error(channel.name(), "open it", e))
        })?;
        let event = self.event(channel.name())?;
        let files = self.files(&service, &event)?;
        Ok(Opened { service, event, files })
    }

    /// Opens the event service of a channel, or creates it. Its limits are the defaults of iceoryx2, so that programs in
    /// other languages need not state any.
    pub(super) fn event(&self, name: &'static str) -> Result<EventService<Ipc>, TransportError> {
        let service = self.service_name(name)?;
        self.attempt(|| {
            let event = self.node.service_builder(&service).event();
            event.open_or_create().map_err(|e| self.error(name, "open its events", e))
        })
    }

    pub(super) fn notifier(
        &self,
        name: &'static str,
        event: &EventService<Ipc>,
    ) -> Result<Notifier<Ipc>, TransportError> {
        self.attempt(|| event.notifier_builder().create().map_err(|e| self.error(name, "create a notifier", e)))
    }

    pub(super) fn listener(
        &self,
        name: &'static str,
        event: &EventService<Ipc>,
    ) -> Result<Listener<Ipc>, TransportError> {
        self.attempt(|| event.listener_builder().create().map_err(|e| self.error(name, "create a listener", e)))
    }

    /// Tries several times, and removes dead processes in between: they may hold what is wanted.
    pub(super) fn attempt<T>(&self, action: impl FnMut() -> Result<T, TransportError>) -> Result<T, TransportError> {
        patiently(action, || {
            self.node.try_cleanup_dead_nodes();
        })
    }

    pub(super) fn service_name(&self, name: &'static str) -> Result<ServiceName, TransportError> {
        ServiceName::new(name).map_err(|e| self.error(name, "name it", e))
    }

    /// The files through which others find this node and two services.
    pub(super) fn files(&self, one: &impl PortFactory, two: &impl PortFactory) -> Result<Files, TransportError> {
        let (root, prefix) = (self.instance.root(), self.instance.prefix());
        let node = root.join("nodes").join(format!("{prefix}{}.node_monitor", self.node.id().value()));
        let services = [
            (one.service_hash().as_str(), one.unique_service_id().value()),
            (two.service_hash().as_str(), two.unique_service_id().value()),
        ];
        let services = services.into_iter().map(|(hash, id)| {
            let description = root.join("services").join(format!("{prefix}{hash}.service"));
            let participants = shared_memory::file_ending(prefix, &format!("_{id}.dynamic"))?;
            Ok(Service { description, participants })
        });
        Ok(Files::new([node]).with_services(services.collect::<Result<_, TransportError>>()?))
    }

    fn error(&self, channel: &'static str, action: &'static str, reason: impl Debug) -> TransportError {
        self.instance.channel_error(channel, action, reason)
    }
}

/// Tries until it works or [`PATIENCE`] has passed, with something done between two attempts.
fn patiently<T>(
    mut action: impl FnMut() -> Result<T, TransportError>,
    between: impl Fn(),
) -> Result<T, TransportError> {
    let start = Instant::now();
    loop {
        let result = action();
        if result.is_ok() || start.elapsed() >= PATIENCE {
            return result;
        }
        between();
        std::thread::sleep(PAUSE);
    }
}

/// iceoryx2 reports through its results; what it logs below an error is of no use to an operator.
fn quieten_log() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| set_log_level(LogLevel::Error));
}
