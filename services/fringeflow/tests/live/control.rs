//! Status and commands from a second terminal.

use std::ffi::OsStr;
use std::time::Duration;

use fringeflow_message::{Command, ControlRequest, Stage, Text};
use fringeflow_recording::{Content, Recording, Topic};
use fringeflow_transport::request;

use crate::support::{Arguments, Bench, NAME};

const ANSWER: Duration = Duration::from_secs(60);

impl Bench {
    /// `fringeflow control`; what it prints.
    fn control(&self, wish: Arguments<'_>) -> String {
        self.done(&[0], &addressed(wish))
    }

    /// `fringeflow control` that must be refused.
    fn control_refused(&self, wish: Arguments<'_>, says: &[&str]) {
        self.refused(&addressed(wish), says);
    }
}

fn addressed<'a>(wish: Arguments<'a>) -> Vec<&'a dyn AsRef<OsStr>> {
    let to: [&dyn AsRef<OsStr>; 2] = [&"control", &NAME];
    [&to, wish].concat()
}

#[test]
fn nobody_answers_for_an_instance_that_does_not_run() {
    let bench = Bench::new();
    bench.refused(&[&"status", &"nobody"], &["no instance nobody is running here"]);
    assert_eq!(bench.done(&[0], &[&"status"]), "No instance is running.\n");
    assert_eq!(bench.json(&[0], &[&"status", &"--json"])["instances"], serde_json::json!([]));
    bench.control_refused(&[&"stop"], &["no instance t is running here"]);
    bench.refused(&[&"control", &"a/b", &"stop"], &["a/b", "letters"]);
    bench.assert_nothing_left();
}

#[test]
fn an_instance_does_what_another_terminal_asks() {
    let bench = Bench::new();
    let live = bench.start(&[]);
    live.wait_for_clouds(5);
    let status = bench.json(&[0], &[&"status", &NAME, &"--json"]);
    assert_eq!((&status["instance"], &status["scanning"]), (&NAME.into(), &true.into()));
    assert!(status["recording"].is_null() && status["exposure_to_cloud"]["p50_ms"].as_f64().unwrap() > 0.0, "{status}");
    let stages: Vec<_> = status["stages"].as_array().unwrap().iter().map(|s| s["stage"].as_str().unwrap()).collect();
    let untracked: Vec<_> = Stage::ALL.into_iter().filter(|&stage| stage != Stage::Tracking).map(Stage::name).collect();
    assert_eq!(stages, untracked);

    let listed = bench.json(&[0], &[&"status", &"--json"]);
    assert_eq!(
        (&listed["instances"][0]["instance"], &listed["instances"][0]["state"]),
        (&NAME.into(), &"scanning".into())
    );
    assert!(listed["instances"][0]["since"].as_str().unwrap().ends_with('Z'), "{listed}");
    let text = bench.done(&[0], &[&"status"]);
    assert!(text.starts_with("NAME ") && text.lines().nth(1).unwrap().ends_with("scanning"), "{text}");

    assert_eq!(bench.control(&[&"stop"]), "t: scan stopped\n");
    assert_eq!(bench.control(&[&"stop"]), "t: the scan was stopped already\n");
    // What had been exposed comes to its end.
    let mut before = 0;
    live.wait_until("it stands still", || {
        std::thread::sleep(Duration::from_millis(300));
        std::mem::replace(&mut before, bench.counts(Stage::Camera1).passed) == bench.counts(Stage::Camera1).passed
    });
    assert!(bench.done(&[0], &[&"status", &NAME]).starts_with("t: stopped\n"));
    assert_eq!(bench.control(&[&"start"]), "t: scan started\n");
    live.wait_for_clouds(5);

    let (first, second) = (bench.path("first.mcap"), bench.path("second.mcap"));
    bench.control_refused(&[&"mark", &"chin"], &["no recording is running"]);
    bench.control_refused(&[&"end-recording"], &["no recording is running"]);
    let answer = bench.control(&[&"record", &first]);
    assert_eq!(answer, format!("t: recording started ({})\n", first.display()));
    bench.control_refused(&[&"record", &second], &["running already", "first.mcap"]);
    live.wait_for_clouds(10);
    assert_eq!(bench.control(&[&"mark", &"chin"]), format!("t: mark 1 set ({})\n", first.display()));
    assert_eq!(bench.control(&[&"end-recording"]), format!("t: recording ended ({})\n", first.display()));
    live.wait_until("the recording is whole", || first.exists());
    bench.control_refused(&[&"record", &first], &["first.mcap", "exists already"]);
    bench.control_refused(&[&"record", &bench.path("nowhere/a.mcap")], &["nowhere", "does not exist"]);
    bench.control_refused(&[&"mark", &"x".repeat(257)], &["too long"]);
    // Its folder is made.
    bench.control(&[&"record"]);
    live.wait_for_clouds(5);
    assert_eq!(bench.control(&[&"quit"]), "t: quits: recording and services end in the order of the pipeline\n");
    let ended = live.ended();
    ended.assert_undisturbed();
    bench.assert_nothing_left();
    let files = std::fs::read_dir(bench.path("recordings")).unwrap().flatten().map(|entry| entry.path());
    // The report on the run lies beside it.
    let named: Vec<_> = files.filter(|file| file.extension().is_some_and(|extension| extension == "mcap")).collect();
    assert_eq!(named.len(), 1, "{named:?}");
    bench.done(&[0, 3], &[&"check", &named[0]]);

    let info = bench.json(&[0], &[&"info", &first, &"--json"]);
    let marks: Vec<_> = info["marks"].as_array().unwrap().iter().map(|mark| &mark["text"]).collect();
    assert_eq!(marks, ["chin"]);
    // It began during the scan: every cloud whose images are all in it comes again.
    let replayed = bench.replay(&[&"replay", &first, &"--rate", &"max", &"--verify"]);
    replayed.assert_balanced();
    let compared = &replayed.summary["compared"];
    assert_eq!((&compared["different"], &compared["missing"]), (&0.into(), &0.into()), "{replayed:?}");
    assert!(compared["same"].as_u64().unwrap() > 0, "{replayed:?}");
}

#[test]
fn marks_in_quick_succession_are_all_recorded() {
    let bench = Bench::new();
    let recording = bench.path("scan.mcap");
    let live = bench.start(&[&"--record", &recording]);
    let texts: Vec<String> = (0..20).map(|number| format!("mark {number}")).collect();
    let instance = bench.instance();
    for text in &texts {
        let mark = ControlRequest { command: Command::Mark as u32, reserved: 0, text: Text::new(text) };
        assert_eq!(request(&instance, &mark, ANSWER).unwrap().refused, 0);
    }
    live.quit().assert_undisturbed();
    let recording = Recording::open(&recording).unwrap();
    let mark = |content| match content {
        Content::Mark(text) => Some(text),
        _ => None,
    };
    let marks: Vec<_> =
        recording.messages_of(Topic::Log).filter_map(|message| mark(message.unwrap().content)).collect();
    assert_eq!(marks, texts);
}
