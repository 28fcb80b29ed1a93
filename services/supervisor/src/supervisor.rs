//! The supervisor's loop: services up, reports in, commands answered, services down in order, balance drawn.

use std::fs;
use std::io;
use std::path::PathBuf;
use std::time::Duration;

use fringeflow_message::{DropReason, Stage};
use fringeflow_recording::{Origin, UNFINISHED};
use fringeflow_runtime::{
    Account, AccountError, Preparation, ServiceKind, Stop, accounts_folder, channel_sizes, clock,
};
use fringeflow_transport::{Instance, InstanceLock, Node, check_shared_memory};

use crate::child::{Event, Launch, Service};
use crate::control::Control;
use crate::display::Display;
use crate::plan::{Outcome, Plan, RunError};
use crate::ports::Ports;
use crate::reports::Reports;
use crate::{Balance, Progress, Source};

/// Longest wait for messages.
const TURN: Duration = Duration::from_millis(50);
/// Wait for the pipeline to take what a source put out; not all of it is reported.
const PIPELINE_PAUSE: Duration = Duration::from_millis(1);
/// Time between two looks at connections and dead processes, nanoseconds.
const HOUSEKEEPING_NS: u64 = 1_000_000_000;
/// Time that a service has to finish its work when it is to end, nanoseconds.
const STOP_NS: u64 = 30_000_000_000;

/// Time that the recorder has to begin before the scan does without it, nanoseconds.
const RECORDER_NS: u64 = 5_000_000_000;

/// Runs an instance until its time is over, its `source` is exhausted, somebody stops it, or it cannot go on.
///
/// # Errors
/// [`RunError`]; nothing is left running.
pub fn run<'s>(plan: &Plan, source: Option<&'s mut (dyn Source + 's)>) -> Result<Outcome, RunError> {
    let instance = Instance::new(&plan.configuration.name)?;
    check_shared_memory(&channel_sizes(&plan.setup, &plan.configuration))?;
    let lock = InstanceLock::take(&instance)?;
    let accounts = accounts_folder(&instance);
    remove_folder(&accounts)?;
    let outcome = write_external_config(&instance)
        .and_then(|()| Supervisor::start(plan, &instance, &accounts, source))
        .and_then(Supervisor::run);
    // Whoever reads it after the end would find no instance.
    let _ = fs::remove_file(external_config(&instance));
    remove_folder(&accounts)?;
    // Last: everything of the instance goes with it.
    drop(lock);
    outcome
}

/// The configuration of iceoryx2 for programs in other languages, beside the folder of the instance.
fn external_config(instance: &Instance) -> PathBuf {
    instance.runtime_dir().join(format!("{}.iceoryx2.toml", instance.name()))
}

fn write_external_config(instance: &Instance) -> Result<(), RunError> {
    let written = fs::write(external_config(instance), instance.external_config()?);
    written
        .map_err(|source| RunError::System { what: "the configuration for other programs cannot be written", source })
}

/// How long to rest until a source has something to put out.
fn wait_until(progress: Progress) -> Duration {
    match progress {
        Progress::Next(time_ns) => Duration::from_nanos(time_ns.saturating_sub(clock::now_ns())).min(TURN),
        Progress::Waiting => PIPELINE_PAUSE,
        Progress::Finished => Duration::ZERO,
    }
}

fn remove_folder(folder: &PathBuf) -> Result<(), RunError> {
    match fs::remove_dir_all(folder) {
        Err(source) if source.kind() != io::ErrorKind::NotFound => {
            Err(RunError::System { what: "the accounts of the last run cannot be removed", source })
        }
        _ => Ok(()),
    }
}

