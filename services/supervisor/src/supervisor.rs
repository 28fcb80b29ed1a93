//! The loop of the supervisor.
//!
//! In: a [`Plan`], reports of the services, control requests. Out: the state of the scan, and the [`Outcome`].
//!
//! ```text
//! start the services, from the end of the pipeline to its start
//! until the time is up, the source is exhausted, or somebody stops the instance:
//!     publish from the source; restart services that died; receive reports; answer requests
//!     once all services have reported: start the recording, then the scan
//! stop the services in pipeline order, close their accounts, collect the counts
//! ```

use std::fs;
use std::io;
use std::path::PathBuf;
use std::time::Duration;

use fringeflow_config::{CameraSource, ScannerConfiguration};
use fringeflow_message::{DropReason, Stage};
use fringeflow_recording::{Origin, UNFINISHED};
use fringeflow_runtime::{
    Account, AccountError, Preparation, RecorderStatus, ServiceKind, Stop, accounts_folder, channel_sizes, clock,
    note_virtual_images,
};
use fringeflow_transport::{Instance, InstanceLock, Node, check_shared_memory};

use crate::control::Control;
use crate::display::Display;
use crate::plan::{Outcome, Plan, RunError};
use crate::ports::Ports;
use crate::process::Launch;
use crate::reports::Reports;
use crate::service::{Service, ServiceEvent};
use crate::{Balance, Progress, Source};

/// Longest wait for messages in one cycle.
const MAX_WAIT: Duration = Duration::from_millis(50);
/// Longest wait in one cycle while the source waits for the pipeline. Not all progress of the pipeline is reported, so
/// the source must be called to look for it.
const SOURCE_POLL_INTERVAL: Duration = Duration::from_millis(1);
/// Time between two checks of the connections and of dead processes, nanoseconds.
const HOUSEKEEPING_INTERVAL_NS: u64 = 1_000_000_000;
/// Time in which a service must stop before it is killed, nanoseconds.
const STOP_TIMEOUT_NS: u64 = 30_000_000_000;
/// Time in which the recorder must create its file, nanoseconds. After it the scan starts all the same.
const RECORDER_TIMEOUT_NS: u64 = 5_000_000_000;
/// Exit of a service that did its work, but lost items.
const EXIT_WITH_LOSSES: &str = "exit code 3";

/// Runs an instance until its time is up, its `source` is exhausted, somebody stops it, or it fails.
///
/// # Errors
/// [`RunError`]. No service is left running.
pub fn run<'s>(plan: &Plan, source: Option<&'s mut (dyn Source + 's)>) -> Result<Outcome, RunError> {
    let instance = Instance::new(&plan.configuration.name)?;
    check_shared_memory(&channel_sizes(&plan.setup, &plan.configuration))?;
    let lock = InstanceLock::take(&instance)?;
    let accounts = accounts_folder(&instance);
    remove_accounts(&accounts)?;
    let outcome = write_external_config(&instance)
        .and_then(|()| tell_virtual_images(&instance, &plan.configuration))
        .and_then(|()| Supervisor::start(plan, &instance, &accounts, source))
        .and_then(Supervisor::run);
    // The file describes a running instance, so it must not outlive it.
    let _ = fs::remove_file(external_config(&instance));
    remove_accounts(&accounts)?;
    // Last, because this removes all other files of the instance.
    drop(lock);
    outcome
}

/// Path of the iceoryx2 configuration for programs in other languages, beside the folder of the instance.
fn external_config(instance: &Instance) -> PathBuf {
    instance.runtime_dir().join(format!("{}.iceoryx2.toml", instance.name()))
}

fn write_external_config(instance: &Instance) -> Result<(), RunError> {
    let result = fs::write(external_config(instance), instance.external_config()?);
    result.map_err(|source| RunError::System { what: "the configuration for other programs cannot be written", source })
}

