//! The loop of a service that makes one output message of each input message, in the order of the input.

use std::collections::VecDeque;
use std::fmt::Display;
use std::time::Duration;

use fringeflow_message::{DropReason, Stage, Window};
use fringeflow_transport::{Channel, Header, Payload, Publisher, Received, Subscriber, TransportError, wait_for};

use crate::clock::now_ns;
use crate::host::{Host, ItemTimes, MAX_WAIT, POLL_INTERVAL, ServiceError};
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

    /// Number of messages that may be in work at once.
    fn at_once(&self) -> usize {
        1
    }

    /// Begins to compute the result of a message. The publisher gets its memory back when the message is dropped.
    ///
    /// # Errors
    /// The message contradicts itself, or there is no result.
    fn begin(&mut self, message: Received<Self::InHeader, Self::InPayload>) -> Result<(), Dropped>;

    /// Ends the oldest work, and returns when its result was there; the sending methods are then about that result.
    /// `None` if it is not there after `timeout`. Without an implementation of its own, `begin` does all of the work.
    ///
    /// # Errors
    /// There is no result.
    fn end_oldest(&mut self, _timeout: Duration) -> Option<Result<u64, Dropped>> {
        Some(Ok(now_ns()))
    }

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
    /// Messages in work, oldest first.
    in_work: VecDeque<Work>,
    /// Reason of the last dropped item, until an item passes: consecutive drops for one reason are logged once.
    last_reason: Option<DropReason>,
}

/// A message in work.
struct Work {
    window: Window,
    taken_ns: u64,
    span: WindowSpan,
}

/// Runs a transform until the service is to stop, and processes the messages that wait then.
///
/// # Errors
/// The channels or the account cannot be used.
pub fn run_transform<T: Transform>(host: &mut Host, transform: T) -> Result<(), ServiceError> {
    let mut input = Subscriber::open(&host.node, T::INPUT, &host.sizes)?;
    let output = Publisher::open(&host.node, T::OUTPUT, &host.sizes)?;
    let account = host.open_account(T::STAGE)?;
    host.set_at_once(transform.at_once());
    let mut service = Service { host, transform, account, output, in_work: VecDeque::new(), last_reason: None };
    service.host.catch_up(&mut service.account, DropReason::Restart)?;
    loop {
        // Read before the channel is emptied, so that the last messages of the stage before are processed too.
        let is_last = service.host.stop.is_requested();
        let is_emptied = service.advance(&mut input)?;
        if is_last && is_emptied && service.in_work.is_empty() {
            break;
        }
        if service.host.is_heartbeat_due() {
            service.host.report(T::STAGE, service.account.counts(), None);
        }
        if service.check_connections(&mut input) {
            service.host.catch_up(&mut service.account, DropReason::Overrun)?;
        }
        service.wait(&input)?;
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

    /// Passes on what is finished, and begins as many messages as may be in work. Returns whether no message is left in
    /// the channel.
    fn advance(&mut self, input: &mut Subscriber<T::InHeader, T::InPayload>) -> Result<bool, ServiceError> {
        loop {
            while self.end_oldest(Duration::ZERO)? {}
            if self.is_full() {
                return Ok(false);
            }
            let Some(message) = receive(input) else { return Ok(true) };
            self.begin(message)?;
        }
    }

    /// Waits until there is something to do: the oldest work has ended, or a message has arrived that can be begun.
    fn wait(&mut self, input: &Subscriber<T::InHeader, T::InPayload>) -> Result<(), ServiceError> {
        if self.is_full() {
            self.end_oldest(MAX_WAIT)?;
            return Ok(());
        }
        // A port cannot wait for work too.
        let timeout = if self.in_work.is_empty() { MAX_WAIT } else { POLL_INTERVAL };
        Ok(wait_for(&[input], timeout)?)
    }

    /// Whether no further message may be begun.
    fn is_full(&self) -> bool {
        self.in_work.len() >= self.transform.at_once()
    }

    fn begin(&mut self, message: Received<T::InHeader, T::InPayload>) -> Result<(), ServiceError> {
        let taken_ns = now_ns();
        let number = T::published(message.header());
        if !self.account.count_arrival(0, number)? {
            return Ok(());
        }
        let span = WindowSpan::new(T::STAGE, number);
        let window = T::window(message.header());
        span.identify(&window);
        match span.work(|| self.transform.begin(message)) {
            Err(dropped) => span.work(|| self.drop_item(&dropped))?,
            Ok(()) => self.in_work.push_back(Work { window, taken_ns, span }),
        }
        Ok(())
    }

    /// Passes the oldest message on, or drops it, if its work ends within `timeout`. Returns whether it did.
    fn end_oldest(&mut self, timeout: Duration) -> Result<bool, ServiceError> {
        if self.in_work.is_empty() {
            return Ok(false);
        }
        let Some(result) = self.transform.end_oldest(timeout) else { return Ok(false) };
        let Some(work) = self.in_work.pop_front() else { return Ok(false) };
        match result {
            Err(dropped) => work.span.work(|| self.drop_item(&dropped))?,
            Ok(ended_ns) => self.send_result(&work, ended_ns)?,
        }
        Ok(true)
    }

    fn drop_item(&mut self, dropped: &Dropped) -> Result<(), AccountError> {
        self.account.drop_one(dropped.reason)?;
        if self.last_reason.replace(dropped.reason) != Some(dropped.reason) {
            tracing::warn!(reason = dropped.reason.name(), "{}", dropped.message);
        }
        self.host.report(T::STAGE, self.account.counts(), None);
        Ok(())
    }

    fn send_result(&mut self, work: &Work, ended_ns: u64) -> Result<(), ServiceError> {
        if let Some(next) = T::NEXT {
            self.host.wait_until_free(next, &self.account);
        }
        // For earlier windows and for the next stage.
        let waited_ns = now_ns().saturating_sub(ended_ns);
        let published = self.account.count_passed()?;
        work.span.work(|| {
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
        let (exposure_start_ns, received_ns) = (work.window.last_exposure_ns, work.window.received_ns);
        let times =
            ItemTimes { exposure_start_ns, received_ns, taken_ns: work.taken_ns, passed_ns: now_ns(), waited_ns };
        self.host.report(T::STAGE, self.account.counts(), Some(times));
        Ok(())
    }
}
