//! Faults of images that spoil a calibration. Each is named, and no file is written.

use std::path::Path;

use crate::{BOARD, copied, fringeflow, intact, path, simulate};

/// Calibrates a set and checks that it is refused with these words, and that the file of before stays.
fn assert_refused(set: &Path, says: &[&str]) {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("calibration.yml");
    std::fs::write(&file, "the file of before").unwrap();
    let output = fringeflow(&["calibrate", path(set), "--board", BOARD, "-o", path(&file)]);
    let text = format!("{}{}", String::from_utf8_lossy(&output.stdout), String::from_utf8_lossy(&output.stderr));
    assert_eq!(output.status.code(), Some(2), "{says:?}: {text}");
    for words in says {
        assert!(text.contains(words), "{words}: {text}");
    }
    assert_eq!(std::fs::read_to_string(&file).unwrap(), "the file of before");
}

/// The intact set with a change.
fn changed(change: impl Fn(&Path)) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    copied(intact(), folder.path());
    change(folder.path());
    folder
}

fn exchange(a: &Path, b: &Path) {
    let aside = a.with_extension("aside");
    std::fs::rename(a, &aside).unwrap();
    std::fs::rename(b, a).unwrap();
    std::fs::rename(&aside, b).unwrap();
}

#[test]
fn a_gamma_of_the_projector_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let set = folder.path().join("set");
    simulate(&set, 4, &["--gamma", "2.2"]);
    assert_refused(&set, &["the projector is not linear", "gamma"]);
}

#[test]
fn an_exposure_that_beats_with_the_projector_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let set = folder.path().join("set");
    simulate(&set, 4, &["--beat", "0.05"]);
    assert_refused(&set, &["differ in brightness", "refresh period"]);
}

#[test]
fn a_board_that_moves_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let set = folder.path().join("set");
    simulate(&set, 4, &["--board-motion", "3"]);
    assert_refused(&set, &["the board moved by"]);
}

#[test]
fn a_bent_board_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let set = folder.path().join("set");
    simulate(&set, 8, &["--board-bend", "0.8"]);
    assert_refused(&set, &["the board is no plane", "--bent-board"]);
}

#[test]
fn pairs_of_different_poses_are_named_with_their_partners() {
    let set = changed(|folder| exchange(&folder.join("view_02/cam2"), &folder.join("view_05/cam2")));
    assert_refused(set.path(), &["in view_02 do not show one pose", "camera 2 sees in view_05", "exchange the images"]);
}

#[test]
fn exchanged_cameras_of_a_pose_are_named_and_a_forced_file_holds_its_flaw() {
    let set = changed(|folder| exchange(&folder.join("view_02/cam1"), &folder.join("view_02/cam2")));
    assert_refused(set.path(), &["in view_02 do not show one pose", "exchange the images of both cameras"]);
    let file = set.path().join("forced.yml");
    let output = fringeflow(&["calibrate", path(set.path()), "--board", BOARD, "-o", path(&file), "--force"]);
    assert!(output.status.success(), "{output:?}");
    let text = std::fs::read_to_string(&file).unwrap();
    assert!(text.contains("flaws:") && text.contains("in view_02 do not show one pose"), "{text}");
}

#[test]
fn images_in_another_order_are_named() {
    let set = changed(|folder| {
        for view in 0..8 {
            for camera in ["cam1", "cam2"] {
                let images = folder.join(format!("view_{view:02}")).join(camera);
                exchange(&images.join("003.png"), &images.join("006.png"));
            }
        }
    });
    assert_refused(set.path(), &["not in the order of patterns.toml"]);
}

#[test]
fn poses_that_are_all_alike_are_named() {
    let set = changed(|folder| {
        for view in 1..8 {
            let name = folder.join(format!("view_{view:02}"));
            std::fs::remove_dir_all(&name).unwrap();
            if view < 3 {
                copied(&folder.join("view_00"), &name);
            }
        }
    });
    assert_refused(set.path(), &["poses"]);
}
