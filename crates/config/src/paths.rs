//! Resolves the paths in a configuration file, relative to its folder.

use std::path::{Component, Path, PathBuf};

/// Resolves a path of a configuration file in `folder`. Removes `.`, and removes `..` together with the folder before
/// it.
///
/// A `..` after a symbolic link stays, since it leads to the parent of the target.
pub(super) fn in_folder(folder: &Path, path: &Path) -> PathBuf {
    let mut clean = PathBuf::new();
    for component in folder.join(path).components() {
        match component {
            Component::CurDir => {}
            Component::ParentDir if ends_in_folder(&clean) => drop(clean.pop()),
            component => clean.push(component),
        }
    }
    if clean.as_os_str().is_empty() { PathBuf::from(".") } else { clean }
}

fn ends_in_folder(path: &Path) -> bool {
    matches!(path.components().next_back(), Some(Component::Normal(_))) && !path.is_symlink()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_clean() {
        for (folder, path, expected) in [
            ("configs", "../demo-output", "demo-output"),
            ("/scans/demo", ".", "/scans/demo"),
            ("", "cache/images", "cache/images"),
            ("configs", "..", "."),
            ("configs", "../../demo-output", "../demo-output"),
            ("../configs", "../demo-output", "../demo-output"),
            ("configs", "/data/./scans/../rig", "/data/rig"),
        ] {
            assert_eq!(in_folder(Path::new(folder), Path::new(path)).as_os_str(), expected, "{folder} {path}");
        }
    }

    #[test]
    fn a_parent_after_a_link_stays() {
        let folder = tempfile::tempdir().unwrap();
        let link = folder.path().join("configs");
        std::os::unix::fs::symlink("/", &link).unwrap();
        assert_eq!(in_folder(&link, Path::new("../scans")), link.join("../scans"));
    }
}
