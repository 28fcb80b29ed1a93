//! Runs the command, and compares the results of two runs.

use std::collections::BTreeMap;
use std::path::Path;
use std::process::Command;

/// What a run of the command printed and wrote.
pub(crate) struct Outcome {
    code: Option<i32>,
    pub(crate) stdout: String,
    pub(crate) stderr: String,
    /// Content of the files below its working folder, by path.
    files: BTreeMap<String, Vec<u8>>,
}

impl Outcome {
    pub(crate) fn is_success(&self) -> bool {
        matches!(self.code, Some(0 | 3))
    }

    /// Whether the arguments or the input were refused. A value that the test should not have given is no refusal.
    pub(crate) fn is_refused(&self) -> bool {
        let is_about_value =
            ["a value is required", "invalid value", "unexpected"].map(|text| self.stderr.contains(text));
        self.code == Some(2) && !is_about_value.contains(&true)
    }

    pub(crate) fn differs_from(&self, other: &Self) -> bool {
        self.is_success() && (&self.stdout, &self.files) != (&other.stdout, &other.files)
    }
}

/// Runs the command in a folder. Lines about durations are left out of what it printed.
pub(crate) fn run(folder: &Path, arguments: &[String]) -> Outcome {
    let mut command = Command::new(env!("CARGO_BIN_EXE_fringeflow"));
    let output = command.current_dir(folder).args(arguments).output().unwrap();
    let [stdout, stderr] = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
    let stdout = stdout.lines().filter(|line| !line.starts_with("tracking ")).collect::<Vec<_>>().join("\n");
    let mut files = BTreeMap::new();
    if folder.is_absolute() {
        collect(folder, folder, &mut files);
    }
    Outcome { code: output.status.code(), stdout, stderr, files }
}

fn collect(root: &Path, folder: &Path, files: &mut BTreeMap<String, Vec<u8>>) {
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() {
            collect(root, &path, files);
        } else {
            let name = path.strip_prefix(root).unwrap().to_string_lossy().into_owned();
            files.insert(name, std::fs::read(&path).unwrap());
        }
    }
}
