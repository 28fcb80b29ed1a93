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
use super::{Channel, ChannelLimits, Header, Instance, Ipc, Payload, TransportError, shared_memory};

/// Maximum number of ports and tools on a channel at once: the default of iceoryx2 for event services.
const MAX_NODES: usize = 36;

/// How long opening is retried. Another process may be creating or removing the same service.
const RETRY_TIMEOUT: Duration = Duration::from_millis(500);

/// Time between two attempts.
const RETRY_INTERVAL: Duration = Duration::from_millis(25);

/// This process in an instance.
#[derive(Clone, Debug)]
pub struct Node {
    instance: Instance,
    name: String,
}

/// An iceoryx2 node; each port has its own.
///
/// An iceoryx2 node panics when a service that it still knows is created again after its files were removed. It knows a
/// service as long as messages of the old port are held. So a port that opens again uses a new node.
#[derive(Debug)]
pub(super) struct Member {
    instance: Instance,
    node: IoxNode<Ipc>,
}

/// An open channel: its service, its event service, and their files.
#[derive(Debug)]
pub(super) struct Opened<H: Header, P: Payload + ?Sized> {
    pub(super) service: ChannelService<Ipc, P, H>,
    pub(super) event: EventService<Ipc>,
    pub(super) files: Files,
}

impl Node {
    /// Joins the instance under a name that other processes see.
    ///
    /// # Errors
    /// The folder of the instance cannot be used, or iceoryx2 refuses the name.
    pub fn open(instance: &Instance, name: &str) -> Result<Self, TransportError> {
        limit_log_level();
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
            // The services handle signals themselves.
            .signal_handling_mode(SignalHandlingMode::Disabled);
        // A starting supervisor may be removing the folder.
        let create = || {
            self.instance.prepare()?;
            builder.clone().create::<Ipc>().map_err(|e| self.instance.node_error(e))
        };
        let node = retry(create, || {})?;
        Ok(Member { instance: self.instance.clone(), node })
    }
}

impl Member {
    pub(super) fn node(&self) -> &IoxNode<Ipc> {
        &self.node
    }

    /// Opens or creates a channel.
    pub(super) fn channel<H: Header, P: Payload + ?Sized>(
        &self,
        channel: Channel<H, P>,
        limits: &ChannelLimits,
    ) -> Result<Opened<H, P>, TransportError> {
        let name = self.service_name(channel.name())?;
        let service = self.attempt(|| {
            let builder = self
                .node
                .service_builder(&name)
                .publish_subscribe::<P>()
                .user_header::<H>()
                .enable_safe_overflow(true)
                .max_publishers(limits.publishers)
                .max_subscribers(limits.subscribers)
                .subscriber_max_buffer_size(limits.buffer)
                .subscriber_max_borrowed_samples(limits.borrowed)
                .history_size(limits.history)
                .max_nodes(MAX_NODES);
            P::open(builder).map_err(|e| self.error(channel.name(), "open the service", e))
        })?;
        let event = self.event(channel.name())?;
        let files = self.files(&service, &event)?;
        Ok(Opened { service, event, files })
    }

    /// Opens or creates the event service of a channel. Its limits are the defaults of iceoryx2, so programs in other
    /// languages need not set any.
    pub(super) fn event(&self, name: &'static str) -> Result<EventService<Ipc>, TransportError> {
        let service = self.service_name(name)?;
        self.attempt(|| {
            let event = self.node.service_builder(&service).event();
            event.open_or_create().map_err(|e| self.error(name, "open the event service", e))
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

    /// Retries an action, and removes dead processes between attempts, since they may hold the resource.
    pub(super) fn attempt<T>(&self, action: impl FnMut() -> Result<T, TransportError>) -> Result<T, TransportError> {
        retry(action, || {
            self.node.try_cleanup_dead_nodes();
        })
    }

    pub(super) fn service_name(&self, name: &'static str) -> Result<ServiceName, TransportError> {
        ServiceName::new(name).map_err(|e| self.error(name, "create the service name", e))
    }

    /// Returns the files through which other processes find this node and two services.
    pub(super) fn files(&self, one: &impl PortFactory, two: &impl PortFactory) -> Result<Files, TransportError> {
        let (root, prefix) = (self.instance.root(), self.instance.prefix());
        let node = root.join("nodes").join(format!("{prefix}{}.node_monitor", self.node.id().value()));
        let services = [
            (one.service_hash().as_str(), one.unique_service_id().value()),
            (two.service_hash().as_str(), two.unique_service_id().value()),
        ];
        let services = services.into_iter().map(|(hash, id)| {
            let description = root.join("services").join(format!("{prefix}{hash}.service"));
            let participants = shared_memory::file_with_suffix(prefix, &format!("_{id}.dynamic"))?;
            Ok(Service { description, participants })
        });
        Ok(Files::new([node]).with_services(services.collect::<Result<_, TransportError>>()?))
    }

    fn error(&self, channel: &'static str, action: &'static str, reason: impl Debug) -> TransportError {
        self.instance.channel_error(channel, action, reason)
    }
}

/// Repeats `action` until it succeeds or [`RETRY_TIMEOUT`] has passed. Calls `between` between two attempts.
fn retry<T>(mut action: impl FnMut() -> Result<T, TransportError>, between: impl Fn()) -> Result<T, TransportError> {
    let start = Instant::now();
    loop {
        let result = action();
        if result.is_ok() || start.elapsed() >= RETRY_TIMEOUT {
            return result;
        }
        between();
        std::thread::sleep(RETRY_INTERVAL);
    }
}

/// iceoryx2 returns errors as results; its log below that level does not help an operator.
fn limit_log_level() {
    static ONCE: Once = Once::new();
    ONCE.call_once(|| set_log_level(LogLevel::Error));
}
