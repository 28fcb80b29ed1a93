//! `fringeflow board --find` beside OpenCV, on the images of a simulated calibration.

// A test fails if its preparation fails.
#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

fn checked(output: Output) -> Output {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    output
}

#[test]
fn corners_are_those_of_opencv_and_more_exact() {
    let (folder, command) = (tempfile::tempdir().unwrap(), env!("CARGO_BIN_EXE_fringeflow"));
    let set = folder.path().join("set");
    let board = "charuco:9x7:square=10:marker=7.5:dictionary=4x4_250";
    let simulate = ["simulate", "--calibration-board", board, "--views", "4", "--steps", "3", "--output"];
    checked(Command::new(command).args(simulate).arg(&set).output().unwrap());
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let prepared = checked(Command::new(root.join("scripts/python.sh")).output().unwrap());
    let python = String::from_utf8(prepared.stdout).unwrap();
    let script = root.join("tests/python/find_board.py");
    let arguments = ["9", "7", "10", "7.5", board];
    let output = Command::new(python.trim()).arg(script).arg(command).arg(&set).args(arguments).output().unwrap();
    let compared: Value = serde_json::from_slice(&checked(output).stdout).unwrap();
    let figure = |name: &str| compared[name].as_f64().unwrap();
    // OpenCV finds the same corners under the same numbers, at the same places.
    assert!(figure("found_by_both") > 150.0 && figure("largest_distance") < 1.0, "{compared}");
    assert!(figure("found") >= figure("found_by_both"), "{compared}");
    assert!(figure("rms") < 0.5 * figure("rms_of_opencv") && figure("rms") < 0.03, "{compared}");
}
