//! The files of a port, and how the port notices that they were replaced.
//!
//! When the files of an instance are removed, running processes keep the files that they have open. Processes that
//! start later create new files under the same names, and the two groups cannot exchange messages. So a port remembers
//! which files it opened.

use std::fs;
use std::ops::Deref;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use super::{TransportError, shared_memory};

/// Files through which other processes find a port, with their identities when the port was opened.
#[derive(Clone, Debug, Default)]
pub(super) struct Files {
    all: Vec<(PathBuf, Option<Identity>)>,
    services: Vec<Service>,
}

/// The files of a service.
#[derive(Clone, Debug)]
pub(super) struct Service {
    /// Static description of the service.
    pub(super) description: PathBuf,
    /// List of the participants, in shared memory.
    pub(super) participants: PathBuf,
}

/// A port and the files through which other processes find it.
#[derive(Debug)]
pub(super) struct Attached<T> {
    // Rust drops the fields in this order: the links must outlive the port.
    port: T,
    files: Files,
    successors: Vec<KeptByLink>,
}

/// Device, inode and modification time. A disk may reuse an inode at once, so the time is needed. Shared memory does
/// not reuse inodes, and its modification time may change with every message, so the time is `None` there.
type Identity = (u64, u64, Option<(i64, i64)>);

impl Files {
    pub(super) fn new(files: impl IntoIterator<Item = PathBuf>) -> Self {
        let with_identity = |file: PathBuf| {
            let identity = identity(&file);
            (file, identity)
        };
        Self { all: files.into_iter().map(with_identity).collect(), services: Vec::new() }
    }

    /// Adds the files of services.
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

    /// Whether all files still exist and none was replaced.
    fn are_current(&self) -> bool {
        self.all.iter().all(|(file, before)| before.is_some() && identity(file) == *before)
    }

    fn is_replaced(&self, file: &Path) -> bool {
        self.all.iter().any(|(known, before)| known == file && identity(file) != *before)
    }

    /// Files that another process has created again.
    fn successors(&self) -> impl Iterator<Item = &Path> {
        let created_again = |(file, before): &&(PathBuf, _)| identity(file).is_some_and(|now| Some(now) != *before);
        self.all.iter().filter(created_again).map(|(file, _)| file.as_path())
    }
}

impl<T> Attached<T> {
    pub(super) fn new(port: T, files: Files) -> Self {
        Self { port, files, successors: Vec::new() }
    }

    /// Whether processes that start now find this port.
    pub(super) fn is_current(&self) -> bool {
        self.files.are_current()
    }

    /// Removes the descriptions of services whose shared memory was removed. No process can join such a service, and
    /// none can create it again while its description exists.
    pub(super) fn remove_unusable_services(&self) {
        for Service { description, participants } in &self.files.services {
            if !participants.exists() && !self.files.is_replaced(description) {
                // If it cannot be removed, opening the port again fails and reports it.
                let _ = fs::remove_file(description);
            }
        }
    }
}

/// Opens a port again if its files were replaced or it is closed. Returns whether it did.
pub(super) fn ensure_open<T>(
    port: &mut Option<Attached<T>>,
    open: impl FnOnce() -> Result<Attached<T>, TransportError>,
) -> Result<bool, TransportError> {
    if port.as_ref().is_some_and(Attached::is_current) {
        return Ok(false);
    }
    // Close the old port first: the channel may allow only one.
    if let Some(old) = port.take() {
        old.remove_unusable_services();
    }
    *port = Some(open()?);
    Ok(true)
}

impl<T> Deref for Attached<T> {
    type Target = T;

    fn deref(&self) -> &T {
        &self.port
    }
}

impl<T> Drop for Attached<T> {
    /// The last user of a service removes its files by name, even if another process has created them again. Hard links
    /// keep the new files.
    fn drop(&mut self) {
        self.successors = self.files.successors().filter_map(KeptByLink::new).collect();
    }
}

/// A hard link that keeps a file while its original name is removed, and then restores the name.
#[derive(Debug)]
struct KeptByLink {
    file: PathBuf,
    link: PathBuf,
}

impl KeptByLink {
    /// `None` if the file has just been removed.
    fn new(file: &Path) -> Option<Self> {
        static NUMBER: AtomicU64 = AtomicU64::new(0);
        let number = NUMBER.fetch_add(1, Ordering::Relaxed);
        let link = file.with_extension(format!("{}-{number}.kept", std::process::id()));
        fs::hard_link(file, &link).ok()?;
        Some(Self { file: file.to_owned(), link })
    }
}

impl Drop for KeptByLink {
    fn drop(&mut self) {
        // On failure, either a file is left that the supervisor removes, or a file is missing, which every port
        // notices.
        let _ = if self.file.exists() { fs::remove_file(&self.link) } else { fs::rename(&self.link, &self.file) };
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

    /// Removes its file when it is dropped, even if the file belongs to another port by then.
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
        assert!(first.is_current());
        fs::remove_file(&file).unwrap();
        assert!(!first.is_current());
        let second = attach();
        assert!(!first.is_current());

        drop(first);
        assert!(second.is_current());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
        drop(second);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
    }
}
