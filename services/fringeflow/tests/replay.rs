//! The recordings of the repository. Each is the file that the manifest describes. Replays in one process and over the
//! channels reproduce its clouds byte for byte, with any number of threads.

// A test fails if its preparation fails.
#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use sha2::{Digest, Sha256};

/// Maximum size of all recordings together, bytes.
const MAX_BYTES: u64 = 25_000_000;

#[derive(serde::Deserialize)]
struct Manifest {
    recording: Vec<Entry>,
}

/// A recording in the manifest.
#[derive(serde::Deserialize)]
struct Entry {
    file: String,
    sha256: String,
    /// The command that made the recording.
    command: String,
    /// Number of clouds in the recording.
    clouds: u64,
}

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../../recordings").canonicalize().unwrap()
}

fn entries() -> Vec<Entry> {
    let text = fs::read_to_string(folder().join("manifest.toml")).unwrap();
    toml::from_str::<Manifest>(&text).unwrap().recording
}

fn fringeflow(arguments: &[&str]) -> Output {
    let runtime = tempfile::Builder::new().prefix("ff").tempdir_in("/tmp").unwrap();
    let mut command = Command::new(env!("CARGO_BIN_EXE_fringeflow"));
    command.args(arguments).env("FRINGEFLOW_RUNTIME_DIR", runtime.path()).output().unwrap()
}

#[track_caller]
fn run_json(arguments: &[&str]) -> serde_json::Value {
    let output = fringeflow(arguments);
    let errors = String::from_utf8_lossy(&output.stderr);
    assert!(output.status.success(), "{arguments:?}: {:?}\n{errors}", output.status);
    serde_json::from_slice(&output.stdout).unwrap()
}

#[test]
fn the_manifest_lists_every_recording_with_its_checksum_and_command() {
    let mut listed: Vec<String> = entries().iter().map(|entry| entry.file.clone()).collect();
    listed.sort();
    let files = fs::read_dir(folder()).unwrap().map(|entry| entry.unwrap());
    let mut found: Vec<(String, u64)> = files
        .map(|file| (file.file_name().into_string().unwrap(), file.metadata().unwrap().len()))
        .filter(|(name, _)| name.ends_with(".mcap"))
        .collect();
    found.sort();
    assert_eq!(found.iter().map(|(name, _)| name.clone()).collect::<Vec<_>>(), listed);
    assert!(found.iter().map(|(_, bytes)| bytes).sum::<u64>() < MAX_BYTES);
    for entry in entries() {
        let bytes = fs::read(folder().join(&entry.file)).unwrap();
        let digest: String = Sha256::digest(&bytes).iter().map(|byte| format!("{byte:02x}")).collect();
        assert_eq!(digest, entry.sha256, "{}", entry.file);
        assert!(entry.command.contains(&entry.file.replace(".mcap", ".toml")), "{}", entry.command);
    }
}

#[test]
fn a_replay_in_one_process_reproduces_every_cloud_byte_for_byte() {
    for entry in entries() {
        let file = folder().join(&entry.file);
        // One thread with the portable kernels, and two threads with the best instructions of this machine.
        for kernels in [["--threads", "1", "--simd", "portable"].as_slice(), &["--threads", "2"]] {
            let report = run_json(&[kernels, &["replay", file.to_str().unwrap(), "--verify", "--json"]].concat());
            assert_eq!(report["clouds"], entry.clouds, "{}: {report}", entry.file);
            assert_eq!(report["same"], entry.clouds, "{}: {report}", entry.file);
        }
    }
}

#[test]
fn a_replay_over_the_channels_reproduces_every_cloud_byte_for_byte() {
    for (entry, threads) in entries().into_iter().zip(["1", "2", "1"]) {
        let file = folder().join(&entry.file);
        let arguments = ["--threads", threads, "replay", file.to_str().unwrap(), "--rate", "max", "--verify", "--json"];
        let report = run_json(&arguments);
        let compared = &report["compared"];
        assert_eq!(compared["same"], entry.clouds, "{}: {report}", entry.file);
        assert_eq!((&compared["different"], &compared["missing"]), (&0.into(), &0.into()), "{}: {report}", entry.file);
        assert_eq!(report["imbalances"], serde_json::json!([]), "{}", entry.file);
    }
}
