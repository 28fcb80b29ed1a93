//! `fringeflow simulate` records what a virtual scanner delivers live, and the true poses.

use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::process::Command;

use tempfile::TempDir;

use fringeflow_dataset::CameraId;
use fringeflow_lab::simulation::{ConfiguredScanner, ImageLoop, VirtualScanner, read_configuration};
use fringeflow_message::PixelFormat;
use fringeflow_recording::Recording;

use super::{fringeflow, json, run_ok};

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

/// Writes the configuration and further lines to a file. Returns its path.
fn write_configuration(folder: &TempDir, more: &str) -> PathBuf {
    let path = folder.path().join("scanner.toml");
    std::fs::write(&path, format!("{CONFIGURATION}{more}")).unwrap();
    path
}

/// Simulates a recording.
fn record(folder: &TempDir, more: &str) -> Recording {
    let path = folder.path().join("scanner.mcap");
    // More than one round of the sweep.
    run_ok(&[&"simulate", &"--config", &write_configuration(folder, more), &"-o", &path, &"--seconds", &"0.6"]);
    Recording::open(&path).unwrap()
}

/// Returns the virtual scanner of the written configuration.
fn virtual_scanner(folder: &TempDir) -> VirtualScanner {
    let configuration = read_configuration(&folder.path().join("scanner.toml")).unwrap();
    let configured = ConfiguredScanner::from_scanner_configuration(&configuration).unwrap().unwrap();
    VirtualScanner::new(configured.scanner).unwrap()
}

#[test]
fn the_recording_has_the_images_and_poses_of_the_live_scanner() {
    let folder = tempfile::tempdir().unwrap();
    let recording = record(&folder, "");
    let scanner = virtual_scanner(&folder);
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
        let error = poses.pose_at(pair.cam1.exposure_start_ns).unwrap().to_homogeneous()
            - scanner.cam1_from_object(number).to_homogeneous();
        assert!(error.amax() < 1e-12, "error of pose {number}: {error}");
    }
}

#[test]
fn a_binned_region_is_recorded_with_the_sums_of_its_pixels() {
    const WIDTH: usize = 320;
    let folder = tempfile::tempdir().unwrap();
    let [x, y, width, height] = [33, 25, 256, 208];
    let readout = format!("region_px = [{x}, {y}, {width}, {height}]\nbinning = 2\n");
    let [whole, region] = [("whole", ""), ("region", &readout)].map(|(name, cameras)| {
        let config = folder.path().join(name).with_extension("toml");
        let text = CONFIGURATION.replace("rate_hz = 50.0\n", &format!("rate_hz = 50.0\n{cameras}"));
        std::fs::write(&config, text.replace("[96, 80]", &format!("[{WIDTH}, 256]"))).unwrap();
        let path = config.with_extension("mcap");
        run_ok(&[&"simulate", &"--config", &config, &"-o", &path, &"--seconds", &"0.2"]);
        path
    });
    let (path, whole, recording) = (&region, Recording::open(&whole).unwrap(), Recording::open(&region).unwrap());
    let setup = recording.setup();
    assert_eq!((setup.image_size_px, recording.pixel_format()), ([width / 2, height / 2], PixelFormat::Y10));
    assert_eq!(setup.rig, setup.readout.rig(&whole.setup().rig));
    for (whole_pair, region_pair) in whole.pairs().unwrap().iter().zip(recording.pairs().unwrap()) {
        for camera in CameraId::BOTH {
            let all = whole.pair_images(&[*whole_pair], camera).unwrap().remove(0);
            let binned = recording.pair_images(&[region_pair], camera).unwrap().remove(0);
            let sum_at = |u: usize, v: usize| -> f32 {
                let offsets = [(0, 0), (1, 0), (0, 1), (1, 1)];
                offsets.map(|(du, dv)| all.levels().grey((y + 2 * v + dv) * WIDTH + x + 2 * u + du)).iter().sum()
            };
            for pixel in 0..binned.levels().pixels() {
                let (u, v) = (pixel % (width / 2), pixel / (width / 2));
                assert_eq!(4.0 * binned.levels().grey(pixel), sum_at(u, v), "{camera:?} at {u}, {v}");
            }
        }
    }
    run_ok(&[&"check", path]);
    let cloud = folder.path().join("cloud.ply");
    let made = json(&run_ok(&[&"reconstruct", path, &"-o", &cloud, &"--json"]));
    assert!(made["points"].as_u64().unwrap() > 4000, "{made}");
}

