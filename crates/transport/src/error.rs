//! Errors of the transport between processes.

use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

/// An instance, a channel or its shared memory cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum TransportError {
    /// The name of an instance is not valid for a folder and sockets.
    #[error("instance name {name:?}: use 1 to 32 letters, digits, - or _")]
    Name {
        /// The name.
        name: String,
    },
    /// The paths of sockets in the folder would be longer than the system allows.
    #[error(
        "the path {} has {bytes} bytes, but at most {limit} leave room for socket names; choose a shorter instance \
         name or runtime folder (FRINGEFLOW_RUNTIME_DIR)",
        path.display()
    )]
    PathTooLong {
        /// Folder of the instance.
        path: PathBuf,
        /// Its length.
        bytes: usize,
        /// Longest allowed.
        limit: usize,
    },
    /// A folder that another user could write to or replace.
    #[error("{} {why}; remove it, or choose another runtime folder (FRINGEFLOW_RUNTIME_DIR)", path.display())]
    UnsafeFolder {
        /// The folder.
        path: PathBuf,
        /// What is wrong with it.
        why: String,
    },
    /// The folder of the instances cannot be created.
    #[error(
        "the runtime folder {} cannot be created: {source}; choose another one (FRINGEFLOW_RUNTIME_DIR)",
        path.display()
    )]
    RuntimeFolder {
        /// The folder.
        path: PathBuf,
        /// Why it failed.
        source: io::Error,
    },
    /// A file of the instance cannot be used.
    #[error("cannot {action} {}: {source}", path.display())]
    File {
        /// What was tried.
        action: &'static str,
        /// The file.
        path: PathBuf,
        /// Why it failed.
        source: io::Error,
    },
    /// Another supervisor runs the instance.
    #[error("instance {name} is already running (pid {pid}); stop it or choose another name")]
    AlreadyRunning {
        /// The instance.
        name: String,
        /// Its supervisor.
        pid: String,
    },
    /// No supervisor runs for this instance.
    #[error("no instance {name} is running here")]
    NotRunning {
        /// The instance.
        name: String,
    },
    /// The supervisor did not answer in time.
    #[error("instance {name} did not answer within {} ms; it may be overloaded or stopped", timeout.as_millis())]
    NoAnswer {
        /// The instance.
        name: String,
        /// The time limit.
        timeout: Duration,
    },
    /// Shared memory cannot be used: it is absent, read-only or closed to this user.
    #[error(
        "{} takes no file for the channels, which need {} MiB of shared memory: {source}; {}",
        folder.display(), needed.div_ceil(1 << 20), remedy(folder, *needed, source)
    )]
    NoSharedMemory {
        /// Where it is mounted, or should be.
        folder: PathBuf,
        /// Bytes needed.
        needed: u64,
        /// Why it failed.
        source: io::Error,
    },
    /// Shared memory is too small.
    #[error(
        "{} has {available} bytes left, the channels need {needed}; enlarge it (mount -o remount,size={enough_mib}M \
         {}, or docker's --shm-size={enough_mib}m), delete files there, or use smaller images",
        folder.display(), folder.display()
    )]
    SharedMemory {
        /// Where it is mounted.
        folder: PathBuf,
        /// Bytes needed.
        needed: u64,
        /// Bytes available.
        available: u64,
        /// Total size that suffices, MiB.
        enough_mib: u64,
    },
    /// The channel already has its maximum number of publishers or subscribers.
    #[error("channel {channel} of instance {instance} already has the maximum of {limit} {role}(s); stop one of them")]
    Occupied {
        /// Name of the channel.
        channel: &'static str,
        /// The instance.
        instance: String,
        /// Publisher or subscriber.
        role: &'static str,
        /// The maximum number.
        limit: usize,
    },
    /// This process cannot take part in the instance.
    #[error("cannot join instance {instance} in {}: {reason}", root.display())]
    Node {
        /// The instance.
        instance: String,
        /// Its folder.
        root: PathBuf,
        /// Reason that iceoryx2 gives.
        reason: String,
    },
    /// A channel cannot be used.
    #[error(
        "channel {channel} of instance {instance}: cannot {action}: {reason}; if it was created with other settings \
         or by another version, stop the instance and all programs attached to it, and start again"
    )]
    Channel {
        /// Name of the channel.
        channel: &'static str,
        /// The instance.
        instance: String,
        /// What was tried.
        action: &'static str,
        /// Reason that iceoryx2 gives.
        reason: String,
    },
    /// A payload is longer than the channel allows.
    #[error(
        "channel {channel}: a payload has {len} elements, at most {limit} fit; the images are larger than configured"
    )]
    TooLong {
        /// Name of the channel.
        channel: &'static str,
        /// Its length.
        len: usize,
        /// Longest allowed.
        limit: usize,
    },
    /// Waiting failed.
    #[error("cannot wait for messages: {reason}")]
    Wait {
        /// Reason that iceoryx2 gives.
        reason: String,
    },
}

/// Tells how to make shared memory usable.
fn remedy(folder: &Path, needed: u64, source: &io::Error) -> String {
    let folder = folder.display();
    match source.kind() {
        io::ErrorKind::ReadOnlyFilesystem => {
            format!("mount it for writing: mount -o remount,rw {folder}; in a container, mount a tmpfs there")
        }
        io::ErrorKind::PermissionDenied => format!("let all users write there: chmod 1777 {folder}"),
        io::ErrorKind::StorageFull | io::ErrorKind::QuotaExceeded => format!("delete files in {folder}"),
        _ => {
            let size_mib = needed.div_ceil(1 << 20);
            format!(
                "mount a tmpfs there: mkdir -p {folder} && mount -t tmpfs -o size={size_mib}M,mode=1777 tmpfs {folder}"
            )
        }
    }
}

impl TransportError {
    /// Whether another attempt would fail too, until a name, a folder or the machine is changed.
    #[must_use]
    pub fn is_lasting(&self) -> bool {
        matches!(
            self,
            Self::Name { .. }
                | Self::PathTooLong { .. }
                | Self::UnsafeFolder { .. }
                | Self::RuntimeFolder { .. }
                | Self::AlreadyRunning { .. }
                | Self::NotRunning { .. }
                | Self::NoSharedMemory { .. }
                | Self::SharedMemory { .. }
        )
    }

    /// Returns a function that adds the path and the action to an I/O error.
    pub(super) fn file(action: &'static str, path: impl Into<PathBuf>) -> impl FnOnce(io::Error) -> Self {
        let path = path.into();
        move |source| Self::File { action, path, source }
    }
}
