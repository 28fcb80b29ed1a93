//! The commands on recordings: what they say, what they write, and their exit codes.

use super::*;

/// Asserts an exit code and one line of standard error that holds all of `says`.
pub(crate) fn assert_ended(output: &Output, code: i32, says: &[&str]) {
    let error = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{error}");
    assert_eq!(error.lines().count(), 1, "{error}");
    for part in says {
        assert!(error.contains(part), "{part:?} is missing in: {error}");
    }
}

#[test]
fn a_recording_and_its_folder_yield_the_same_cloud_and_the_same_scores() {
    let folder = tempfile::tempdir().unwrap();
    let recording = imported(&folder);
    let [a, b] = ["folder.ply", "recording.ply"].map(|name| folder.path().join(name));
    done(&[&"reconstruct", &dataset(), &"-o", &a]);
    done(&[&"reconstruct", &recording, &"-o", &b]);
    let bytes = std::fs::read(&a).unwrap();
    assert!(bytes.len() > 10_000 && bytes == std::fs::read(&b).unwrap());
    done(&[&"reconstruct", &recording, &"-o", &b, &"--frames", &"0..4", &"--steps", &"4"]);
    assert!(bytes == std::fs::read(&b).unwrap());
    let scores = [dataset(), &recording].map(|input| json(&done(&[&"evaluate", &input, &"--json"])));
    assert_eq!(scores[0], scores[1]);
}

#[test]
fn what_a_recording_has_not_is_asked_for_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let recording = imported(&folder);
    let gray = fringeflow(&[&"evaluate", &recording, &"--against", &"gray"]);
    assert_ended(&gray, 2, &["plane.mcap", "no Gray-code images"]);
    let cloud = folder.path().join("cloud.ply");
    let frames = fringeflow(&[&"reconstruct", &recording, &"-o", &cloud, &"--frames", &"2..6"]);
    assert_ended(&frames, 2, &["--frames 2..6", "image pairs 0..4"]);
    assert_ended(&fringeflow(&[&"export", &recording, &"-o", &cloud]), 2, &["plane.mcap has 0 clouds"]);
    assert_ended(&fringeflow(&[&"replay", &recording, &"--verify"]), 2, &["has no clouds"]);
    assert_ended(&fringeflow(&[&"import", &dataset(), &"-o", &recording]), 2, &["plane.mcap", "already exists"]);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn latencies_are_told_of_runs_alone() {
    let folder = tempfile::tempdir().unwrap();
    let recording = imported(&folder);
    let says = &["plane.mcap", "has no reports of the stages", "fringeflow run --record"];
    assert_ended(&fringeflow(&[&"latency", &recording]), 2, says);
    let page = folder.path().join("page.html");
    assert_ended(&fringeflow(&[&"latency", &recording, &"--html", &page]), 2, says);
    let nowhere = folder.path().join("nowhere/page.html");
    assert_ended(&fringeflow(&[&"latency", &recording, &"--html", &nowhere]), 1, &["nowhere", "does not exist"]);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn a_recording_says_what_is_in_it_and_that_it_is_whole() {
    let folder = tempfile::tempdir().unwrap();
    let recording = imported(&folder);
    let info = json(&done(&[&"info", &recording, &"--json"]));
    assert_eq!((info["steps"].as_u64(), info["lost"].as_u64()), (Some(4), Some(0)));
    let frames = info["topics"].as_array().unwrap().iter().find(|topic| topic["topic"] == "/cam1/frame").unwrap();
    assert_eq!(frames["messages"], 4);
    assert!((frames["rate_hz"].as_f64().unwrap() - 50.0).abs() < 1e-9);
    assert!(String::from_utf8_lossy(&done(&[&"info", &recording]).stdout).contains("96 × 80 pixels, 4 steps, GREY"));
    let check = json(&done(&[&"check", &recording, &"--json"]));
    assert_eq!(check["missing_images"], serde_json::json!([0, 0]));
}

#[test]
fn images_come_back_as_a_dataset_that_yields_the_same_cloud() {
    let folder = tempfile::tempdir().unwrap();
    let recording = imported(&folder);
    let exported = folder.path().join("exported");
    done(&[&"export", &recording, &"--images", &"-o", &exported]);
    for name in ["calibration.yml", "truth.npz", "cam1/phase_02.png"] {
        let [a, b] = [dataset(), &exported].map(|folder| std::fs::read(folder.join(name)).unwrap());
        assert!(a == b, "{name}");
    }
    let scores = [dataset(), &exported].map(|input| json(&done(&[&"evaluate", &input, &"--json"])));
    assert_eq!(scores[0], scores[1]);
    let again = fringeflow(&[&"export", &recording, &"--images", &"-o", &exported]);
    assert_ended(&again, 2, &["exported", "already exists"]);
}

#[test]
fn a_cut_recording_is_refused_recovered_and_known_to_have_lost_something() {
    let folder = tempfile::tempdir().unwrap();
    let recording = imported(&folder);
    let bytes = std::fs::read(&recording).unwrap();
    let cut = folder.path().join("cut.mcap.part");
    // Before the footer, after all chunks.
    std::fs::write(&cut, &bytes[..bytes.len() - 100]).unwrap();
    assert_ended(&fringeflow(&[&"check", &cut]), 1, &["cut.mcap.part", "unfinished", "fringeflow recover"]);
    assert_ended(&fringeflow(&[&"info", &cut]), 2, &["unfinished", "fringeflow recover"]);
    let saved = folder.path().join("cut.mcap");
    let report = json(&done(&[&"recover", &cut, &"-o", &saved, &"--json"]));
    assert_eq!(report["messages"]["/cam2/frame"], 4);
    assert_eq!(report["faults"].as_array().unwrap().len(), 1);
    let [a, b] = ["whole.ply", "saved.ply"].map(|name| folder.path().join(name));
    done(&[&"reconstruct", &recording, &"-o", &a]);
    done(&[&"reconstruct", &saved, &"-o", &b]);
    assert!(std::fs::read(a).unwrap() == std::fs::read(b).unwrap());
}

#[test]
fn a_damaged_recording_is_named_with_the_place() {
    let folder = tempfile::tempdir().unwrap();
    let recording = imported(&folder);
    let mut bytes = std::fs::read(&recording).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    let damaged = folder.path().join("damaged.mcap");
    std::fs::write(&damaged, bytes).unwrap();
    assert_ended(&fringeflow(&[&"check", &damaged]), 1, &["damaged.mcap", "damaged at byte", "checksum"]);
    let cloud = folder.path().join("cloud.ply");
    assert_ended(&fringeflow(&[&"reconstruct", &damaged, &"-o", &cloud]), 2, &["damaged at byte"]);
    assert!(!cloud.exists());
}
