//! `fringeflow project` on a virtual X server: what it shows, announces and refuses.

use std::collections::BTreeSet;
use std::io::{BufRead as _, BufReader};
use std::process::{Child, Command, Stdio};

use rustix::process::Signal;
use serde_json::Value;
use x11rb::connection::Connection as _;
use x11rb::protocol::xproto::{ConnectionExt as _, ImageFormat};

use fringeflow_message::Stage;
use fringeflow_patterns::PatternSet;

use crate::support::{Bench, Live, NAME, send, wait_until};

const EXTERNAL: (&str, &str) = ("driver = \"virtual\"", "driver = \"external\"");
/// The virtual server has 60 refreshes a second.
const RATE: (&str, &str) = ("rate_hz = 25.0", "rate_hz = 30.0");
/// Size of the image of the virtual projector.
const SIZE: &str = "1024x1024";

/// An X server without a monitor.
struct Server {
    child: Child,
    display: String,
}

impl Server {
    fn new(size: &str) -> Self {
        let mut command = Command::new("Xvfb");
        command.args(["-displayfd", "1", "-nolisten", "tcp", "-screen", "0", &format!("{size}x24")]);
        let spawned = command.stdout(Stdio::piped()).stderr(Stdio::null()).spawn();
        let mut child = spawned.unwrap_or_else(|e| panic!("Xvfb cannot be run ({e}): `make setup` installs xvfb"));
        // The server writes its number when it is ready, and ends the line.
        let mut number = String::new();
        BufReader::new(child.stdout.as_mut().unwrap()).read_line(&mut number).unwrap();
        assert!(number.ends_with('\n'), "Xvfb does not start");
        Self { child, display: format!(":{}", number.trim_end()) }
    }

