//! Environment of a running service: configuration, setup, its place in the instance, accounts and reports.

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

use crate::clock::{cpu_ns, now_ns};
use crate::{
    Account, AccountError, ArgumentError, PreparationReporter, RecorderStatus, ServiceArgs, Stop, accounts_folder,
};

/// Longest wait of a service for messages. Heartbeats and the reaction to a stop request are late by this at most.
pub const MAX_WAIT: Duration = Duration::from_millis(100);
/// Time between two heartbeats, nanoseconds.
const HEARTBEAT_INTERVAL_NS: u64 = 500_000_000;
/// Time between two checks of the connections, nanoseconds.
const CONNECTION_CHECK_INTERVAL_NS: u64 = 1_000_000_000;
/// Time between two reads of the account of a stage that is waited for.
pub const POLL_INTERVAL: Duration = Duration::from_micros(500);

/// Why a service ended.
#[derive(Debug, thiserror::Error)]
pub enum ServiceError {
    /// Its arguments, or the files that they name.
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    /// A channel.
    #[error(transparent)]
    Transport(#[from] TransportError),
    /// Its account.
    #[error(transparent)]
    Account(#[from] AccountError),
    /// The system refuses signal handlers.
    #[error("signals cannot be handled: {0}")]
    Signals(#[source] std::io::Error),
    /// A problem of this service alone.
    #[error("{0}")]
    Unusable(String),
}

impl ServiceError {
    /// Returns whether a restart would not help, because arguments, files or the machine must change first.
    #[must_use]
    pub fn is_lasting(&self) -> bool {
        match self {
            Self::Argument(_) | Self::Unusable(_) => true,
            Self::Transport(error) => error.is_lasting(),
            Self::Account(_) | Self::Signals(_) => false,
        }
    }
}

/// Environment of a service of an instance.
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
    /// Request to stop the service.
    pub stop: Stop,
    accounts: PathBuf,
    restarts: u32,
    /// Processors that the instance may use. The configuration may give this service fewer.
    processors: u64,
    /// Number of items that this service may have in work at once.
    at_once: u64,
    reports: Publisher<(), StageReport>,
    last_heartbeat_ns: u64,
    last_check_ns: u64,
}

/// Times of an item that a stage has finished.
#[derive(Clone, Copy, Debug, Default)]
pub struct ItemTimes {
    /// Start of its last exposure.
    pub exposure_start_ns: u64,
    /// Arrival of its last image on this machine.
    pub received_ns: u64,
    /// When the stage took it.
    pub taken_ns: u64,
    /// When the stage passed it on.
    pub passed_ns: u64,
    /// How long it waited in the stage: for windows before it, or for the next stage.
    pub waited_ns: u64,
}

impl Host {
    /// Reads configuration and setup, applies the CPUs, threads, priority and memory lock that are configured for
    /// service `name`, and joins the instance under that name.
    ///
    /// # Errors
    /// [`ServiceError`].
    pub fn open(arguments: &ServiceArgs, name: &'static str) -> Result<Self, ServiceError> {
        let configuration = arguments.configuration()?;
        // Before this service is limited to some of them. The number is 0 if the system does not tell it.
        let processors = std::thread::available_parallelism().map_or(0, |number| number.get() as u64);
        // Before any thread starts: threads inherit CPUs and priority.
        let grants = arguments.apply_processors(&configuration, name)?;
        let stop = Stop::from_signals().map_err(ServiceError::Signals)?;
        if arguments.supervised {
            stop.watch_stdin();
        }
        let setup = arguments.setup(&configuration)?;
        let instance = Instance::new(&configuration.name)?;
        let node = Node::open(&instance, name)?;
        let sizes = channel_sizes(&setup, &configuration);
        let reports = Publisher::open(&node, REPORT_STAGE, &sizes)?;
        let accounts = accounts_folder(&instance);
        if let Some(grants) = grants {
            grants.publish(&accounts, name);
        }
        Ok(Self {
            configuration,
            setup,
            node,
            sizes,
            stop,
            accounts,
            restarts: arguments.restarts,
            processors,
            at_once: 1,
            reports,
            last_heartbeat_ns: 0,
            last_check_ns: 0,
        })
    }

    /// Returns how often this service was restarted in this instance.
    #[must_use]
    pub fn restarts(&self) -> u32 {
        self.restarts
    }

    /// Sets how many items this service may have in work at once; its reports tell it.
    pub(crate) fn set_at_once(&mut self, items: usize) {
        self.at_once = items as u64;
    }

    /// Begins a preparation of `total` parts that this service needs before it can work. Other processes can read its
    /// progress.
    #[must_use]
    pub fn begin_preparation(&self, what: &str, total: u64) -> PreparationReporter {
        PreparationReporter::new(&self.accounts, what, total)
    }

    /// Tells other processes what the recorder does.
    pub fn publish_recorder_status(&self, status: &RecorderStatus) {
        status.write(&self.accounts);
    }

    /// Opens the account of a stage that this service keeps.
    ///
    /// # Errors
    /// The file cannot be read or written.
    pub fn open_account(&self, stage: Stage) -> Result<Account, AccountError> {
        Account::open(&self.accounts, stage)
    }

    /// Reads the counts of a stage that another service keeps. Returns `None` if the stage has no account.
    #[must_use]
    pub fn read_counts(&self, stage: Stage) -> Option<Counts> {
        Account::read_counts(&self.accounts, stage)
    }

    /// Reads session and number of the last item that a stage passed on. Returns `None` if there is none.
    #[must_use]
    pub fn read_last_item(&self, stage: Stage) -> Option<[u64; 2]> {
        Account::read_last_item(&self.accounts, stage)
    }

    /// Counts items as lost that the stages before sent while this service did not listen.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn catch_up(&self, account: &mut Account, reason: DropReason) -> Result<(), AccountError> {
        account.catch_up(&self.accounts, reason)
    }

    /// Returns whether the stages before have sent items that have not arrived.
    #[must_use]
    pub fn is_behind(&self, account: &Account) -> bool {
        account.is_behind(&self.accounts)
    }

    /// Opens a port again if it lost its publisher; see [`ensure_connected`](crate::ensure_connected).
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

    /// Returns whether the next stage has taken all items that this stage passed on, or has no account. Then both
    /// stages work at the same time, and no item waits between them.
    #[must_use]
    pub fn is_free(&self, next: Stage, account: &Account) -> bool {
        self.read_counts(next).is_none_or(|counts| counts.taken >= account.counts().passed)
    }

    /// Waits until the next stage is free or the service is to stop. Returns at once unless the configuration has
    /// `window.when_busy = "wait"`, so that no window is lost.
    pub fn wait_until_free(&self, next: Stage, account: &Account) {
        while self.configuration.wait_when_busy && !self.is_free(next, account) && !self.stop.is_requested() {
            std::thread::sleep(POLL_INTERVAL);
        }
    }

    /// Reports the counts of a stage, and the times of the item that it finished.
    pub fn report(&mut self, stage: Stage, counts: &Counts, item: Option<ItemTimes>) {
        self.report_with_skew(stage, counts, item, Skew::default());
    }

    /// Reports as [`Self::report`] does, with the skew of the image pairs since the previous report.
    pub fn report_with_skew(&mut self, stage: Stage, counts: &Counts, item: Option<ItemTimes>, skew: Skew) {
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
            work_ns: times.passed_ns.saturating_sub(times.taken_ns).saturating_sub(times.waited_ns),
            cpu_ns: cpu_ns(),
            processors: self.processors,
            at_once: self.at_once,
            counts: *counts,
            skew,
        };
        // A lost report must not end the service: the account has the counts, and so does the next report.
        if let Err(error) = self.reports.send_message(&report) {
            tracing::debug!(%error, "the report was not sent");
        }
    }

