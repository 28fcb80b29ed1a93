//! The process of a service: its standard input tells it when to end, its log may pass through this process.

use std::io::{self, BufRead, BufReader, Read};
use std::os::unix::process::CommandExt;
use std::process::{Child, ChildStderr, Command, ExitStatus, Stdio};
use std::thread::{self, JoinHandle};

use fringeflow_runtime::log;

use crate::child::Launch;

/// Longest line of a log that is kept whole, bytes.
const LINE_BYTES: u64 = 1 << 16;

/// A running process.
#[derive(Debug)]
pub(crate) struct Process {
    child: Child,
    /// Passes its log on, until it ends.
    relay: Option<JoinHandle<()>>,
}

impl Process {
    /// Starts the service of a name, for the `restarts`-th time after the first.
    pub(crate) fn spawn(name: &str, launch: &Launch, restarts: u32) -> io::Result<Self> {
        let mut command = Command::new(&launch.program);
        command.args(&launch.before).args(["service", name]).args(&launch.behind);
        command.args(["--restarts", &restarts.to_string(), "--supervised"]);
        // The pipe tells the service when its supervisor is gone. A Ctrl-C in the terminal goes to the supervisor alone, which
        // stops the services in their order.
        command.stdin(Stdio::piped()).stdout(Stdio::null()).process_group(0);
        if launch.is_relayed {
            command.stderr(Stdio::piped());
        }
        let mut child = command.spawn()?;
        let relay = child.stderr.take().map(|log| thread::spawn(move || relay(log)));
        Ok(Self { child, relay })
    }

    /// How it ended, if it has; then its last words were passed on.
    pub(crate) fn try_wait(&mut self) -> io::Result<Option<ExitStatus>> {
        let status = self.child.try_wait()?;
        if status.is_some() {
            self.hear_out();
        }
        Ok(status)
    }

    /// Closes the pipe that it listens to.
    pub(crate) fn ask_to_stop(&mut self) {
        drop(self.child.stdin.take());
    }

    /// Ends it at once.
    pub(crate) fn kill(&mut self) {
        // It may have ended just now; either way it is gone after the wait.
        let _ = self.child.kill();
        let _ = self.child.wait();
        self.hear_out();
    }

    /// Waits for the end of the log, which is that of the process: nobody else holds the pipe.
    fn hear_out(&mut self) {
        if let Some(relay) = self.relay.take() {
            // It has nothing to tell beside what it passed on.
            let _ = relay.join();
        }
    }
}

/// Passes lines on until there are no more.
fn relay(log: ChildStderr) {
    let mut log = BufReader::new(log);
    let mut line = Vec::new();
    while matches!((&mut log).take(LINE_BYTES).read_until(b'\n', &mut line), Ok(1..)) {
        if !line.ends_with(b"\n") {
            line.push(b'\n');
        }
        log::pass_on(&line);
        line.clear();
    }
}

#[cfg(test)]
mod tests {
    use std::sync::{Arc, Mutex};
    use std::time::Duration;

    use super::*;

    #[test]
    fn the_last_words_of_a_process_are_passed_on_before_its_end_is_told() {
        let said = Arc::new(Mutex::new(Vec::new()));
        let taker = Arc::clone(&said);
        let _diversion = log::divert(move |line| {
            taker.lock().unwrap().push(String::from_utf8_lossy(line).into_owned());
            Ok(())
        });
        let before = vec!["-c".to_owned(), "echo first >&2; printf last >&2; exit 3".to_owned(), "sh".to_owned()];
        let launch = Launch { program: "/bin/sh".into(), before, behind: Vec::new(), is_relayed: true };
        let mut process = Process::spawn("phase", &launch, 0).unwrap();
        let status = loop {
            if let Some(status) = process.try_wait().unwrap() {
                break status;
            }
            thread::sleep(Duration::from_millis(5));
        };
        assert_eq!(
            (status.code(), said.lock().unwrap().as_slice()),
            (Some(3), &["first\n".to_owned(), "last\n".to_owned()][..])
        );
    }
}
