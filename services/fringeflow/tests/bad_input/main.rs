//! Bad input and bad output paths by the command line. Each ends with the right exit code and one line that names file
//! and field, and leaves no partial output.

// A test fails if its preparation fails.
#![allow(clippy::unwrap_used)]

mod faults;
mod input;

use std::ffi::OsString;
use std::path::Path;
use std::process::{Command, Output};

use faults::{FAULTS, Fault, FoundIn};

/// A command that reads a dataset folder.
struct DatasetCommand {
    name: &'static str,
    reads_images: bool,
    /// Arguments after the dataset folder, with a folder for the output.
    arguments: fn(out: &Path) -> Vec<OsString>,
    /// A file that it writes to the output folder.
    writes: &'static str,
}

const COMMANDS: &[DatasetCommand] = &[
    DatasetCommand {
        name: "reconstruct",
        reads_images: true,
        arguments: |out| vec!["-o".into(), out.join("cloud.ply").into()],
        writes: "cloud.ply",
    },
    DatasetCommand {
        name: "evaluate",
        reads_images: true,
        arguments: |out| vec!["--against".into(), "truth".into(), "--preview".into(), out.into()],
        writes: "judgement.png",
    },
    DatasetCommand {
        name: "rig",
        reads_images: false,
        arguments: |out| vec!["--grid".into(), "16".into(), "--output".into(), out.into()],
        writes: "periods.png",
    },
];

impl DatasetCommand {
    /// Returns whether the command reads the part of the dataset that has the fault.
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

/// Asserts an exit code, an empty standard output, and one line of standard error that contains all of `says`.
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
    input::write_intact(&set);
    std::fs::create_dir(&out).unwrap();
    for command in COMMANDS {
        let output = command.run(&set, &out);
        assert!(output.status.success(), "{}: {}", command.name, String::from_utf8_lossy(&output.stderr));
        assert!(out.join(command.writes).is_file(), "{}", command.name);
    }
}

#[test]
fn images_and_calibrations_under_other_names_are_accepted() {
    let folder = tempfile::tempdir().unwrap();
    let (set, out) = (folder.path().join("set"), folder.path().join("out"));
    std::fs::create_dir(&out).unwrap();
    input::write_intact(&set);
    for command in COMMANDS {
        assert!(command.run(&set, &out).status.success());
    }
    let expected = std::fs::read(out.join("cloud.ply")).unwrap();
    for (case, change) in input::OTHER_NAMES {
        std::fs::remove_dir_all(&set).unwrap();
        input::write_intact(&set);
        change(&set);
        let output = COMMANDS[0].run(&set, &out);
        assert!(output.status.success(), "{case}: {}", String::from_utf8_lossy(&output.stderr));
        assert!(std::fs::read(out.join("cloud.ply")).unwrap() == expected, "{case}");
    }
}

#[test]
fn every_fault_in_a_dataset_is_named_and_nothing_is_written() {
    for fault in FAULTS {
        let folder = tempfile::tempdir().unwrap();
        let (set, out) = (folder.path().join("set"), folder.path().join("out"));
        input::write_intact(&set);
        std::fs::create_dir(&out).unwrap();
        (fault.damage)(&set);
        let before = input::list_files(folder.path());
        for command in COMMANDS.iter().filter(|command| command.finds(fault)) {
            let case = format!("{}, {}", command.name, fault.name);
            assert_refused(&command.run(&set, &out), 2, &[fault.file, fault.says], &case);
            assert_eq!(input::list_files(folder.path()), before, "{case}");
        }
    }
}

#[test]
fn a_folder_at_the_path_of_an_output_file_ends_with_exit_code_1() {
    let folder = tempfile::tempdir().unwrap();
    let set = folder.path().join("set");
    input::write_intact(&set);
    for command in COMMANDS {
        let out = folder.path().join(command.name);
        std::fs::create_dir_all(out.join(command.writes)).unwrap();
        let before = input::list_files(folder.path());
        assert_refused(&command.run(&set, &out), 1, &[command.writes, "is a folder"], command.name);
        assert_eq!(input::list_files(folder.path()), before, "{}", command.name);
    }
}

#[test]
fn reconstruct_refuses_a_missing_output_folder_and_writes_nothing() {
    let folder = tempfile::tempdir().unwrap();
    let set = folder.path().join("set");
    input::write_intact(&set);
    for command in COMMANDS.iter().filter(|command| command.name == "reconstruct") {
        let output = command.run(&set, &folder.path().join("missing"));
        assert_refused(&output, 1, &["missing", "does not exist"], command.name);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1, "{}", command.name);
    }
}

#[test]
fn simulate_never_overwrites_and_leaves_no_partial_folder() {
    let folder = tempfile::tempdir().unwrap();
    let taken = folder.path().join("taken");
    std::fs::create_dir(&taken).unwrap();
    std::fs::write(taken.join("mine.txt"), "mine").unwrap();
    let before = input::list_files(folder.path());
    let simulate = |target: &Path, size: &str| {
        let arguments = ["simulate", "--object", "plane", "--size", size, "--supersampling", "1", "-o"];
        fringeflow(arguments.into_iter().map(OsString::from).chain([target.into()]))
    };
    assert_refused(&simulate(&taken, "64x64"), 2, &["taken", "already exists"], "taken folder");
    assert_refused(&simulate(&taken.join("mine.txt"), "64x64"), 2, &["mine.txt", "already exists"], "taken file");
    let nowhere = folder.path().join("nowhere/set");
    assert_refused(&simulate(&nowhere, "64x64"), 1, &["nowhere/set", "cannot be written"], "missing parent folder");
    assert_refused(&simulate(&folder.path().join("small"), "8x8"), 2, &["size", "8"], "too small");
    assert_eq!(input::list_files(folder.path()), before);
}

#[test]
fn simulate_refuses_formats_and_layouts_that_are_not_possible() {
    let folder = tempfile::tempdir().unwrap();
    let target = folder.path().join("set");
    let refused = |options: &[&str], says: &[&str]| {
        let arguments = ["simulate", "--object", "plane", "--supersampling", "1", "-o"].map(OsString::from);
        let output =
            fringeflow(arguments.into_iter().chain([target.clone().into()]).chain(options.iter().map(OsString::from)));
        assert_refused(&output, 2, says, &options.join(" "));
        assert!(!target.exists());
    };
    refused(&["--format", "MJPG"], &["MJPG", "does not compress"]);
    refused(&["--format", "Y8I", "--stereo-layout", "top-bottom"], &["remove the layout top-bottom"]);
    refused(&["--format", "RGGB", "--size", "65x64", "--stereo-layout", "side-by-side"], &["65 × 64", "multiple of 2"]);
    refused(&["--format", "Y10P", "--size", "66x64", "--stereo-layout", "side-by-side"], &["multiple of 4"]);
}