struct Supervisor<'a, 's> {
    plan: &'a Plan,
    instance: &'a Instance,
    accounts: &'a PathBuf,
    launch: Launch,
    services: Vec<(ServiceKind, Service)>,
    stop: Stop,
    control: Control,
    origin: Origin,
    reports: Reports,
    display: Display,
    ports: Ports,
    housekeeping_ns: u64,
    /// When all services had given a sign of life.
    ready_since_ns: Option<u64>,
    /// When scanning began.
    scanning_since_ns: Option<u64>,
    /// What puts out images and events in this process, if anything does.
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
            Stop::on_signals().map_err(|source| RunError::System { what: "signals cannot be handled", source })?;
        let node = Node::open(instance, "supervisor")?;
        let sizes = channel_sizes(&plan.setup, &plan.configuration);
        let ports = Ports::open(&node, &sizes)?;
        let display = Display::new(source.is_none());
        let launch = Launch {
            program: plan.program.clone(),
            before: plan.before.clone(),
            behind: plan.arguments.clone(),
            is_relayed: display.is_terminal(),
        };
        let mut supervisor = Self {
            plan,
            instance,
            accounts,
            launch,
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
        // From the end of the pipeline to its beginning: whoever sends is heard.
        for &kind in plan.services.iter().rev() {
            let service = Service::start(kind.name(), &supervisor.launch, clock::now_ns());
            let service = service.map_err(|source| RunError::Service { service: kind.name(), source })?;
            supervisor.services.insert(0, (kind, service));
        }
        Ok(supervisor)
    }

    fn run(mut self) -> Result<Outcome, RunError> {
        while !self.is_over() {
            let progress = self.turn_source(self.scanning_since_ns.is_some())?;
            if progress == Progress::Finished {
                break;
            }
            self.turn(wait_until(progress))?;
        }
        let ended_badly = self.stop_all()?;
        self.close_accounts(&ended_badly)?;
        self.display.finish();
        Ok(self.outcome(ended_badly))
    }

    /// Whether it is time to stop.
    fn is_over(&self) -> bool {
        let scanned_ns = self.scanning_since_ns.map_or(0, |since| clock::now_ns().saturating_sub(since));
        let time_is_up = self.plan.duration_ns.is_some_and(|duration| scanned_ns >= duration);
        self.stop.is_requested() || self.control.is_to_end || time_is_up
    }

    /// Lets the source put out what is due.
    fn turn_source(&mut self, is_scanning: bool) -> Result<Progress, RunError> {
        match &mut self.source {
            Some(source) if is_scanning => source.turn().map_err(RunError::Source),
            _ => Ok(Progress::Next(u64::MAX)),
        }
    }

    /// One turn: children, reports, commands, state, display; then a rest.
    fn turn(&mut self, rest: Duration) -> Result<(), RunError> {
        let now_ns = clock::now_ns();
        self.tend_services(now_ns)?;
        self.listen();
        self.begin_when_ready(now_ns)?;
        self.ports.publish_state(&self.control.state);
        if now_ns.saturating_sub(self.housekeeping_ns) >= HOUSEKEEPING_NS {
            self.housekeeping_ns = now_ns;
            self.keep_house(now_ns);
        }
        Ok(self.ports.wait(rest)?)
    }

    fn listen(&mut self) {
        self.ports.drain(&mut self.reports);
        self.ports.answer(&mut self.control);
    }

    fn tend_services(&mut self, now_ns: u64) -> Result<(), RunError> {
        for (_, service) in &mut self.services {
            let event = service.tend(&self.launch, now_ns);
            let event = event.map_err(|source| RunError::Service { service: service.name, source })?;
            match event {
                None => {}
                Some(Event::Died { how, wait_ns }) => {
                    tracing::warn!(service = service.name, how, wait_ms = wait_ns / 1_000_000, "a service died");
                }
                Some(Event::Restarted) => tracing::info!(service = service.name, "a service was started again"),
                Some(Event::Hopeless { how }) => return Err(RunError::Hopeless { service: service.name, how }),
            }
        }
        Ok(())
    }

    /// Begins to record, then to scan, when every service has given a sign of life: the first image is in the recording.
    fn begin_when_ready(&mut self, now_ns: u64) -> Result<(), RunError> {
        if self.scanning_since_ns.is_some() || !self.waited_for().is_empty() {
            return Ok(());
        }
        let Some(asked_ns) = self.ready_since_ns else {
            self.ready_since_ns = Some(now_ns);
            if let Some(file) = &self.plan.recording {
                self.control.record(file).map_err(RunError::Recording)?;
            }
            return Ok(());
        };
        // A recorder that cannot begin says why; the scan goes on without it.
        if self.recording_has_begun() || now_ns.saturating_sub(asked_ns) >= RECORDER_NS {
            self.control.start();
            self.scanning_since_ns = Some(now_ns);
        }
        Ok(())
    }