/// Says in the log, and for `status`, that no camera takes the images.
fn tell_virtual_images(instance: &Instance, configuration: &ScannerConfiguration) -> Result<(), RunError> {
    if configuration.cameras == CameraSource::Virtual {
        tracing::info!("the images are virtual: the virtual scanner takes them, no camera and no projector");
    }
    let noted = note_virtual_images(instance, configuration);
    noted.map_err(|source| RunError::System { what: "the note about virtual images cannot be written", source })
}

/// Returns how long the loop may wait for messages before it must call the source again.
fn wait_time(progress: Progress) -> Duration {
    match progress {
        Progress::Next(time_ns) => Duration::from_nanos(time_ns.saturating_sub(clock::now_ns())).min(MAX_WAIT),
        Progress::Waiting => SOURCE_POLL_INTERVAL,
        Progress::Finished => Duration::ZERO,
    }
}

fn remove_accounts(accounts: &PathBuf) -> Result<(), RunError> {
    match fs::remove_dir_all(accounts) {
        Err(source) if source.kind() != io::ErrorKind::NotFound => {
            Err(RunError::System { what: "the accounts of the last run cannot be removed", source })
        }
        _ => Ok(()),
    }
}

struct Supervisor<'a, 's> {
    plan: &'a Plan,
    instance: &'a Instance,
    /// Folder of the accounts.
    accounts: &'a PathBuf,
    /// In pipeline order.
    services: Vec<(ServiceKind, Service)>,
    stop: Stop,
    control: Control,
    origin: Origin,
    reports: Reports,
    display: Display,
    ports: Ports,
    /// Time of the last housekeeping.
    housekeeping_ns: u64,
    /// When all services had reported.
    ready_since_ns: Option<u64>,
    /// When the scan started.
    scanning_since_ns: Option<u64>,
    /// Source that replaces cameras and projector.
    source: Option<&'s mut (dyn Source + 's)>,
}

