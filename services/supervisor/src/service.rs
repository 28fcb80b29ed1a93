//! Runs one service as a child process: starts, watches, restarts and stops it.

use std::io;
use std::os::unix::process::ExitStatusExt;
use std::process::ExitStatus;

use crate::process::{Launch, Process};

/// Delay before the first restart, nanoseconds. It doubles with every further restart, up to the maximum.
const MIN_RESTART_DELAY_NS: u64 = 100_000_000;
const MAX_RESTART_DELAY_NS: u64 = 5_000_000_000;
/// A service that ran for longer than this is restarted after the minimum delay again, nanoseconds.
const STABLE_NS: u64 = 5_000_000_000;
/// Exit code for wrong arguments, configuration or environment. A restart would not help.
const EXIT_WRONG_USAGE: i32 = 2;

/// A service of the instance.
#[derive(Debug)]
pub(crate) struct Service {
    pub(crate) name: &'static str,
    pub(crate) restarts: u32,
    launch: Launch,
    state: State,
    /// Delay before the next restart.
    restart_delay_ns: u64,
    /// Time of the last start.
    started_ns: u64,
}

#[derive(Debug)]
enum State {
    Running(Process),
    /// The service died; it restarts at `restart_ns`.
    WaitingToRestart {
        restart_ns: u64,
        exit: String,
    },
    /// The service ended and will not be restarted. Holds the exit of a service that failed.
    Ended(Option<String>),
}

/// Change of a service since the last poll. `exit` says how it ended: `exit code 1` or `signal 9`.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum ServiceEvent {
    /// The service died and will be restarted after the delay.
    Died { exit: String, delay_ns: u64 },
    /// The service was restarted.
    Restarted,
    /// The service cannot run with its arguments, configuration or environment.
    CannotRun { exit: String },
}

impl Service {
    pub(crate) fn start(name: &'static str, launch: Launch, now_ns: u64) -> io::Result<Self> {
        let state = State::Running(Process::spawn(name, &launch, 0)?);
        Ok(Self { name, restarts: 0, launch, state, restart_delay_ns: MIN_RESTART_DELAY_NS, started_ns: now_ns })
    }

    /// Notices the death of the service, and restarts it once the delay is over.
    pub(crate) fn poll(&mut self, now_ns: u64) -> io::Result<Option<ServiceEvent>> {
        match &mut self.state {
            State::Running(process) => match process.try_wait()? {
                Some(status) => Ok(Some(self.handle_death(status, now_ns))),
                None => Ok(None),
            },
            State::WaitingToRestart { restart_ns, .. } if now_ns >= *restart_ns => {
                self.restarts += 1;
                self.state = State::Running(Process::spawn(self.name, &self.launch, self.restarts)?);
                self.started_ns = now_ns;
                Ok(Some(ServiceEvent::Restarted))
            }
            State::WaitingToRestart { .. } | State::Ended(_) => Ok(None),
        }
    }

    /// Schedules a restart, unless the exit code says that it would not help.
    fn handle_death(&mut self, status: ExitStatus, now_ns: u64) -> ServiceEvent {
        let exit = describe(status);
        if status.code() == Some(EXIT_WRONG_USAGE) {
            self.state = State::Ended(Some(exit.clone()));
            return ServiceEvent::CannotRun { exit };
        }
        if now_ns.saturating_sub(self.started_ns) > STABLE_NS {
            self.restart_delay_ns = MIN_RESTART_DELAY_NS;
        }
        let delay_ns = self.restart_delay_ns;
        self.state = State::WaitingToRestart { restart_ns: now_ns + delay_ns, exit: exit.clone() };
        self.restart_delay_ns = (2 * delay_ns).min(MAX_RESTART_DELAY_NS);
        ServiceEvent::Died { exit, delay_ns }
    }

    /// Asks the service to finish its work and exit, by closing its standard input.
    pub(crate) fn ask_to_stop(&mut self) {
        match &mut self.state {
            State::Running(process) => process.ask_to_stop(),
            State::WaitingToRestart { exit, .. } => self.state = State::Ended(Some(std::mem::take(exit))),
            State::Ended(_) => {}
        }
    }

