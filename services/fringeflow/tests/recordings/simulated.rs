//! A recording of a virtual scanner is what it delivers live, with the true poses, and works as a live one does.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::Command;

use tempfile::TempDir;

use fringeflow_dataset::CameraId;
use fringeflow_lab::simulation::{ConfiguredScanner, ImageLoop, VirtualScanner, read_configuration};
use fringeflow_message::PixelFormat;
use fringeflow_recording::Recording;

use super::{done, fringeflow, json};

const CONFIGURATION: &str = r#"
[cameras]
source = "virtual"
rate_hz = 50.0

[projector]
driver = "virtual"

[pattern]
steps = 4
period_px = 48.0

[virtual_scanner]
object = "tooth"
size_px = [96, 80]
sd_rad = 0.0

[virtual_scanner.sweep]
poses = 24
"#;

/// A file with the configuration and further lines.
fn configuration(folder: &TempDir, more: &str) -> PathBuf {
    let path = folder.path().join("scanner.toml");
    std::fs::write(&path, format!("{CONFIGURATION}{more}")).unwrap();
    path
}

fn recorded(folder: &TempDir, more: &str) -> Recording {
    let path = folder.path().join("scanner.mcap");
    // One round and a bit of the next.
    done(&[&"simulate", &"--config", &configuration(folder, more), &"-o", &path, &"--seconds", &"0.6"]);
    Recording::open(&path).unwrap()
}

fn scanner(folder: &TempDir) -> VirtualScanner {
    let configuration = read_configuration(&folder.path().join("scanner.toml")).unwrap();
    let configured = ConfiguredScanner::of_instance(&configuration).unwrap().unwrap();
    VirtualScanner::new(configured.scanner).unwrap()
}

#[test]
fn images_and_poses_are_those_of_the_live_scanner() {
    let folder = tempfile::tempdir().unwrap();
    let recording = recorded(&folder, "");
    let scanner = scanner(&folder);
    let live = ImageLoop::render(&scanner, |_| ControlFlow::Continue(())).unwrap().unwrap();
    let (pairs, poses) = (recording.pairs().unwrap(), recording.truth_poses().unwrap());
    assert_eq!((pairs.len(), poses.all().len()), (30, 30));
    for (number, pair) in pairs.iter().enumerate() {
        assert_eq!((pair.step, pair.cam1.sequence), (number % 4, number as u64));
        assert_eq!(pair.cam2.exposure_start_ns - pair.cam1.exposure_start_ns, 40_000);
        for camera in CameraId::BOTH {
            let image = recording.pair_images(&[*pair], camera).unwrap().remove(0);
            let expected = live.image(camera, number as u64, pair.step as u32).unwrap();
            assert!(image.pixels == expected.bytes, "{camera:?}, image {number}");
        }
        let off = poses.pose_at(pair.cam1.exposure_start_ns).unwrap().to_homogeneous()
            - scanner.cam1_from_object(number).to_homogeneous();
        assert!(off.amax() < 1e-12, "pose {number} is {off} off");
    }
}

#[test]
fn of_a_region_whose_pixels_are_added_up_the_recording_holds_what_is_used() {
    const WIDTH: usize = 320;
    let folder = tempfile::tempdir().unwrap();
    let [x, y, width, height] = [33, 25, 256, 208];
    let readout = format!("region_px = [{x}, {y}, {width}, {height}]\nbinning = 2\n");
    let [whole, part] = [("whole", ""), ("part", &readout)].map(|(name, cameras)| {
        let config = folder.path().join(name).with_extension("toml");
        let text = CONFIGURATION.replace("rate_hz = 50.0\n", &format!("rate_hz = 50.0\n{cameras}"));
        std::fs::write(&config, text.replace("[96, 80]", &format!("[{WIDTH}, 256]"))).unwrap();
        let path = config.with_extension("mcap");
        done(&[&"simulate", &"--config", &config, &"-o", &path, &"--seconds", &"0.2"]);
        path
    });
    let (path, whole, recording) = (&part, Recording::open(&whole).unwrap(), Recording::open(&part).unwrap());
    let setup = recording.setup();
    assert_eq!((setup.image_size_px, recording.pixel_format()), ([width / 2, height / 2], PixelFormat::Y10));
    assert_eq!(setup.rig, setup.readout.rig(&whole.setup().rig));
    for (all, used) in whole.pairs().unwrap().iter().zip(recording.pairs().unwrap()) {
        for camera in CameraId::BOTH {
            let all = whole.pair_images(&[*all], camera).unwrap().remove(0);
            let used = recording.pair_images(&[used], camera).unwrap().remove(0);
            let sum_at = |u: usize, v: usize| -> f32 {
                let places = [(0, 0), (1, 0), (0, 1), (1, 1)];
                places.map(|(du, dv)| all.levels().grey((y + 2 * v + dv) * WIDTH + x + 2 * u + du)).iter().sum()
            };
            for pixel in 0..used.levels().pixels() {
                let (u, v) = (pixel % (width / 2), pixel / (width / 2));
                assert_eq!(4.0 * used.levels().grey(pixel), sum_at(u, v), "{camera:?} at {u}, {v}");
            }
        }
    }
    done(&[&"check", path]);
    let cloud = folder.path().join("cloud.ply");
    let made = json(&done(&[&"reconstruct", path, &"-o", &cloud, &"--json"]));
    assert!(made["points"].as_u64().unwrap() > 4000, "{made}");
}

