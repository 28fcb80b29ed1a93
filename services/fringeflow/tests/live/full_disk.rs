//! A disk that runs full while the scan goes on.

use std::path::{Path, PathBuf};
use std::process::Command;

use fringeflow_message::{DropReason, Stage};

use crate::support::Bench;

/// A small file system; unmounted when it is dropped.
struct SmallDisk(PathBuf);

impl SmallDisk {
    /// Mounts it; `None` where this user may not.
    fn mount(folder: &Path) -> Option<Self> {
        std::fs::create_dir(folder).unwrap();
        let mount = Command::new("mount").args(["-t", "tmpfs", "-o", "size=33m", "tmpfs"]).arg(folder).output();
        mount.is_ok_and(|output| output.status.success()).then(|| Self(folder.to_owned()))
    }
}

impl Drop for SmallDisk {
    fn drop(&mut self) {
        // Lazily: a failed test may leave a process in it for a moment.
        let _ = Command::new("umount").arg("--lazy").arg(&self.0).output();
    }
}

#[test]
fn a_full_disk_ends_the_recording_and_not_the_scan() {
    // All that can be recorded, so that it does not take long.
    let bench = Bench::with(&[("min_free_mb = 0", "min_free_mb = 0\nphase_maps = true\ncorrespondences = true")]);
    let Some(disk) = SmallDisk::mount(&bench.path("disk")) else {
        eprintln!("skipped: no file system can be mounted here; run as root to test a full disk");
        return;
    };
    let recording = disk.0.join("scan.mcap");
    let live = bench.start(&[&"--record", &recording]);
    live.wait_until("the disk is full", || bench.counts(Stage::Recorder).dropped(DropReason::DiskFull) > 0);
    live.wait_for_clouds(20);
    let ended = live.quit();
    ended.assert_balanced();
    assert_eq!((ended.code, &ended.summary["restarts"]), (Some(3), &0.into()), "{ended:?}");
    assert!(ended.log.contains("the disk is full"), "{}", ended.log);
    bench.assert_nothing_left();
    let check = bench.json(&[3], &[&"check", &recording, &"--json"]);
    assert_eq!(check["fault_count"], 0, "{check}");
    assert!(check["lost"].as_u64().unwrap() > 0, "{check}");
    let verified = bench.json(&[0, 3], &[&"replay", &recording, &"--verify", &"--json"]);
    assert_eq!((&verified["different"], &verified["no_cloud"]), (&0.into(), &0.into()));
    assert!(verified["same"].as_u64().unwrap() >= 20, "{verified}");
}
