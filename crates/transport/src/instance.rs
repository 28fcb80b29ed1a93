//! An instance: name, folder, and prefix in shared memory.

use std::fs::{self, Permissions};
use std::os::unix::fs::{DirBuilderExt, MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};

use iceoryx2::node::NodeView;
use iceoryx2::prelude::{CallbackProgression, Config, FileName, Node as IoxNode, NodeState, SemanticString};
use rustix::process::geteuid;
use sha2::{Digest, Sha256};

use super::{Ipc, TransportError};

/// Longest name of an instance.
const MAX_NAME_BYTES: usize = 32;

/// Longest path of a socket on Linux.
const MAX_SOCKET_PATH_BYTES: usize = 107;

/// Bytes after the root path in the path of a socket: separator, prefix, a number of up to 128 bits, suffix.
const SOCKET_NAME_BYTES: usize = 1 + PREFIX_BYTES + 39 + ".event".len();

/// Bytes of the prefix of shared memory.
const PREFIX_BYTES: usize = "ff_".len() + 8;

/// A set of processes that exchange messages with each other only.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Instance {
    name: String,
    runtime_dir: PathBuf,
    root: PathBuf,
    prefix: String,
}

/// A living process of an instance.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Participant {
    /// Name that the process chose.
    pub name: String,
    /// The process.
    pub pid: u32,
}

impl Instance {
    /// Returns the instance with this name of this user. Its runtime folder is `$FRINGEFLOW_RUNTIME_DIR`, else
    /// `$XDG_RUNTIME_DIR/fringeflow`, else `/tmp/fringeflow-UID`.
    ///
    /// # Errors
    /// An invalid name, or a path too long for sockets.
    pub fn new(name: &str) -> Result<Self, TransportError> {
        Self::in_folder(&Self::user_runtime_dir(), name)
    }

    /// The runtime folder of this user.
    pub(super) fn user_runtime_dir() -> PathBuf {
        let folder = |variable| std::env::var_os(variable).filter(|value| !value.is_empty()).map(PathBuf::from);
        folder("FRINGEFLOW_RUNTIME_DIR")
            .or_else(|| folder("XDG_RUNTIME_DIR").map(|dir| dir.join("fringeflow")))
            .unwrap_or_else(|| PathBuf::from(format!("/tmp/fringeflow-{}", geteuid().as_raw())))
    }

