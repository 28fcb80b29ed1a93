//! The page, its figures and its buttons.

use serde_json::json;

use fringeflow_message::Stage;

use super::*;

#[test]
fn the_page_the_figures_and_the_metrics_show_the_state_of_the_instance() {
    let bench = monitor_bench("");
    let watched = Watched::start(&bench, &[]);
    watched.live.wait_for_clouds(3);
    let page = watched.get("/");
    assert!(page.status == 200 && page.body.contains("panel-cloud"), "{page:?}");
    assert!(page.head.contains("default-src 'self'"), "{page:?}");
    watched.live.wait_until("the figures have clouds", || {
        watched.figures()["exposure_to_cloud"]["count"].as_u64().is_some_and(|count| count > 0)
    });
    let figures = watched.figures();
    assert_eq!(figures["state"]["scanning"], true);
    let services: Vec<_> =
        figures["services"].as_array().unwrap().iter().map(|s| s["name"].as_str().unwrap()).collect();
    assert!(["supervisor", "phase", "monitor"].iter().all(|name| services.contains(name)), "{services:?}");
    let segments: f64 = figures["sample"]["segments"].as_array().into_iter().flatten().filter_map(Value::as_f64).sum();
    assert!(segments >= 0.0 && figures["window"]["points"].as_u64().unwrap() > 0, "{figures}");
    watched.live.wait_until("the health is known", || watched.figures()["window"]["health"]["state"] == "ok");
    let figures = watched.figures();
    assert!(figures["health_for_s"]["delta_sd"].is_f64() && page.body.contains("panel-health"), "{figures}");
    let metrics = watched.get("/metrics").body;
    for line in ["fringeflow_health_worst_state 0.0", "fringeflow_health_state{quantity=\"harmonics_cam1\"} 0.0"] {
        assert!(metrics.contains(line), "{line} is missing in {metrics}");
    }
    watched.live.quit().assert_undisturbed();
    bench.assert_nothing_left();
}

#[test]
fn bad_health_appears_in_the_figures_the_metrics_the_log_and_the_summary() {
    let on = "enabled = true\naddress = \"127.0.0.1:0\"\nfoxglove = \"off\"";
    let bench = Bench::with_changes(&[("enabled = false", on), ("noise = \"low\"", "noise = \"low\"\ngamma = 1.4")]);
    let watched = Watched::start(&bench, &[]);
    watched.live.wait_until("the health is bad", || watched.figures()["window"]["health"]["state"] == "bad");
    let metrics = watched.get("/metrics").body;
    assert!(metrics.contains("fringeflow_health_state{quantity=\"harmonics_cam1\"} 2.0"), "{metrics}");
    assert!(!metrics.lines().any(|line| line.starts_with("fringeflow_health") && line.ends_with("NaN")), "{metrics}");
    let run = watched.live.quit();
    let event = "harmonics of the fringes, camera 1: bad";
    assert_eq!(run.log.matches(event).count(), 1, "{}", run.log);
    assert_eq!(run.summary["health"]["worst"], "bad");
}

#[test]
fn the_commands_of_the_page_record_mark_stop_and_start() {
    let bench = monitor_bench("");
    let watched = Watched::start(&bench, &[]);
    let refused = watched.control(&json!({"command": "mark", "text": "too early"}));
    assert!(refused.status == 409 && refused.body.contains("start one before"), "{refused:?}");
    let recording = watched.control(&json!({"command": "record"}));
    assert_eq!(recording.status, 200, "{recording:?}");
    let state: Value = serde_json::from_str(&recording.body).unwrap();
    let file = state["state"]["recording"].as_str().unwrap().to_owned();
    assert!(file.starts_with(bench.path("recordings").to_str().unwrap()), "{file}");
    watched.live.wait_for_clouds(1);
    assert_eq!(watched.control(&json!({"command": "mark", "text": "<b>ear</b>"})).status, 200);
    assert_eq!(watched.control(&json!({"command": "end-recording"})).status, 200);
    watched.live.wait_until("the recording is complete", || std::path::Path::new(&file).exists());
    assert_eq!(watched.control(&json!({"command": "stop"})).status, 200);
    watched.live.wait_until("the figures show the stop", || watched.figures()["state"]["scanning"] == false);
    let before = bench.counts(Stage::Cloud).passed;
    assert_eq!(watched.control(&json!({"command": "start"})).status, 200);
    watched.live.wait_until("there are clouds again", || bench.counts(Stage::Cloud).passed > before);
    let info = bench.execute(&[0], &[&"info", &file]);
    assert!(info.contains("<b>ear</b>"), "{info}");
    watched.live.quit().assert_balanced();
}

#[test]
fn a_killed_monitor_returns_at_the_same_address_and_the_scan_goes_on() {
    let free = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    let monitor = format!("enabled = true\naddress = \"{free}\"\nfoxglove = \"off\"");
    let bench = Bench::with_changes(&[("enabled = false", &monitor)]);
    let watched = Watched::start(&bench, &[]);
    assert_eq!(watched.address, free);
    watched.live.signal("monitor", rustix::process::Signal::KILL);
    watched.live.wait_until("the monitor answers again", || {
        TcpStream::connect(free).is_ok() && watched.get("/figures").body.contains("\"figures\"")
    });
    watched.live.wait_for_clouds(2);
    let run = watched.live.quit();
    run.assert_balanced();
    assert_eq!(run.summary["restarts"], 1);
    bench.assert_nothing_left();
}
