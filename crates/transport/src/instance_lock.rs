//! The lock of an instance: allows one supervisor at a time, and cleans up at start and end.

use std::fs::{self, File, OpenOptions};
use std::io::{Read, Seek, Write};
use std::os::unix::fs::{MetadataExt, OpenOptionsExt};
use std::path::{Path, PathBuf};
use std::time::SystemTime;

use rustix::fs::{FlockOperation, flock};
use rustix::io::Errno;

use super::{Instance, TransportError, shared_memory};

/// Suffix of a lock file, after the name of the instance.
const LOCK_SUFFIX: &str = ".lock";

/// Held by the supervisor of an instance.
///
/// Taking the lock removes the files of a killed instance. Dropping it removes all files of the instance, unless a
/// process that the supervisor did not start is still attached. Drop all ports and nodes first.
#[derive(Debug)]
pub struct InstanceLock {
    instance: Instance,
    path: PathBuf,
    _file: File,
}

impl InstanceLock {
    /// Takes the lock.
    ///
    /// # Errors
    /// [`TransportError::AlreadyRunning`], or the folder of the instance cannot be used.
    pub fn take(instance: &Instance) -> Result<Self, TransportError> {
        instance.prepare()?;
        // The file lies beside the folder of the instance, so that removing the folder does not release the lock.
        let path = instance.runtime_dir().join(format!("{}{LOCK_SUFFIX}", instance.name()));
        let file = lock_file(instance, &path)?;
        let lock = Self { instance: instance.clone(), path, _file: file };
        lock.remove_unused()?;
        instance.prepare()?;
        Ok(lock)
    }

    /// Removes the files of the instance, unless a living process uses them.
    fn remove_unused(&self) -> Result<(), TransportError> {
        self.instance.clean_dead()?;
        if !self.instance.participants()?.is_empty() {
            return Ok(());
        }
        for file in shared_memory::files(self.instance.prefix())? {
            ignore_missing(fs::remove_file(&file)).map_err(TransportError::file("remove", file))?;
        }
        let root = self.instance.root();
        match fs::remove_dir_all(root) {
            // A process has just attached, for example `status` while the instance starts, and uses the folder.
            Err(e) if e.kind() == std::io::ErrorKind::DirectoryNotEmpty => Ok(()),
            result => ignore_missing(result).map_err(TransportError::file("remove", root)),
        }
    }
}

impl Drop for InstanceLock {
    fn drop(&mut self) {
        if let Err(error) = self.remove_unused() {
            tracing::warn!(%error, "cannot remove all files of the instance");
        }
        // The file is removed while it is locked: a process that opened it before sees that the path no longer names
        // this file.
        if let Err(error) = ignore_missing(fs::remove_file(&self.path)) {
            tracing::warn!(%error, path = %self.path.display(), "cannot remove the lock file");
        }
    }
}

/// An instance whose supervisor has started and has not shut down cleanly.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct StartedInstance {
    /// The instance. It is running, unless its supervisor was killed.
    pub instance: Instance,
    /// When its supervisor started.
    pub since: SystemTime,
}

impl Instance {
    /// Lists the instances of this user that have started and have not shut down cleanly, sorted by name.
    ///
    /// # Errors
    /// The runtime folder cannot be found or read.
    pub fn list_started() -> Result<Vec<StartedInstance>, TransportError> {
        Self::list_started_in(&Self::user_runtime_dir())
    }

    /// [`Self::list_started`] for a runtime folder.
    pub(super) fn list_started_in(runtime_dir: &Path) -> Result<Vec<StartedInstance>, TransportError> {
        let entries = match fs::read_dir(runtime_dir) {
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => return Ok(Vec::new()),
            entries => entries.map_err(TransportError::file("read", runtime_dir))?,
        };
        let started = |entry: fs::DirEntry| {
            let name = entry.file_name().to_str()?.strip_suffix(LOCK_SUFFIX)?.to_owned();
            let since = entry.metadata().ok()?.modified().ok()?;
            Some(StartedInstance { instance: Self::in_folder(runtime_dir, &name).ok()?, since })
        };
        let mut found: Vec<StartedInstance> = entries.flatten().filter_map(started).collect();
        found.sort_by(|a, b| a.instance.name().cmp(b.instance.name()));
        Ok(found)
    }
}

/// Opens and locks the file, and writes the process id into it.
fn lock_file(instance: &Instance, path: &Path) -> Result<File, TransportError> {
    loop {
        let mut options = OpenOptions::new();
        options.read(true).write(true).create(true).truncate(false).mode(0o600);
        let mut file = options.open(path).map_err(TransportError::file("open", path))?;
        match flock(&file, FlockOperation::NonBlockingLockExclusive) {
            Ok(()) => {}
            Err(Errno::WOULDBLOCK) => return Err(already_running(instance, &mut file)),
            Err(e) => return Err(TransportError::file("lock", path)(e.into())),
        }
        if is_file_at(&file, path) {
            write_pid(&mut file).map_err(TransportError::file("write", path))?;
            return Ok(file);
        }
    }
}

/// Whether the path still names the open file: another supervisor may have just removed it.
fn is_file_at(file: &File, path: &Path) -> bool {
    let identity = |found: fs::Metadata| (found.dev(), found.ino());
    let (open, named) = (file.metadata().map(identity), fs::metadata(path).map(identity));
    matches!((open, named), (Ok(open), Ok(named)) if open == named)
}

fn write_pid(file: &mut File) -> std::io::Result<()> {
    file.set_len(0)?;
    file.rewind()?;
    writeln!(file, "{}", std::process::id())
}

fn already_running(instance: &Instance, file: &mut File) -> TransportError {
    let mut pid = String::new();
    let read = file.take(32).read_to_string(&mut pid);
    let pid = if read.is_ok() && !pid.trim().is_empty() { pid.trim() } else { "unknown" };
    TransportError::AlreadyRunning { name: instance.name().to_owned(), pid: pid.to_owned() }
}

fn ignore_missing(result: std::io::Result<()>) -> std::io::Result<()> {
    match result {
        Err(e) if e.kind() == std::io::ErrorKind::NotFound => Ok(()),
        result => result,
    }
}
