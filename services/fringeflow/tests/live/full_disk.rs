//! The disk fills up during the scan.

use std::path::{Path, PathBuf};
use std::process::Command;

use fringeflow_message::{DropReason, Stage};
use serde_json::Value;

use crate::support::{Bench, NAME};

/// A small file system; unmounted when dropped.
struct SmallDisk(PathBuf);

impl SmallDisk {
    /// Mounts the file system. Returns `None` if this user may not mount.
    fn mount(folder: &Path) -> Option<Self> {
        std::fs::create_dir(folder).unwrap();
        let mount = Command::new("mount").args(["-t", "tmpfs", "-o", "size=120m", "tmpfs"]).arg(folder).output();
        mount.is_ok_and(|output| output.status.success()).then(|| Self(folder.to_owned()))
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        // Lazily, because a failed test may leave a process that still uses it for a moment.
        let _ = Command::new("umount").arg("--lazy").arg(&self.0).output();
    }
}

#[test]
fn a_full_disk_ends_the_recording_but_not_the_scan() {
    // Everything is recorded, so that the disk fills up soon.
    let bench =
        Bench::with_changes(&[("min_free_mb = 0", "min_free_mb = 0\nphase_maps = true\ncorrespondences = true")]);
    let Some(disk) = SmallDisk::mount(&bench.path("disk")) else {
        eprintln!("skipped: no file system can be mounted here; run as root to test a full disk");
        return;
    };
    let recording = disk.0.join("scan.mcap");
    let live = bench.start(&[&"--record", &recording]);
    live.wait_until("the disk is full", || bench.counts(Stage::Recorder).dropped(DropReason::DiskFull) > 0);
    let status = || bench.json(&[0], &[&"status", &NAME, &"--json"]);
    live.wait_until("status knows that the recording has ended", || status()["recorder"]["early_end"] == "disk full");
    assert!(status()["recorder"]["rate"]["measured"].as_f64().unwrap() > 0.0);
    let said = bench.execute(&[0], &[&"status", &NAME]);
    let ended = format!("t: scanning (virtual images); the recording {} has ended: disk full\n", recording.display());
    assert!(said.starts_with(&ended) && said.contains("a second of recording takes"), "{said}");
    // Nothing is marked in a recording that has ended, and another one can start.
    live.wait_until("marks are refused", || bench.fringeflow(&[&"control", &NAME, &"mark"]).status.code() != Some(0));
    bench.execute(&[0], &[&"control", &NAME, &"record", &bench.path("again.mcap")]);
    live.wait_for_clouds(20);
    assert_eq!(status()["recorder"]["early_end"], Value::Null);
    let run = live.quit();
    run.assert_balanced();
    assert_eq!((run.code, &run.summary["restarts"]), (Some(3), &0.into()), "{run:?}");
    for part in ["a second of recording takes", "the disk will be full in", "the disk is full"] {
        assert!(run.log.contains(part), "{part:?} is missing in: {}", run.log);
    }
    bench.assert_nothing_left();
    let check = bench.json(&[3], &[&"check", &recording, &"--json"]);
    assert_eq!(check["fault_count"], 0, "{check}");
    assert!(check["lost"].as_u64().unwrap() > 0, "{check}");
    let verified = bench.json(&[0, 3], &[&"replay", &recording, &"--verify", &"--json"]);
    assert_eq!((&verified["different"], &verified["no_cloud"]), (&0.into(), &0.into()));
    assert!(verified["same"].as_u64().unwrap() >= 20, "{verified}");
}
