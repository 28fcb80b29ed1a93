//! `fringeflow rig` by the command line: output, pictures and exit codes.

// A test fails if its preparation fails.
#![allow(clippy::unwrap_used)]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use fringeflow::calibration::{Unit, write_calibration};
use fringeflow::geometry::{Camera, Distortion, Pose, Rig};
use fringeflow_lab::simulation::{Board, Object, RigOptions, Simulation, SimulationOptions};

const VOLUME: &str = "--volume=-60,-50,280,60,50,320";

/// Writes a calibration file, in millimetres. C2 and P are turned towards the axis of C1.
fn write_rig_calibration(folder: &Path) -> PathBuf {
    let camera = Camera::new([1850.0; 2], [320.0, 256.0], Distortion::default(), [640, 512]);
    let towards_axis = |x: f64| {
        let turn = Pose::rotation([0.0, (x / 0.3).atan(), 0.0].into());
        turn * Pose::translation(-x, 0.0, 0.0)
    };
    let rig = Rig {
        cam1: camera,
        cam2: camera,
        projector: camera,
        cam2_from_cam1: towards_axis(0.1),
        projector_from_cam1: towards_axis(0.04),
    };
    let path = folder.join("calibration.yml");
    write_calibration(&path, &rig, Unit::Millimetre).unwrap();
    path
}

fn rig(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_fringeflow")).arg("rig").args(arguments).output().unwrap()
}

#[test]
fn rig_prints_every_section_as_json_and_writes_the_maps() {
    let folder = tempfile::tempdir().unwrap();
    let calibration = write_rig_calibration(folder.path());
    let out = folder.path().to_str().unwrap();
    let output = rig(&[calibration.to_str().unwrap(), VOLUME, "--json", "--grid", "32", "-o", out]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let report: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!((report["layout"]["base_cam1_cam2_m"].as_f64().unwrap() - 0.1).abs() < 1e-9);
    assert!((report["layout"]["projector_place_on_base"].as_f64().unwrap() - 0.4).abs() < 1e-6);
    assert!(report["evaluation"]["periods"]["mean"].as_f64().unwrap() > 1.0);
    assert!(!report["evaluation"]["comb"]["teeth"].as_array().unwrap().is_empty());
    assert!(!report["advice"].as_array().unwrap().is_empty());
    for name in ["periods.png", "survivors.png"] {
        let map = fringeflow_dataset::read_grey(&folder.path().join(name), Some([20, 16]), None).unwrap();
        assert!(map.pixels.iter().any(|&grey| grey > 0), "{name}");
    }
}

#[test]
fn a_volume_file_gives_the_same_output_as_the_volume_in_numbers() {
    let folder = tempfile::tempdir().unwrap();
    let calibration = write_rig_calibration(folder.path());
    let file = folder.path().join("volume.json");
    let text = r#"{"R_v": [[1,0,0],[0,1,0],[0,0,1]], "T_v": [0,0,300], "min": [-60,-50,-20], "max": [60,50,20]}"#;
    std::fs::write(&file, text).unwrap();
    let volume = format!("--volume={}", file.display());
    let [by_file, by_numbers] = [volume.as_str(), VOLUME].map(|volume| {
        let output = rig(&[calibration.to_str().unwrap(), volume, "--grid", "32"]);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        String::from_utf8(output.stdout).unwrap()
    });
    assert_eq!(by_file, by_numbers);
}

#[test]
fn wrong_arguments_end_with_exit_code_2_and_a_message_that_says_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let calibration = write_rig_calibration(folder.path());
    let calibration = calibration.to_str().unwrap();
    let cases: [(&[&str], &str); 6] = [
        (&[calibration], "give --volume"),
        (&[calibration, "--volume=1,2,3"], "3 numbers were given"),
        (&[calibration, "--volume=-60,-50,-320,60,50,-280"], "behind camera 1"),
        (&[calibration, "--volume=900,-50,280,1000,50,320"], "camera 1 never sees"),
        (&[calibration, VOLUME, "--period", "1"], "projector px"),
        (&[calibration, VOLUME, "--sign", "2"], "possible values: 1, -1"),
    ];
    for (arguments, says) in cases {
        let output = rig(arguments);
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {error}");
        assert!(error.contains(says), "{arguments:?}: {error}");
    }
}

