//! One service as a child process: started, watched, started again, stopped.

use std::io;
use std::os::unix::process::ExitStatusExt;
use std::path::PathBuf;
use std::process::ExitStatus;

use crate::process::Process;

/// Wait before the first new start; doubled with every further one, up to the longest.
const FIRST_WAIT_NS: u64 = 100_000_000;
const LONGEST_WAIT_NS: u64 = 5_000_000_000;
/// A service that ran this long is started again without much ado.
const SETTLED_NS: u64 = 5_000_000_000;
/// Exit code of a service whose arguments, configuration or surroundings are wrong: starting it again would not help.
const WRONG_USAGE: i32 = 2;

/// How services are started.
#[derive(Clone, Debug)]
pub(crate) struct Launch {
    /// The `fringeflow` command.
    pub(crate) program: PathBuf,
    /// Arguments before the name of the service.
    pub(crate) before: Vec<String>,
    /// Arguments behind it.
    pub(crate) behind: Vec<String>,
    /// Whether their log passes through this process, which draws on the terminal that they would write to.
    pub(crate) is_relayed: bool,
}

/// A service of the instance.
#[derive(Debug)]
pub(crate) struct Service {
    pub(crate) name: &'static str,
    pub(crate) restarts: u32,
    state: State,
    wait_ns: u64,
    started_ns: u64,
}

#[derive(Debug)]
enum State {
    Running(Process),
    /// Died; is started again at a time.
    Waiting {
        until_ns: u64,
        how: String,
    },
    /// Stopped, or beyond help; how, if not well.
    Ended(Option<String>),
}

/// What became of a service since the last look.
#[derive(Debug, PartialEq, Eq)]
pub(crate) enum Event {
    /// It died and will be started again after the wait.
    Died { how: String, wait_ns: u64 },
    /// It was started again.
    Restarted,
    /// It cannot run at all.
    Hopeless { how: String },
}

impl Service {
    pub(crate) fn start(name: &'static str, launch: &Launch, now_ns: u64) -> io::Result<Self> {
        let state = State::Running(Process::spawn(name, launch, 0)?);
        Ok(Self { name, restarts: 0, state, wait_ns: FIRST_WAIT_NS, started_ns: now_ns })
    }

    /// Looks after the service: notices its death, and starts it again when its wait is over.
    pub(crate) fn tend(&mut self, launch: &Launch, now_ns: u64) -> io::Result<Option<Event>> {
        match &mut self.state {
            State::Running(process) => match process.try_wait()? {
                Some(status) => Ok(Some(self.died(status, now_ns))),
                None => Ok(None),
            },
            State::Waiting { until_ns, .. } if now_ns >= *until_ns => {
                self.restarts += 1;
                self.state = State::Running(Process::spawn(self.name, launch, self.restarts)?);
                self.started_ns = now_ns;
                Ok(Some(Event::Restarted))
            }
            State::Waiting { .. } | State::Ended(_) => Ok(None),
        }
    }

    fn died(&mut self, status: ExitStatus, now_ns: u64) -> Event {
        let how = describe(status);
        if status.code() == Some(WRONG_USAGE) {
            self.state = State::Ended(Some(how.clone()));
            return Event::Hopeless { how };
        }
        if now_ns.saturating_sub(self.started_ns) > SETTLED_NS {
            self.wait_ns = FIRST_WAIT_NS;
        }
        let wait_ns = self.wait_ns;
        self.state = State::Waiting { until_ns: now_ns + wait_ns, how: how.clone() };
        self.wait_ns = (2 * wait_ns).min(LONGEST_WAIT_NS);
        Event::Died { how, wait_ns }
    }

    /// Asks the service to finish its work and end: closes the pipe that it listens to.
    pub(crate) fn ask_to_stop(&mut self) {
        match &mut self.state {
            State::Running(process) => process.ask_to_stop(),
            State::Waiting { how, .. } => self.state = State::Ended(Some(std::mem::take(how))),
            State::Ended(_) => {}
        }
    }

    /// Whether it has ended, after [`Self::ask_to_stop`]; how, if not well.
    pub(crate) fn has_ended(&mut self) -> io::Result<Option<Option<String>>> {
        if let State::Running(process) = &mut self.state {
            let Some(status) = process.try_wait()? else { return Ok(None) };
            self.state = State::Ended((!status.success()).then(|| describe(status)));
        }
        match &self.state {
            State::Ended(how) => Ok(Some(how.clone())),
            State::Running(_) | State::Waiting { .. } => Ok(None),
        }
    }

    /// Ends it at once.
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

    /// Starts `sh`, which takes the name and all further arguments as parameters of a script.
    fn launch(script: &str) -> Launch {
        let before = vec!["-c".to_owned(), script.to_owned(), "sh".to_owned()];
        Launch { program: "/bin/sh".into(), before, behind: Vec::new(), is_relayed: false }
    }

    fn wait_for(service: &mut Service, launch: &Launch, now_ns: u64) -> Event {
        loop {
            if let Some(event) = service.tend(launch, now_ns).unwrap() {
                return event;
            }
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
    }

    #[test]
    fn a_service_that_dies_is_started_again_with_growing_waits() {
        let launch = launch("exit 1");
        let mut service = Service::start("phase", &launch, 0).unwrap();
        let mut now_ns = 0;
        let waits: Vec<u64> = (0..8)
            .map(|_| {
                let Event::Died { wait_ns, how } = wait_for(&mut service, &launch, now_ns) else { panic!() };
                assert_eq!(how, "exit code 1");
                assert_eq!(service.tend(&launch, now_ns + wait_ns - 1).unwrap(), None);
                now_ns += wait_ns;
                assert_eq!(service.tend(&launch, now_ns).unwrap(), Some(Event::Restarted));
                wait_ns / 1_000_000
            })
            .collect();
        assert_eq!(waits, [100, 200, 400, 800, 1600, 3200, 5000, 5000]);
        assert_eq!(service.restarts, 8);
    }

    #[test]
    fn wrong_usage_is_hopeless() {
        let launch = launch("exit 2");
        let mut service = Service::start("phase", &launch, 0).unwrap();
        assert_eq!(wait_for(&mut service, &launch, 0), Event::Hopeless { how: "exit code 2".to_owned() });
        assert_eq!(service.tend(&launch, u64::MAX).unwrap(), None);
    }

    #[test]
    fn a_service_that_is_dead_when_it_is_to_stop_did_not_end_well() {
        let launch = launch("exit 1");
        let mut service = Service::start("phase", &launch, 0).unwrap();
        wait_for(&mut service, &launch, 0);
        service.ask_to_stop();
        assert_eq!(service.has_ended().unwrap(), Some(Some("exit code 1".to_owned())));
        assert_eq!(service.tend(&launch, u64::MAX).unwrap(), None);
    }

    #[test]
    fn a_service_hears_that_it_is_to_stop() {
        let launch = launch("read line; exit 0");
        let mut service = Service::start("phase", &launch, 0).unwrap();
        assert_eq!(service.has_ended().unwrap(), None);
        service.ask_to_stop();
        loop {
            if let Some(ended) = service.has_ended().unwrap() {
                assert_eq!(ended, None);
                break;
            }
            std::thread::sleep(std::time::Duration::from_millis(5));
        }
    }
}
