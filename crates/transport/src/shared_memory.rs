//! Shared memory: required bytes, free bytes, and reservation.
//!
//! Files in shared memory are created sparse. Without a reservation, writing a message while the file system is full
//! kills the process.

use std::fs::{self, File, OpenOptions};
use std::io;
use std::os::unix::fs::MetadataExt;
use std::path::{Path, PathBuf};

use rustix::fs::{FallocateFlags, fallocate, statvfs};
use rustix::io::Errno;

use super::{ChannelId, ChannelLimits, ChannelSizes, TransportError, trial_file};

/// Folder of shared memory on Linux.
pub(super) const FOLDER: &str = "/dev/shm";

/// Bytes that iceoryx2 stores before the user header and the payload, including alignment.
const HEADER_BYTES: usize = 128;

/// Bytes of bookkeeping for each subscriber of a publisher: the list of free messages and a connection, in whole pages.
const CONNECTION_BYTES: usize = 16 << 10;

/// Bytes of bookkeeping for each channel: its participants, and the events of each listener.
const SERVICE_BYTES: usize = 256 << 10;

/// Number of publishers of stage reports in a running instance.
const STAGE_REPORT_PUBLISHERS: usize = 10;

/// Bytes of shared memory that an instance needs if each of its channels has a publisher.
#[must_use]
pub fn required_bytes(sizes: &ChannelSizes) -> u64 {
    let publishers = |id| if id == ChannelId::ReportStage { STAGE_REPORT_PUBLISHERS as u64 } else { 1 };
    let channels = ChannelId::ALL.into_iter();
    channels.map(|id| publishers(id) * publisher_bytes(&id.limits(sizes)) + SERVICE_BYTES as u64).sum()
}

/// Checks that shared memory can be used, and that its free bytes suffice for the channels. Returns its folder.
///
/// # Errors
/// [`TransportError::NoSharedMemory`] if no file can be created and mapped there, [`TransportError::SharedMemory`] with
/// the required and the available bytes.
pub fn check_shared_memory(sizes: &ChannelSizes) -> Result<&'static Path, TransportError> {
    let (folder, needed) = (Path::new(FOLDER), required_bytes(sizes));
    // A full file system takes no trial file either.
    check_free(needed)?;
    let unusable = |source| TransportError::NoSharedMemory { folder: folder.to_owned(), needed, source };
    trial_file::try_file_in(folder).map_err(unusable)?;
    Ok(folder)
}

/// Bytes of one publisher and its connections.
pub(super) fn publisher_bytes(limits: &ChannelLimits) -> u64 {
    // At worst, every subscriber has a full buffer and holds as many messages as allowed, and one more message is being
    // written.
    let messages = limits.subscribers * (limits.buffer + limits.borrowed) + limits.history + 1;
    let message = HEADER_BYTES + limits.header_bytes + limits.elements * limits.element_bytes;
    (messages * message + limits.subscribers * CONNECTION_BYTES) as u64
}

/// Fails if less than `needed` bytes are free.
pub(super) fn check_free(needed: u64) -> Result<(), TransportError> {
    let folder = Path::new(FOLDER);
    let unusable = |e: Errno| TransportError::NoSharedMemory { folder: folder.to_owned(), needed, source: e.into() };
    let found = statvfs(folder).map_err(unusable)?;
    check_available(folder, needed, found.f_bavail * found.f_frsize, found.f_blocks * found.f_frsize)
}

fn check_available(folder: &Path, needed: u64, available: u64, whole: u64) -> Result<(), TransportError> {
    if available >= needed {
        return Ok(());
    }
    let enough_mib = (whole.saturating_sub(available) + needed).div_ceil(1 << 20);
    Err(TransportError::SharedMemory { folder: folder.to_owned(), needed, available, enough_mib })
}

