//! Recordings from the outside: import, info, check, recover, export, reconstruct and evaluate, and other programs that
//! read them.

// A helper that cannot prepare its test fails it.
#![allow(clippy::unwrap_used, clippy::panic)]

mod commands;
mod fuse;
mod python;
mod simulated;

use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

use fringeflow::message::PixelFormat;
use fringeflow::simulation::{Arrangement, Board, NoiseLevel, Object, RigOptions, Simulation, SimulationOptions};
use serde_json::Value;
use tempfile::TempDir;

/// Width and height of the images, pixels.
const SIZE_PX: [usize; 2] = [96, 80];

/// A dataset folder of a plane, with fringes wide enough for so few pixels, and Gray code, which a recording leaves out.
fn dataset() -> &'static Path {
    static DATASET: OnceLock<(TempDir, PathBuf)> = OnceLock::new();
    let make = || {
        let rig = RigOptions {
            arrangement: Arrangement::TABLE_TOP,
            size_px: SIZE_PX,
            depth_m: 0.025,
            period_px: 48.0,
            sd_rad: 0.0,
            seed: 1,
        };
        let options = SimulationOptions {
            object: Object::Plane,
            board: Board::None,
            rig,
            steps: 4,
            two_directions: false,
            gray: true,
            noise: NoiseLevel::Low,
            format: PixelFormat::Grey,
            gamma: 1.0,
            supersampling: 1,
            seed: 1,
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
fn done(arguments: &[&dyn AsRef<OsStr>]) -> Output {
    let output = fringeflow(arguments);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    output
}

/// Standard output as JSON.
fn json(output: &Output) -> Value {
    serde_json::from_slice(&output.stdout).unwrap()
}

fn imported(folder: &TempDir) -> PathBuf {
    let path = folder.path().join("plane.mcap");
    done(&[&"import", &dataset(), &"-o", &path, &"--rate", &"50"]);
    path
}
