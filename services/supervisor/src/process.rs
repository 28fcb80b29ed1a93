//! The process of a service. Closing its standard input asks it to stop. This process can relay its log.

use std::io::{self, BufRead, BufReader, Read};
use std::os::unix::process::CommandExt;
use std::path::PathBuf;
use std::process::{Child, ChildStderr, Command, ExitStatus, Stdio};
use std::thread::{self, JoinHandle};

use fringeflow_runtime::log;

/// Longer lines of a log are split, bytes.
const MAX_LINE_BYTES: u64 = 1 << 16;

/// Command line of a service.
#[derive(Clone, Debug)]
pub(crate) struct Launch {
    /// The `fringeflow` executable.
    pub(crate) program: PathBuf,
    /// Arguments before `service NAME`.
    pub(crate) global_arguments: Vec<String>,
    /// Arguments after `service NAME`.
    pub(crate) service_arguments: Vec<String>,
    /// Whether this process relays the logs of the services, because it draws on the same terminal.
    pub(crate) relays_log: bool,
}

/// A running process.
#[derive(Debug)]
pub(crate) struct Process {
    child: Child,
    /// Thread that relays the log until the process ends.
    relay: Option<JoinHandle<()>>,
}

impl Process {
    /// Starts the service `name`, after `restarts` earlier restarts in this instance.
    pub(crate) fn spawn(name: &str, launch: &Launch, restarts: u32) -> io::Result<Self> {
        let mut command = Command::new(&launch.program);
        command.args(&launch.global_arguments).args(["service", name]).args(&launch.service_arguments);
        command.args(["--restarts", &restarts.to_string(), "--supervised"]);
        // The service stops when its standard input closes, even if the supervisor is killed. In a process group of its
        // own it gets no Ctrl-C from the terminal: only the supervisor does, and stops the services in order.
        command.stdin(Stdio::piped()).stdout(Stdio::null()).process_group(0);
        if launch.relays_log {
            command.stderr(Stdio::piped());
        }
        let mut child = command.spawn()?;
        let relay = child.stderr.take().map(|log| thread::spawn(move || relay_log(log)));
        Ok(Self { child, relay })
    }

    /// Returns the exit status if the process has ended. By then its whole log has been relayed.
    pub(crate) fn try_wait(&mut self) -> io::Result<Option<ExitStatus>> {
        let status = self.child.try_wait()?;
        if status.is_some() {
            self.join_relay();
        }
        Ok(status)
    }

    /// Closes the standard input of the process, which asks it to stop.
    pub(crate) fn ask_to_stop(&mut self) {
        drop(self.child.stdin.take());
    }

    /// Kills the process, and waits until it is gone.
    pub(crate) fn kill(&mut self) {
        // Errors are ignored: the process may already have ended.
        let _ = self.child.kill();
        let _ = self.child.wait();
        self.join_relay();
    }

    /// Waits until the log is fully relayed. It ends with the process, which alone holds the other end of the pipe.
    fn join_relay(&mut self) {
        if let Some(relay) = self.relay.take() {
            // The thread returns nothing.
            let _ = relay.join();
        }
    }
}

/// Relays the lines of a log until it ends.
fn relay_log(log: ChildStderr) {
    let mut log = BufReader::new(log);
    let mut line = Vec::new();
    while matches!((&mut log).take(MAX_LINE_BYTES).read_until(b'\n', &mut line), Ok(1..)) {
        if !line.ends_with(b"\n") {
            line.push(b'\n');
        }
        log::forward_line(&line);
        line.clear();
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, Mutex};
    use std::time::Duration;

    use super::*;

    #[test]
    fn the_whole_log_of_a_process_is_relayed_before_its_exit_is_reported() {
        let relayed = Arc::new(Mutex::new(Vec::new()));
        let lines = Arc::clone(&relayed);
        let _diversion = log::redirect(move |line| {
            lines.lock().unwrap().push(String::from_utf8_lossy(line).into_owned());
            Ok(())
        });
        let global_arguments =
            vec!["-c".to_owned(), "echo first >&2; printf last >&2; exit 3".to_owned(), "sh".to_owned()];
        let launch =
            Launch { program: "/bin/sh".into(), global_arguments, service_arguments: Vec::new(), relays_log: true };
        let mut process = Process::spawn("phase", &launch, 0).unwrap();
        let status = loop {
            if let Some(status) = process.try_wait().unwrap() {
                break status;
            }
            thread::sleep(Duration::from_millis(5));
        };
        assert_eq!(
            (status.code(), relayed.lock().unwrap().as_slice()),
            (Some(3), &["first\n".to_owned(), "last\n".to_owned()][..])
        );
    }
}
