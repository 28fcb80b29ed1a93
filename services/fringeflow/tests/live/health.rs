//! The health of the scanner is the same in status, log, summary, recording and report, and is logged only if something
//! is wrong.

use serde_json::Value;

use crate::support::Bench;

/// Returns the state of a quantity from the health in a status, a report or a recording.
fn quantity<'v>(health: &'v Value, name: &str) -> &'v Value {
    let quantities = health["quantities"].as_array().unwrap_or_else(|| panic!("{health}"));
    quantities.iter().find(|quantity| quantity["quantity"] == name).unwrap_or_else(|| panic!("{name}: {health}"))
}

#[test]
fn a_healthy_scanner_is_ok_and_logs_no_warning() {
    let bench = Bench::new();
    let recording = bench.path("scan.mcap");
    let live = bench.start(&[&"--record", &recording]);
    live.wait_for_clouds(20);
    let health = &bench.json(&[0], &[&"status", &"t", &"--json"])["health"];
    assert_eq!(health["state"], "ok", "{health}");
    assert!(bench.execute(&[0], &[&"status", &"t"]).contains("health: ok"));
    let run = live.quit();
    run.assert_undisturbed();
    assert_eq!(run.summary["health"]["worst"], "ok", "{}", run.summary["health"]);
    assert!(!run.log.contains("limit"), "{}", run.log);
    assert!(bench.execute(&[0], &[&"info", &recording]).contains("health: ok at worst"));
}

#[test]
fn a_drifted_calibration_is_logged_once_and_recorded() {
    let limits = "[health]\ndrift_rad = { warn = 0.005, bad = 0.01 }\n[monitor]";
    let bench = Bench::with_changes(&[("sd_rad = 0.0", "sd_rad = 0.1"), ("[monitor]", limits)]);
    let recording = bench.path("scan.mcap");
    let live = bench.start(&[&"--record", &recording]);
    live.wait_for_clouds(20);
    let status = bench.json(&[0], &[&"status", &"t", &"--json"]);
    let drift = quantity(&status["health"], "drift");
    assert_eq!((&status["health"]["state"], &drift["state"]), (&"bad".into(), &"bad".into()), "{status}");
    assert_eq!((&drift["warn"], &drift["bad"]), (&0.005.into(), &0.01.into()));
    assert!(drift["for_s"].as_f64().is_some_and(|for_s| for_s >= 0.0), "{drift}");
    let text = bench.execute(&[0], &[&"status", &"t"]);
    assert!(text.contains("health: bad") && text.contains("calibrate again"), "{text}");
    let run = live.quit();
    run.assert_undisturbed();
    assert!(run.summary["drift"]["rms_rad"].as_f64().unwrap() > 0.01, "{}", run.summary);
    let worst = quantity(&run.summary["health"], "drift");
    assert_eq!((&run.summary["health"]["worst"], &worst["state"]), (&"bad".into(), &"bad".into()));
    assert_eq!(run.log.matches("drift of the calibration: ").count(), 1, "{}", run.log);
    assert!(run.log.contains("limit 0.010 rad") && run.log.contains("calibrate again"), "{}", run.log);
    let info = bench.json(&[0], &[&"info", &recording, &"--json"]);
    assert_eq!(quantity(&info["health"], "drift")["state"], "bad");
    let offline = bench.json(&[0], &[&"latency", &recording, &"--json"]);
    assert_eq!(quantity(&offline["last_window"]["health"], "drift")["state"], "bad");
    assert_eq!(offline["health"]["worst"], "bad");
    assert!(offline["time_line"][0]["window"]["drift_rms_rad"].is_f64(), "{}", offline["time_line"][0]);
    let report = bench.json(&[0], &[&"rig", &recording, &"--images", &recording, &"--windows", &"3", &"--json"]);
    assert_eq!((&report["beyond_limit"], &report["limit_rad"]), (&true.into(), &0.005.into()));
    assert_eq!(report["windows"].as_array().unwrap().len(), 3);
    // The drift is a property of the calibration, so offline and live figures agree.
    let [first, last] = ["first_rms_rad", "last_rms_rad"].map(|key| report[key].as_f64().unwrap());
    let live = worst["level"].as_f64().unwrap();
    assert!([first, last].iter().all(|rms| (rms / live - 1.0).abs() < 0.5), "{report} {worst}");
}

#[test]
fn health_distinguishes_a_nonlinear_projector_from_overexposure() {
    let monitor = "enabled = true\naddress = \"127.0.0.1:0\"\nfoxglove = \"off\"";
    let nonlinear =
        Bench::with_changes(&[("noise = \"low\"", "noise = \"low\"\ngamma = 1.4"), ("enabled = false", monitor)]);
    let overexposed =
        Bench::with_changes(&[("noise = \"low\"", "noise = \"low\"\nexposure = 2.0"), ("enabled = false", monitor)]);
    for (bench, bad, ok) in [(&nonlinear, "harmonics_cam", "saturated_cam"), (&overexposed, "saturated_cam", "dim_cam")]
    {
        let live = bench.start(&[]);
        live.wait_for_clouds(20);
        let health = &bench.json(&[0], &[&"status", &"t", &"--json"])["health"];
        for camera in ["1", "2"] {
            let state = |name: &str| quantity(health, &format!("{name}{camera}"))["state"].clone();
            assert_eq!([state(bad), state(ok)], ["bad", "ok"], "camera {camera}: {health}");
        }
        assert_eq!(health["state"], "bad");
        live.quit().assert_undisturbed();
    }
}

#[test]
fn the_old_key_of_the_drift_limit_is_refused_with_the_new_one() {
    let bench = Bench::with_changes(&[("[monitor]", "[correspondence]\ndrift_alarm_rad = 0.1\n[monitor]")]);
    let says = ["scanner.toml", "correspondence.drift_alarm_rad is 0.1", "drift_rad", "[health]"];
    bench.assert_refused(&[&"run", &"--config", &bench.configuration()], &says);
}
