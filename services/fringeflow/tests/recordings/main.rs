//! Recordings by the command line: import, info, check, recover, export, reconstruct, evaluate, fuse and simulate, and
//! their reading in Python.

// A test fails if its preparation fails.
#![allow(clippy::unwrap_used, clippy::panic)]

mod commands;
mod formats;
mod fuse;
mod python;
mod simulated;

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

use serde_json::Value;
use tempfile::TempDir;

use fringeflow_lab::simulation::{Board, NoiseLevel, Object, RigOptions, Simulation, SimulationOptions};

/// Width and height of the images, pixels.
const SIZE_PX: [usize; 2] = [96, 80];

/// Returns a dataset folder of a plane. The fringes are wide enough for so few pixels. The folder has Gray-code images,
/// which recordings leave out.
fn dataset() -> &'static Path {
    static DATASET: OnceLock<(TempDir, PathBuf)> = OnceLock::new();
    let make = || {
        let options = SimulationOptions {
            board: Board::None,
            rig: RigOptions { size_px: SIZE_PX, period_px: 48.0, sd_rad: 0.0, ..RigOptions::usual(0.025) },
            steps: 4,
            noise: NoiseLevel::Low,
            supersampling: 1,
            ..SimulationOptions::usual(Object::Plane)
        };
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("plane");
        Simulation::new(options).unwrap().write(&path, || ()).unwrap();
        (folder, path)
    };
    &DATASET.get_or_init(make).1
}

fn fringeflow(arguments: &[&dyn AsRef<OsStr>]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_fringeflow")).args(arguments.iter().map(AsRef::as_ref)).output().unwrap()
}

/// Runs a command that must succeed.
fn run_ok(arguments: &[&dyn AsRef<OsStr>]) -> Output {
    let output = fringeflow(arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    output
}

/// Standard output as JSON.
fn json(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).unwrap()
}

/// Imports the dataset folder. Returns the path of the recording.
fn import_dataset(folder: &TempDir) -> PathBuf {
    let path = folder.path().join("plane.mcap");
    run_ok(&[&"import", &dataset(), &"-o", &path, &"--rate", &"50"]);
    path
}
