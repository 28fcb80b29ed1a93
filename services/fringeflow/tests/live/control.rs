//! `fringeflow status` and `control`, from a second terminal.

use std::ffi::OsStr;
use std::time::Duration;

use fringeflow_message::{Command, ControlRequest, Stage, Text};
use fringeflow_recording::{Content, Recording, Topic};
use fringeflow_transport::request;

use crate::support::{Arguments, Bench, NAME};

const ANSWER_TIMEOUT: Duration = Duration::from_secs(60);

impl Bench {
    /// Runs `fringeflow control`. Returns its standard output.
    fn control(&self, command: Arguments<'_>) -> String {
        self.execute(&[0], &control_arguments(command))
    }

    /// Asserts that `fringeflow control` is refused.
    fn assert_control_refused(&self, command: Arguments<'_>, says: &[&str]) {
        self.assert_refused(&control_arguments(command), says);
    }
}

fn control_arguments<'a>(command: Arguments<'a>) -> Vec<&'a dyn AsRef<OsStr>> {
    let subcommand: [&dyn AsRef<OsStr>; 2] = [&"control", &NAME];
    [&subcommand, command].concat()
}

#[test]
fn status_and_control_refuse_an_instance_that_does_not_run() {
    let bench = Bench::new();
    bench.assert_refused(&[&"status", &"nobody"], &["no instance nobody is running here"]);
    assert_eq!(bench.execute(&[0], &[&"status"]), "No instance is running.\n");
    assert_eq!(bench.json(&[0], &[&"status", &"--json"])["instances"], serde_json::json!([]));
    bench.assert_control_refused(&[&"stop"], &["no instance t is running here"]);
    bench.assert_refused(&[&"control", &"a/b", &"stop"], &["a/b", "letters"]);
    bench.assert_nothing_left();
}

#[test]
fn control_starts_and_stops_scan_and_recording_sets_marks_and_quits() {
    let bench = Bench::new();
    let live = bench.start(&[]);
    live.wait_for_clouds(5);
    let status = bench.json(&[0], &[&"status", &NAME, &"--json"]);
    assert_eq!((&status["instance"], &status["scanning"]), (&NAME.into(), &true.into()));
    assert!(status["recording"].is_null() && status["exposure_to_cloud"]["p50_ms"].as_f64().unwrap() > 0.0, "{status}");
    let capacity = ["clouds_hz", "windows_hz", "window_ms"].map(|figure| status["capacity"][figure].as_f64().unwrap());
    assert!(capacity.iter().all(|&figure| figure > 0.0), "{status}");
    let stages: Vec<_> = status["stages"].as_array().unwrap().iter().map(|s| s["stage"].as_str().unwrap()).collect();
    let untracked: Vec<_> = Stage::ALL.into_iter().filter(|&stage| stage != Stage::Tracking).map(Stage::name).collect();
    assert_eq!(stages, untracked);

    let listed = bench.json(&[0], &[&"status", &"--json"]);
    assert_eq!(
        (&listed["instances"][0]["instance"], &listed["instances"][0]["state"]),
        (&NAME.into(), &"scanning (virtual images)".into())
    );
    assert!(listed["instances"][0]["since"].as_str().unwrap().ends_with('Z'), "{listed}");
    let text = bench.execute(&[0], &[&"status"]);
    assert!(text.starts_with("NAME ") && text.lines().nth(1).unwrap().ends_with("scanning (virtual images)"), "{text}");

    assert_eq!(bench.control(&[&"stop"]), "t: scan stopped\n");
    assert_eq!(bench.control(&[&"stop"]), "t: the scan is already stopped\n");
    // Images that are already exposed are still processed.
    let mut before = 0;
    live.wait_until("the cameras have stopped", || {
        std::thread::sleep(Duration::from_millis(300));
        std::mem::replace(&mut before, bench.counts(Stage::Camera1).passed) == bench.counts(Stage::Camera1).passed
    });
    assert!(bench.execute(&[0], &[&"status", &NAME]).starts_with("t: stopped (virtual images)\n"));
    assert_eq!(bench.control(&[&"start"]), "t: scan started\n");
    live.wait_for_clouds(5);

    let (first, second) = (bench.path("first.mcap"), bench.path("second.mcap"));
    bench.assert_control_refused(&[&"mark", &"chin"], &["no recording is running"]);
    bench.assert_control_refused(&[&"end-recording"], &["no recording is running"]);
    let answer = bench.control(&[&"record", &first]);
    assert_eq!(answer, format!("t: recording started ({})\n", first.display()));
    bench.assert_control_refused(&[&"record", &second], &["already running", "first.mcap"]);
    live.wait_for_clouds(10);
    assert_eq!(bench.control(&[&"mark", &"chin"]), format!("t: mark 1 set ({})\n", first.display()));
    assert_eq!(bench.control(&[&"end-recording"]), format!("t: recording ended ({})\n", first.display()));
    live.wait_until("the recording is complete", || first.exists());
    bench.assert_control_refused(&[&"record", &first], &["first.mcap", "already exists"]);
    bench.assert_control_refused(&[&"record", &bench.path("nowhere/a.mcap")], &["nowhere", "does not exist"]);
    bench.assert_control_refused(&[&"mark", &"x".repeat(257)], &["too long"]);
    // Without a file, the recording goes to the configured folder, which is created.
    bench.control(&[&"record"]);
    live.wait_for_clouds(5);
    assert_eq!(bench.control(&[&"quit"]), "t: quitting: the recording and the services end in pipeline order\n");
    let run = live.wait_for_end();
    run.assert_undisturbed();
    bench.assert_nothing_left();
    let files = std::fs::read_dir(bench.path("recordings")).unwrap().flatten().map(|entry| entry.path());
    // The folder also has the report on the run.
    let recordings: Vec<_> =
        files.filter(|file| file.extension().is_some_and(|extension| extension == "mcap")).collect();
    assert_eq!(recordings.len(), 1, "{recordings:?}");
    bench.execute(&[0, 3], &[&"check", &recordings[0]]);

    let info = bench.json(&[0], &[&"info", &first, &"--json"]);
    let marks: Vec<_> = info["marks"].as_array().unwrap().iter().map(|mark| &mark["text"]).collect();
    assert_eq!(marks, ["chin"]);
    // The recording began during the scan. The replay reproduces every cloud whose images are all in it.
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
        assert_eq!(request(&instance, &mark, ANSWER_TIMEOUT).unwrap().refused, 0);
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