    /// Returns `None` while the service still runs after [`Self::ask_to_stop`]. Once it has ended, returns how it
    /// failed, or `Some(None)` if it succeeded.
    pub(crate) fn poll_stopped(&mut self) -> io::Result<Option<Option<String>>> {
        if let State::Running(process) = &mut self.state {
            let Some(status) = process.try_wait()? else { return Ok(None) };
            self.state = State::Ended((!status.success()).then(|| describe(status)));
        }
        match &self.state {
            State::Ended(exit) => Ok(Some(exit.clone())),
            State::Running(_) | State::WaitingToRestart { .. } => Ok(None),
        }
    }

    /// Kills the service, and waits until it is gone.
    pub(crate) fn kill(&mut self) {
        if let State::Running(process) = &mut self.state {
            process.kill();
        }
        self.state = State::Ended(None);
    }
}

impl Drop for Service {
    fn drop(&mut self) {
        self.kill();
    }
}

fn describe(status: ExitStatus) -> String {
    match (status.code(), status.signal()) {
        (Some(code), _) => format!("exit code {code}"),
        (None, Some(signal)) => format!("signal {signal}"),
        (None, None) => status.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Launches `sh` with a script, which gets the name of the service and all further arguments as its parameters.
    fn launch(script: &str) -> Launch {
        let global_arguments = vec!["-c".to_owned(), script.to_owned(), "sh".to_owned()];
        Launch { program: "/bin/sh".into(), global_arguments, service_arguments: Vec::new(), relays_log: false }
    }

    fn wait_for_event(service: &mut Service, now_ns: u64) -> ServiceEvent {
        loop {
            if let Some(event) = service.poll(now_ns).unwrap() {
                return event;
            }
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
    }

    #[test]
    fn a_service_that_dies_is_restarted_after_growing_delays() {
        let launch = launch("exit 1");
        let mut service = Service::start("phase", launch, 0).unwrap();
        let mut now_ns = 0;
        let delays_ms: Vec<u64> = (0..8)
            .map(|_| {
                let event = wait_for_event(&mut service, now_ns);
                let ServiceEvent::Died { delay_ns, exit } = event else { panic!() };
                assert_eq!(exit, "exit code 1");
                assert_eq!(service.poll(now_ns + delay_ns - 1).unwrap(), None);
                now_ns += delay_ns;
                assert_eq!(service.poll(now_ns).unwrap(), Some(ServiceEvent::Restarted));
                delay_ns / 1_000_000
            })
            .collect();
        assert_eq!(delays_ms, [100, 200, 400, 800, 1600, 3200, 5000, 5000]);
        assert_eq!(service.restarts, 8);
    }

    #[test]
    fn a_service_that_exits_with_code_2_is_not_restarted() {
        let launch = launch("exit 2");
        let mut service = Service::start("phase", launch, 0).unwrap();
        let event = wait_for_event(&mut service, 0);
        assert_eq!(event, ServiceEvent::CannotRun { exit: "exit code 2".to_owned() });
        assert_eq!(service.poll(u64::MAX).unwrap(), None);
    }

    #[test]
    fn a_service_that_is_dead_at_the_stop_counts_as_failed() {
        let launch = launch("exit 1");
        let mut service = Service::start("phase", launch, 0).unwrap();
        wait_for_event(&mut service, 0);
        service.ask_to_stop();
        assert_eq!(service.poll_stopped().unwrap(), Some(Some("exit code 1".to_owned())));
        assert_eq!(service.poll(u64::MAX).unwrap(), None);
    }

    #[test]
    fn closing_the_standard_input_stops_a_service() {
        let launch = launch("read line; exit 0");
        let mut service = Service::start("phase", launch, 0).unwrap();
        assert_eq!(service.poll_stopped().unwrap(), None);
        service.ask_to_stop();
        loop {
            if let Some(failure) = service.poll_stopped().unwrap() {
                assert_eq!(failure, None);
                break;
            }
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
    }
}
