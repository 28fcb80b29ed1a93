//! `run --check` and `cameras` without a camera: they report every problem and start nothing.

use crate::support::Bench;

/// Runs the check, which must end with this exit code. Returns for each point its name, whether it is ready, and what
/// was found.
fn check(bench: &Bench, code: i32) -> Vec<(String, bool, String)> {
    let report = bench.json(&[code], &[&"run", &"--config", &bench.configuration(), &"--check", &"--json"]);
    assert_eq!(report["ready"], code == 0);
    let text = |value: &serde_json::Value| value.as_str().unwrap().to_owned();
    let points = report["points"].as_array().unwrap().iter();
    points.map(|point| (text(&point["what"]), point["ready"].as_bool().unwrap(), text(&point["found"]))).collect()
}

#[test]
fn the_check_finds_a_virtual_scanner_ready_and_leaves_nothing_behind() {
    let bench = Bench::new();
    let found = check(&bench, 0);
    let names: Vec<&str> = found.iter().map(|(what, _, _)| what.as_str()).collect();
    let expected = [
        "configuration",
        "calibration and volume",
        "segment table",
        "shared memory",
        "runtime folder",
        "recorder",
        "monitor",
    ];
    assert_eq!(names, expected);
    assert!(found[1].2.contains("images of 96x80, 4 steps"), "{found:?}");
    assert!(!bench.path("recordings").exists());
    bench.assert_nothing_left();
}

#[test]
fn the_check_reports_all_problems_at_once() {
    let devices =
        "rate_hz = 25.0\n[cameras.cam1]\ndevice = \"/dev/no-camera\"\n[cameras.cam2]\ndevice = \"serial:none\"";
    let bench = Bench::with_changes(&[
        ("source = \"virtual\"", "source = \"v4l2\""),
        ("rate_hz = 25.0", devices),
        ("min_free_mb = 0", "min_free_mb = 16000000"),
    ]);
    let found = check(&bench, 2);
    let problem = |what: &str| {
        let (_, ready, found) = found.iter().find(|point| point.0 == what).unwrap();
        assert!(!ready, "{what}: {found}");
        found.as_str()
    };
    assert!(problem("calibration and volume").contains("has no rig"));
    assert!(problem("camera 1").starts_with("/dev/no-camera was not found; "));
    assert!(problem("camera 2").starts_with("serial:none was not found; "));
    assert!(problem("recorder").contains("recorder.min_free_mb keeps 16000000 MiB free"));
    assert!(found.iter().any(|(what, ready, _)| what == "runtime folder" && *ready));
    bench.assert_refused(&[&"cameras", &"/dev/no-camera"], &["/dev/no-camera was not found"]);
    bench.assert_refused(
        &[&"cameras", &"/dev/null"],
        &["/dev/null is no V4L2 camera, but a device of ", "`fringeflow cameras` lists the cameras"],
    );
    bench.assert_nothing_left();
}

#[test]
fn the_check_says_what_a_path_is_if_it_is_no_camera() {
    let bench = Bench::new();
    let [file, link, gone] = ["image.png", "camera", "gone"].map(|name| bench.path(name));
    std::fs::write(&file, "").unwrap();
    std::os::unix::fs::symlink(&gone, &link).unwrap();
    let linked = format!("{} was not found: it is a link to {}, which does not exist", link.display(), gone.display());
    for (device, says) in [
        (file.as_path(), "is no V4L2 camera, but a file; `fringeflow cameras` lists the cameras"),
        (bench.runtime_dir().parent().unwrap(), "is no V4L2 camera, but a folder; "),
        (std::path::Path::new("/dev/null"), "is no V4L2 camera, but a device of "),
        (&link, &linked),
    ] {
        let devices =
            format!("rate_hz = 25.0\n[cameras.cam1]\ndevice = {device:?}\n[cameras.cam2]\ndevice = \"serial:none\"");
        let changes = [("source = \"virtual\"", "source = \"v4l2\""), ("rate_hz = 25.0", &devices)];
        let found = check(&Bench::with_changes(&changes), 2);
        let camera = found.iter().find(|(what, _, _)| what == "camera 1").unwrap();
        assert!(!camera.1 && camera.2.contains(says), "{camera:?}");
    }
}

#[test]
fn the_check_refuses_a_recorder_folder_that_is_a_file() {
    let bench = Bench::new();
    std::fs::write(bench.path("recordings"), "").unwrap();
    let found = check(&bench, 2);
    let wrong: Vec<_> = found.iter().filter(|(_, ready, _)| !ready).collect();
    assert!(wrong.len() == 1 && wrong[0].2.contains("recordings: it is not a folder; name another"), "{wrong:?}");
}

#[test]
fn the_check_reports_that_the_instance_is_already_running() {
    let bench = Bench::new();
    let live = bench.start(&[]);
    let found = check(&bench, 2);
    let wrong: Vec<_> = found.iter().filter(|(_, ready, _)| !ready).collect();
    assert!(wrong.len() == 1 && wrong[0].2.contains("instance t is already running"), "{wrong:?}");
    live.wait_for_clouds(5);
    live.quit().assert_undisturbed();
    bench.assert_nothing_left();
}
