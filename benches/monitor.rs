//! Cost of the monitor during a scan:
//! `cargo bench -p fringeflow-command --bench monitor [-- [cpu | pages] SECONDS ROUNDS]`.
//!
//! Makes two comparisons. The two sides of each take turns, so changes in the speed of the machine affect both alike.
//!
//! 1. `cpu`: CPU time of whole instances of `configs/demo.toml`, with the monitor on (no page open) and off;
//! 2. `pages`: clouds per second and median time from exposure to cloud of one instance, without pages and with fifty,
//!    ten of which never read.

// A bench that cannot prepare its work panics.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic, clippy::print_stdout, missing_docs)]

use std::fmt;
use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread::JoinHandle;
use std::time::Duration;

use serde_json::Value;
use tungstenite::{Message, WebSocket};

use fringeflow_supervisor::observe;
use fringeflow_transport::Instance;

/// Number of pages, and how many of them never read.
const PAGES: usize = 50;
const SILENT: usize = 10;
/// Time between a change and the measurement.
const SETTLING_TIME: Duration = Duration::from_secs(3);

fn main() {
    let numbers: Vec<u64> = std::env::args().filter_map(|argument| argument.parse().ok()).collect();
    let seconds = numbers.first().copied().unwrap_or(20);
    let rounds = numbers.get(1).copied().unwrap_or(5);
    let folder = tempfile::Builder::new().prefix("ffbench").tempdir_in("/tmp").unwrap();
    let is_selected = |part: &str, other: &str| has_argument(part) || !has_argument(other);
    if is_selected("cpu", "pages") {
        compare_cpu_time(folder.path(), seconds, rounds);
    }
    if is_selected("pages", "cpu") {
        compare_pages(folder.path(), seconds, rounds);
    }
}

fn has_argument(name: &str) -> bool {
    std::env::args().any(|argument| argument == name)
}

fn compare_cpu_time(folder: &Path, seconds: u64, rounds: u64) {
    println!("CPU seconds of an instance over {seconds} s, with the monitor off and on:");
    let (off, on) = (configuration(folder, false), configuration(folder, true));
    run_for(folder, &off, 1);
    let mut ratios = Vec::new();
    for _ in 0..rounds {
        let [off, on] = [&off, &on].map(|configuration| cpu_s(|| run_for(folder, configuration, seconds)));
        ratios.push(on / off);
        println!("  off {off:.2}, on {on:.2}: {:+.1} %", 100.0 * (on / off - 1.0));
    }
    println!("  median {:+.1} %", 100.0 * (median(&mut ratios) - 1.0));
}

fn compare_pages(folder: &Path, seconds: u64, rounds: u64) {
    println!("clouds per second, and median ms from exposure to cloud, without pages and with {PAGES}:");
    let instance = Running::start(folder, &configuration(folder, true));
    let (mut rates, mut latencies) = (Vec::new(), Vec::new());
    for _ in 0..rounds {
        let [without, with] = [0, PAGES].map(|pages| instance.measure(pages, seconds));
        rates.push(with.clouds_hz / without.clouds_hz);
        latencies.push(with.p50_ms / without.p50_ms);
        println!("  without {without}; with {with}");
    }
    let [rate, latency] = [rates, latencies].map(|mut ratios| 100.0 * (median(&mut ratios) - 1.0));
    println!("  median: rate {rate:+.1} %, latency {latency:+.1} %");
}

/// Performance of a scan.
struct Measured {
    clouds_hz: f64,
    /// Median time from exposure to cloud.
    p50_ms: f64,
    /// CPU time of the monitor, percent of a core.
    monitor_percent: f64,
}

impl fmt::Display for Measured {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { clouds_hz, p50_ms, monitor_percent } = self;
        write!(f, "{clouds_hz:.2}/s {p50_ms:.1} ms, monitor {monitor_percent:.1} % of a core")
    }
}

/// A running instance with its dashboard.
struct Running {
    child: Child,
    instance: Instance,
    address: String,
}

impl Running {
    fn start(folder: &Path, configuration: &Path) -> Self {
        let child = command(folder, configuration).stdout(Stdio::null()).spawn().unwrap();
        let url = folder.join("r/bench.accounts/dashboard.url");
        let address = loop {
            match std::fs::read_to_string(&url) {
                Ok(url) if url.ends_with('/') => break url.split('/').nth(2).unwrap().to_owned(),
                _ => std::thread::sleep(Duration::from_millis(100)),
            }
        };
        let instance = Instance::in_folder(&folder.join("r"), "bench").unwrap();
        let instance = Self { child, instance, address };
        while instance.figures()["exposure_to_cloud"].is_null() {
            std::thread::sleep(Duration::from_secs(1));
        }
        instance
    }

