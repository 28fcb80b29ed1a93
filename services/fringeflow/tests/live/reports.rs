//! The latencies of a run: its page, its trace and its log, and the same figures from its recording.

use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::monitor::prometheus::{monitoring_file, python, run_script};
use crate::support::{Bench, FinishedRun};

#[test]
fn a_run_and_its_recording_report_the_same_latencies() {
    let bench = Bench::new();
    let (recording, trace) = (bench.path("scan.mcap"), bench.path("trace.json"));
    let run = bench.run(&[&"--seconds", &"3", &"--record", &recording, &"--trace", &trace, &"--log-format", &"json"]);
    run.assert_undisturbed();
    let clouds = run.stage("cloud").passed;
    assert!(clouds > 0, "{run:?}");
    assert_log_is_json(&run);
    assert_eq!(run.summary["trace"], trace.to_str().unwrap());
    assert_trace(&trace);
    let page = PathBuf::from(run.summary["report"].as_str().unwrap());
    assert_eq!(page.parent(), Some(bench.path("recordings").as_path()));
    let live = embedded_data(&page);
    assert_eq!(
        (&live["instance"], &live["is_recorded"], &live["replayed"]),
        (&"t".into(), &false.into(), &false.into())
    );
    assert_eq!(live["exposure_to_cloud"], run.summary["exposure_to_cloud"]);
    // The services report before the first image, but the time line begins with it.
    assert!(live["time_line"][0]["rates"]["camera1"].as_f64().unwrap() > 0.0, "{live}");

    let [html, offline_trace] = ["offline.html", "offline.json"].map(|name| bench.path(name));
    let arguments: &[&dyn AsRef<std::ffi::OsStr>] =
        &[&"latency", &recording, &"--json", &"--worst", &"3", &"--html", &html, &"--trace", &offline_trace];
    let offline = bench.json(&[0], arguments);
    assert_same_latencies(&live, &offline);
    assert!(!offline["worst"].as_array().unwrap().is_empty() && offline["worst"][0]["cause"].is_string());
    assert_eq!(embedded_data(&html)["exposure_to_cloud"], offline["exposure_to_cloud"]);
    eprintln!("{}", run_script(python().arg(monitoring_file("report.py")).args([&page, &html])));
    assert_trace(&offline_trace);
    let text = bench.execute(&[0], &[&"latency", &recording]);
    for part in ["correspondence_queue", "exposure to cloud", "slowest windows", "(median "] {
        assert!(text.contains(part), "{part:?} is missing in: {text}");
    }
    assert_replay_has_no_exposure_latency(&bench, &recording);
}

#[test]
fn a_report_that_cannot_be_written_does_not_fail_the_run() {
    let bench = Bench::with_changes(&[("folder = \"recordings\"", "folder = \"scanner.toml\"")]);
    let run = bench.run(&[&"--seconds", &"1"]);
    run.assert_undisturbed();
    assert_eq!(run.summary.get("report"), None);
    assert!(run.log.contains("no report on the run") && run.log.contains("scanner.toml"), "{}", run.log);
    bench.assert_refused_with(
        1,
        &[&"run", &"--config", &bench.configuration(), &"--trace", &"/nowhere/t.json"],
        &["/nowhere"],
    );
    let page = bench.path("mine.html");
    let run = bench.run(&[&"--seconds", &"1", &"--report", &page]);
    assert_eq!(run.summary["report"], page.to_str().unwrap());
    assert_eq!(embedded_data(&page)["instance"], "t");
}

/// Asserts that the figures of a recorded replay have no latency from the exposure.
fn assert_replay_has_no_exposure_latency(bench: &Bench, recording: &Path) {
    let again = bench.path("again.mcap");
    bench.replay(&[&"replay", &recording, &"--rate", &"max", &"--record", &again]).assert_balanced();
    let figures = bench.json(&[0], &[&"latency", &again, &"--json"]);
    assert_eq!((&figures["replayed"], &figures["exposure_to_cloud"]), (&true.into(), &Value::Null));
    assert_eq!(figures["segments"][0]["segment"], "phase");
    assert!(bench.execute(&[0], &[&"latency", &again]).contains("was a replay"));
}

/// Asserts that the figures of a run and of its recording are equal, unless the recording lacks reports.
fn assert_same_latencies(live: &Value, offline: &Value) {
    let windows = |figures: &Value| figures["windows"].as_u64().unwrap();
    assert!(windows(offline) > 0 && windows(offline) <= windows(live), "{} {}", live["windows"], offline["windows"]);
    if windows(offline) == windows(live) {
        for key in ["exposure_to_cloud", "segments"] {
            assert_eq!(live[key], offline[key], "{key}");
        }
    }
}

/// Returns the figures embedded in a page. Asserts that the page loads nothing.
fn embedded_data(page: &Path) -> Value {
    let page = std::fs::read_to_string(page).unwrap();
    for loading in [" src=", " href=", "url(", "@import"] {
        assert!(!page.contains(loading), "{loading}");
    }
    let (_, data) = page.split_once("<script id=\"data\" type=\"application/json\">").unwrap();
    serde_json::from_str(data.split_once("</script>").unwrap().0).unwrap()
}

/// Asserts that a trace has items, and arrows through all three stages that compute.
fn assert_trace(path: &Path) {
    let trace: Value = serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap();
    let events = trace["traceEvents"].as_array().unwrap();
    let count = |phase: &str| events.iter().filter(|event| event["ph"] == phase).count();
    assert!(count("X") > count("s") && count("s") > 0 && count("t") > 0 && count("f") > 0);
    assert_eq!(events.iter().filter(|event| event["ph"] == "X" && event["name"] == "cloud").count(), count("f"));
}

/// Asserts that every line of the log is a JSON object, also those of the services.
fn assert_log_is_json(run: &FinishedRun) {
    // The last message of the command itself is not a log event.
    let lines = run.log.lines().filter(|line| !line.starts_with("fringeflow: "));
    let lines: Vec<Value> = lines.map(|line| serde_json::from_str(line).unwrap()).collect();
    assert!(lines.iter().all(|line| line["level"].is_string() && line["message"].is_string()), "{}", run.log);
    for process in ["run", "recorder"] {
        assert!(lines.iter().any(|line| line["process"] == process), "{process} is missing in {}", run.log);
    }
}
