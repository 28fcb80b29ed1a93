//! The loop of a service that makes one message of another.

use std::fmt::Display;

use fringeflow_message::{DropReason, Stage, Window};
use fringeflow_transport::{Channel, Header, Payload, Publisher, Received, Subscriber, TransportError, wait_for};

use crate::clock::now_ns;
use crate::host::{BEAT, Host, ItemTimes, ServiceError};
use crate::{Account, AccountError, receive};

/// A worker between two channels.
pub trait Transform {
    /// Header of what comes.
    type InHeader: Header;
    /// Payload of what comes.
    type InPayload: Payload + ?Sized;
    /// Header of what goes.
    type OutHeader: Header;
    /// Payload of what goes.
    type OutPayload: Payload + ?Sized;

    /// Where messages come from.
    const INPUT: Channel<Self::InHeader, Self::InPayload>;
    /// Where results go.
    const OUTPUT: Channel<Self::OutHeader, Self::OutPayload>;
    /// This stage.
    const STAGE: Stage;
    /// The stage behind, if there is one.
    const NEXT: Option<Stage>;

    /// Number of a message in its channel.
    fn published(header: &Self::InHeader) -> u64;

    /// Takes a message over.
    ///
    /// # Errors
    /// It contradicts itself.
    fn read(&mut self, header: &Self::InHeader, payload: &Self::InPayload) -> Result<Window, Dropped>;

    /// Makes the result.
    ///
    /// # Errors
    /// There is none.
    fn step(&mut self) -> Result<(), Dropped>;

    /// Sends the result under a number.
    ///
    /// # Errors
    /// The channel does not take it.
    fn send(
        &mut self,
        published: u64,
        output: &mut Publisher<Self::OutHeader, Self::OutPayload>,
    ) -> Result<(), TransportError>;

    /// Tells what there is to tell about the result that was sent under a number, beside the report of the stage.
    ///
    /// # Errors
    /// The channel does not take it.
    fn tell(&mut self, _published: u64) -> Result<(), TransportError> {
        Ok(())
    }

    /// Opens again what ports of its own have lost their other side; asked about once a second.
    ///
    /// # Errors
    /// They cannot be opened; the next call tries again.
    fn ensure_connected(&mut self) -> Result<(), TransportError> {
        Ok(())
    }
}

/// Why an item has no result.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Dropped {
    /// What it is counted under.
    pub reason: DropReason,
    /// What the log says.
    pub why: String,
}

impl Dropped {
    /// An item dropped for a reason, in the words of whoever found it.
    pub fn new(reason: DropReason, why: impl Display) -> Self {
        Self { reason, why: why.to_string() }
    }
}

struct Service<'a, T: Transform> {
    host: &'a mut Host,
    transform: T,
    account: Account,
    output: Publisher<T::OutHeader, T::OutPayload>,
    /// The last reason that was logged: what repeats itself is said once.
    logged: Option<DropReason>,
}

/// Runs a transform until the service is to end; then what still waits is worked off.
///
/// # Errors
/// The channels or the account cannot be used.
pub fn run_transform<T: Transform>(host: &mut Host, transform: T) -> Result<(), ServiceError> {
    let mut input = Subscriber::open(&host.node, T::INPUT, &host.sizes)?;
    let output = Publisher::open(&host.node, T::OUTPUT, &host.sizes)?;
    let account = host.account(T::STAGE)?;
    let mut service = Service { host, transform, account, output, logged: None };
    service.host.catch_up(&mut service.account, DropReason::Restart)?;
    loop {
        // Asked before the channel is emptied, so that what the stage before put out last is not left.
        let is_last = service.host.stop.is_requested();
        while let Some(message) = receive(&mut input) {
            service.work(message)?;
        }
        if is_last {
            break;
        }
        if service.host.beat_is_due() {
            service.host.report(T::STAGE, service.account.counts(), None);
        }
        if service.tend(&mut input) {
            service.host.catch_up(&mut service.account, DropReason::Overrun)?;
        }
        wait_for(&[&input], BEAT)?;
    }
    service.host.catch_up(&mut service.account, DropReason::Overrun)?;
    service.host.report(T::STAGE, service.account.counts(), None);
    Ok(())
}

impl<T: Transform> Service<'_, T> {
    /// Looks after the connections; whether the input was opened anew: what was sent to the old one is lost.
    fn tend(&mut self, input: &mut Subscriber<T::InHeader, T::InPayload>) -> bool {
        let mut is_renewed = false;
        let (account, output, transform) = (&self.account, &mut self.output, &mut self.transform);
        self.host.tend(|host, now_ns| {
            if !host.is_behind(account) {
                input.forgive_silence();
            }
            is_renewed = input.ensure_connected(now_ns)?;
            output.ensure_connected()?;
            transform.ensure_connected()
        });
        is_renewed
    }

    fn work(&mut self, message: Received<T::InHeader, T::InPayload>) -> Result<(), ServiceError> {
        let taken_ns = now_ns();
        if !self.account.arrive(0, T::published(message.header()))? {
            return Ok(());
        }
        let window = self.transform.read(message.header(), message.payload());
        // The publisher needs the sample back sooner than the work is done.
        drop(message);
        let done = window.and_then(|window| self.transform.step().map(|()| window));
        match done {
            Err(dropped) => self.drop_item(&dropped)?,
            Ok(window) => self.put_out(&window, taken_ns)?,
        }
        Ok(())
    }

    fn drop_item(&mut self, dropped: &Dropped) -> Result<(), AccountError> {
        self.account.drop_one(dropped.reason)?;
        if self.logged.replace(dropped.reason) != Some(dropped.reason) {
            tracing::warn!(reason = dropped.reason.name(), "{}", dropped.why);
        }
        self.host.report(T::STAGE, self.account.counts(), None);
        Ok(())
    }

    fn put_out(&mut self, window: &Window, taken_ns: u64) -> Result<(), ServiceError> {
        if let Some(next) = T::NEXT {
            self.host.wait_until_free(next, &self.account);
        }
        let published = self.account.pass()?;
        // What could not be sent is missing in the channel, and counted there.
        if let Err(error) = self.transform.send(published, &mut self.output) {
            tracing::warn!("{error}");
        }
        // Behind the result, which somebody waits for.
        if let Err(error) = self.transform.tell(published) {
            tracing::debug!(%error, "no report");
        }
        self.logged = None;
        let (exposure_start_ns, received_ns) = (window.last_exposure_ns, window.received_ns);
        let times = ItemTimes { exposure_start_ns, received_ns, taken_ns, passed_ns: now_ns() };
        self.host.report(T::STAGE, self.account.counts(), Some(times));
        Ok(())
    }
}
