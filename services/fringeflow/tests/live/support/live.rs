//! A running instance.

use std::fs::File;
use std::process::{Child, Stdio};
use std::time::Duration;

use rustix::process::{Pid, Signal, kill_process};

use fringeflow_message::{Command, ControlRequest, Stage};
use fringeflow_transport::request;

use super::{Arguments, Bench, FinishedRun, NAME, wait_until};

/// Longest wait for an answer; after it the request is repeated.
const ANSWER_TIMEOUT: Duration = Duration::from_secs(1);

/// An instance that is run by `fringeflow run`; killed when dropped.
pub(crate) struct Live<'a> {
    bench: &'a Bench,
    child: Child,
}

impl<'a> Live<'a> {
    /// Starts `fringeflow run`.
    pub(super) fn spawn(bench: &'a Bench, arguments: Arguments<'_>) -> Self {
        let mut command = bench.command(&[&"run", &"--json", &"--config", &bench.configuration()]);
        command.args(arguments.iter().map(AsRef::as_ref)).stdin(Stdio::null());
        command.stdout(File::create(bench.path("summary.json")).unwrap());
        command.stderr(File::create(bench.path("log.txt")).unwrap());
        Self { bench, child: command.spawn().unwrap() }
    }

    /// Returns the process of the supervisor.
    pub(crate) fn pid(&self) -> u32 {
        self.child.id()
    }

    /// Waits until the instance scans.
    pub(super) fn wait_for_scan(&mut self) {
        let instance = self.bench.instance();
        let asked = ControlRequest { command: Command::State as u32, ..ControlRequest::default() };
        let is_scanning =
            || request(&instance, &asked, ANSWER_TIMEOUT).is_ok_and(|response| response.state.scanning != 0);
        let child = &mut self.child;
        assert!(wait_until(|| child.try_wait().unwrap().is_some() || is_scanning()), "the scan does not start");
        assert!(child.try_wait().unwrap().is_none(), "the instance has ended");
    }

    /// Waits until a condition holds. `what` names it in the failure message.
    pub(crate) fn wait_until(&self, what: &str, condition: impl FnMut() -> bool) {
        assert!(wait_until(condition), "timed out while waiting until {what}");
    }

    /// Waits for this number of further clouds.
    pub(crate) fn wait_for_clouds(&self, more: u64) {
        let target = self.bench.counts(Stage::Cloud).passed + more;
        self.wait_until("there are more clouds", || self.bench.counts(Stage::Cloud).passed >= target);
    }

    /// Sends a signal to the process of a service. Returns the process.
    pub(crate) fn signal(&self, service: &str, signal: Signal) -> u32 {
        let pid = self.bench.pid_of(service).unwrap();
        send(pid, signal);
        pid
    }

    /// Stops the instance by `fringeflow control`, and waits for its end.
    pub(crate) fn quit(self) -> FinishedRun {
        self.bench.execute(&[0], &[&"control", &NAME, &"quit"]);
        self.wait_for_end()
    }

    /// Kills the supervisor alone.
    pub(crate) fn kill_supervisor(mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    /// Waits until the instance has ended.
    pub(crate) fn wait_for_end(mut self) -> FinishedRun {
        let has_ended = wait_until(|| self.child.try_wait().unwrap().is_some());
        assert!(has_ended, "the instance does not end");
        let read = |name| std::fs::read_to_string(self.bench.path(name)).unwrap();
        let code = self.child.wait().unwrap().code();
        FinishedRun::new(code, &read("summary.json"), read("log.txt"))
    }
}

impl Drop for Live<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            eprintln!("{}", std::fs::read_to_string(self.bench.path("log.txt")).unwrap_or_default());
        }
        // Errors are ignored: it may have ended already. Its services end with it.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Sends a signal to a process.
pub(crate) fn send(pid: u32, signal: Signal) {
    kill_process(Pid::from_raw(pid.try_into().unwrap()).unwrap(), signal).unwrap();
}
