//! A test bench for one instance: its folders and configuration, the commands of a user, and their results.

mod finished_run;
mod live;

use std::ffi::OsStr;
use std::path::PathBuf;
use std::process::{Command, Output};
use std::time::{Duration, Instant};

use serde_json::Value;
use tempfile::TempDir;

use fringeflow_message::{Counts, Stage};
use fringeflow_runtime::{Account, accounts_folder};
use fringeflow_transport::Instance;

pub(crate) use finished_run::FinishedRun;
pub(crate) use live::{Live, send};

/// Name of every instance. Each has its own runtime folder, so equal names do not clash.
pub(crate) const NAME: &str = "t";

/// Fails a test that hangs.
const TIMEOUT: Duration = Duration::from_secs(300);
/// Pause between two looks at a condition.
const POLL_INTERVAL: Duration = Duration::from_millis(10);

/// The object is a plane. The fringes are wide enough for so few pixels.
const CONFIGURATION: &str = r#"
[instance]
name = "t"
[cameras]
source = "virtual"
rate_hz = 25.0
[projector]
driver = "virtual"
[pattern]
steps = 4
period_px = 48.0
[virtual_scanner]
object = "plane"
board = "none"
size_px = [96, 80]
noise = "low"
sd_rad = 0.0
cache = "images"
[virtual_scanner.sweep]
poses = 8
[virtual_scanner.faults]
lost = 0.0
[window]
when_busy = "skip"
[recorder]
folder = "recordings"
min_free_mb = 0
[monitor]
enabled = false
"#;

/// The services of the instance, in pipeline order.
pub(crate) const SERVICES: [&str; 8] =
    ["virtual-projector", "virtual-cameras", "phase", "correspondence", "cloud", "tracking", "recorder", "monitor"];

