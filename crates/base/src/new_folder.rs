//! Folders that appear when they are complete. In: a path that is new, or an empty folder. Out: a temporary folder
//! beside it, which is renamed at the end.

use std::fs::Permissions;
use std::io;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use tempfile::TempDir;

/// An unfinished folder. If it is dropped without [`Self::finish`], it is deleted.
#[derive(Debug)]
pub struct NewFolder {
    target: PathBuf,
    unfinished: TempDir,
}

impl NewFolder {
    /// Creates the temporary folder.
    ///
    /// # Errors
    /// [`io::ErrorKind::AlreadyExists`] if `target` exists and is not an empty folder; or its parent folder is not
    /// writable.
    pub fn begin(target: &Path) -> io::Result<Self> {
        check_new(target)?;
        let parent = match target.parent() {
            Some(parent) if !parent.as_os_str().is_empty() => parent,
            _ => Path::new("."),
        };
        let mut builder = tempfile::Builder::new();
        // The umask still applies. With the default of tempfile, other users could not read the result.
        builder.prefix(".fringeflow-").suffix(".part").permissions(Permissions::from_mode(0o777));
        Ok(Self { target: target.to_owned(), unfinished: builder.tempdir_in(parent)? })
    }

    /// Its final path.
    #[must_use]
    pub fn target(&self) -> &Path {
        &self.target
    }

    /// Its temporary path.
    #[must_use]
    pub fn path(&self) -> &Path {
        self.unfinished.path()
    }

    /// Renames the folder to its final name.
    ///
    /// # Errors
    /// `target` was created by someone else in the meantime, or its parent folder is not writable.
    pub fn finish(self) -> io::Result<()> {
        check_new(&self.target)?;
        std::fs::rename(self.unfinished.path(), &self.target)?;
        // The temporary name no longer exists, so there is nothing to delete.
        let _ = self.unfinished.keep();
        Ok(())
    }
}

/// Checks that a new folder can be written at `target`: the path does not exist, or it is an empty folder.
///
/// # Errors
/// [`io::ErrorKind::AlreadyExists`].
pub fn check_new(target: &Path) -> io::Result<()> {
    let is_new = match std::fs::read_dir(target) {
        Ok(mut entries) => entries.next().is_none(),
        Err(e) => e.kind() == io::ErrorKind::NotFound,
    };
    if is_new { Ok(()) } else { Err(io::ErrorKind::AlreadyExists.into()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_folder_appears_when_it_is_finished() {
        let folder = tempfile::tempdir().unwrap();
        let target = folder.path().join("set");
        let new = NewFolder::begin(&target).unwrap();
        std::fs::write(new.path().join("list"), "1").unwrap();
        assert!(!target.exists());
        new.finish().unwrap();
        assert_eq!(std::fs::read(target.join("list")).unwrap(), b"1");
        assert_eq!(NewFolder::begin(&target).unwrap_err().kind(), io::ErrorKind::AlreadyExists);
        drop(NewFolder::begin(&folder.path().join("other")).unwrap());
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
