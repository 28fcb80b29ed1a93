//! Default output names.

use std::path::{Path, PathBuf};
use std::time::SystemTime;

/// Returns a path in `folder`, named after the instance and a time in UTC: `demo-2026-05-01T12-30-00Z.mcap`. These
/// names sort by time.
#[must_use]
pub fn timestamped_path(folder: &Path, instance: &str, time: SystemTime, extension: &str) -> PathBuf {
    let time = humantime::format_rfc3339_seconds(time).to_string();
    folder.join(format!("{instance}-{}.{extension}", time.replace(':', "-")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_file_name_contains_instance_and_time() {
        let path = timestamped_path(Path::new("here"), "demo", SystemTime::UNIX_EPOCH, "html");
        assert_eq!(path, Path::new("here/demo-1970-01-01T00-00-00Z.html"));
    }
}
