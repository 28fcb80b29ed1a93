//! Services that are stopped for a while by SIGSTOP.

use rustix::process::Signal;

use fringeflow_message::{DropReason, Stage};

use crate::support::{Bench, Live, NAME, send};

/// Stops a service until the cameras have published `images` more and `meanwhile` has returned. Then waits for clouds.
fn freeze(bench: &Bench, live: &Live<'_>, service: &str, images: u64, meanwhile: impl FnOnce()) {
    let target = bench.counts(Stage::Camera1).passed + images;
    let pid = live.signal(service, Signal::STOP);
    live.wait_until("the cameras go on", || bench.counts(Stage::Camera1).passed >= target);
    assert_eq!(bench.pid_of(service), Some(pid), "{service} was restarted");
    meanwhile();
    send(pid, Signal::CONT);
    live.wait_for_clouds(10);
}

/// Returns whether the status shows this stage as silent, and no other.
fn is_only_silent_stage(bench: &Bench, silent: &str) -> bool {
    let status = bench.json(&[0], &[&"status", &NAME, &"--json"]);
    let stages = status["stages"].as_array().unwrap();
    stages.len() == 10 && stages.iter().all(|stage| stage["silent"] == (stage["stage"] == silent))
}

#[test]
fn a_stopped_service_does_not_block_the_stages_before_it() {
    let bench = Bench::new();
    let recording = bench.path("scan.mcap");
    let live = bench.start(&[&"--record", &recording]);
    live.wait_for_clouds(5);
    freeze(&bench, &live, "correspondence", 40, || {
        live.wait_until("the stage is silent", || is_only_silent_stage(&bench, "correspondence"));
    });
    // Only one window may wait for the stage. The others are dropped.
    let busy = bench.counts(Stage::Phase).dropped(DropReason::NextStageBusy);
    assert!(busy > 0);
    freeze(&bench, &live, "phase", 40, || ());
    freeze(&bench, &live, "recorder", 40, || ());
    let run = live.quit();
    run.assert_balanced();
    assert_eq!((run.code, &run.summary["restarts"]), (Some(3), &0.into()), "{run:?}");
    assert!(run.stage("phase").dropped(DropReason::NextStageBusy) >= busy, "{run:?}");
    for stage in ["pairing", "recorder"] {
        assert!(run.stage(stage).dropped(DropReason::Overrun) > 0, "{stage}: {run:?}");
    }
    bench.assert_nothing_left();
    // The recording is intact. It only lacks what the recorder missed.
    let check = bench.json(&[3], &[&"check", &recording, &"--json"]);
    assert_eq!(check["fault_count"], 0, "{check}");
    let verified = bench.json(&[0, 3], &[&"replay", &recording, &"--verify", &"--json"]);
    assert_eq!((&verified["different"], &verified["no_cloud"]), (&0.into(), &0.into()));
    assert!(verified["same"].as_u64().unwrap() >= 20, "{verified}");
}
