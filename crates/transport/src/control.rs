//! Commands to the supervisor, and its responses.

use std::time::{Duration, Instant};

use iceoryx2::port::listener::Listener;
use iceoryx2::port::server::Server;
use iceoryx2::service::builder::request_response::Builder;

use fringeflow_message::{ControlRequest, ControlResponse};

use super::attached::{Attached, ensure_open};
use super::wait::{Listening, WaitSource};
use super::{Instance, Ipc, Node, TransportError};

/// Name of the request–response service, and of the event service that signals requests.
const CONTROL: &str = "control";

/// Maximum number of clients at once.
const MAX_CLIENTS: usize = 16;

/// Time between two polls for the response.
const POLL_INTERVAL: Duration = Duration::from_millis(2);

/// Receives the commands and sends the responses.
#[derive(Debug)]
pub struct ControlServer {
    node: Node,
    open: Option<Attached<Port>>,
}

#[derive(Debug)]
struct Port {
    server: Server<Ipc, ControlRequest, (), ControlResponse, ()>,
    listener: Listener<Ipc>,
}

impl ControlServer {
    /// Opens the control service.
    ///
    /// # Errors
    /// Another process already serves the commands, or iceoryx2 refuses.
    pub fn open(node: &Node) -> Result<Self, TransportError> {
        Ok(Self { node: node.clone(), open: Some(Port::open(node)?) })
    }

    /// Responds to all waiting requests, and returns their number.
    ///
    /// # Errors
    /// A request cannot be received. It is not an error if the client no longer waits for the response.
    pub fn answer(
        &mut self,
        mut respond: impl FnMut(&ControlRequest) -> ControlResponse,
    ) -> Result<usize, TransportError> {
        let Some(open) = &self.open else { return Ok(0) };
        let mut answered = 0;
        while let Some(request) =
            open.server.receive().map_err(|e| self.node.instance().channel_error(CONTROL, "receive", e))?
        {
            let _ = request.send_copy(respond(request.payload()));
            answered += 1;
        }
        Ok(answered)
    }

    /// Opens the port again if its files were removed. Returns whether it did.
    ///
    /// # Errors
    /// As [`Self::open`]; the next call tries again.
    pub fn ensure_connected(&mut self) -> Result<bool, TransportError> {
        ensure_open(&mut self.open, || Port::open(&self.node))
    }
}

impl WaitSource for ControlServer {}

impl Listening for ControlServer {
    fn listener(&self) -> Option<&Listener<Ipc>> {
        self.open.as_ref().map(|open| &open.listener)
    }
}

impl Port {
    fn open(node: &Node) -> Result<Attached<Self>, TransportError> {
        let member = node.member()?;
        let error = |action, reason| node.instance().channel_error(CONTROL, action, reason);
        let name = member.service_name(CONTROL)?;
        let service = member.attempt(|| {
            with_limits(member.node().service_builder(&name).request_response())
                .open_or_create()
                .map_err(|e| error("open the service", format!("{e:?}")))
        })?;
        let event = member.event(CONTROL)?;
        let listener = member.listener(CONTROL, &event)?;
        let server = member
            .attempt(|| service.server_builder().create().map_err(|e| error("create a server", format!("{e:?}"))))?;
        let files = member.files(&service, &event)?;
        Ok(Attached::new(Self { server, listener }, files))
    }
}

/// Sends a request to the supervisor of an instance.
///
/// # Errors
/// [`TransportError::NotRunning`] if no supervisor runs for the instance; [`TransportError::NoAnswer`] if no response
/// arrives in time.
pub fn request(
    instance: &Instance,
    request: &ControlRequest,
    timeout: Duration,
) -> Result<ControlResponse, TransportError> {
    let not_running = || TransportError::NotRunning { name: instance.name().to_owned() };
    // Opening a node would create the folder of the instance.
    if !instance.root().exists() {
        return Err(not_running());
    }
    let member = Node::open(instance, "client")?.member()?;
    let name = member.service_name(CONTROL)?;
    let builder = member.node().service_builder(&name).request_response::<ControlRequest, ControlResponse>();
    let service = builder.open().map_err(|_| not_running())?;
    let client =
        service.client_builder().create().map_err(|e| instance.channel_error(CONTROL, "create a client", e))?;
    let pending = client.send_copy(*request).map_err(|e| instance.channel_error(CONTROL, "send a request", e))?;
    if pending.number_of_server_connections() == 0 {
        return Err(not_running());
    }
    // If notifying fails, the server finds the request at its next poll.
    let _ = member.notifier(CONTROL, &member.event(CONTROL)?)?.notify();
    let start = Instant::now();
    loop {
        let response = pending.receive().map_err(|e| instance.channel_error(CONTROL, "receive the response", e))?;
        if let Some(response) = response {
            return Ok(*response.payload());
        }
        if start.elapsed() >= timeout {
            return Err(TransportError::NoAnswer { name: instance.name().to_owned(), timeout });
        }
        std::thread::sleep(POLL_INTERVAL);
    }
}

fn with_limits(
    builder: Builder<ControlRequest, (), ControlResponse, (), Ipc>,
) -> Builder<ControlRequest, (), ControlResponse, (), Ipc> {
    builder.max_servers(1).max_clients(MAX_CLIENTS).enable_fire_and_forget_requests(false)
}
