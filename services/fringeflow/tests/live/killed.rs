//! Killed services, and a killed supervisor.

use rustix::process::Signal;
use serde_json::Value;

use fringeflow_message::DropReason;

use crate::support::{Bench, NAME, SERVICES, wait_until};

#[test]
fn a_killed_service_is_restarted_and_the_others_go_on() {
    // With eight threads, two windows are searched at once.
    let changes = [
        ("enabled = false", "address = \"127.0.0.1:0\"\nfoxglove = \"127.0.0.1:0\""),
        ("[window]", "[processors.correspondence]\nthreads = 8\n[window]"),
    ];
    let bench = Bench::with_changes(&changes);
    let live = bench.start(&[&"--record", &bench.path("scan.mcap")]);
    live.wait_for_clouds(10);
    let running: Vec<&str> = SERVICES.into_iter().filter(|service| bench.pid_of(service).is_some()).collect();
    assert!(running.len() >= 7, "{running:?}");
    for &service in &running {
        let before: Vec<Option<u32>> = running.iter().map(|service| bench.pid_of(service)).collect();
        let killed = live.signal(service, Signal::KILL);
        live.wait_until("the service is restarted", || bench.pid_of(service).is_some_and(|pid| pid != killed));
        live.wait_for_clouds(10);
        for (other, pid) in running.iter().zip(before).filter(|(other, _)| **other != service) {
            assert_eq!(bench.pid_of(other), pid, "{other}, when {service} was killed");
        }
    }
    live.wait_until("the recorder writes a new file", || bench.path("scan-continued-1.mcap.part").exists());
    let mut before = status(&bench);
    live.wait_until("every service was restarted once, and goes on", || {
        let earlier = std::mem::replace(&mut before, status(&bench));
        let stages = |status: &Value| status["stages"].as_array().unwrap().clone();
        stages(&before)
            .iter()
            .zip(stages(&earlier))
            .all(|(stage, earlier)| stage["restarts"] == 1 && stage["passed"].as_u64() > earlier["passed"].as_u64())
    });
    live.wait_for_clouds(10);
    let run = live.quit();
    run.assert_balanced();
    assert_eq!((run.code, &run.summary["restarts"]), (Some(3), &7.into()), "{run:?}");
    for stage in ["pairing", "correspondence", "cloud", "recorder"] {
        assert!(run.stage(stage).dropped(DropReason::Restart) > 0, "{stage}: {run:?}");
    }
    // Projector and cameras each started a new session.
    assert!(run.stage("windowing").dropped(DropReason::NewSession) >= 2, "{run:?}");
    bench.assert_nothing_left();
    // The killed recorder could not count what it lost.
    bench.execute(&[3], &[&"recover", &bench.path("scan.mcap.part"), &"-o", &bench.path("recovered.mcap")]);
    for name in ["recovered.mcap", "scan-continued-1.mcap"] {
        let verified = bench.json(&[0, 3], &[&"replay", &bench.path(name), &"--verify", &"--json"]);
        assert_eq!((&verified["different"], &verified["no_cloud"]), (&0.into(), &0.into()), "{name}");
        assert!(verified["same"].as_u64().unwrap() >= 10, "{name}");
    }
    // The replay repeats the sessions of projector and cameras that began during the recording.
    let replayed = bench.replay(&[&"replay", &bench.path("recovered.mcap"), &"--rate", &"max", &"--verify"]);
    replayed.assert_balanced();
    let compared = &replayed.summary["compared"];
    assert_eq!((&compared["different"], &compared["missing"]), (&0.into(), &0.into()), "{replayed:?}");
    assert!(compared["same"].as_u64().unwrap() >= 10, "{replayed:?}");
}

fn status(bench: &Bench) -> Value {
    let status = bench.json(&[0], &[&"status", &NAME, &"--json"]);
    assert_eq!(status["stages"].as_array().unwrap().len(), 10, "{status}");
    status
}

#[test]
fn the_items_of_a_service_that_is_dead_at_the_end_are_counted_as_dropped() {
    let bench = Bench::new();
    let live = bench.start(&[]);
    // Each death doubles the delay before the restart. The last delay is not over when the run ends.
    for _ in 0..4 {
        live.wait_for_clouds(2);
        let killed = live.signal("cloud", Signal::KILL);
        live.wait_until("the service is gone", || bench.pid_of("cloud") != Some(killed));
    }
    let run = live.quit();
    run.assert_balanced();
    assert_eq!(run.code, Some(3), "{run:?}");
    assert!(run.stage("cloud").dropped(DropReason::Restart) > 0, "{run:?}");
    bench.assert_nothing_left();
}

#[test]
fn services_end_when_their_supervisor_is_killed_and_the_name_is_free_again() {
    let bench = Bench::new();
    let recording = bench.path("scan.mcap");
    let live = bench.start(&[&"--record", &recording]);
    live.wait_for_clouds(10);
    live.kill_supervisor();
    for service in SERVICES {
        assert!(wait_until(|| bench.pid_of(service).is_none()), "{service} still runs");
    }
    // The recorder closed its file.
    bench.execute(&[0, 3], &[&"check", &recording]);
    let verified = bench.json(&[0, 3], &[&"replay", &recording, &"--verify", &"--json"]);
    assert_eq!(verified["different"], 0);
    assert!(verified["same"].as_u64().unwrap() > 0, "{verified}");
    let run = bench.run(&[&"--seconds", &"1"]);
    run.assert_undisturbed();
    assert!(run.stage("cloud").passed > 0, "{run:?}");
    bench.assert_nothing_left();
}
