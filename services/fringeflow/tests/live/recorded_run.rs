//! A recorded run and its replays.

use std::path::Path;

use fringeflow_message::DropReason;

use crate::support::{Bench, FinishedRun};

#[test]
fn a_recorded_run_is_balanced_and_replays_byte_for_byte() {
    let bench = Bench::new();
    let recording = bench.path("scan.mcap");
    let run = bench.run(&[&"--seconds", &"3", &"--record", &recording]);
    run.assert_undisturbed();
    bench.assert_nothing_left();
    assert!(run.stage("cloud").passed > 0, "{run:?}");
    assert_eq!(run.summary["recording"], recording.to_str().unwrap());
    // On a busy machine the recorder may lose messages. Then it counts the loss.
    let lost = run.stage("recorder").dropped(DropReason::Overrun);
    let codes: &[i32] = if lost > 0 { &[0, 3] } else { &[0] };
    assert_recorded(&bench, &recording, &run, lost);
    let check = bench.json(codes, &[&"check", &recording, &"--json"]);
    assert_eq!(check["fault_count"], 0);
    // With eight threads, two windows are searched at once.
    for threads in ["1", "8"] {
        let offline = bench.json(codes, &[&"--threads", &threads, &"replay", &recording, &"--verify", &"--json"]);
        assert_eq!(
            (&offline["different"], &offline["no_cloud"], &offline["before_recording"]),
            (&0.into(), &0.into(), &0.into())
        );
        let same = offline["same"].as_u64().unwrap();
        assert!(same > 0 && same <= check["clouds"].as_u64().unwrap() && same + 4 * lost >= run.stage("cloud").passed);
        let live = bench.replay(&[&"--threads", &threads, &"replay", &recording, &"--rate", &"max", &"--verify"]);
        live.assert_balanced();
        assert!(live.code.is_some_and(|code| codes.contains(&code)), "{live:?}");
        let compared = &live.summary["compared"];
        assert_eq!((&compared["different"], &compared["missing"]), (&0.into(), &0.into()), "{live:?}");
        assert_eq!(compared["same"], offline["same"], "{live:?}");
    }
    bench.assert_nothing_left();
}

/// Asserts that the recording has everything that the cameras, the projector and the cloud service sent, except for the
/// `lost` messages.
fn assert_recorded(bench: &Bench, recording: &Path, run: &FinishedRun, lost: u64) {
    let info = bench.json(&[0], &[&"info", &recording, &"--json"]);
    for (stage, topic) in [
        ("camera1", "/cam1/frame"),
        ("camera2", "/cam2/frame"),
        ("projector", "/projector/pattern"),
        ("cloud", "/cloud"),
    ] {
        let found = info["topics"].as_array().unwrap().iter().find(|found| found["topic"] == topic).unwrap();
        let (messages, passed) = (found["messages"].as_u64().unwrap(), run.stage(stage).passed);
        assert!(messages <= passed && messages + lost >= passed, "{topic}: {messages} of {passed}: {info}");
    }
}
