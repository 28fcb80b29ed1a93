//! The health of the scanner: told the same everywhere, and only where something is wrong.

use serde_json::Value;

use crate::support::Bench;

/// State of a quantity among those of a status, a report or a recording.
fn quantity<'v>(health: &'v Value, name: &str) -> &'v Value {
    let quantities = health["quantities"].as_array().unwrap_or_else(|| panic!("{health}"));
    quantities.iter().find(|quantity| quantity["quantity"] == name).unwrap_or_else(|| panic!("{name}: {health}"))
}

#[test]
fn a_healthy_scanner_is_ok_and_nothing_is_said() {
    let bench = Bench::new();
    let recording = bench.path("scan.mcap");
    let live = bench.start(&[&"--record", &recording]);
    live.wait_for_clouds(20);
    let health = &bench.json(&[0], &[&"status", &"t", &"--json"])["health"];
    assert_eq!(health["state"], "ok", "{health}");
    assert!(bench.done(&[0], &[&"status", &"t"]).contains("health: ok"));
    let ended = live.quit();
    ended.assert_undisturbed();
    assert_eq!(ended.summary["health"]["worst"], "ok", "{}", ended.summary["health"]);
    assert!(!ended.log.contains("limit"), "{}", ended.log);
    assert!(bench.done(&[0], &[&"info", &recording]).contains("health: ok at worst"));
}

#[test]
fn a_calibration_that_has_drifted_is_told_once_and_recorded() {
    let limits = "[health]\ndrift_rad = { warn = 0.005, bad = 0.01 }\n[monitor]";
    let bench = Bench::with(&[("sd_rad = 0.0", "sd_rad = 0.1"), ("[monitor]", limits)]);
    let recording = bench.path("scan.mcap");
    let live = bench.start(&[&"--record", &recording]);
    live.wait_for_clouds(20);
    let status = bench.json(&[0], &[&"status", &"t", &"--json"]);
    let drift = quantity(&status["health"], "drift");
    assert_eq!((&status["health"]["state"], &drift["state"]), (&"bad".into(), &"bad".into()), "{status}");
    assert_eq!((&drift["warn"], &drift["bad"]), (&0.005.into(), &0.01.into()));
    assert!(drift["for_s"].as_f64().is_some_and(|for_s| for_s >= 0.0), "{drift}");
    let text = bench.done(&[0], &[&"status", &"t"]);
    assert!(text.contains("health: bad") && text.contains("calibrate again"), "{text}");
    let ended = live.quit();
    ended.assert_undisturbed();
    assert!(ended.summary["drift"]["rms_rad"].as_f64().unwrap() > 0.01, "{}", ended.summary);
    let worst = quantity(&ended.summary["health"], "drift");
    assert_eq!((&ended.summary["health"]["worst"], &worst["state"]), (&"bad".into(), &"bad".into()));
    assert_eq!(ended.log.matches("drift of the calibration: ").count(), 1, "{}", ended.log);
    assert!(ended.log.contains("limit 0.010 rad") && ended.log.contains("calibrate again"), "{}", ended.log);
    let info = bench.json(&[0], &[&"info", &recording, &"--json"]);
    assert_eq!(quantity(&info["health"], "drift")["state"], "bad");
    let offline = bench.json(&[0], &[&"latency", &recording, &"--json"]);
    assert_eq!(quantity(&offline["last_window"]["health"], "drift")["state"], "bad");
    assert_eq!(offline["health"]["worst"], "bad");
    assert!(offline["time_line"][0]["window"]["drift_rms_rad"].is_f64(), "{}", offline["time_line"][0]);
    let report = bench.json(&[0], &[&"rig", &recording, &"--images", &recording, &"--windows", &"3", &"--json"]);
    assert_eq!((&report["beyond_limit"], &report["limit_rad"]), (&true.into(), &0.005.into()));
    assert_eq!(report["windows"].as_array().unwrap().len(), 3);
    // The drift is the calibration's, whoever measures it and when.
    let [first, last] = ["first_rms_rad", "last_rms_rad"].map(|key| report[key].as_f64().unwrap());
    let live = worst["level"].as_f64().unwrap();
    assert!([first, last].iter().all(|rms| (rms / live - 1.0).abs() < 0.5), "{report} {worst}");
}

#[test]
fn a_projector_that_is_not_linear_and_too_much_light_are_told_apart() {
    let monitor = "enabled = true\naddress = \"127.0.0.1:0\"\nfoxglove = \"off\"";
    let crooked = Bench::with(&[("noise = \"low\"", "noise = \"low\"\ngamma = 1.4"), ("enabled = false", monitor)]);
    let bright = Bench::with(&[("noise = \"low\"", "noise = \"low\"\nexposure = 2.0"), ("enabled = false", monitor)]);
    for (bench, beyond, within) in [(&crooked, "harmonics_cam", "saturated_cam"), (&bright, "saturated_cam", "dim_cam")]
    {
        let live = bench.start(&[]);
        live.wait_for_clouds(20);
        let health = &bench.json(&[0], &[&"status", &"t", &"--json"])["health"];
        for camera in ["1", "2"] {
            let state = |quantity_of: &str| quantity(health, &format!("{quantity_of}{camera}"))["state"].clone();
            assert_eq!([state(beyond), state(within)], ["bad", "ok"], "camera {camera}: {health}");
        }
        assert_eq!(health["state"], "bad");
        live.quit().assert_undisturbed();
    }
}

#[test]
fn the_former_key_of_the_limit_is_refused_with_its_new_name() {
    let bench = Bench::with(&[("[monitor]", "[correspondence]\ndrift_alarm_rad = 0.1\n[monitor]")]);
    let says = ["scanner.toml", "correspondence.drift_alarm_rad is 0.1", "drift_rad", "[health]"];
    bench.refused(&[&"run", &"--config", &bench.configuration()], &says);
}
