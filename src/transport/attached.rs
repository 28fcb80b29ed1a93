//! What is attached to an instance through files, and how it notices that they are no longer the same.
//!
//! When somebody removes files of an instance, processes that run keep what they opened; processes that come later
//! create it again under the same names, and the two groups do not hear each other. So a port remembers its files.

use std::fs;
use std::ops::Deref;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// Files that others find a port through, as they were when it was opened.
#[derive(Clone, Debug, Default)]
pub(super) struct Files(Vec<(PathBuf, Option<Identity>)>);

/// A port together with the files that others find it through.
#[derive(Debug)]
pub(super) struct Attached<T> {
    port: Option<T>,
    files: Files,
}

/// Device, inode and time of the last change of the content; the inode alone is reused at once.
type Identity = (u64, u64, i64, i64);

impl Files {
    pub(super) fn new(files: impl IntoIterator<Item = PathBuf>) -> Self {
        let identified = |file: PathBuf| {
            let identity = identity(&file);
            (file, identity)
        };
        Self(files.into_iter().map(identified).collect())
    }

    pub(super) fn extend(&mut self, other: Self) {
        self.0.extend(other.0);
    }

    /// Whether all of them exist and are the same ones.
    fn unchanged(&self) -> bool {
        self.0.iter().all(|(file, before)| before.is_some() && identity(file) == *before)
    }

    /// Those that others have created again.
    fn successors(&self) -> Vec<&Path> {
        let created_again = |(file, before): &&(PathBuf, _)| identity(file).is_some_and(|now| Some(now) != *before);
        self.0.iter().filter(created_again).map(|(file, _)| file.as_path()).collect()
    }
}

impl<T> Attached<T> {
    pub(super) fn new(port: T, files: Files) -> Self {
        Self { port: Some(port), files }
    }

    /// Whether others who come now find this port.
    pub(super) fn unchanged(&self) -> bool {
        self.files.unchanged()
    }
}

impl<T> Deref for Attached<T> {
    type Target = T;

    #[allow(clippy::expect_used)]
    fn deref(&self) -> &T {
        self.port.as_ref().expect("only drop takes it")
    }
}

impl<T> Drop for Attached<T> {
    /// The last user of a service removes its files by name, even if they meanwhile belong to its successor: keep those.
    fn drop(&mut self) {
        let kept: Vec<_> = self.files.successors().into_iter().filter_map(Kept::new).collect();
        self.port = None;
        drop(kept);
    }
}

/// A second name of a file, under which it survives its removal.
struct Kept<'a> {
    file: &'a Path,
    second: PathBuf,
}

impl<'a> Kept<'a> {
    /// `None` if the file has just gone.
    fn new(file: &'a Path) -> Option<Self> {
        static NUMBER: AtomicU64 = AtomicU64::new(0);
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let second = file.with_extension(format!("{}-{number}.kept", std::process::id()));
        fs::hard_link(file, &second).ok()?;
        Some(Self { file, second })
    }
}

impl Drop for Kept<'_> {
    fn drop(&mut self) {
        // A failure leaves a file that the supervisor removes, or a changed one that every port notices.
        let _ = if self.file.exists() { fs::remove_file(&self.second) } else { fs::rename(&self.second, self.file) };
    }
}

fn identity(file: &Path) -> Option<Identity> {
    let found = fs::symlink_metadata(file).ok()?;
    Some((found.dev(), found.ino(), found.mtime(), found.mtime_nsec()))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Removes its file when it is dropped, whosever it is by then.
    struct Service(PathBuf);

    impl Drop for Service {
        fn drop(&mut self) {
            let _ = fs::remove_file(&self.0);
        }
    }

    #[test]
    fn dropping_removes_the_own_file_and_keeps_the_successor() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("a.service");
        let attach = || {
            fs::write(&file, "description").unwrap();
            Attached::new(Service(file.clone()), Files::new([file.clone()]))
        };
        let first = attach();
        assert!(first.unchanged());
        fs::remove_file(&file).unwrap();
        assert!(!first.unchanged());
        let second = attach();
        assert!(!first.unchanged());

        drop(first);
        assert!(second.unchanged());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
        drop(second);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
