//! What is attached to an instance through files, and how it notices that they are no longer the same.
//!
//! When somebody removes files of an instance, processes that run keep what they opened; processes that come later
//! create it again under the same names, and the two groups do not hear each other. So a port remembers its files.

use std::fs;
use std::ops::Deref;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use super::shared_memory;

/// Files that others find a port through, as they were when it was opened.
#[derive(Clone, Debug, Default)]
pub(super) struct Files {
    all: Vec<(PathBuf, Option<Identity>)>,
    services: Vec<Service>,
}

/// The files of a service.
#[derive(Clone, Debug)]
pub(super) struct Service {
    /// What it is.
    pub(super) description: PathBuf,
    /// Who takes part, in shared memory.
    pub(super) participants: PathBuf,
}

/// A port together with the files that others find it through.
#[derive(Debug)]
pub(super) struct Attached<T> {
    // Dropped in this order.
    port: T,
    files: Files,
    kept: Vec<Kept>,
}

/// Device, inode and time of the last change of the content. Disks reuse an inode at once. Shared memory does not, and
/// there the time may change with every message: it is left out.
type Identity = (u64, u64, Option<(i64, i64)>);

impl Files {
    pub(super) fn new(files: impl IntoIterator<Item = PathBuf>) -> Self {
        let identified = |file: PathBuf| {
            let identity = identity(&file);
            (file, identity)
        };
        Self { all: files.into_iter().map(identified).collect(), services: Vec::new() }
    }

    /// With those of services.
    pub(super) fn with_services(mut self, services: Vec<Service>) -> Self {
        for service in &services {
            self.extend(Self::new([service.description.clone(), service.participants.clone()]));
        }
        self.services.extend(services);
        self
    }

    pub(super) fn extend(&mut self, other: Self) {
        self.all.extend(other.all);
        self.services.extend(other.services);
    }

    /// Whether all of them exist and are the same ones.
    fn unchanged(&self) -> bool {
        self.all.iter().all(|(file, before)| before.is_some() && identity(file) == *before)
    }

    fn is_changed(&self, file: &Path) -> bool {
        self.all.iter().any(|(known, before)| known == file && identity(file) != *before)
    }

    /// Those that others have created again.
    fn successors(&self) -> impl Iterator<Item = &Path> {
        let created_again = |(file, before): &&(PathBuf, _)| identity(file).is_some_and(|now| Some(now) != *before);
        self.all.iter().filter(created_again).map(|(file, _)| file.as_path())
    }
}

impl<T> Attached<T> {
    pub(super) fn new(port: T, files: Files) -> Self {
        Self { port, files, kept: Vec::new() }
    }

    /// Whether others who come now find this port.
    pub(super) fn unchanged(&self) -> bool {
        self.files.unchanged()
    }

    /// Removes the descriptions of services that nobody can join, since their shared memory was removed: as long as
    /// these are there, nobody can create the services again.
    pub(super) fn withdraw(&self) {
        for Service { description, participants } in &self.files.services {
            if !participants.exists() && !self.files.is_changed(description) {
                // If it cannot be removed, opening anew fails and says so.
                let _ = fs::remove_file(description);
            }
        }
    }
}

impl<T> Deref for Attached<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.port
    }
}

impl<T> Drop for Attached<T> {
    /// The last user of a service removes its files by name, even if they meanwhile belong to its successor: keep those.
    fn drop(&mut self) {
        self.kept = self.files.successors().filter_map(Kept::new).collect();
    }
}

/// A second name of a file, under which it survives its removal.
#[derive(Debug)]
struct Kept {
    file: PathBuf,
    second: PathBuf,
}

impl Kept {
    /// `None` if the file has just gone.
    fn new(file: &Path) -> Option<Self> {
        static NUMBER: AtomicU64 = AtomicU64::new(0);
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let second = file.with_extension(format!("{}-{number}.kept", std::process::id()));
        fs::hard_link(file, &second).ok()?;
        Some(Self { file: file.to_owned(), second })
    }
}

impl Drop for Kept {
    fn drop(&mut self) {
        // A failure leaves a file that the supervisor removes, or a changed one that every port notices.
        let _ = if self.file.exists() { fs::remove_file(&self.second) } else { fs::rename(&self.second, &self.file) };
    }
}

fn identity(file: &Path) -> Option<Identity> {
    let found = fs::symlink_metadata(file).ok()?;
    let written = (!file.starts_with(shared_memory::FOLDER)).then_some((found.mtime(), found.mtime_nsec()));
    Some((found.dev(), found.ino(), written))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Removes its file when it is dropped, whosever it is by then.
    struct Port(PathBuf);

    impl Drop for Port {
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
            Attached::new(Port(file.clone()), Files::new([file.clone()]))
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
