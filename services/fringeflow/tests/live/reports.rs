//! Where the time of a run went: the page that it leaves, its trace, its log, and the same figures from its recording.

use std::path::{Path, PathBuf};

use serde_json::Value;

use crate::support::{Bench, Ended};

#[test]
fn a_run_and_its_recording_tell_the_same_latencies() {
    let bench = Bench::new();
    let (recording, trace) = (bench.path("scan.mcap"), bench.path("trace.json"));
    let ended = bench.run(&[&"--seconds", &"3", &"--record", &recording, &"--trace", &trace, &"--log-format", &"json"]);
    ended.assert_undisturbed();
    let clouds = ended.stage("cloud").passed;
    assert!(clouds > 0, "{ended:?}");
    assert_log_is_json(&ended);
    assert_eq!(ended.summary["trace"], trace.to_str().unwrap());
    assert_trace(&trace);
    let page = PathBuf::from(ended.summary["report"].as_str().unwrap());
    assert_eq!(page.parent(), Some(bench.path("recordings").as_path()));
    let live = data_of(&page);
    assert_eq!(
        (&live["instance"], &live["is_recorded"], &live["replayed"]),
        (&"t".into(), &false.into(), &false.into())
    );
    assert_eq!(live["exposure_to_cloud"], ended.summary["exposure_to_cloud"]);

    let [html, offline_trace] = ["offline.html", "offline.json"].map(|name| bench.path(name));
    let arguments: &[&dyn AsRef<std::ffi::OsStr>] =
        &[&"latency", &recording, &"--json", &"--worst", &"3", &"--html", &html, &"--trace", &offline_trace];
    let offline = bench.json(&[0], arguments);
    assert_same_latencies(&live, &offline);
    assert!(!offline["worst"].as_array().unwrap().is_empty() && offline["worst"][0]["cause"].is_string());
    assert_eq!(data_of(&html)["exposure_to_cloud"], offline["exposure_to_cloud"]);
    assert_trace(&offline_trace);
    let text = bench.done(&[0], &[&"latency", &recording]);
    for part in ["correspondence_queue", "exposure to cloud", "slowest windows", "in the median"] {
        assert!(text.contains(part), "{part:?} is missing in: {text}");
    }
    assert_a_replay_is_told(&bench, &recording);
}

#[test]
fn a_page_that_cannot_be_written_takes_nothing_from_the_run() {
    let bench = Bench::with(&[("folder = \"recordings\"", "folder = \"scanner.toml\"")]);
    let ended = bench.run(&[&"--seconds", &"1"]);
    ended.assert_undisturbed();
    assert_eq!(ended.summary.get("report"), None);
    assert!(ended.log.contains("no report on the run") && ended.log.contains("scanner.toml"), "{}", ended.log);
    bench.refused_with(
        1,
        &[&"run", &"--config", &bench.configuration(), &"--trace", &"/nowhere/t.json"],
        &["/nowhere"],
    );
    let page = bench.path("mine.html");
    let ended = bench.run(&[&"--seconds", &"1", &"--report", &page]);
    assert_eq!(ended.summary["report"], page.to_str().unwrap());
    assert_eq!(data_of(&page)["instance"], "t");
}

/// Asserts that a recording of a replay tells nothing of its exposures.
fn assert_a_replay_is_told(bench: &Bench, recording: &Path) {
    let again = bench.path("again.mcap");
    bench.replay(&[&"replay", &recording, &"--rate", &"max", &"--record", &again]).assert_balanced();
    let figures = bench.json(&[0], &[&"latency", &again, &"--json"]);
    assert_eq!((&figures["replayed"], &figures["exposure_to_cloud"]), (&true.into(), &Value::Null));
    assert_eq!(figures["segments"][0]["segment"], "phase");
    assert!(bench.done(&[0], &[&"latency", &again]).contains("was a replay"));
}

/// Asserts that figures of a run and of its recording are the same, as far as no report was lost on the way.
fn assert_same_latencies(live: &Value, offline: &Value) {
    let windows = |figures: &Value| figures["windows"].as_u64().unwrap();
    assert!(windows(offline) > 0 && windows(offline) <= windows(live), "{} {}", live["windows"], offline["windows"]);
    if windows(offline) == windows(live) {
        for key in ["exposure_to_cloud", "segments"] {
            assert_eq!(live[key], offline[key], "{key}");
        }
    }
}

/// The figures in a page, which loads nothing.
fn data_of(page: &Path) -> Value {
    let page = std::fs::read_to_string(page).unwrap();
    for loading in [" src=", " href=", "url(", "@import"] {
        assert!(!page.contains(loading), "{loading}");
    }
    let (_, data) = page.split_once("<script id=\"data\" type=\"application/json\">").unwrap();
    serde_json::from_str(data.split_once("</script>").unwrap().0).unwrap()
}

/// Asserts that a trace has items, and arrows through all three working stages.
fn assert_trace(path: &Path) {
    let trace: Value = serde_json::from_slice(&std::fs::read(path).unwrap()).unwrap();
    let events = trace["traceEvents"].as_array().unwrap();
    let count = |phase: &str| events.iter().filter(|event| event["ph"] == phase).count();
    assert!(count("X") > count("s") && count("s") > 0 && count("t") > 0 && count("f") > 0);
    assert_eq!(events.iter().filter(|event| event["ph"] == "X" && event["name"] == "cloud").count(), count("f"));
}

/// Asserts that every line of the log is an object, those of the services too.
fn assert_log_is_json(ended: &Ended) {
    // What the command itself says at its end is no event.
    let lines = ended.log.lines().filter(|line| !line.starts_with("fringeflow: "));
    let lines: Vec<Value> = lines.map(|line| serde_json::from_str(line).unwrap()).collect();
    assert!(lines.iter().all(|line| line["level"].is_string() && line["message"].is_string()), "{}", ended.log);
    for process in ["run", "recorder"] {
        assert!(lines.iter().any(|line| line["process"] == process), "{process} is missing in {}", ended.log);
    }
}