    /// Measures the scan with this number of pages.
    fn measure(&self, pages: usize, seconds: u64) -> Measured {
        let stop = Arc::new(AtomicBool::new(false));
        let pages: Vec<_> = (0..pages).map(|number| self.open_page(number < SILENT, &stop)).collect();
        std::thread::sleep(SETTLING_TIME);
        let total = *observe(&self.instance, seconds * 1_000_000_000).unwrap().tally.total().brief().as_ref().unwrap();
        let services = self.figures()["services"].take();
        let monitor = services.as_array().unwrap().iter().find(|service| service["name"] == "monitor").unwrap();
        stop.store(true, Ordering::Relaxed);
        pages.into_iter().for_each(|page| page.join().unwrap());
        Measured {
            clouds_hz: total.count as f64 / seconds as f64,
            p50_ms: total.p50_ms,
            monitor_percent: monitor["cpu_percent"].as_f64().unwrap_or_default(),
        }
    }

    /// Opens a page in its own thread. A page that reads acknowledges each message at once. Usually pages are on other
    /// machines, so here their threads have the lowest priority.
    fn open_page(&self, is_silent: bool, stop: &Arc<AtomicBool>) -> JoinHandle<()> {
        let (address, stop) = (self.address.clone(), Arc::clone(stop));
        std::thread::spawn(move || {
            let _ = rustix::process::nice(19);
            let stream = TcpStream::connect(&address).unwrap();
            stream.set_read_timeout(Some(Duration::from_millis(500))).unwrap();
            let (mut page, _) = tungstenite::client(format!("ws://{address}/live"), stream).unwrap();
            page.send(Message::text(r#"{"type": "want", "pictures": true, "cloud": true}"#)).unwrap();
            while !stop.load(Ordering::Relaxed) {
                if is_silent {
                    std::thread::sleep(Duration::from_millis(100));
                } else {
                    acknowledge_next(&mut page);
                }
            }
        })
    }

    fn figures(&self) -> Value {
        let mut stream = TcpStream::connect(&self.address).unwrap();
        write!(stream, "GET /figures HTTP/1.1\r\nHost: {}\r\nConnection: close\r\n\r\n", self.address).unwrap();
        let mut answer = String::new();
        stream.read_to_string(&mut answer).unwrap();
        serde_json::from_str(answer.split_once("\r\n\r\n").unwrap().1).unwrap_or_default()
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Receives the next message, if there is one, and acknowledges it as drawn.
fn acknowledge_next(page: &mut WebSocket<TcpStream>) {
    let Ok(Message::Binary(message)) = page.read() else { return };
    let length = u32::from_le_bytes(message[..4].try_into().unwrap()) as usize;
    let header: Value = serde_json::from_slice(&message[4..4 + length]).unwrap();
    let _ = page.send(Message::text(format!(r#"{{"type": "shown", "id": {}}}"#, header["id"])));
}

/// Writes the configuration of the demo under another name, with the monitor on or off.
fn configuration(folder: &Path, is_on: bool) -> PathBuf {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").canonicalize().unwrap();
    let demo = std::fs::read_to_string(root.join("configs/demo.toml")).unwrap();
    let images = root.join("demo-output/demo.images");
    let text = demo
        .replace("name = \"demo\"", "name = \"bench\"")
        .replace("\"../demo-output/demo.images\"", &format!("{images:?}"))
        .replace("\"../demo-output\"", &format!("{folder:?}"));
    let (others, monitor) = text.split_once("[monitor]").unwrap();
    let settings = format!("enabled = {is_on}\naddress = \"127.0.0.1:0\"\nfoxglove = \"127.0.0.1:0\"");
    let text = format!("{others}[monitor]{}", monitor.replacen("enabled = true", &settings, 1));
    let file = folder.join(format!("monitor-{is_on}.toml"));
    std::fs::write(&file, text).unwrap();
    file
}

fn command(folder: &Path, configuration: &Path) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_fringeflow"));
    command.env("FRINGEFLOW_RUNTIME_DIR", folder.join("r")).env("FRINGEFLOW_LOG", "error");
    command.args(["run", "--no-report", "--config"]).arg(configuration).stdin(Stdio::null());
    command
}

fn run_for(folder: &Path, configuration: &Path, seconds: u64) {
    let status =
        command(folder, configuration).args(["--seconds", &seconds.to_string()]).stdout(Stdio::null()).status();
    assert!(status.unwrap().code().is_some_and(|code| code == 0 || code == 3));
}

/// CPU time of all processes that `run` starts and waits for, with their own child processes.
fn cpu_s(run: impl FnOnce()) -> f64 {
    let before = child_ticks();
    run();
    (child_ticks() - before) as f64 / rustix::param::clock_ticks_per_second() as f64
}

/// CPU time of child processes, clock ticks: fields 16 and 17 of proc_pid_stat(5).
fn child_ticks() -> u64 {
    let stat = std::fs::read_to_string("/proc/self/stat").unwrap();
    let fields: Vec<&str> = stat.rsplit_once(')').unwrap().1.split_ascii_whitespace().collect();
    fields[13..15].iter().map(|field| field.parse::<u64>().unwrap()).sum()
}

fn median(values: &mut [f64]) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or(f64::NAN)
}