#[test]
fn the_recording_is_intact_and_its_bytes_do_not_depend_on_the_number_of_threads() {
    let folder = tempfile::tempdir().unwrap();
    record(&folder, "");
    let path = folder.path().join("scanner.mcap");
    run_ok(&[&"check", &path]);
    let cloud = folder.path().join("cloud.ply");
    let made = json(&run_ok(&[&"reconstruct", &path, &"-o", &cloud, &"--min-confidence", &"0", &"--json"]));
    assert!(made["points"].as_u64().unwrap() > 300, "{made}");
    let info = json(&run_ok(&[&"info", &path, &"--json"]));
    let topics = info["topics"].as_array().unwrap();
    assert!(topics.iter().any(|topic| topic["topic"] == "/truth/pose" && topic["messages"] == 30), "{info}");
    let again = folder.path().join("again.mcap");
    let config = write_configuration(&folder, "");
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
fn faults_leave_missing_and_repeated_images_and_correct_poses_and_steps() {
    let folder = tempfile::tempdir().unwrap();
    let faults =
        "[virtual_scanner.faults]\nlost = 0.1\nswapped = 0.1\nlate = 0.1\nduplicated = 0.1\nevents_lost = 0.1\n";
    let recording = record(&folder, faults);
    let check = recording.check(|| ()).unwrap();
    assert!(
        check.losses.missing_images.iter().sum::<u64>() > 0 && check.repeated_images.iter().sum::<u64>() > 0,
        "{check:?}"
    );
    assert_eq!(check.fault_count, 0, "{check:?}");
    let scanner = virtual_scanner(&folder);
    let poses = recording.truth_poses().unwrap();
    for pair in recording.pairs().unwrap() {
        let number = pair.cam1.sequence as usize;
        let error = poses.pose_at(pair.cam1.exposure_start_ns).unwrap().to_homogeneous()
            - scanner.cam1_from_object(number).to_homogeneous();
        assert!(error.amax() < 1e-12 && pair.step == number % 4, "pair {number}");
    }
}

#[test]
fn unusable_arguments_and_configurations_are_refused_and_leave_no_file() {
    let folder = tempfile::tempdir().unwrap();
    let (target, config) = (folder.path().join("none.mcap"), write_configuration(&folder, ""));
    let refuse = |arguments: &[&dyn AsRef<std::ffi::OsStr>]| {
        let base: [&dyn AsRef<std::ffi::OsStr>; 5] = [&"simulate", &"-o", &target, &"--config", &config];
        let output = fringeflow(&[&base[..], arguments].concat());
        assert_eq!((output.status.code(), target.exists()), (Some(2), false));
        String::from_utf8(output.stderr).unwrap()
    };
    assert!(refuse(&[&"--object", &"nose"]).contains("--object"));
    assert!(refuse(&[&"--seconds", &"0"]).contains("is not a duration"));
    let text = CONFIGURATION.replace("driver = \"virtual\"", "driver = \"external\"");
    std::fs::write(&config, text).unwrap();
    assert!(refuse(&[]).contains("projector.driver is \"external\""));
    std::fs::write(&config, CONFIGURATION.replace("poses = 24", "poses = 24\ntravel_mm = [45, 0, 0]")).unwrap();
    assert!(refuse(&[]).contains("out of the measurement volume"));
}
