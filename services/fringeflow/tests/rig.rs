//! `fringeflow rig` from the outside: output, pictures and exit codes.

// A helper that cannot prepare its test fails it.
#![allow(clippy::unwrap_used)]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use fringeflow::calibration::{Unit, write_calibration};
use fringeflow::geometry::{Camera, Distortion, Pose, Rig};

const VOLUME: &str = "--volume=-60,-50,280,60,50,320";

/// Writes the calibration, in millimetres, of a rig with C2 and P turned towards the axis of C1.
fn calibration(folder: &Path) -> PathBuf {
    let camera = Camera::new([1850.0; 2], [320.0, 256.0], Distortion::default(), [640, 512]);
    let towards_axis = |x: f64| {
        let turn = Pose::rotation([0.0, (x / 0.3).atan(), 0.0].into());
        turn * Pose::translation(-x, 0.0, 0.0)
    };
    let rig = Rig {
        cam1: camera.clone(),
        cam2: camera.clone(),
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
fn prints_json_with_every_part_and_writes_the_maps() {
    let folder = tempfile::tempdir().unwrap();
    let calibration = calibration(folder.path());
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
        let map = fringeflow::dataset::read_png(&folder.path().join(name), Some([20, 16]), None).unwrap();
        assert!(map.pixels.iter().any(|&grey| grey > 0), "{name}");
    }
}

#[test]
fn a_volume_file_says_the_same_as_the_numbers() {
    let folder = tempfile::tempdir().unwrap();
    let calibration = calibration(folder.path());
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
fn wrong_use_ends_with_2_and_says_what_to_do() {
    let folder = tempfile::tempdir().unwrap();
    let calibration = calibration(folder.path());
    let calibration = calibration.to_str().unwrap();
    let cases: [(&[&str], &str); 6] = [
        (&[calibration], "give --volume"),
        (&[calibration, "--volume=1,2,3"], "has 3 numbers"),
        (&[calibration, "--volume=-60,-50,-320,60,50,-280"], "behind camera 1"),
        (&[calibration, "--volume=900,-50,280,1000,50,320"], "camera 1 never sees"),
        (&[calibration, VOLUME, "--period", "1"], "projector px"),
        (&[calibration, VOLUME, "--sign", "2"], "1 or -1"),
    ];
    for (arguments, said) in cases {
        let output = rig(arguments);
        let error = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{arguments:?}: {error}");
        assert!(error.contains(said), "{arguments:?}: {error}");
    }
}
