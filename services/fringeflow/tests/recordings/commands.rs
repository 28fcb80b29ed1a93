//! The commands on recordings: their messages, their output, and their exit codes.

use super::*;

/// Asserts an exit code, and one line of standard error that contains all of `says`.
pub(crate) fn assert_exit(output: &Output, code: i32, says: &[&str]) {
    let error = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{error}");
    assert_eq!(error.lines().count(), 1, "{error}");
    for part in says {
        assert!(error.contains(part), "{part:?} is missing in: {error}");
    }
}

#[test]
fn a_recording_and_its_dataset_folder_give_the_same_cloud_and_the_same_scores() {
    let folder = tempfile::tempdir().unwrap();
    let recording = import_dataset(&folder);
    let [a, b] = ["folder.ply", "recording.ply"].map(|name| folder.path().join(name));
    run_ok(&[&"reconstruct", &dataset(), &"-o", &a]);
    run_ok(&[&"reconstruct", &recording, &"-o", &b]);
    let bytes = std::fs::read(&a).unwrap();
    assert!(bytes.len() > 10_000 && bytes == std::fs::read(&b).unwrap());
    run_ok(&[&"reconstruct", &recording, &"-o", &b, &"--frames", &"0..4", &"--steps", &"4"]);
    assert!(bytes == std::fs::read(&b).unwrap());
    let scores = [dataset(), &recording].map(|input| json(&run_ok(&[&"evaluate", &input, &"--json"])));
    assert_eq!(scores[0], scores[1]);
}

