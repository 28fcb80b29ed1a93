//! What a service stands on: its configuration and setup, its place in the instance, its accounts and reports.

use std::path::PathBuf;
use std::time::Duration;

use fringeflow::cloud::RECORD_BYTES;
use fringeflow_config::ScannerConfiguration;
use fringeflow_dataset::Setup;
use fringeflow_message::{Counts, DropReason, Skew, Stage, StageReport};
use fringeflow_transport::{
    ChannelSizes, Header, Instance, Node, Payload, Publisher, REPORT_STAGE, Subscriber, TransportError,
};
use fringeflow_wire as wire;

use crate::clock::now_ns;
use crate::{Account, AccountError, ArgumentError, Preparing, ServiceArgs, Stop};

/// Longest wait of a service for messages: signs of life and the end of a run are not missed by more.
pub const BEAT: Duration = Duration::from_millis(100);
/// Time between two signs of life, nanoseconds.
const SIGN_OF_LIFE_NS: u64 = 500_000_000;
/// Time between two looks at the connections, nanoseconds.
const CONNECTION_CHECK_NS: u64 = 1_000_000_000;
/// Pause between two looks at the account of a stage that is waited for.
pub const PAUSE: Duration = Duration::from_micros(500);

/// Why a service ended.
#[derive(Debug, thiserror::Error)]
pub enum ServiceError {
    /// What it was started with.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// The channels.
    #[error(transparent)]
    Transport(#[from] TransportError),
    /// Its account.
    #[error(transparent)]
    Account(#[from] AccountError),
    /// The system refuses signal handlers.
    #[error("signals cannot be handled: {0}")]
    Signals(#[source] std::io::Error),
    /// Something of this service alone, with the reason.
    #[error("{0}")]
    Unusable(String),
}

impl ServiceError {
    /// Whether starting the service again would not help: arguments, files or the machine must change first.
    #[must_use]
    pub fn is_lasting(&self) -> bool {
        match self {
            Self::Argument(_) | Self::Unusable(_) => true,
            Self::Transport(error) => error.is_lasting(),
            Self::Account(_) | Self::Signals(_) => false,
        }
    }
}

/// Where a process of an instance stands.
#[derive(Debug)]
pub struct Host {
    /// Configuration of the scanner.
    pub configuration: ScannerConfiguration,
    /// Rig, pattern and volume.
    pub setup: Setup,
    /// This process in the instance.
    pub node: Node,
    /// Sizes of the messages.
    pub sizes: ChannelSizes,
    /// Whether the service is to end.
    pub stop: Stop,
    accounts: PathBuf,
    restarts: u32,
    reports: Publisher<(), StageReport>,
    beaten_ns: u64,
    checked_ns: u64,
}

/// Times of an item that a stage has finished.
#[derive(Clone, Copy, Debug, Default)]
pub struct ItemTimes {
    /// Start of its last exposure.
    pub exposure_start_ns: u64,
    /// When its last image had reached this machine.
    pub received_ns: u64,
    /// When it was taken.
    pub taken_ns: u64,
    /// When it was put out.
    pub passed_ns: u64,
}

impl Host {
    /// Reads configuration and setup, takes what service `name` is given of the machine, and joins the instance under that name.
    ///
    /// # Errors
    /// [`ServiceError`].
    pub fn open(arguments: &ServiceArgs, name: &'static str) -> Result<Self, ServiceError> {
        let configuration = arguments.configuration()?;
        // Before anything starts a thread: threads inherit it.
        let standing = arguments.take_processors(&configuration, name)?;
        let stop = Stop::on_signals().map_err(ServiceError::Signals)?;
        if arguments.supervised {
            stop.also_when_input_ends();
        }
        let setup = arguments.setup(&configuration)?;
        let instance = Instance::new(&configuration.name)?;
        let node = Node::open(&instance, name)?;
        let sizes = channel_sizes(&setup, &configuration);
        let reports = Publisher::open(&node, REPORT_STAGE, &sizes)?;
        let accounts = accounts_folder(&instance);
        if let Some(standing) = standing {
            standing.tell(&accounts, name);
        }
        let restarts = arguments.restarts;
        Ok(Self { configuration, setup, node, sizes, stop, accounts, restarts, reports, beaten_ns: 0, checked_ns: 0 })
    }

    /// How often this service was started before in this instance.
    #[must_use]
    pub fn restarts(&self) -> u32 {
        self.restarts
    }

    /// Tells that this service prepares something of `total` parts before it can work.
    #[must_use]
    pub fn prepare(&self, what: &str, total: u64) -> Preparing {
        Preparing::begin(&self.accounts, what, total)
    }

    /// Opens the account of a stage that this service keeps.
    ///
    /// # Errors
    /// The file cannot be read or written.
    pub fn account(&self, stage: Stage) -> Result<Account, AccountError> {
        Account::open(&self.accounts, stage)
    }

    /// Counts of a stage that another service keeps; `None` where none does.
    #[must_use]
    pub fn counts_of(&self, stage: Stage) -> Option<Counts> {
        Account::read(&self.accounts, stage)
    }

    /// Session and number of the item that a stage put out last.
    #[must_use]
    pub fn last_of(&self, stage: Stage) -> Option<[u64; 2]> {
        Account::read_last(&self.accounts, stage)
    }

    /// Counts as lost what the stages before have put out while this service did not listen.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn catch_up(&self, account: &mut Account, reason: DropReason) -> Result<(), AccountError> {
        account.catch_up(&self.accounts, reason)
    }

    /// Whether the stages before have put out something that has not come.
    #[must_use]
    pub fn is_behind(&self, account: &Account) -> bool {
        account.is_behind(&self.accounts)
    }

    /// [`ensure_connected`](crate::ensure_connected) by the accounts of this instance.
    ///
    /// # Errors
    /// As there.
    pub fn ensure_connected<H: Header, P: Payload + ?Sized>(
        &self,
        port: &mut Subscriber<H, P>,
        from: Stage,
        next: u64,
        now_ns: u64,
    ) -> Result<(), TransportError> {
        crate::ensure_connected(port, &self.accounts, from, next, now_ns)
    }

    /// Whether the next stage has time: has begun all that this one put out, so that both work and nothing grows old between
    /// them. True where there is no next stage.
    #[must_use]
    pub fn is_free(&self, next: Stage, account: &Account) -> bool {
        self.counts_of(next).is_none_or(|counts| counts.taken >= account.counts().passed)
    }

    /// Waits until the next stage is free or the service is to end, where the configuration wants no window lost.
    pub fn wait_until_free(&self, next: Stage, account: &Account) {
        while self.configuration.wait_when_busy && !self.is_free(next, account) && !self.stop.is_requested() {
            std::thread::sleep(PAUSE);
        }
    }

    /// Reports the counts of a stage, and the item that it finished.
    pub fn report(&mut self, stage: Stage, counts: &Counts, item: Option<ItemTimes>) {
        self.report_pairs(stage, counts, item, Skew::default());
    }

    /// [`Self::report`] of a stage that pairs images, with the skew of the pairs since the report before.
    pub fn report_pairs(&mut self, stage: Stage, counts: &Counts, item: Option<ItemTimes>, skew: Skew) {
        if let Some(ItemTimes { exposure_start_ns, taken_ns, passed_ns, .. }) = item {
            let took_us = passed_ns.saturating_sub(taken_ns) / 1000;
            tracing::trace!(stage = stage.name(), took_us, exposure_start_ns, "item");
        }
        let times = item.unwrap_or_default();
        let report = StageReport {
            stage: stage as u32,
            pid: std::process::id(),
            restarts: self.restarts,
            of_item: u32::from(item.is_some()),
            time_ns: now_ns(),
            exposure_start_ns: times.exposure_start_ns,
            received_ns: times.received_ns,
            taken_ns: times.taken_ns,
            passed_ns: times.passed_ns,
            counts: *counts,
            skew,
        };
        // A report that nobody gets is not worth a service; the counts are in the account, and come with the next one.
        if let Err(error) = self.reports.send_message(&report) {
            tracing::debug!(%error, "no report");
        }
    }

    /// Whether a sign of life is due; it is taken as given.
    pub fn beat_is_due(&mut self) -> bool {
        let now_ns = now_ns();
        let due = now_ns.saturating_sub(self.beaten_ns) >= SIGN_OF_LIFE_NS;
        if due {
            self.beaten_ns = now_ns;
        }
        due
    }

    /// Looks after the connections about once a second: `check` those of the service's own ports.
    ///
    /// # Errors
    /// A port that cannot be opened again is tried at the next look; this never fails the service.
    pub fn tend(&mut self, check: impl FnOnce(&Self, u64) -> Result<(), TransportError>) {
        let now_ns = now_ns();
        if now_ns.saturating_sub(self.checked_ns) < CONNECTION_CHECK_NS {
            return;
        }
        self.checked_ns = now_ns;
        let own = self.reports.ensure_connected().map(|_| ());
        if let Err(error) = own.and_then(|()| check(self, now_ns)) {
            tracing::warn!("{error}");
        }
    }
}

/// Sizes of the messages that a setup and a configuration lead to.
#[must_use]
pub fn channel_sizes(setup: &Setup, configuration: &ScannerConfiguration) -> ChannelSizes {
    let pixels = setup.image_pixels();
    ChannelSizes {
        frame_bytes: pixels * configuration.pixel_format().bytes(),
        window: configuration.measurement.settings.window_images(setup.steps),
        map_blocks: wire::maps::blocks(pixels),
        correspondence_blocks: wire::correspondences::blocks(pixels),
        cloud_bytes: pixels * RECORD_BYTES,
        model_points: configuration.measurement.tracking.channel_points(),
        prior_bytes: wire::prior::payload_bytes(setup.image_size_px),
    }
}

/// File that says where the dashboard of a running instance is, for whoever asks.
#[must_use]
pub fn dashboard_file(instance: &Instance) -> PathBuf {
    accounts_folder(instance).join("dashboard.url")
}

/// Folder of the accounts of an instance. It stands beside the folder of the channels, so that whoever removes that one does
/// not take the accounts with it.
#[must_use]
pub fn accounts_folder(instance: &Instance) -> PathBuf {
    instance.runtime_dir().join(format!("{}.accounts", instance.name()))
}
