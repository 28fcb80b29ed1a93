//! `fringeflow calibrate` by the command line: simulated rigs are found, and what is wrong with images is named and leaves no
//! file.

// A test fails if its preparation fails.
#![allow(clippy::unwrap_used)]

mod bad_input;
mod faults;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::OnceLock;

use fringeflow::calibration::{Unit, read_calibration};
use fringeflow::geometry::{Camera, Rig};
use tempfile::TempDir;

/// A board with large squares, so that small images show them.
pub(crate) const BOARD: &str = "charuco:10x8:square=11:marker=8:dictionary=4x4_100";
/// Views of the intact set.
const VIEWS: usize = 8;

pub(crate) fn fringeflow(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_fringeflow")).args(arguments).output().unwrap()
}

/// Renders a calibration set of so many views, with further options.
pub(crate) fn simulate(folder: &Path, views: usize, options: &[&str]) {
    let views = views.to_string();
    let usual = ["simulate", "--calibration-board", BOARD, "--drawn-rig", "3", "--size", "320x256", "--views", &views];
    let output = fringeflow(&[&usual[..], &["-o", path(folder)], options].concat());
    assert!(output.status.success(), "{output:?}");
}

/// A set without fault, rendered once.
pub(crate) fn intact() -> &'static Path {
    static SET: OnceLock<(TempDir, PathBuf)> = OnceLock::new();
    let (_, folder) = SET.get_or_init(|| {
        let parent = tempfile::tempdir().unwrap();
        let folder = parent.path().join("set");
        simulate(&folder, VIEWS, &[]);
        (parent, folder)
    });
    folder
}

pub(crate) fn path(path: &Path) -> &str {
    path.to_str().unwrap()
}

/// Copies a folder with all that is in it.
pub(crate) fn copied(from: &Path, to: &Path) {
    std::fs::create_dir_all(to).unwrap();
    for entry in std::fs::read_dir(from).unwrap() {
        let entry = entry.unwrap();
        let target = to.join(entry.file_name());
        if entry.path().is_dir() {
            copied(&entry.path(), &target);
        } else {
            std::fs::copy(entry.path(), target).unwrap();
        }
    }
}

fn calibrated(folder: &Path, options: &[&str]) -> (Rig, String) {
    let output_folder = tempfile::tempdir().unwrap();
    let file = output_folder.path().join("calibration.yml");
    let arguments = [&["calibrate", path(folder), "--board", BOARD, "-o", path(&file)], options].concat();
    let output = fringeflow(&arguments);
    assert!(output.status.success(), "{output:?}");
    (read_calibration(&file, Unit::Millimetre).unwrap(), String::from_utf8(output.stdout).unwrap())
}

fn focal_error(found: &Camera, exact: &Camera) -> f64 {
    (found.focal_px()[0] / exact.focal_px()[0] - 1.0).abs()
}

#[test]
fn a_rig_is_found_from_images_alone() {
    let set = intact();
    let page = tempfile::tempdir().unwrap();
    let page = page.path().join("page.html");
    let (rig, text) = calibrated(set, &["--report", path(&page), "--compare", path(&set.join("exact.yml"))]);
    let exact = read_calibration(&set.join("exact.yml"), Unit::Millimetre).unwrap();
    for (found, exact) in [(&rig.cam1, &exact.cam1), (&rig.cam2, &exact.cam2), (&rig.projector, &exact.projector)] {
        assert!(focal_error(found, exact) < 1e-3, "{found:?} {exact:?}");
    }
    let place_mm = |rig: &Rig| rig.centre_of_projector().coords * 1e3;
    assert!((place_mm(&rig) - place_mm(&exact)).norm() < 0.5, "{:?} {:?}", place_mm(&rig), place_mm(&exact));
    assert!(text.contains("efc") && text.contains("Poses that would make it better"), "{text}");
    let page = std::fs::read_to_string(page).unwrap();
    assert!(page.contains("usable") && page.matches("<svg").count() >= 4 && !page.contains("<script"));
}

#[test]
fn the_size_of_the_print_is_the_size_of_the_rig() {
    // The rulers of this board are 110 mm and 80 mm long.
    let (usual, _) = calibrated(intact(), &[]);
    let (larger, _) = calibrated(intact(), &["--rulers", "111.1,80.8"]);
    let base = |rig: &Rig| rig.centre_of_cam2().coords.norm();
    assert!((base(&larger) / base(&usual) - 1.01).abs() < 1e-3, "{} {}", base(&larger), base(&usual));
}

#[test]
fn the_same_images_give_the_same_bytes_with_any_number_of_threads() {
    let text = |threads: &str| {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("calibration.yml");
        let output =
            fringeflow(&["--threads", threads, "calibrate", path(intact()), "--board", BOARD, "-o", path(&file)]);
        assert!(output.status.success(), "{output:?}");
        std::fs::read_to_string(file).unwrap()
    };
    assert_eq!(text("1"), text("3"));
}

#[test]
fn the_cameras_alone_are_calibrated_and_a_scene_finds_the_projector() {
    let folder = tempfile::tempdir().unwrap();
    let [boards, scene] = ["boards", "scene"].map(|name| folder.path().join(name));
    for camera in ["cam1", "cam2"] {
        std::fs::create_dir_all(boards.join(camera)).unwrap();
        for view in 0..VIEWS {
            let image = intact().join(format!("view_{view:02}/{camera}/000.png"));
            std::fs::copy(image, boards.join(camera).join(format!("{view:02}.png"))).unwrap();
        }
        copied(&intact().join("view_00").join(camera), &scene.join(camera));
    }
    std::fs::copy(intact().join("patterns.toml"), scene.join("patterns.toml")).unwrap();
    let cameras = folder.path().join("cameras.yml");
    let output = fringeflow(&["calibrate", path(&boards), "--board", BOARD, "-o", path(&cameras)]);
    assert!(output.status.success(), "{output:?}");
    assert!(String::from_utf8_lossy(&output.stdout).contains("with the cameras alone"));
    let error = read_calibration(&cameras, Unit::Millimetre).unwrap_err().to_string();
    assert!(error.contains("--refine"), "{error}");
    // A plane does not determine a projector.
    let file = folder.path().join("calibration.yml");
    let output = fringeflow(&["calibrate", "--refine", path(&scene), "--from", path(&cameras), "-o", path(&file)]);
    let says = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success() || says.contains("do not determine a projector"), "{output:?}");
}
