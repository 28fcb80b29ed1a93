//! Bad input and bad output paths, from the outside: the exit code, one line that names file and field, and nothing
//! half-written.

// A helper that cannot prepare its test fails it.
#![allow(clippy::unwrap_used)]

mod faults;
mod input;

use std::ffi::OsString;
use std::path::Path;
use std::process::{Command, Output};

use faults::{FAULTS, Fault, FoundIn};

/// A command that reads a dataset folder.
struct Job {
    name: &'static str,
    reads_images: bool,
    /// Arguments after the dataset folder, with a folder for whatever it writes.
    arguments: fn(out: &Path) -> Vec<OsString>,
    /// A file that it writes to the folder.
    writes: &'static str,
}

const JOBS: &[Job] = &[
    Job {
        name: "reconstruct",
        reads_images: true,
        arguments: |out| vec!["-o".into(), out.join("cloud.ply").into()],
        writes: "cloud.ply",
    },
    Job {
        name: "evaluate",
        reads_images: true,
        arguments: |out| vec!["--against".into(), "truth".into(), "--preview".into(), out.into()],
        writes: "judgement.png",
    },
    Job {
        name: "rig",
        reads_images: false,
        arguments: |out| vec!["--grid".into(), "16".into(), "--output".into(), out.into()],
        writes: "periods.png",
    },
];

impl Job {
    /// Whether it comes upon a fault.
    fn finds(&self, fault: &Fault) -> bool {
        self.reads_images || fault.found_in == FoundIn::Folder
    }

    fn run(&self, set: &Path, out: &Path) -> Output {
        fringeflow([self.name.into(), set.into()].into_iter().chain((self.arguments)(out)))
    }
}

fn fringeflow(arguments: impl IntoIterator<Item = OsString>) -> Output {
    Command::new(env!("CARGO_BIN_EXE_fringeflow")).args(arguments).output().unwrap()
}

/// Asserts an exit code, an empty standard output and one line of standard error that holds all of `says`.
fn assert_refused(output: &Output, code: i32, says: &[&str], case: &str) {
    let error = String::from_utf8_lossy(&output.stderr);
    assert_eq!(output.status.code(), Some(code), "{case}: {error}");
    assert!(output.stdout.is_empty(), "{case}: {}", String::from_utf8_lossy(&output.stdout));
    assert_eq!(error.lines().count(), 1, "{case}: {error}");
    assert!(error.starts_with("fringeflow: "), "{case}: {error}");
    for part in says {
        assert!(error.contains(part), "{case}: {part:?} is missing in: {error}");
    }
}

#[test]
fn intact_input_is_accepted() {
    let folder = tempfile::tempdir().unwrap();
    let (set, out) = (folder.path().join("set"), folder.path().join("out"));
    input::intact(&set);
    std::fs::create_dir(&out).unwrap();
    for job in JOBS {
        let output = job.run(&set, &out);
        assert!(output.status.success(), "{}: {}", job.name, String::from_utf8_lossy(&output.stderr));
        assert!(out.join(job.writes).is_file(), "{}", job.name);
    }
}

#[test]
fn every_fault_is_named_and_nothing_is_written() {
    for fault in FAULTS {
        let folder = tempfile::tempdir().unwrap();
        let (set, out) = (folder.path().join("set"), folder.path().join("out"));
        input::intact(&set);
        std::fs::create_dir(&out).unwrap();
        (fault.damage)(&set);
        let before = input::listing(folder.path());
        for job in JOBS.iter().filter(|job| job.finds(fault)) {
            let case = format!("{}, {}", job.name, fault.name);
            assert_refused(&job.run(&set, &out), 2, &[fault.file, fault.says], &case);
            assert_eq!(input::listing(folder.path()), before, "{case}");
        }
    }
}

#[test]
fn a_folder_in_the_place_of_an_output_ends_with_1() {
    let folder = tempfile::tempdir().unwrap();
    let set = folder.path().join("set");
    input::intact(&set);
    for job in JOBS {
        let out = folder.path().join(job.name);
        std::fs::create_dir_all(out.join(job.writes)).unwrap();
        let before = input::listing(folder.path());
        assert_refused(&job.run(&set, &out), 1, &[job.writes, "is a folder"], job.name);
        assert_eq!(input::listing(folder.path()), before, "{}", job.name);
    }
}

#[test]
fn a_cloud_for_a_folder_that_is_not_there_is_refused_before_the_work() {
    let folder = tempfile::tempdir().unwrap();
    let set = folder.path().join("set");
    input::intact(&set);
    for job in JOBS.iter().filter(|job| job.name == "reconstruct") {
        assert_refused(&job.run(&set, &folder.path().join("missing")), 1, &["missing", "does not exist"], job.name);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "{}", job.name);
    }
}

#[test]
fn a_simulation_neither_overwrites_nor_leaves_half_a_folder() {
    let folder = tempfile::tempdir().unwrap();
    let taken = folder.path().join("taken");
    std::fs::create_dir(&taken).unwrap();
    std::fs::write(taken.join("mine.txt"), "mine").unwrap();
    let before = input::listing(folder.path());
    let simulate = |target: &Path, size: &str| {
        let arguments = ["simulate", "--object", "plane", "--size", size, "--supersampling", "1", "-o"];
        fringeflow(arguments.into_iter().map(OsString::from).chain([target.into()]))
    };
    assert_refused(&simulate(&taken, "64x64"), 2, &["taken", "already exists"], "taken folder");
    assert_refused(&simulate(&taken.join("mine.txt"), "64x64"), 2, &["mine.txt", "already exists"], "taken file");
    let nowhere = folder.path().join("nowhere/set");
    assert_refused(&simulate(&nowhere, "64x64"), 1, &["nowhere/set", "cannot be written"], "no folder around it");
    assert_refused(&simulate(&folder.path().join("small"), "8x8"), 2, &["size", "8"], "too small");
    assert_eq!(input::listing(folder.path()), before);
}
