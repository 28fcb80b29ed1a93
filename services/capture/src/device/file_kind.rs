//! What the file at a path is, if it is no V4L2 device. It is told without opening the file: opening a terminal or a
//! device of another driver may have effects.

use std::fs::{self, FileType, Metadata};
use std::os::unix::fs::{FileTypeExt, MetadataExt};
use std::path::Path;

use rustix::fs::{major, minor};

/// Major number of V4L2 nodes, as the kernel's `devices.txt` lists it.
const V4L2_MAJOR: u32 = 81;

/// Returns what a file is, in words; `None` if it is a node of V4L2, or cannot be examined.
pub(super) fn other_than_v4l2(path: &Path) -> Option<String> {
    let found = fs::metadata(path).ok()?;
    if !found.file_type().is_char_device() {
        return Some(name_of(found.file_type()).to_owned());
    }
    (major(found.rdev()) != V4L2_MAJOR).then(|| character_device(&found))
}

/// Describes a node of V4L2 that does not answer as a video node, such as a sub-device.
pub(super) fn other_v4l2_node(path: &Path) -> String {
    fs::metadata(path).map_or_else(|_| "another file".to_owned(), |found| character_device(&found))
}

fn name_of(kind: FileType) -> &'static str {
    match () {
        () if kind.is_file() => "a file",
        () if kind.is_dir() => "a folder",
        () if kind.is_block_device() => "a disk",
        () if kind.is_fifo() => "a pipe",
        () if kind.is_socket() => "a socket",
        () => "no device",
    }
}

/// Names a character device by its class in the kernel: `mem` for /dev/null, `tty` for terminals, `video4linux`.
fn character_device(found: &Metadata) -> String {
    let (major, minor) = (major(found.rdev()), minor(found.rdev()));
    let class = fs::read_link(format!("/sys/dev/char/{major}:{minor}/subsystem")).ok();
    let class = class.as_ref().and_then(|class| class.file_name()).map(|class| class.to_string_lossy().into_owned());
    match class {
        Some(class) => format!("a device of the class {class} (number {major}:{minor})"),
        None => format!("a device of another driver (number {major}:{minor})"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_that_are_no_video_nodes_are_named() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("image.png");
        fs::write(&file, "").unwrap();
        assert_eq!(other_than_v4l2(&file).unwrap(), "a file");
        assert_eq!(other_than_v4l2(folder.path()).unwrap(), "a folder");
        let null = other_than_v4l2(Path::new("/dev/null")).unwrap();
        assert!(null.starts_with("a device of ") && null.ends_with("(number 1:3)"), "{null}");
        assert_eq!(other_than_v4l2(Path::new("/nowhere")), None);
    }
}
