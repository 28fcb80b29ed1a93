//! The real Prometheus watches an instance, and sees what everybody else sees.

use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use super::*;
use crate::tracking::TRACKED_BODY;

/// Allowed distance between percentiles of the two, beside the bucket: a histogram of two digits.
const DIGITS: f64 = 0.02;

fn root() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../..")
}

/// What a script of tests/monitoring or scripts prints.
pub(super) fn script(command: &mut Command) -> String {
    let Output { status, stdout, stderr } = command.output().unwrap();
    let [said, complained] = [stdout, stderr].map(|bytes| String::from_utf8_lossy(&bytes).trim().to_owned());
    assert!(status.success(), "{command:?}: {status}:\n{said}\n{complained}");
    said
}

/// The Python of the tests.
pub(super) fn python() -> Command {
    Command::new(script(&mut Command::new(root().join("scripts/python.sh"))))
}

/// A file of tests/monitoring.
pub(super) fn monitoring(name: &str) -> PathBuf {
    root().join("tests/monitoring").join(name)
}

#[test]
fn prometheus_rules_and_dashboard_find_what_they_ask_for() {
    let binaries = script(&mut Command::new(monitoring("prometheus_package.sh")));
    let promtool = PathBuf::from(&binaries).join("promtool");
    script(Command::new(&promtool).args(["test", "rules"]).arg(monitoring("alerts_test.yml")));

    let bench = bench_with(&TRACKED_BODY, "");
    let recording = bench.path("run.mcap");
    let watched = Watched::start(&bench, &[&"--record", &recording]);
    watched.live.wait_for_clouds(20);
    let metrics = bench.path("metrics.txt");
    std::fs::write(&metrics, watched.get("/metrics").body).unwrap();
    script(python().arg(monitoring("grafana.py")).arg(root().join("configs/grafana.json")).arg(&metrics));
    lint(&promtool, &watched.get("/metrics").body);
    let url = format!("http://{}", watched.address);
    let seen = script(python().arg(monitoring("prometheus.py")).args([&url, &binaries]));
    let seen: Value = serde_json::from_str(&seen).unwrap();

    // Nothing more happens, so that all tell of the same items.
    assert_eq!(watched.control(&serde_json::json!({"command": "stop"})).status, 200);
    watched.live.wait_until("everything is worked off", || {
        let figures = watched.figures();
        // The recorder goes on, with reports; and a pattern whose image is not taken any more waits for it to the end.
        let stages = figures["stages"].as_array().unwrap().iter().filter(|stage| stage["stage"] != "recorder");
        let is_idle = |stage: &Value| stage["in_work"] == 0 && stage["waiting"] == 0;
        stages.into_iter().all(|stage| stage["rate_hz"] == 0.0 && (stage["latency"].is_null() || is_idle(stage)))
    });
    let seen_last = script(python().arg(monitoring("prometheus.py")).args([&url, &binaries, "--idle"]));
    let seen_last: Value = serde_json::from_str(&seen_last).unwrap();
    assert_eq!(seen["series"], seen_last["series"]);
    let figures = watched.figures();
    let ended = watched.live.quit();
    agree(&seen_last["since_start"]["exposure_to_cloud"], &figures["exposure_to_cloud"]);
    agree_if_all_came(&seen_last["since_start"]["exposure_to_cloud"], &ended.summary["exposure_to_cloud"]);
    for stage in figures["stages"].as_array().unwrap() {
        let name = stage["stage"].as_str().unwrap();
        agree(&seen_last["since_start"]["stages"][name], &stage["latency"]);
    }
    agree_with_recording(&seen_last["since_start"], &bench.json(&[0], &[&"latency", &recording, &"--json"]));
}

/// Asserts that promtool finds no fault in the text format of the metrics.
fn lint(promtool: &Path, metrics: &str) {
    let mut check = Command::new(promtool);
    check.args(["check", "metrics"]).stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut check = check.spawn().unwrap();
    check.stdin.take().unwrap().write_all(metrics.as_bytes()).unwrap();
    let output = check.wait_with_output().unwrap();
    let said = [output.stdout, output.stderr].map(|bytes| String::from_utf8_lossy(&bytes).into_owned());
    assert!(output.status.success() && said.iter().all(String::is_empty), "{said:?}\n{metrics}");
}

/// [`agree`] of what the recording tells.
fn agree_with_recording(seen: &Value, recorded: &Value) {
    agree_if_all_came(&seen["exposure_to_cloud"], &recorded["exposure_to_cloud"]);
    for segment in recorded["segments"].as_array().unwrap() {
        agree_if_all_came(&seen["segments"][segment["segment"].as_str().unwrap()], &segment["latency"]);
    }
}

/// [`agree`], unless this machine is so busy that the monitor, which gives way to all others, or the recorder missed reports:
/// then they tell of other items.
fn agree_if_all_came(buckets: &Value, latency: &Value) {
    let counts = [buckets, latency].map(|figures| figures["count"].as_f64().unwrap());
    assert!(counts.into_iter().all(|count| count > 0.0));
    if counts[0] == counts[1] {
        agree(buckets, latency);
    } else {
        eprintln!("reports were missed: {counts:?}");
    }
}

/// Asserts that percentiles lie in the buckets in which Prometheus finds them.
fn agree(buckets: &Value, latency: &Value) {
    assert_eq!(buckets.is_null(), latency.is_null(), "{buckets} {latency}");
    if latency.is_null() {
        return;
    }
    assert_eq!(buckets["count"].as_f64(), latency["count"].as_f64(), "{buckets} {latency}");
    for percentile in ["p50", "p90", "p99"] {
        let bucket = &buckets[percentile];
        let seconds = latency[format!("{percentile}_ms")].as_f64().unwrap() * 1e-3;
        let above = bucket["above"].as_f64().unwrap() * (1.0 - DIGITS);
        let up_to = bucket["up_to"].as_f64().unwrap_or(f64::INFINITY) * (1.0 + DIGITS);
        assert!((above..=up_to).contains(&seconds), "{percentile}: {seconds} s is not in {bucket}");
    }
}
