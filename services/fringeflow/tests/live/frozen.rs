//! Services that stand still for a while.

use rustix::process::Signal;

use fringeflow_message::{DropReason, Stage};

use crate::support::{Bench, Live, NAME, send};

/// Stops a service until the cameras have put out so many more images and something was done, and waits for clouds again.
fn freeze(bench: &Bench, live: &Live<'_>, service: &str, images: u64, meanwhile: impl FnOnce()) {
    let enough = bench.counts(Stage::Camera1).passed + images;
    let pid = live.signal(service, Signal::STOP);
    live.wait_until("the cameras go on", || bench.counts(Stage::Camera1).passed >= enough);
    assert_eq!(bench.pid_of(service), Some(pid), "{service} was started again");
    meanwhile();
    send(pid, Signal::CONT);
    live.wait_for_clouds(10);
}

/// Whether the status tells of one stage alone that it gives no sign of life.
fn is_alone_silent(bench: &Bench, silent: &str) -> bool {
    let status = bench.json(&[0], &[&"status", &NAME, &"--json"]);
    let stages = status["stages"].as_array().unwrap();
    stages.len() == 10 && stages.iter().all(|stage| stage["silent"] == (stage["stage"] == silent))
}

#[test]
fn a_service_that_stands_still_holds_up_nobody_before_it() {
    let bench = Bench::new();
    let recording = bench.path("scan.mcap");
    let live = bench.start(&[&"--record", &recording]);
    live.wait_for_clouds(5);
    freeze(&bench, &live, "correspondence", 40, || {
        live.wait_until("it is silent", || is_alone_silent(&bench, "correspondence"));
    });
    // One window more than it works on may wait for it.
    let busy = bench.counts(Stage::Phase).dropped(DropReason::NextStageBusy);
    assert!(busy > 0);
    freeze(&bench, &live, "phase", 40, || ());
    freeze(&bench, &live, "recorder", 40, || ());
    let ended = live.quit();
    ended.assert_balanced();
    assert_eq!((ended.code, &ended.summary["restarts"]), (Some(3), &0.into()), "{ended:?}");
    assert!(ended.stage("phase").dropped(DropReason::NextStageBusy) >= busy, "{ended:?}");
    for stage in ["pairing", "recorder"] {
        assert!(ended.stage(stage).dropped(DropReason::Overrun) > 0, "{stage}: {ended:?}");
    }
    bench.assert_nothing_left();
    // What the recorder missed is missing in a whole file.
    let check = bench.json(&[3], &[&"check", &recording, &"--json"]);
    assert_eq!(check["fault_count"], 0, "{check}");
    let verified = bench.json(&[0, 3], &[&"replay", &recording, &"--verify", &"--json"]);
    assert_eq!((&verified["different"], &verified["no_cloud"]), (&0.into(), &0.into()));
    assert!(verified["same"].as_u64().unwrap() >= 20, "{verified}");
}
