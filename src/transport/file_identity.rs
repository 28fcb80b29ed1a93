//! Whether a file is still the one it was.

use std::fs;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

/// Files that a port rests on, as they were when it was opened.
#[derive(Clone, Debug)]
pub(super) struct Watched {
    files: Vec<(PathBuf, Option<Identity>)>,
}

/// Device, inode and time of the last change of the content; the inode alone is reused at once.
type Identity = (u64, u64, i64, i64);

impl Watched {
    pub(super) fn new(files: impl IntoIterator<Item = PathBuf>) -> Self {
        let identified = |file: PathBuf| {
            let identity = identity(&file);
            (file, identity)
        };
        Self { files: files.into_iter().map(identified).collect() }
    }

    /// Whether all files exist and are the same ones.
    pub(super) fn unchanged(&self) -> bool {
        self.files.iter().all(|(file, before)| before.is_some() && identity(file) == *before)
    }
}

fn identity(file: &Path) -> Option<Identity> {
    let found = fs::symlink_metadata(file).ok()?;
    Some((found.dev(), found.ino(), found.mtime(), found.mtime_nsec()))
}