/// Reserves the memory of every file of an instance.
pub(super) fn reserve(prefix: &str) -> Result<(), TransportError> {
    for file in files(prefix)? {
        match reserve_file(&file) {
            // Another process is removing the file, or is still creating it and reserves it itself.
            Err(e) if matches!(e.kind(), io::ErrorKind::NotFound | io::ErrorKind::PermissionDenied) => {}
            Err(e) if e.kind() == io::ErrorKind::StorageFull => {
                let needed = fs::metadata(&file).map_or(0, |found| found.len());
                check_free(needed)?;
                return Err(TransportError::file("reserve", file)(e));
            }
            result => result.map_err(TransportError::file("reserve", file))?,
        }
    }
    Ok(())
}

fn reserve_file(path: &Path) -> io::Result<()> {
    let found = fs::metadata(path)?;
    if found.blocks() * 512 >= found.len() {
        return Ok(());
    }
    let file: File = OpenOptions::new().write(true).open(path)?;
    Ok(fallocate(&file, FallocateFlags::KEEP_SIZE, 0, found.len())?)
}

/// Returns the file of an instance whose name has this suffix, or a path that does not exist if the file has just been
/// removed.
pub(super) fn file_with_suffix(prefix: &str, suffix: &str) -> Result<PathBuf, TransportError> {
    let found = files(prefix)?.into_iter().find(|file| file.to_string_lossy().ends_with(suffix));
    Ok(found.unwrap_or_else(|| Path::new(FOLDER).join(format!("{prefix}{suffix}"))))
}

/// The files of an instance in shared memory.
pub(super) fn files(prefix: &str) -> Result<Vec<PathBuf>, TransportError> {
    let folder = Path::new(FOLDER);
    let entries = fs::read_dir(folder).map_err(TransportError::file("list", folder))?;
    let ours = entries.flatten().filter(|entry| entry.file_name().to_string_lossy().starts_with(prefix));
    Ok(ours.map(|entry| entry.path()).collect())
}

#[cfg(test)]
mod tests {
    use super::*;

    const MIB: u64 = 1 << 20;

    #[test]
    fn too_little_is_refused_with_the_size_that_suffices() {
        assert!(check_available(Path::new("/m"), 8 * MIB, 8 * MIB, 64 * MIB).is_ok());
        let refused = check_available(Path::new("/m"), 100 * MIB, 8 * MIB, 64 * MIB).unwrap_err().to_string();
        assert_eq!(
            refused,
            "/m has 8388608 bytes left, the channels need 104857600; enlarge it (mount -o remount,size=156M /m, or \
             docker's --shm-size=156m), delete files there, or use smaller images"
        );
    }

    #[test]
    fn memory_that_takes_no_file_is_refused_with_its_remedy() {
        let text = |errno: Errno| {
            let unusable =
                TransportError::NoSharedMemory { folder: "/m".into(), needed: 3 * MIB, source: errno.into() };
            unusable.to_string()
        };
        let read_only = text(Errno::ROFS);
        assert!(
            read_only.starts_with("/m takes no file for the channels, which need 3 MiB of shared memory: "),
            "{read_only}"
        );
        assert!(read_only.contains("mount -o remount,rw /m"), "{read_only}");
        assert!(text(Errno::ACCESS).contains("chmod 1777 /m"));
        assert!(text(Errno::NOENT).contains("mount -t tmpfs -o size=3M,mode=1777 tmpfs /m"));
    }

    #[test]
    fn one_more_image_in_a_window_costs_three_images_for_each_subscriber() {
        let sizes = |window| ChannelSizes {
            frame_bytes: 1_000_000,
            window,
            map_blocks: 1,
            correspondence_blocks: 1,
            cloud_bytes: 1,
            model_points: 1,
            prior_bytes: 1,
        };
        let difference = required_bytes(&sizes(5)) - required_bytes(&sizes(4));
        // Two cameras, four subscribers, three images each, with their headers.
        assert_eq!(difference, 2 * 4 * 3 * (1_000_000 + 128 + 72));
    }

    #[test]
    fn holes_are_filled() {
        let folder = tempfile::tempdir_in(FOLDER).unwrap();
        let path = folder.path().join("sparse");
        File::create(&path).unwrap().set_len(MIB).unwrap();
        assert_eq!(fs::metadata(&path).unwrap().blocks(), 0);
        reserve_file(&path).unwrap();
        assert_eq!(fs::metadata(&path).unwrap().blocks() * 512, MIB);
    }
}