#[test]
fn requests_for_content_that_a_recording_lacks_are_refused_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let recording = import_dataset(&folder);
    let gray = fringeflow(&[&"evaluate", &recording, &"--against", &"gray"]);
    assert_exit(&gray, 2, &["plane.mcap", "no Gray-code images"]);
    let cloud = folder.path().join("cloud.ply");
    let frames = fringeflow(&[&"reconstruct", &recording, &"-o", &cloud, &"--frames", &"2..6"]);
    assert_exit(&frames, 2, &["--frames 2..6", "image pairs 0..4"]);
    assert_exit(&fringeflow(&[&"export", &recording, &"-o", &cloud]), 2, &["plane.mcap has 0 clouds"]);
    assert_exit(&fringeflow(&[&"replay", &recording, &"--verify"]), 2, &["has no clouds"]);
    assert_exit(&fringeflow(&[&"import", &dataset(), &"-o", &recording]), 2, &["plane.mcap", "already exists"]);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn latency_refuses_a_recording_without_reports() {
    let folder = tempfile::tempdir().unwrap();
    let recording = import_dataset(&folder);
    let says = &["plane.mcap", "has no reports of the stages", "fringeflow run --record"];
    assert_exit(&fringeflow(&[&"latency", &recording]), 2, says);
    let page = folder.path().join("page.html");
    assert_exit(&fringeflow(&[&"latency", &recording, &"--html", &page]), 2, says);
    let nowhere = folder.path().join("nowhere/page.html");
    assert_exit(&fringeflow(&[&"latency", &recording, &"--html", &nowhere]), 1, &["nowhere", "does not exist"]);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn info_and_check_describe_an_intact_recording() {
    let folder = tempfile::tempdir().unwrap();
    let recording = import_dataset(&folder);
    let info = json(&run_ok(&[&"info", &recording, &"--json"]));
    assert_eq!((info["steps"].as_u64(), info["lost"].as_u64()), (Some(4), Some(0)));
    let frames = info["topics"].as_array().unwrap().iter().find(|topic| topic["topic"] == "/cam1/frame").unwrap();
    assert_eq!(frames["messages"], 4);
    assert!((frames["rate_hz"].as_f64().unwrap() - 50.0).abs() < 1e-9);
    assert!(String::from_utf8_lossy(&run_ok(&[&"info", &recording]).stdout).contains("96 × 80 pixels, 4 steps, GREY"));
    let check = json(&run_ok(&[&"check", &recording, &"--json"]));
    assert_eq!(check["missing_images"], serde_json::json!([0, 0]));
}

#[test]
fn exported_images_are_a_dataset_with_the_same_files_and_scores() {
    let folder = tempfile::tempdir().unwrap();
    let recording = import_dataset(&folder);
    let exported = folder.path().join("exported");
    run_ok(&[&"export", &recording, &"--images", &"-o", &exported]);
    for name in ["calibration.yml", "truth.npz", "cam1/phase_02.png"] {
        let [a, b] = [dataset(), &exported].map(|folder| std::fs::read(folder.join(name)).unwrap());
        assert!(a == b, "{name}");
    }
    let scores = [dataset(), &exported].map(|input| json(&run_ok(&[&"evaluate", &input, &"--json"])));
    assert_eq!(scores[0], scores[1]);
    let again = fringeflow(&[&"export", &recording, &"--images", &"-o", &exported]);
    assert_exit(&again, 2, &["exported", "already exists"]);
}

#[test]
fn a_truncated_recording_is_refused_until_it_is_recovered() {
    let folder = tempfile::tempdir().unwrap();
    let recording = import_dataset(&folder);
    let bytes = std::fs::read(&recording).unwrap();
    let cut = folder.path().join("cut.mcap.part");
    // The cut is after all chunks and before the footer.
    std::fs::write(&cut, &bytes[..bytes.len() - 100]).unwrap();
    assert_exit(&fringeflow(&[&"check", &cut]), 1, &["cut.mcap.part", "unfinished", "fringeflow recover"]);
    assert_exit(&fringeflow(&[&"info", &cut]), 2, &["unfinished", "fringeflow recover"]);
    let saved = folder.path().join("cut.mcap");
    let report = json(&run_ok(&[&"recover", &cut, &"-o", &saved, &"--json"]));
    assert_eq!(report["messages"]["/cam2/frame"], 4);
    assert_eq!(report["faults"].as_array().unwrap().len(), 1);
    let [a, b] = ["whole.ply", "saved.ply"].map(|name| folder.path().join(name));
    run_ok(&[&"reconstruct", &recording, &"-o", &a]);
    run_ok(&[&"reconstruct", &saved, &"-o", &b]);
    assert!(std::fs::read(a).unwrap() == std::fs::read(b).unwrap());
}

#[test]
fn a_damaged_recording_is_refused_with_the_position_of_the_damage() {
    let folder = tempfile::tempdir().unwrap();
    let recording = import_dataset(&folder);
    let mut bytes = std::fs::read(&recording).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    let damaged = folder.path().join("damaged.mcap");
    std::fs::write(&damaged, bytes).unwrap();
    assert_exit(&fringeflow(&[&"check", &damaged]), 1, &["damaged.mcap", "damaged at byte", "checksum"]);
    let cloud = folder.path().join("cloud.ply");
    assert_exit(&fringeflow(&[&"reconstruct", &damaged, &"-o", &cloud]), 2, &["damaged at byte"]);
    assert!(!cloud.exists());
}

/// Returns the line of the output that says what was lost.
#[track_caller]
fn lost_line(output: &Output) -> String {
    let text = String::from_utf8_lossy(&output.stdout).into_owned();
    let mut lines = text.lines().filter(|line| line.starts_with("losses: "));
    let line = lines.next().unwrap_or_else(|| panic!("no line says what was lost: {text}")).to_owned();
    assert_eq!(lines.next(), None, "{text}");
    line
}

#[test]
fn info_check_and_recover_say_the_same_about_losses() {
    let folder = tempfile::tempdir().unwrap();
    let recording = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../recordings/cycle.mcap");
    let saved = folder.path().join("whole.mcap");
    let recovered = lost_line(&run_ok(&[&"recover", &recording, &"-o", &saved]));
    assert!(recovered.starts_with("losses: nothing was lost; left out by choice: not_recording 19 ("), "{recovered}");
    assert_eq!(lost_line(&run_ok(&[&"info", &saved])), recovered);
    assert_eq!(lost_line(&run_ok(&[&"check", &saved])), recovered);

    // A damaged chunk, and a file without its end.
    let bytes = std::fs::read(&recording).unwrap();
    let middle = bytes.len() / 2;
    let mut altered = bytes.clone();
    altered[middle] ^= 1;
    for (name, bytes, says) in
        [("altered", &altered[..], "missing in recordings"), ("cut", &bytes[..middle], "is unknown")]
    {
        let [damaged, saved] = [".part", ".mcap"].map(|end| folder.path().join(format!("{name}{end}")));
        std::fs::write(&damaged, bytes).unwrap();
        let recovered = fringeflow(&[&"recover", &damaged, &"-o", &saved]);
        let lost = lost_line(&recovered);
        let sentence = lost.strip_prefix("losses: ").unwrap();
        assert!(lost.contains(says), "{lost}");
        assert_exit(&recovered, 3, &[sentence]);
        let checked = fringeflow(&[&"check", &saved]);
        assert_exit(&checked, 3, &[sentence]);
        assert_eq!([lost_line(&checked), lost_line(&run_ok(&[&"info", &saved]))], [lost.clone(), lost]);
    }
}

#[test]
fn settings_that_equal_the_recorded_ones_are_said_to_change_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let recording = root.join("recordings/cycle.mcap");
    let cloud = folder.path().join("cloud.ply");
    let note = |config: &Path| {
        let output = run_ok(&[&"reconstruct", &recording, &"--config", &config, &"-o", &cloud]);
        String::from_utf8(output.stderr).unwrap()
    };
    let text = note(&root.join("configs/reconstruct.toml"));
    assert!(text.contains("reconstruct.toml changes nothing") && text.contains("cycle.mcap"), "{text}");
    let other = folder.path().join("other.toml");
    std::fs::write(&other, "[phase]\nmin_modulation_grey = 7.0\n").unwrap();
    assert_eq!(note(&other), "");
}

#[test]
fn files_of_other_programs_are_named_and_not_called_damaged() {
    let folder = tempfile::tempdir().unwrap();
    let [file, saved] = ["other.mcap", "saved.mcap"].map(|name| folder.path().join(name));
    for (bytes, says) in [(&b""[..], "empty"), (b"hello\n", "a text"), (b"\x1f\x8b\x08\0\0", "a gzip file")] {
        std::fs::write(&file, bytes).unwrap();
        for command in ["info", "check"] {
            assert_exit(&fringeflow(&[&command, &file]), 2, &["other.mcap", "is not an MCAP file, but", says]);
        }
        assert_exit(&fringeflow(&[&"recover", &file, &"-o", &saved]), 2, &["is not an MCAP file, but", says]);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