    /// Returns the green of all pixels of the screen.
    fn screenshot(&self) -> Vec<u8> {
        let (connection, number) = x11rb::connect(Some(&self.display)).unwrap();
        let screen = &connection.setup().roots[number];
        let (width, height) = (screen.width_in_pixels, screen.height_in_pixels);
        let image = connection.get_image(ImageFormat::Z_PIXMAP, screen.root, 0, 0, width, height, u32::MAX).unwrap();
        image.reply().unwrap().data.chunks_exact(4).map(|pixel| pixel[1]).collect()
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        // It may have ended already.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Starts `fringeflow project` on the instance of a bench.
fn project(bench: &Bench, server: &Server) -> Child {
    let mut command =
        bench.command(&[&"project", &"--config", &bench.configuration(), &"--display", &server.display, &"--json"]);
    command.stdin(Stdio::null()).stdout(Stdio::piped()).spawn().unwrap()
}

/// Waits for the end of `fringeflow project`. Returns its balance.
fn counts(mut projector: Child) -> Value {
    assert!(wait_until(|| projector.try_wait().unwrap().is_some()), "project does not end");
    let output = projector.wait_with_output().unwrap();
    // 3: a busy machine was too late for some refreshes.
    assert!(matches!(output.status.code(), Some(0 | 3)), "{:?}", output.status);
    let report: Value = serde_json::from_slice(&output.stdout).unwrap();
    let counts = report["counts"].clone();
    let number = |key: &str| counts[key].as_u64().unwrap();
    assert_eq!(number("due"), number("announced") + number("dropped"), "{counts}");
    counts
}

fn wait_for_events(bench: &Bench, live: &Live<'_>, projector: &mut Child, events: u64) {
    live.wait_until("events have arrived", || {
        assert_eq!(projector.try_wait().unwrap(), None, "project has ended");
        bench.counts(Stage::Pattern).taken >= events
    });
}

#[test]
fn the_monitor_shows_the_patterns_of_a_file_and_each_is_announced() {
    let file = ("steps = 4\nperiod_px = 48.0", "file = \"patterns\"");
    let bench = Bench::with_changes(&[EXTERNAL, RATE, file]);
    let patterns = bench.path("patterns");
    let size = ["--size", SIZE, "--period", "48", "--gamma", "2.2", "--rotate", "180"];
    let mut arguments: Vec<&dyn AsRef<std::ffi::OsStr>> = vec![&"patterns", &"--output", &patterns];
    arguments.extend(size.iter().map(|word| word as &dyn AsRef<std::ffi::OsStr>));
    bench.execute(&[0], &arguments);
    let server = Server::new(SIZE);
    let live = bench.start(&[]);
    let mut projector = project(&bench, &server);
    wait_for_events(&bench, &live, &mut projector, 20);
    let set = PatternSet::read(&patterns).unwrap();
    let images: Vec<Vec<u8>> = (0..4).map(|index| set.image(index).unwrap().levels).collect();
    let mut seen = BTreeSet::new();
    live.wait_until("all patterns are seen", || {
        let shown = server.screenshot();
        seen.insert(images.iter().position(|image| *image == shown).expect("another image is shown"));
        seen.len() == images.len()
    });
    live.wait_until("there are clouds", || bench.counts(Stage::Cloud).passed >= 5);
    send(projector.id(), Signal::INT);
    let announced = counts(projector)["announced"].as_u64().unwrap();
    assert!(announced >= 20);
    live.wait_until("all events have arrived", || bench.counts(Stage::Pattern).taken >= announced);
    let run = live.quit();
    run.assert_balanced();
    assert_eq!(run.stage("pattern").taken, announced, "{run:?}");
    bench.assert_nothing_left();
}

#[test]
fn project_follows_the_scan_and_ends_with_the_instance() {
    let bench = Bench::with_changes(&[EXTERNAL, RATE]);
    let server = Server::new(SIZE);
    let live = bench.start(&[]);
    let mut projector = project(&bench, &server);
    wait_for_events(&bench, &live, &mut projector, 10);
    bench.execute(&[0], &[&"control", &NAME, &"stop"]);
    live.wait_until("the monitor is dark", || server.screenshot().iter().all(|&level| level == 0));
    let before = bench.counts(Stage::Pattern).taken;
    bench.execute(&[0], &[&"control", &NAME, &"start"]);
    wait_for_events(&bench, &live, &mut projector, before + 10);
    live.quit().assert_balanced();
    assert!(counts(projector)["announced"].as_u64().unwrap() >= before + 10);
}

#[test]
fn what_cannot_be_shown_is_refused_by_name() {
    let bench = Bench::with_changes(&[EXTERNAL, RATE]);
    let (server, small) = (Server::new(SIZE), Server::new("640x480"));
    let refused = |bench: &Bench, server: &Server, says: &[&str]| {
        let configuration = bench.configuration();
        bench.assert_refused(&[&"project", &"--config", &configuration, &"--display", &server.display], says);
    };
    refused(&bench, &server, &["no instance t is running"]);
    let live = bench.start(&[]);
    refused(&bench, &small, &["1024 × 1024", "640 × 480", "--size"]);
    live.quit();
    let bench = Bench::with_changes(&[EXTERNAL]);
    let live = bench.start(&[]);
    refused(&bench, &server, &["25 images a second", "cameras.rate_hz"]);
    live.quit();
    refused(&Bench::new(), &server, &["scanner.toml", "projector.driver = \"external\""]);
    bench.assert_refused(&[&"project", &"--check", &"--display", &":no"], &["no X server :no"]);
    let monitor: [&dyn AsRef<std::ffi::OsStr>; 6] =
        [&"project", &"--check", &"--monitor", &"HDMI-1", &"--display", &server.display];
    bench.assert_refused(&monitor, &["no monitor \"HDMI-1\"", "screen"]);
}

#[test]
fn a_check_tells_size_and_steadiness() {
    let (bench, server) = (Bench::new(), Server::new("640x480"));
    let report = bench.json(&[0, 3], &[&"project", &"--check", &"--json", &"--display", &server.display]);
    assert_eq!(report["monitor"]["size_px"], serde_json::json!([640, 480]));
    let steadiness = &report["steadiness"];
    assert!(steadiness["shown"].as_u64() > Some(0), "{report}");
    assert!(steadiness["refresh_hz"].as_f64() > Some(0.0) && steadiness["jitter_rms_us"].is_number(), "{report}");
    let list = bench.json(&[0], &[&"project", &"--list", &"--json", &"--display", &server.display]);
    assert_eq!(list[0]["name"], "screen");
}