#[test]
fn it_can_be_checked_and_reconstructed_and_its_bytes_depend_on_nothing_else() {
    let folder = tempfile::tempdir().unwrap();
    recorded(&folder, "");
    let path = folder.path().join("scanner.mcap");
    done(&[&"check", &path]);
    let cloud = folder.path().join("cloud.ply");
    let made = json(&done(&[&"reconstruct", &path, &"-o", &cloud, &"--min-confidence", &"0", &"--json"]));
    assert!(made["points"].as_u64().unwrap() > 300, "{made}");
    let info = json(&done(&[&"info", &path, &"--json"]));
    let topics = info["topics"].as_array().unwrap();
    assert!(topics.iter().any(|topic| topic["topic"] == "/truth/pose" && topic["messages"] == 30), "{info}");
    let again = folder.path().join("again.mcap");
    let config = configuration(&folder, "");
    let output = Command::new(env!("CARGO_BIN_EXE_fringeflow"))
        .args(["simulate", "--seconds", "0.6", "--config"])
        .args([&config, Path::new("-o"), &again])
        .env("RAYON_NUM_THREADS", "1")
        .output()
        .unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    assert!(std::fs::read(&path).unwrap() == std::fs::read(&again).unwrap(), "the bytes differ");
}

#[test]
fn faults_happen_as_they_do_live() {
    let folder = tempfile::tempdir().unwrap();
    let faults =
        "[virtual_scanner.faults]\nlost = 0.1\nswapped = 0.1\nlate = 0.1\nduplicated = 0.1\nevents_lost = 0.1\n";
    let recording = recorded(&folder, faults);
    let check = recording.check(|| ()).unwrap();
    assert!(check.missing_images.iter().sum::<u64>() > 0 && check.repeated_images.iter().sum::<u64>() > 0, "{check:?}");
    assert_eq!(check.fault_count, 0, "{check:?}");
    let scanner = scanner(&folder);
    let poses = recording.truth_poses().unwrap();
    for pair in recording.pairs().unwrap() {
        let number = pair.cam1.sequence as usize;
        let off = poses.pose_at(pair.cam1.exposure_start_ns).unwrap().to_homogeneous()
            - scanner.cam1_from_object(number).to_homogeneous();
        assert!(off.amax() < 1e-12 && pair.step == number % 4, "pair {number}");
    }
}

#[test]
fn what_cannot_be_recorded_is_refused_and_leaves_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let (target, config) = (folder.path().join("none.mcap"), configuration(&folder, ""));
    let refused = |arguments: &[&dyn AsRef<std::ffi::OsStr>]| {
        let base: [&dyn AsRef<std::ffi::OsStr>; 5] = [&"simulate", &"-o", &target, &"--config", &config];
        let output = fringeflow(&[&base[..], arguments].concat());
        assert_eq!((output.status.code(), target.exists()), (Some(2), false));
        String::from_utf8(output.stderr).unwrap()
    };
    assert!(refused(&[&"--object", &"nose"]).contains("--object"));
    assert!(refused(&[&"--seconds", &"0"]).contains("is not a duration"));
    let text = CONFIGURATION.replace("driver = \"virtual\"", "driver = \"external\"");
    std::fs::write(&config, text).unwrap();
    assert!(refused(&[]).contains("projector.driver is \"external\""));
    std::fs::write(&config, CONFIGURATION.replace("poses = 24", "poses = 24\ntravel_mm = [45, 0, 0]")).unwrap();
    assert!(refused(&[]).contains("out of the measurement volume"));
}
