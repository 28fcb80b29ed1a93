//! An instance in folders of its own: its configuration, the commands that a user gives, and what comes of them.

mod ended;
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

pub(crate) use ended::Ended;
pub(crate) use live::{Live, send};

/// Name of every instance; the folders tell them apart.
pub(crate) const NAME: &str = "t";

/// Only there against hanging.
const HANG: Duration = Duration::from_secs(60);
const PAUSE: Duration = Duration::from_millis(10);

/// A plane before fringes wide enough for so few pixels.
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

/// The services of the instance, in the order of the pipeline.
pub(crate) const SERVICES: [&str; 8] =
    ["virtual-projector", "virtual-cameras", "phase", "correspondence", "cloud", "tracking", "recorder", "monitor"];

/// Arguments of a command.
pub(crate) type Arguments<'a> = &'a [&'a dyn AsRef<OsStr>];

/// Folders and configuration of one instance.
pub(crate) struct Bench {
    folder: TempDir,
}

impl Bench {
    pub(crate) fn new() -> Self {
        Self::with(&[])
    }

    /// With parts of the configuration replaced.
    pub(crate) fn with(changes: &[(&str, &str)]) -> Self {
        let change = |text: String, (from, to): &(&str, &str)| {
            assert!(text.contains(from), "{from}");
            text.replace(from, to)
        };
        Self::of(&changes.iter().fold(CONFIGURATION.to_owned(), change))
    }

    /// With this configuration, of an instance called [`NAME`].
    pub(crate) fn of(configuration: &str) -> Self {
        // Sockets have short names.
        let folder = tempfile::Builder::new().prefix("ff").tempdir_in("/tmp").unwrap();
        std::fs::write(folder.path().join("scanner.toml"), configuration).unwrap();
        Self { folder }
    }

    /// A file of this name.
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

    /// A command that must end with one of these exit codes; its standard output.
    pub(crate) fn done(&self, codes: &[i32], arguments: Arguments<'_>) -> String {
        let output = self.fringeflow(arguments);
        let said = String::from_utf8_lossy(&output.stderr);
        assert!(output.status.code().is_some_and(|code| codes.contains(&code)), "{}: {said}", output.status);
        String::from_utf8(output.stdout).unwrap()
    }

    /// [`Self::done`] of a command that prints JSON.
    pub(crate) fn json(&self, codes: &[i32], arguments: Arguments<'_>) -> Value {
        serde_json::from_str(&self.done(codes, arguments)).unwrap()
    }

    /// A command that must be refused: with exit code 2, and a message on standard error that holds all of `says`.
    pub(crate) fn refused(&self, arguments: Arguments<'_>, says: &[&str]) {
        self.refused_with(2, arguments, says);
    }

    /// [`Self::refused`] with another exit code.
    pub(crate) fn refused_with(&self, code: i32, arguments: Arguments<'_>, says: &[&str]) {
        let output = self.fringeflow(arguments);
        let error = String::from_utf8_lossy(&output.stderr);
        assert_eq!(output.status.code(), Some(code), "{error}");
        assert!(output.stdout.is_empty(), "{}", String::from_utf8_lossy(&output.stdout));
        // Log lines may stand before it.
        let message = error.find("fringeflow: ").map_or("", |start| &error[start..]);
        for part in says {
            assert!(message.contains(part), "{part:?} is missing in: {error}");
        }
    }

    /// Starts `fringeflow run`, and waits until it scans.
    pub(crate) fn start(&self, arguments: Arguments<'_>) -> Live<'_> {
        let mut live = Live::spawn(self, arguments);
        live.wait_for_scan();
        live
    }

    /// `fringeflow replay` over the channels of the instance.
    pub(crate) fn replay(&self, arguments: Arguments<'_>) -> Ended {
        let output = self.command(arguments).args([NAME, "--json"]).output().unwrap();
        let [summary, log] = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
        Ended::new(output.status.code(), &summary, log)
    }

    /// `fringeflow run` from beginning to end.
    pub(crate) fn run(&self, arguments: Arguments<'_>) -> Ended {
        Live::spawn(self, arguments).ended()
    }

    /// The account of a stage as it stands.
    pub(crate) fn counts(&self, stage: Stage) -> Counts {
        Account::read(&accounts_folder(&self.instance()), stage).unwrap_or_default()
    }

    /// The process of a service, if it runs.
    pub(crate) fn pid_of(&self, service: &str) -> Option<u32> {
        let configuration = self.configuration();
        let is_it = |line: &[u8]| {
            let arguments: Vec<&[u8]> = line.split(|&byte| byte == 0).collect();
            arguments.windows(2).any(|pair| pair == [b"service".as_slice(), service.as_bytes()])
                && arguments.contains(&configuration.as_os_str().as_encoded_bytes())
        };
        let processes = std::fs::read_dir("/proc").unwrap().flatten();
        let found = processes.filter_map(|entry| {
            let pid = entry.file_name().to_str()?.parse().ok()?;
            is_it(&std::fs::read(entry.path().join("cmdline")).ok()?).then_some(pid)
        });
        found.max()
    }

    /// Asserts that nothing of any instance is left: no file in the runtime folder, no shared memory, no process.
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

/// Waits until something is so; `false` if it never is.
pub(crate) fn wait(mut is: impl FnMut() -> bool) -> bool {
    let start = Instant::now();
    while !is() {
        if start.elapsed() > HANG {
            return false;
        }
        std::thread::sleep(PAUSE);
    }
    true
}