    /// Returns the instance with this name in this runtime folder.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn in_folder(runtime_dir: &Path, name: &str) -> Result<Self, TransportError> {
        let allowed = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
        if name.is_empty() || name.len() > MAX_NAME_BYTES || !name.chars().all(allowed) {
            return Err(TransportError::Name { name: name.to_owned() });
        }
        let runtime_dir = std::path::absolute(runtime_dir).map_err(TransportError::file("find", runtime_dir))?;
        let root = runtime_dir.join(name);
        let (bytes, limit) = (root.as_os_str().len(), MAX_SOCKET_PATH_BYTES - SOCKET_NAME_BYTES);
        if bytes > limit {
            return Err(TransportError::PathTooLong { path: root, bytes, limit });
        }
        let digest = Sha256::digest(root.as_os_str().as_encoded_bytes());
        let number = digest.iter().take(4).fold(0_u32, |number, &byte| number << 8 | u32::from(byte));
        Ok(Self { name: name.to_owned(), runtime_dir, root, prefix: format!("ff_{number:08x}") })
    }

    /// Its name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Folder of its sockets and descriptions.
    #[must_use]
    pub fn root(&self) -> &Path {
        &self.root
    }

    /// Prefix of the names of its files in shared memory.
    #[must_use]
    pub fn prefix(&self) -> &str {
        &self.prefix
    }

    /// Runtime folder of the instance. Other processes find the instance if `FRINGEFLOW_RUNTIME_DIR` is set to it.
    #[must_use]
    pub fn runtime_dir(&self) -> &Path {
        &self.runtime_dir
    }

    /// Returns the configuration of iceoryx2 as TOML, for programs in other languages.
    ///
    /// # Errors
    /// iceoryx2 cannot represent the path.
    pub fn external_config(&self) -> Result<String, TransportError> {
        toml::to_string(&self.config()?).map_err(|e| self.node_error(e))
    }

    /// Lists the living processes of the instance.
    ///
    /// # Errors
    /// The processes cannot be listed.
    pub fn participants(&self) -> Result<Vec<Participant>, TransportError> {
        let mut found = Vec::new();
        IoxNode::<Ipc>::list(&self.config()?, |state| {
            if let NodeState::Alive(node) = state
                && let Some(details) = node.details()
            {
                let pid = u32::try_from(details.process_id().value()).unwrap_or_default();
                let participant = Participant { name: details.name().to_string(), pid };
                // A process is listed once for each of its ports.
                if !found.contains(&participant) {
                    found.push(participant);
                }
            }
            CallbackProgression::Continue
        })
        .map_err(|e| self.node_error(e))?;
        Ok(found)
    }

    /// Removes the resources of dead processes, and returns the number of ports they had. Skips resources that another
    /// process is removing.
    ///
    /// # Errors
    /// The processes cannot be listed.
    pub fn clean_dead(&self) -> Result<usize, TransportError> {
        let mut cleaned = 0;
        IoxNode::<Ipc>::list(&self.config()?, |state| {
            if let NodeState::Dead(node) = state {
                cleaned += usize::from(node.try_remove_stale_resources().is_ok());
            }
            CallbackProgression::Continue
        })
        .map_err(|e| self.node_error(e))?;
        Ok(cleaned)
    }

    /// Creates the folders of the instance, without access for others. Refuses folders that others could tamper with.
    pub(super) fn prepare(&self) -> Result<(), TransportError> {
        create_private(&self.runtime_dir)?;
        refuse_foreign(&self.runtime_dir)?;
        create_private(&self.root)?;
        refuse_foreign(&self.root)?;
        make_private(&self.root)
    }

    /// Configuration of iceoryx2. It is complete: iceoryx2 reads no configuration file of the user or the working
    /// folder.
    pub(super) fn config(&self) -> Result<Config, TransportError> {
        let mut config = Config::default();
        let root = self.root.as_os_str().as_encoded_bytes();
        config.global.set_root_path(&SemanticString::new(root).map_err(|e| self.node_error(e))?);
        config.global.prefix = FileName::new(self.prefix.as_bytes()).map_err(|e| self.node_error(e))?;
        Ok(config)
    }

    pub(super) fn channel_error(
        &self,
        channel: &'static str,
        action: &'static str,
        reason: impl std::fmt::Debug,
    ) -> TransportError {
        TransportError::Channel { channel, instance: self.name.clone(), action, reason: format!("{reason:?}") }
    }

    pub(super) fn node_error(&self, reason: impl std::fmt::Debug) -> TransportError {
        TransportError::Node { instance: self.name.clone(), root: self.root.clone(), reason: format!("{reason:?}") }
    }
}

fn create_private(folder: &Path) -> Result<(), TransportError> {
    let mut builder = fs::DirBuilder::new();
    let created = builder.recursive(true).mode(0o700).create(folder);
    created.map_err(|source| TransportError::RuntimeFolder { path: folder.to_owned(), source })
}

/// Refuses a folder that is a link, belongs to another user, or is writable by others.
fn refuse_foreign(folder: &Path) -> Result<(), TransportError> {
    let found = fs::symlink_metadata(folder).map_err(TransportError::file("examine", folder))?;
    let why = if !found.is_dir() {
        "is not a folder".to_owned()
    } else if found.uid() != geteuid().as_raw() {
        format!("belongs to user {}", found.uid())
    } else if found.mode() & 0o022 != 0 {
        format!("is writable by others (mode {:04o})", found.mode() & 0o7777)
    } else {
        return Ok(());
    };
    Err(TransportError::UnsafeFolder { path: folder.to_owned(), why })
}

/// Removes the permissions of group and others from the folder of the instance. iceoryx2 grants some to the group if it
/// creates the folder: when a tool attaches while a supervisor cleans up.
fn make_private(folder: &Path) -> Result<(), TransportError> {
    let found = fs::symlink_metadata(folder).map_err(TransportError::file("examine", folder))?;
    if found.mode() & 0o077 == 0 {
        return Ok(());
    }
    fs::set_permissions(folder, Permissions::from_mode(0o700))
        .map_err(TransportError::file("restrict access to", folder))
}