    /// Whether the recorder has made the file of the recording that is asked for, if one is.
    fn recording_has_begun(&self) -> bool {
        let file = self.control.state.recording_file.to_text() + UNFINISHED;
        self.plan.recording.is_none() || PathBuf::from(file).exists()
    }

    fn keep_house(&mut self, now_ns: u64) {
        if let Err(error) = self.ports.ensure_connected(self.accounts, now_ns) {
            tracing::warn!("{error}");
        }
        match self.instance.clean_dead() {
            Ok(_) => {}
            Err(error) => tracing::warn!("{error}"),
        }
        let waiting = self.waiting();
        self.display.show(self.reports.run.tally(), &self.control.state, waiting.as_deref(), now_ns);
    }

    /// What the scan waits for: a preparation of a service, or services that have not reported.
    fn waiting(&self) -> Option<String> {
        let services = self.waited_for();
        if services.is_empty() {
            return None;
        }
        let preparation = Preparation::read(self.instance).map(|preparation| preparation.to_string());
        Some(preparation.unwrap_or_else(|| format!("waiting for the services {}", services.join(", "))))
    }

    /// Services that have not reported yet.
    fn waited_for(&self) -> Vec<&'static str> {
        let is_ready = |kind: ServiceKind| {
            kind.stages().is_empty()
                || kind.stages().iter().any(|&stage| self.reports.run.tally().stage(stage).is_some())
        };
        self.services.iter().map(|(kind, _)| *kind).filter(|&kind| !is_ready(kind)).map(ServiceKind::name).collect()
    }

    /// Stops the services in the order of the pipeline: each gets the time to work off what the one before left.
    fn stop_all(&mut self) -> Result<Vec<(&'static str, String)>, RunError> {
        let mut ended_badly = Vec::new();
        self.control.state.scanning = 0;
        self.control.state.revision += 1;
        self.ports.publish_state(&self.control.state);
        for number in 0..self.services.len() {
            let deadline_ns = clock::now_ns() + STOP_NS;
            self.services[number].1.ask_to_stop();
            loop {
                self.listen();
                self.turn_source(true)?;
                let (kind, service) = &mut self.services[number];
                let ended = service.has_ended();
                match ended.map_err(|source| RunError::Service { service: kind.name(), source })? {
                    Some(how) => {
                        ended_badly.extend(how.map(|how| (kind.name(), how)));
                        break;
                    }
                    None if clock::now_ns() > deadline_ns => {
                        service.kill();
                        ended_badly.push((kind.name(), "did not end in time and was killed".to_owned()));
                        break;
                    }
                    None => self.ports.wait(TURN)?,
                }
            }
        }
        self.listen();
        Ok(ended_badly)
    }

    /// Closes the accounts that a service left open by its death.
    fn close_accounts(&self, ended_badly: &[(&'static str, String)]) -> Result<(), AccountError> {
        let died = |kind: &ServiceKind| ended_badly.iter().any(|(name, how)| *name == kind.name() && how != LOSSES);
        for (kind, _) in self.services.iter().filter(|(kind, _)| died(kind)) {
            for &stage in kind.stages() {
                Account::open(self.accounts, stage)?.catch_up(self.accounts, DropReason::Restart)?;
            }
        }
        Ok(())
    }

    fn outcome(&mut self, ended_badly: Vec<(&'static str, String)>) -> Outcome {
        let account = |stage| Some((stage, Account::read(self.accounts, stage)?));
        let recording = self.control.state.recording_file.to_text();
        let (run, trace) = std::mem::take(&mut self.reports).finish();
        Outcome {
            balance: Balance(Stage::ALL.into_iter().filter_map(account).collect()),
            run,
            origin: self.origin.clone(),
            ended_badly,
            restarts: self.services.iter().map(|(_, service)| service.restarts).sum(),
            recording: (!recording.is_empty()).then(|| PathBuf::from(recording)),
            trace,
        }
    }
}

impl Drop for Supervisor<'_, '_> {
    /// The source leaves before the instance is removed.
    fn drop(&mut self) {
        if let Some(source) = &mut self.source {
            source.close();
        }
    }
}

/// How a service ends that has done its work, but lost something on the way.
const LOSSES: &str = "exit code 3";