    /// Returns whether a heartbeat is due. If so, it counts as sent.
    pub fn is_heartbeat_due(&mut self) -> bool {
        let now_ns = now_ns();
        let is_due = now_ns.saturating_sub(self.last_heartbeat_ns) >= HEARTBEAT_INTERVAL_NS;
        if is_due {
            self.last_heartbeat_ns = now_ns;
        }
        is_due
    }

    /// Checks the connections about once a second; `check_ports` checks the ports of the service itself. An error is
    /// logged, and the next check tries again.
    pub fn check_connections(&mut self, check_ports: impl FnOnce(&Self, u64) -> Result<(), TransportError>) {
        let now_ns = now_ns();
        if now_ns.saturating_sub(self.last_check_ns) < CONNECTION_CHECK_INTERVAL_NS {
            return;
        }
        self.last_check_ns = now_ns;
        let reports = self.reports.ensure_connected().map(|_| ());
        if let Err(error) = reports.and_then(|()| check_ports(self, now_ns)) {
            tracing::warn!("{error}");
        }
    }
}

/// Returns the sizes of the messages for a setup and a configuration.
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

/// Returns the file that holds the address of the dashboard while an instance runs.
#[must_use]
pub fn dashboard_file(instance: &Instance) -> PathBuf {
    accounts_folder(instance).join("dashboard.url")
}
