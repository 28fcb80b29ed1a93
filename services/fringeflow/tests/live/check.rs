//! `run --check` and `cameras` where there is no camera: everything is told, nothing is started.

use crate::support::Bench;

/// What is checked, whether it is as it should be, and what was said.
fn points(bench: &Bench, code: i32) -> Vec<(String, bool, String)> {
    let report = bench.json(&[code], &[&"run", &"--config", &bench.configuration(), &"--check", &"--json"]);
    assert_eq!(report["ready"], code == 0);
    let text = |value: &serde_json::Value| value.as_str().unwrap().to_owned();
    let points = report["points"].as_array().unwrap().iter();
    points.map(|point| (text(&point["what"]), point["ready"].as_bool().unwrap(), text(&point["found"]))).collect()
}

#[test]
fn a_virtual_scanner_is_ready_and_leaves_nothing() {
    let bench = Bench::new();
    let found = points(&bench, 0);
    let names: Vec<&str> = found.iter().map(|(what, _, _)| what.as_str()).collect();
    let expected = [
        "configuration",
        "calibration and volume",
        "segment table",
        "shared memory",
        "runtime folder",
        "recorder",
        "monitor",
    ];
    assert_eq!(names, expected);
    assert!(found[1].2.contains("images of 96x80, 4 steps"), "{found:?}");
    assert!(!bench.path("recordings").exists());
    bench.assert_nothing_left();
}

#[test]
fn everything_that_is_wrong_is_told_at_once() {
    let devices =
        "rate_hz = 25.0\n[cameras.cam1]\ndevice = \"/dev/no-camera\"\n[cameras.cam2]\ndevice = \"serial:none\"";
    let bench = Bench::with(&[
        ("source = \"virtual\"", "source = \"v4l2\""),
        ("rate_hz = 25.0", devices),
        ("min_free_mb = 0", "min_free_mb = 16000000"),
    ]);
    let found = points(&bench, 2);
    let said = |what: &str| {
        let (_, ready, found) = found.iter().find(|point| point.0 == what).unwrap();
        assert!(!ready, "{what}: {found}");
        found.as_str()
    };
    assert!(said("calibration and volume").contains("names no rig"));
    assert!(said("camera 1").starts_with("/dev/no-camera was not found; "));
    assert!(said("camera 2").starts_with("serial:none was not found; "));
    assert!(said("recorder").contains("recorder.min_free_mb keeps 16000000 MiB free"));
    assert!(found.iter().any(|(what, ready, _)| what == "runtime folder" && *ready));
    bench.refused(&[&"cameras", &"/dev/no-camera"], &["/dev/no-camera was not found"]);
    bench.refused(&[&"cameras", &"/dev/null"], &["/dev/null does not answer as a V4L2 device"]);
    bench.assert_nothing_left();
}

#[test]
fn a_running_instance_is_told() {
    let bench = Bench::new();
    let live = bench.start(&[]);
    let found = points(&bench, 2);
    let wrong: Vec<_> = found.iter().filter(|(_, ready, _)| !ready).collect();
    assert!(wrong.len() == 1 && wrong[0].2.contains("an instance t is already running"), "{wrong:?}");
    live.wait_for_clouds(5);
    live.quit().assert_undisturbed();
    bench.assert_nothing_left();
}
