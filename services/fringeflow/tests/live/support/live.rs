//! A running instance.

use std::fs::File;
use std::process::{Child, Stdio};
use std::time::Duration;

use rustix::process::{Pid, Signal, kill_process};

use fringeflow_message::{Command, ControlRequest, Stage};
use fringeflow_transport::request;

use super::{Arguments, Bench, Ended, NAME, wait};

/// Longest wait for an answer; then it is asked again.
const ANSWER: Duration = Duration::from_secs(1);

/// An instance that `fringeflow run` holds; killed when it is dropped.
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

    /// The supervisor's process.
    pub(crate) fn pid(&self) -> u32 {
        self.child.id()
    }

    /// Waits until it is to scan.
    pub(super) fn wait_for_scan(&mut self) {
        let instance = self.bench.instance();
        let asked = ControlRequest { command: Command::State as u32, ..ControlRequest::default() };
        let is_scanning = || request(&instance, &asked, ANSWER).is_ok_and(|response| response.state.scanning != 0);
        let child = &mut self.child;
        assert!(wait(|| child.try_wait().unwrap().is_some() || is_scanning()), "it does not scan");
        assert!(child.try_wait().unwrap().is_none(), "it has ended");
    }

    /// Waits until something is so.
    pub(crate) fn wait_until(&self, what: &str, is: impl FnMut() -> bool) {
        assert!(wait(is), "it never is that {what}");
    }

    /// Waits for so many more clouds.
    pub(crate) fn wait_for_clouds(&self, more: u64) {
        let enough = self.bench.counts(Stage::Cloud).passed + more;
        self.wait_until("there are more clouds", || self.bench.counts(Stage::Cloud).passed >= enough);
    }

    /// Sends a signal to a service, whose process is returned.
    pub(crate) fn signal(&self, service: &str, signal: Signal) -> u32 {
        let pid = self.bench.pid_of(service).unwrap();
        send(pid, signal);
        pid
    }

    /// Asks it to end by `control`, and waits.
    pub(crate) fn quit(self) -> Ended {
        self.bench.done(&[0], &[&"control", &NAME, &"quit"]);
        self.ended()
    }

    /// Kills the supervisor, and nobody else.
    pub(crate) fn kill(mut self) {
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    /// Waits for the end.
    pub(crate) fn ended(mut self) -> Ended {
        let has_ended = wait(|| self.child.try_wait().unwrap().is_some());
        assert!(has_ended, "it does not end");
        let read = |name| std::fs::read_to_string(self.bench.path(name)).unwrap();
        let code = self.child.wait().unwrap().code();
        Ended::new(code, &read("summary.json"), read("log.txt"))
    }
}

impl Drop for Live<'_> {
    fn drop(&mut self) {
        if std::thread::panicking() {
            eprintln!("{}", std::fs::read_to_string(self.bench.path("log.txt")).unwrap_or_default());
        }
        // It may have ended; its services end with it.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Sends a signal to a process.
pub(crate) fn send(pid: u32, signal: Signal) {
    kill_process(Pid::from_raw(pid.try_into().unwrap()).unwrap(), signal).unwrap();
}
