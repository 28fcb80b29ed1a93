//! The spans of the windows in the log of a run.

use std::collections::BTreeMap;

use serde_json::Value;

use crate::support::Bench;

#[test]
fn the_log_tells_how_long_every_stage_was_busy_with_every_window() {
    let bench = Bench::with_changes(&[("[window]", "[tracking]\nenabled = true\n[window]")]);
    let mut command = bench.command(&[&"run", &"--config", &bench.configuration(), &"--seconds", &"2"]);
    command.args(["--log-format", "json"]).env("FRINGEFLOW_LOG", "info,fringeflow::window=trace");
    let output = command.output().unwrap();
    let log = String::from_utf8(output.stderr).unwrap();
    let mut stages: BTreeMap<String, Vec<Value>> = BTreeMap::new();
    for line in log.lines().filter(|line| !line.starts_with("fringeflow: ")) {
        let line: Value = serde_json::from_str(line).unwrap();
        if line["message"] == "close" && line["span"]["name"] == "window" {
            assert!(line["fields"]["time.busy"].is_string() && line["fields"]["time.idle"].is_string(), "{line}");
            let stage = line["span"]["stage"].as_str().unwrap();
            assert_eq!(line["process"], stage, "{line}");
            stages.entry(stage.to_owned()).or_default().push(line["span"].clone());
        }
    }
    assert_eq!(stages.keys().collect::<Vec<_>>(), ["cloud", "correspondence", "phase", "tracking"], "{log}");
    for (stage, spans) in &stages {
        let numbers: Vec<u64> = spans.iter().map(|span| span["window"].as_u64().unwrap()).collect();
        assert!(numbers.windows(2).all(|pair| pair[0] < pair[1]), "{stage}: {numbers:?}");
        // Session and first image name a window in all stages.
        let identities = |spans: &[Value]| -> Vec<[u64; 2]> {
            spans.iter().map(|span| ["session", "first_image"].map(|key| span[key].as_u64().unwrap())).collect()
        };
        let of_phase = identities(&stages["phase"]);
        assert!(identities(spans).iter().all(|identity| of_phase.contains(identity)), "{stage}: {spans:?}");
    }
}