/// Simulates a dataset folder. The error of its calibration scatters δ by `sd_rad`.
fn simulate_images(folder: &Path, size_px: [usize; 2], sd_rad: f64) -> PathBuf {
    let options = SimulationOptions {
        board: Board::Visible,
        rig: RigOptions { size_px, sd_rad, seed: 3, ..RigOptions::usual(0.025) },
        steps: 4,
        gray: false,
        supersampling: 1,
        seed: 3,
        ..SimulationOptions::usual(Object::Elephant)
    };
    let path = folder.join("images");
    Simulation::new(options).unwrap().write(&path, || ()).unwrap();
    path
}

fn rig_json(arguments: &[&str]) -> serde_json::Value {
    let output = rig(&[arguments, &["--json"]].concat());
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn rig_measures_the_drift_of_the_calibration_from_images() {
    let folder = tempfile::tempdir().unwrap();
    let images = simulate_images(folder.path(), [320, 256], 0.123);
    let recording = folder.path().join("images.mcap");
    let import = [images.as_os_str(), "-o".as_ref(), recording.as_os_str()];
    assert!(Command::new(env!("CARGO_BIN_EXE_fringeflow")).arg("import").args(import).status().unwrap().success());
    let calibration = images.join("calibration.yml");
    let [calibration, images, recording] = [&calibration, &images, &recording].map(|path| path.to_str().unwrap());

    let report = rig_json(&[calibration, "--images", images, "-o", folder.path().to_str().unwrap()]);
    let window = &report["windows"][0];
    let rms_rad = window["rms_rad"].as_f64().unwrap();
    assert!((rms_rad / 0.123 - 1.0).abs() < 0.1 && report["median_rms_rad"] == rms_rad, "{report}");
    assert!(window["greatest_rad"].as_f64().unwrap() > rms_rad && window["share"].as_f64().unwrap() > 0.6, "{report}");
    assert!(window["residual_sd_rad"].as_f64().unwrap() < 0.1 * window["delta_sd_rad"].as_f64().unwrap(), "{report}");
    assert_eq!((&report["beyond_limit"], &window["time_s"]), (&true.into(), &serde_json::Value::Null));
    let picture = std::fs::read(folder.path().join("drift.png")).unwrap();
    assert!(picture.starts_with(b"\x89PNG"));

    // The same images as a recording. The window starts at time 0, and the limit comes from the configuration.
    let settings = folder.path().join("settings.toml");
    std::fs::write(&settings, "[health]\ndrift_rad = { warn = 0.2, bad = 0.4 }\n").unwrap();
    let recorded = rig_json(&[recording, "--images", recording, "--config", settings.to_str().unwrap()]);
    assert_eq!((&recorded["windows"][0]["rms_rad"], &recorded["windows"][0]["time_s"]), (&rms_rad.into(), &0.0.into()));
    assert_eq!((&recorded["beyond_limit"], &recorded["windows_available"]), (&false.into(), &1.into()));

    let text = rig(&[calibration, "--images", images]);
    let text = String::from_utf8(text.stdout).unwrap();
    assert!(text.contains("BEYOND the limit of 0.1 rad") && text.contains("calibrate again"), "{text}");
}

#[test]
fn images_that_do_not_show_the_drift_are_refused_with_the_reason() {
    let folder = tempfile::tempdir().unwrap();
    let calibration = write_rig_calibration(folder.path());
    let images = simulate_images(folder.path(), [64, 64], 0.041);
    let missing = folder.path().join("missing");
    let [calibration, images, missing] = [&calibration, &images, &missing].map(|path| path.to_str().unwrap());
    let cases: [(&[&str], &[&str]); 5] = [
        (&[calibration, "--images", images], &[calibration, "640×512", images, "64×64", "give the calibration"]),
        (&[calibration, "--images", missing], &["missing"]),
        (&[images, "--images", images, "--steps", "3"], &["--steps 3", "divisor of 4"]),
        (&[images, "--images", images, "--grid", "16"], &["--grid"]),
        (&[images, "--windows", "3"], &["--images"]),
    ];
    for (arguments, says) in cases {
        let output = rig(arguments);
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {error}");
        assert!(says.iter().all(|part| error.contains(part)), "{arguments:?}: {error}");
    }
}
