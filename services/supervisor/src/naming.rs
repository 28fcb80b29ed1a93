//! Names of files that nobody named.

use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// A file of an instance in a folder, named by a time of UTC, which sorts: `demo-2026-05-01T12-30-00Z.mcap`.
#[must_use]
pub fn named_by_time(folder: &Path, instance: &str, time: SystemTime, extension: &str) -> PathBuf {
    let time = humantime::format_rfc3339_seconds(time).to_string();
    folder.join(format!("{instance}-{}.{extension}", time.replace(':', "-")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_hold_instance_and_time() {
        let path = named_by_time(Path::new("here"), "demo", SystemTime::UNIX_EPOCH, "html");
        assert_eq!(path, Path::new("here/demo-1970-01-01T00-00-00Z.html"));
    }
}
