//! The loop of a service that makes one output message of each input message.

use std::fmt::Display;

use fringeflow_message::{DropReason, Stage, Window};
use fringeflow_transport::{Channel, Header, Payload, Publisher, Received, Subscriber, TransportError, wait_for};

use crate::clock::now_ns;
use crate::host::{Host, ItemTimes, MAX_WAIT, ServiceError};
use crate::{Account, AccountError, WindowSpan, receive};

/// A worker between two channels.
pub trait Transform {
    /// Header of the input.
    type InHeader: Header;
    /// Payload of the input.
    type InPayload: Payload + ?Sized;
    /// Header of the output.
    type OutHeader: Header;
    /// Payload of the output.
    type OutPayload: Payload + ?Sized;

    /// Channel of the input.
    const INPUT: Channel<Self::InHeader, Self::InPayload>;
    /// Channel of the output.
    const OUTPUT: Channel<Self::OutHeader, Self::OutPayload>;
    /// This stage.
    const STAGE: Stage;
    /// The next stage, if there is one.
    const NEXT: Option<Stage>;

    /// Returns the number of a message in its channel.
    fn published(header: &Self::InHeader) -> u64;

    /// Returns the window that a message belongs to.
    fn window(header: &Self::InHeader) -> Window;

    /// Computes the result of a message. The publisher gets its memory back when the message is dropped.
    ///
    /// # Errors
    /// The message contradicts itself, or there is no result.
    fn step(&mut self, message: Received<Self::InHeader, Self::InPayload>) -> Result<(), Dropped>;

    /// Sends the result with number `published`.
    ///
    /// # Errors
    /// The channel refuses it.
    fn send(
        &mut self,
        published: u64,
        output: &mut Publisher<Self::OutHeader, Self::OutPayload>,
    ) -> Result<(), TransportError>;

    /// Sends reports about the result with number `published`, besides the report of the stage.
    ///
    /// # Errors
    /// The channel refuses a report.
    fn send_reports(&mut self, _published: u64) -> Result<(), TransportError> {
        Ok(())
    }

    /// Opens ports of the worker again if they lost their connection. Called about once a second.
    ///
    /// # Errors
    /// A port cannot be opened; the next call tries again.
    fn ensure_connected(&mut self) -> Result<(), TransportError> {
        Ok(())
    }
}

/// Why an item has no result.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Dropped {
    /// Reason that the account counts.
    pub reason: DropReason,
    /// Message for the log.
    pub message: String,
}

impl Dropped {
    /// Drops an item for a reason; `message` goes into the log.
    pub fn new(reason: DropReason, message: impl Display) -> Self {
        Self { reason, message: message.to_string() }
    }
}

struct Service<'a, T: Transform> {
    host: &'a mut Host,
    transform: T,
    account: Account,
    output: Publisher<T::OutHeader, T::OutPayload>,
    /// Reason of the last dropped item, until an item passes: consecutive drops for one reason are logged once.
    last_reason: Option<DropReason>,
}

/// Runs a transform until the service is to stop, and processes the messages that wait then.
///
/// # Errors
/// The channels or the account cannot be used.
pub fn run_transform<T: Transform>(host: &mut Host, transform: T) -> Result<(), ServiceError> {
    let mut input = Subscriber::open(&host.node, T::INPUT, &host.sizes)?;
    let output = Publisher::open(&host.node, T::OUTPUT, &host.sizes)?;
    let account = host.open_account(T::STAGE)?;
    let mut service = Service { host, transform, account, output, last_reason: None };
    service.host.catch_up(&mut service.account, DropReason::Restart)?;
    loop {
        // Read before the channel is emptied, so that the last messages of the stage before are processed too.
        let is_last = service.host.stop.is_requested();
        while let Some(message) = receive(&mut input) {
            service.process(message)?;
        }
        if is_last {
            break;
        }
        if service.host.is_heartbeat_due() {
            service.host.report(T::STAGE, service.account.counts(), None);
        }
        if service.check_connections(&mut input) {
            service.host.catch_up(&mut service.account, DropReason::Overrun)?;
        }
        wait_for(&[&input], MAX_WAIT)?;
    }
    service.host.catch_up(&mut service.account, DropReason::Overrun)?;
    service.host.report(T::STAGE, service.account.counts(), None);
    Ok(())
}

impl<T: Transform> Service<'_, T> {
    /// Checks the connections. Returns whether the input was opened again; messages in the old port are lost.
    fn check_connections(&mut self, input: &mut Subscriber<T::InHeader, T::InPayload>) -> bool {
        let mut is_reopened = false;
        let (account, output, transform) = (&self.account, &mut self.output, &mut self.transform);
        self.host.check_connections(|host, now_ns| {
            if !host.is_behind(account) {
                input.forgive_silence();
            }
            is_reopened = input.ensure_connected(now_ns)?;
            output.ensure_connected()?;
            transform.ensure_connected()
        });
        is_reopened
    }

    fn process(&mut self, message: Received<T::InHeader, T::InPayload>) -> Result<(), ServiceError> {
        let taken_ns = now_ns();
        let number = T::published(message.header());
        if !self.account.count_arrival(0, number)? {
            return Ok(());
        }
        let span = WindowSpan::new(T::STAGE, number);
        let window = T::window(message.header());
        span.identify(&window);
        match span.work(|| self.transform.step(message)) {
            Err(dropped) => span.work(|| self.drop_item(&dropped))?,
            Ok(()) => self.send_result(&window, taken_ns, &span)?,
        }
        Ok(())
    }

    fn drop_item(&mut self, dropped: &Dropped) -> Result<(), AccountError> {
        self.account.drop_one(dropped.reason)?;
        if self.last_reason.replace(dropped.reason) != Some(dropped.reason) {
            tracing::warn!(reason = dropped.reason.name(), "{}", dropped.message);
        }
        self.host.report(T::STAGE, self.account.counts(), None);
        Ok(())
    }

    fn send_result(&mut self, window: &Window, taken_ns: u64, span: &WindowSpan) -> Result<(), ServiceError> {
        let waiting_since_ns = now_ns();
        if let Some(next) = T::NEXT {
            self.host.wait_until_free(next, &self.account);
        }
        let waited_ns = now_ns() - waiting_since_ns;
        let published = self.account.count_passed()?;
        span.work(|| {
            // A result that was not sent is missing in the channel, and the next stage counts it.
            if let Err(error) = self.transform.send(published, &mut self.output) {
                tracing::warn!("{error}");
            }
            // After the result, because the next stage waits for that.
            if let Err(error) = self.transform.send_reports(published) {
                tracing::debug!(%error, "a report was not sent");
            }
        });
        self.last_reason = None;
        let (exposure_start_ns, received_ns) = (window.last_exposure_ns, window.received_ns);
        let times = ItemTimes { exposure_start_ns, received_ns, taken_ns, passed_ns: now_ns(), waited_ns };
        self.host.report(T::STAGE, self.account.counts(), Some(times));
        Ok(())
    }
}
