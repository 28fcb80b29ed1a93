//! A real Prometheus scrapes an instance, and sees the same figures as the page, the summary and the recording.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use super::*;
use crate::tracking::TRACKED_BODY;

/// Relative tolerance of percentiles beyond the limits of their bucket. The histogram behind them has two digits.
const TOLERANCE: f64 = 0.02;

/// Returns the root of the repository.
fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// Runs a script, which must succeed. Returns its standard output.
pub(crate) fn run_script(command: &mut Command) -> String {
    let Output { status, stdout, stderr } = command.output().unwrap();
    let [printed, errors] = [stdout, stderr].map(|bytes| String::from_utf8_lossy(&bytes).trim().to_owned());
    // Long messages lose their end in some logs: what is wrong comes first.
    assert!(status.success(), "{command:?}: {status}:\n{errors}\n{printed}");
    printed
}

/// Returns the Python interpreter of the tests.
pub(crate) fn python() -> Command {
    Command::new(run_script(&mut Command::new(root().join("scripts/python.sh"))))
}

/// Returns the path of a file in `tests/monitoring`.
pub(crate) fn monitoring_file(name: &str) -> PathBuf {
    root().join("tests/monitoring").join(name)
}

#[test]
fn prometheus_and_grafana_find_their_metrics_and_percentiles_agree_with_the_figures() {
    let binaries = run_script(&mut Command::new(monitoring_file("prometheus_package.sh")));
    let promtool = PathBuf::from(&binaries).join("promtool");
    run_script(Command::new(&promtool).args(["test", "rules"]).arg(monitoring_file("alerts_test.yml")));

    let bench = monitor_bench_with_changes(&TRACKED_BODY, "");
    let recording = bench.path("run.mcap");
    let watched = Watched::start(&bench, &[&"--record", &recording]);
    watched.live.wait_for_clouds(20);
    // The monitor yields to all other processes: it may know of the health later than of the clouds.
    let is_health_known = || watched.get("/metrics").body.contains("fringeflow_health_level{");
    watched.live.wait_until("the health is known", is_health_known);
    let metrics = bench.path("metrics.txt");
    std::fs::write(&metrics, watched.get("/metrics").body).unwrap();
    run_script(python().arg(monitoring_file("grafana.py")).arg(root().join("configs/grafana.json")).arg(&metrics));
    assert_valid_format(&promtool, &watched.get("/metrics").body);
    let url = format!("http://{}", watched.address);
    let seen = run_script(python().arg(monitoring_file("prometheus.py")).args([&url, &binaries]));
    let seen: Value = serde_json::from_str(&seen).unwrap();

    // Stop the scan, so that all figures count the same items.
    assert_eq!(watched.control(&serde_json::json!({"command": "stop"})).status, 200);
    watched.live.wait_until("all items are processed", || {
        let figures = watched.figures();
        // The recorder still records reports. A pattern whose image is never taken waits until the end.
        let stages = figures["stages"].as_array().unwrap().iter().filter(|stage| stage["stage"] != "recorder");
        let is_idle = |stage: &Value| stage["in_work"] == 0 && stage["waiting"] == 0;
        stages.into_iter().all(|stage| stage["rate_hz"] == 0.0 && (stage["latency"].is_null() || is_idle(stage)))
    });
    let seen_last = run_script(python().arg(monitoring_file("prometheus.py")).args([&url, &binaries, "--idle"]));
    let seen_last: Value = serde_json::from_str(&seen_last).unwrap();
    assert_eq!(seen["series"], seen_last["series"]);
    let figures = watched.figures();
    let run = watched.live.quit();
    assert_agree(&seen_last["since_start"]["exposure_to_cloud"], &figures["exposure_to_cloud"]);
    assert_agree_if_complete(&seen_last["since_start"]["exposure_to_cloud"], &run.summary["exposure_to_cloud"]);
    for stage in figures["stages"].as_array().unwrap() {
        let name = stage["stage"].as_str().unwrap();
        assert_agree(&seen_last["since_start"]["stages"][name], &stage["latency"]);
    }
    assert_agrees_with_recording(&seen_last["since_start"], &bench.json(&[0], &[&"latency", &recording, &"--json"]));
}

/// Asserts that promtool accepts the text format of the metrics.
fn assert_valid_format(promtool: &Path, metrics: &str) {
    let mut check = Command::new(promtool);
    check.args(["check", "metrics"]).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut check = check.spawn().unwrap();
    check.stdin.take().unwrap().write_all(metrics.as_bytes()).unwrap();
    let output = check.wait_with_output().unwrap();
    let messages = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
    assert!(output.status.success() && messages.iter().all(String::is_empty), "{messages:?}\n{metrics}");
}

/// Asserts that the buckets agree with the figures of the recording.
fn assert_agrees_with_recording(seen: &Value, recorded: &Value) {
    assert_agree_if_complete(&seen["exposure_to_cloud"], &recorded["exposure_to_cloud"]);
    for segment in recorded["segments"].as_array().unwrap() {
        assert_agree_if_complete(&seen["segments"][segment["segment"].as_str().unwrap()], &segment["latency"]);
    }
}

/// [`assert_agree`], unless the monitor or the recorder missed reports: then the counts differ. This happens on a busy
/// machine, because the monitor yields to all other processes.
fn assert_agree_if_complete(buckets: &Value, latency: &Value) {
    let counts = [buckets, latency].map(|figures| figures["count"].as_f64().unwrap());
    assert!(counts.into_iter().all(|count| count > 0.0));
    if counts[0] == counts[1] {
        assert_agree(buckets, latency);
    } else {
        eprintln!("reports were missed: {counts:?}");
    }
}

/// Asserts that percentiles lie in the buckets in which Prometheus finds them.
fn assert_agree(buckets: &Value, latency: &Value) {
    assert_eq!(buckets.is_null(), latency.is_null(), "{buckets} {latency}");
    if latency.is_null() {
        return;
    }
    assert_eq!(buckets["count"].as_f64(), latency["count"].as_f64(), "{buckets} {latency}");
    for percentile in ["p50", "p90", "p99"] {
        let bucket = &buckets[percentile];
        let seconds = latency[format!("{percentile}_ms")].as_f64().unwrap() * 1e-3;
        let above = bucket["above"].as_f64().unwrap() * (1.0 - TOLERANCE);
        let up_to = bucket["up_to"].as_f64().unwrap_or(f64::INFINITY) * (1.0 + TOLERANCE);
        assert!((above..=up_to).contains(&seconds), "{percentile}: {seconds} s is not in {bucket}");
    }
}