impl<'a, 's> Supervisor<'a, 's> {
    fn start(
        plan: &'a Plan,
        instance: &'a Instance,
        accounts: &'a PathBuf,
        source: Option<&'s mut (dyn Source + 's)>,
    ) -> Result<Self, RunError> {
        let stop =
            Stop::from_signals().map_err(|source| RunError::System { what: "signals cannot be handled", source })?;
        let node = Node::open(instance, "supervisor")?;
        let sizes = channel_sizes(&plan.setup, &plan.configuration);
        let ports = Ports::open(&node, &sizes)?;
        let has_virtual_images = plan.configuration.cameras == CameraSource::Virtual;
        let display = Display::new(source.is_none(), has_virtual_images);
        let relays_log = display.is_terminal();
        let launch = |kind| Launch {
            program: plan.program.clone(),
            global_arguments: plan.global_arguments.clone(),
            service_arguments: plan.arguments.to_command_line(kind),
            relays_log,
        };
        let mut supervisor = Self {
            plan,
            instance,
            accounts,
            services: Vec::new(),
            stop,
            control: Control::new(&plan.configuration),
            origin: Origin::here(),
            reports: Reports::new(plan.trace.as_deref()),
            display,
            ports,
            housekeeping_ns: 0,
            ready_since_ns: None,
            scanning_since_ns: None,
            source,
        };
        if let Some(source) = &mut supervisor.source {
            source.open(&node, &sizes, accounts).map_err(RunError::Source)?;
        }
        // From the end of the pipeline to its start, so that the receivers of a service start before it.
        for &kind in plan.services.iter().rev() {
            let service = Service::start(kind.name(), launch(kind), clock::now_ns());
            let service = service.map_err(|source| RunError::Service { service: kind.name(), source })?;
            supervisor.services.insert(0, (kind, service));
        }
        Ok(supervisor)
    }

    fn run(mut self) -> Result<Outcome, RunError> {
        while !self.is_over() {
            let progress = self.publish_from_source(self.scanning_since_ns.is_some())?;
            if progress == Progress::Finished {
                break;
            }
            self.run_cycle(wait_time(progress))?;
        }
        let failed_services = self.stop_all()?;
        self.close_accounts(&failed_services)?;
        self.display.finish();
        Ok(self.take_outcome(failed_services))
    }

    /// Returns whether the run should end.
    fn is_over(&self) -> bool {
        let scanned_ns = self.scanning_since_ns.map_or(0, |since| clock::now_ns().saturating_sub(since));
        let time_is_up = self.plan.duration_ns.is_some_and(|duration| scanned_ns >= duration);
        self.stop.is_requested() || self.control.should_quit || time_is_up
    }

    /// Lets the source publish everything that is due, if there is a source and `is_scanning` is set.
    fn publish_from_source(&mut self, is_scanning: bool) -> Result<Progress, RunError> {
        match &mut self.source {
            Some(source) if is_scanning => source.publish_due().map_err(RunError::Source),
            _ => Ok(Progress::Next(u64::MAX)),
        }
    }

    /// Runs one cycle of the loop. At its end waits for messages, at most for `timeout`.
    fn run_cycle(&mut self, timeout: Duration) -> Result<(), RunError> {
        let now_ns = clock::now_ns();
        self.poll_services(now_ns)?;
        self.handle_messages();
        self.start_when_ready(now_ns)?;
        self.ports.publish_state(&self.control.state);
        if now_ns.saturating_sub(self.housekeeping_ns) >= HOUSEKEEPING_INTERVAL_NS {
            self.housekeeping_ns = now_ns;
            self.do_housekeeping(now_ns);
        }
        Ok(self.ports.wait(timeout)?)
    }

    /// Receives all waiting reports, and answers all waiting requests.
    fn handle_messages(&mut self) {
        self.ports.receive_reports(&mut self.reports);
        self.ports.answer_requests(&mut self.control);
    }

    /// Restarts services that died. Fails if a service cannot run.
    fn poll_services(&mut self, now_ns: u64) -> Result<(), RunError> {
        for (_, service) in &mut self.services {
            let event = service.poll(now_ns);
            let event = event.map_err(|source| RunError::Service { service: service.name, source })?;
            match event {
                None => {}
                Some(ServiceEvent::Died { exit, delay_ns }) => {
                    let wait_ms = delay_ns / 1_000_000;
                    tracing::warn!(service = service.name, how = exit, wait_ms, "a service died");
                }
                Some(ServiceEvent::Restarted) => tracing::info!(service = service.name, "a service was restarted"),
                Some(ServiceEvent::CannotRun { exit }) => {
                    return Err(RunError::CannotRun { service: service.name, exit });
                }
            }
        }
        Ok(())
    }

    /// Starts the recording, and then the scan, once every service has reported. In this order the recording contains
    /// the first image.
    fn start_when_ready(&mut self, now_ns: u64) -> Result<(), RunError> {
        if self.scanning_since_ns.is_some() || !self.services_not_ready().is_empty() {
            return Ok(());
        }
        let Some(ready_since_ns) = self.ready_since_ns else {
            self.ready_since_ns = Some(now_ns);
            if let Some(file) = &self.plan.recording {
                self.control.start_recording(file).map_err(RunError::Recording)?;
            }
            return Ok(());
        };
        // A recorder that cannot create its file logs why. The scan then starts without it.
        if self.recording_has_started() || now_ns.saturating_sub(ready_since_ns) >= RECORDER_TIMEOUT_NS {
            self.control.start_scan();
            self.scanning_since_ns = Some(now_ns);
        }
        Ok(())
    }

    /// Returns whether the recorder has created its file. Returns true if no recording is planned.
    fn recording_has_started(&self) -> bool {
        let file = self.control.state.recording_file.to_text() + UNFINISHED;
        self.plan.recording.is_none() || PathBuf::from(file).exists()
    }

    /// Checks the connections, removes what dead processes left behind, and updates the display.
    fn do_housekeeping(&mut self, now_ns: u64) {
        if let Err(error) = self.ports.ensure_connected(self.accounts, now_ns) {
            tracing::warn!("{error}");
        }
        match self.instance.clean_dead() {
            Ok(_) => {}
            Err(error) => tracing::warn!("{error}"),
        }
        let waiting = self.startup_status();
        let state = &self.control.state;
        let recorder = RecorderStatus::read(self.instance);
        self.control.early_end = recorder.as_ref().and_then(|recorder| recorder.early_end_of(state)).map(str::to_owned);
        self.display.show(self.reports.run.tally(), state, recorder.as_ref(), waiting.as_deref(), now_ns);
    }

    /// Returns what the scan waits for: a preparation of a service, or services that have not reported. Returns `None`
    /// if all services are ready.
    fn startup_status(&self) -> Option<String> {
        let services = self.services_not_ready();
        if services.is_empty() {
            return None;
        }
        let preparation = Preparation::read(self.instance).map(|preparation| preparation.to_string());
        Some(preparation.unwrap_or_else(|| format!("waiting for the services {}", services.join(", "))))
    }

    /// Returns the services that have not reported yet. Services without stages never report; they count as ready.
    fn services_not_ready(&self) -> Vec<&'static str> {
        let is_ready = |kind: ServiceKind| {
            kind.stages().is_empty()
                || kind.stages().iter().any(|&stage| self.reports.run.tally().stage(stage).is_some())
        };
        self.services.iter().map(|(kind, _)| *kind).filter(|&kind| !is_ready(kind)).map(ServiceKind::name).collect()
    }

    /// Stops the services in pipeline order, so that each still processes all items of those before it. Returns the
    /// services that failed, and how.
    fn stop_all(&mut self) -> Result<Vec<(&'static str, String)>, RunError> {
        let mut failed = Vec::new();
        self.control.state.scanning = 0;
        self.control.state.revision += 1;
        self.ports.publish_state(&self.control.state);
        for index in 0..self.services.len() {
            let deadline_ns = clock::now_ns() + STOP_TIMEOUT_NS;
            self.services[index].1.ask_to_stop();
            loop {
                // Reports, requests and the source go on until the last service has stopped.
                self.handle_messages();
                self.publish_from_source(true)?;
                let (kind, service) = &mut self.services[index];
                let stopped = service.poll_stopped();
                match stopped.map_err(|source| RunError::Service { service: kind.name(), source })? {
                    Some(failure) => {
                        failed.extend(failure.map(|exit| (kind.name(), exit)));
                        break;
                    }
                    None if clock::now_ns() > deadline_ns => {
                        service.kill();
                        failed.push((kind.name(), "did not end in time and was killed".to_owned()));
                        break;
                    }
                    None => self.ports.wait(MAX_WAIT)?,
                }
            }
        }
        self.handle_messages();
        Ok(failed)
    }

    /// Closes the accounts of services that died. Items that a service had taken or should have received count as
    /// dropped.
    fn close_accounts(&self, failed_services: &[(&'static str, String)]) -> Result<(), AccountError> {
        let died = |kind: &ServiceKind| {
            failed_services.iter().any(|(name, exit)| *name == kind.name() && exit != EXIT_WITH_LOSSES)
        };
        for (kind, _) in self.services.iter().filter(|(kind, _)| died(kind)) {
            for &stage in kind.stages() {
                Account::open(self.accounts, stage)?.catch_up(self.accounts, DropReason::Restart)?;
            }
        }
        Ok(())
    }

    fn take_outcome(&mut self, failed_services: Vec<(&'static str, String)>) -> Outcome {
        let account = |stage| Some((stage, Account::read_counts(self.accounts, stage)?));
        let recording = self.control.state.recording_file.to_text();
        let (run, trace) = std::mem::take(&mut self.reports).finish();
        Outcome {
            balance: Balance(Stage::ALL.into_iter().filter_map(account).collect()),
            run,
            origin: self.origin.clone(),
            failed_services,
            restarts: self.services.iter().map(|(_, service)| service.restarts).sum(),
            recording: (!recording.is_empty()).then(|| PathBuf::from(recording)),
            trace,
        }
    }
}

impl Drop for Supervisor<'_, '_> {
    /// Closes the source before the files of the instance are removed.
    fn drop(&mut self) {
        if let Some(source) = &mut self.source {
            source.close();
        }
    }
}
