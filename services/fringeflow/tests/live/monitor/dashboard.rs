//! A real browser shows the page of a live instance and uses its buttons.

use super::prometheus::{monitoring_file, python, run_script};
use super::*;
use crate::tracking::TRACKED_BODY;

#[test]
fn the_page_of_a_tracked_scan_begins_with_the_model() {
    let bench = monitor_bench_with_changes(&TRACKED_BODY, "");
    let watched = Watched::start(&bench, &[]);
    watched.live.wait_for_clouds(1);
    let mut browser = python();
    browser.arg(monitoring_file("dashboard.py")).arg(format!("http://{}/", watched.address)).arg("--tracked");
    eprintln!("{}", run_script(&mut browser));
    watched.live.quit().assert_balanced();
}

#[test]
fn every_panel_is_live_and_every_button_works_in_a_browser() {
    // The page reconnects to the same address, so the port must be fixed.
    let free = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let bench = Bench::with_changes(&[
        ("enabled = false", &format!("enabled = true\naddress = \"{free}\"\nfoxglove = \"127.0.0.1:0\"")),
        // The fringes are so fine that the threshold is a small part of a turn, as on real rigs.
        ("period_px = 48.0", "period_px = 16.0"),
        ("size_px = [96, 80]", "size_px = [320, 256]"),
    ]);
    let watched = Watched::start(&bench, &[]);
    watched.live.wait_for_clouds(1);
    let monitor = bench.pid_of("monitor").unwrap().to_string();
    let mut browser = python();
    browser.arg(monitoring_file("dashboard.py")).arg(format!("http://{free}/"));
    browser.arg("--recordings").arg(bench.path("recordings")).args(["--restart-pid", &monitor]);
    // The script prints one line per check, for a test that fails later.
    eprintln!("{}", run_script(&mut browser));
    watched.live.quit().assert_balanced();
}