/// Arguments of a command.
pub(crate) type Arguments<'a> = &'a [&'a dyn AsRef<OsStr>];

/// Folders and configuration of one instance, and the commands on it.
pub(crate) struct Bench {
    folder: TempDir,
}

impl Bench {
    /// Creates a bench with the standard configuration.
    pub(crate) fn new() -> Self {
        Self::with_changes(&[])
    }

    /// Creates a bench with changes to the standard configuration: pairs of a text and its replacement.
    pub(crate) fn with_changes(changes: &[(&str, &str)]) -> Self {
        let change = |text: String, (from, to): &(&str, &str)| {
            assert!(text.contains(from), "{from}");
            text.replace(from, to)
        };
        Self::from_configuration(&changes.iter().fold(CONFIGURATION.to_owned(), change))
    }

    /// Creates a bench with this configuration. It must name the instance [`NAME`].
    pub(crate) fn from_configuration(configuration: &str) -> Self {
        // Paths of sockets must be short.
        let folder = tempfile::Builder::new().prefix("ff").tempdir_in("/tmp").unwrap();
        std::fs::write(folder.path().join("scanner.toml"), configuration).unwrap();
        Self { folder }
    }

    /// Returns the path of a file in the folder of the bench.
    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    pub(crate) fn configuration(&self) -> PathBuf {
        self.path("scanner.toml")
    }

    pub(crate) fn runtime_dir(&self) -> PathBuf {
        self.path("r")
    }

    pub(crate) fn instance(&self) -> Instance {
        Instance::in_folder(&self.runtime_dir(), NAME).unwrap()
    }

    pub(crate) fn command(&self, arguments: Arguments<'_>) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_fringeflow"));
        command.env("FRINGEFLOW_RUNTIME_DIR", self.runtime_dir()).env_remove("FRINGEFLOW_LOG");
        command.args(arguments.iter().map(AsRef::as_ref));
        command
    }

    pub(crate) fn fringeflow(&self, arguments: Arguments<'_>) -> Output {
        self.command(arguments).output().unwrap()
    }

    /// Runs a command, which must end with one of these exit codes. Returns its standard output.
    pub(crate) fn execute(&self, codes: &[i32], arguments: Arguments<'_>) -> String {
        let output = self.fringeflow(arguments);
        let errors = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code().is_some_and(|code| codes.contains(&code)), "{}: {errors}", output.status);
        String::from_utf8(output.stdout).unwrap()
    }

    /// Runs a command as [`Self::execute`] does, and parses the JSON that it prints.
    pub(crate) fn json(&self, codes: &[i32], arguments: Arguments<'_>) -> Value {
        serde_json::from_str(&self.execute(codes, arguments)).unwrap()
    }

    /// Asserts that a command is refused: with exit code 2, and a message on standard error that has all parts `says`.
    pub(crate) fn assert_refused(&self, arguments: Arguments<'_>, says: &[&str]) {
        self.assert_refused_with(2, arguments, says);
    }

    /// [`Self::assert_refused`] with another exit code.
    pub(crate) fn assert_refused_with(&self, code: i32, arguments: Arguments<'_>, says: &[&str]) {
        let output = self.fringeflow(arguments);
        let error = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{error}");
        assert!(output.stdout.is_empty(), "{}", String::from_utf8_lossy(&output.stdout));
        // Log lines may precede the message.
        let message = error.find("fringeflow: ").map_or("", |start| &error[start..]);
        for part in says {
            assert!(message.contains(part), "{part:?} is missing in: {error}");
        }
    }

    /// Starts `fringeflow run`, and waits until the instance scans.
    pub(crate) fn start(&self, arguments: Arguments<'_>) -> Live<'_> {
        let mut live = Live::spawn(self, arguments);
        live.wait_for_scan();
        live
    }

    /// Runs `fringeflow replay` over the channels of the instance.
    pub(crate) fn replay(&self, arguments: Arguments<'_>) -> FinishedRun {
        let output = self.command(arguments).args([NAME, "--json"]).output().unwrap();
        let [summary, log] = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
        FinishedRun::new(output.status.code(), &summary, log)
    }

    /// Runs `fringeflow run` from start to end.
    pub(crate) fn run(&self, arguments: Arguments<'_>) -> FinishedRun {
        Live::spawn(self, arguments).wait_for_end()
    }

    /// Returns the present counts of a stage.
    pub(crate) fn counts(&self, stage: Stage) -> Counts {
        Account::read_counts(&accounts_folder(&self.instance()), stage).unwrap_or_default()
    }

    /// Returns the process of a service, or `None` if it does not run.
    pub(crate) fn pid_of(&self, service: &str) -> Option<u32> {
        let configuration = self.configuration();
        let is_service = |line: &[u8]| {
            let arguments: Vec<&[u8]> = line.split(|&byte| byte == 0).collect();
            arguments.windows(2).any(|pair| pair == [b"service".as_slice(), service.as_bytes()])
                && arguments.contains(&configuration.as_os_str().as_encoded_bytes())
        };
        let processes = std::fs::read_dir("/proc").unwrap().flatten();
        let found = processes.filter_map(|entry| {
            let pid = entry.file_name().to_str()?.parse().ok()?;
            is_service(&std::fs::read(entry.path().join("cmdline")).ok()?).then_some(pid)
        });
        found.max()
    }

    /// Asserts that nothing of an instance is left: no file in the runtime folder, no shared memory, no process.
    pub(crate) fn assert_nothing_left(&self) {
        let entries = |folder: PathBuf| std::fs::read_dir(folder).into_iter().flatten().flatten();
        let left: Vec<_> = entries(self.runtime_dir()).map(|entry| entry.file_name()).collect();
        assert!(left.is_empty(), "in the runtime folder: {left:?}");
        let prefix = self.instance().prefix().to_owned();
        let names = entries("/dev/shm".into()).map(|entry| entry.file_name().to_string_lossy().into_owned());
        let left: Vec<_> = names.filter(|name| name.starts_with(&prefix)).collect();
        assert!(left.is_empty(), "in shared memory: {left:?}");
        for service in SERVICES {
            assert_eq!(self.pid_of(service), None, "{service} still runs");
        }
    }
}

/// Waits until a condition holds. Returns `false` after a timeout.
pub(crate) fn wait_until(mut condition: impl FnMut() -> bool) -> bool {
    let start = Instant::now();
    while !condition() {
        if start.elapsed() > TIMEOUT {
            return false;
        }
        std::thread::sleep(POLL_INTERVAL);
    }
    true
}
