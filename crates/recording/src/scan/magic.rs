//! The first bytes of a file: those of MCAP, or those of another kind of file, which the error names.

use mcap::MAGIC;

use super::file::Reader;
use crate::RecordingProblem;

/// Kinds of files by their first bytes.
const KINDS: [(&[u8], &str); 14] = [
    (b"\x1f\x8b", "a gzip file; unpack it first, with `gunzip`"),
    (b"\x28\xb5\x2f\xfd", "a zstd file; unpack it first, with `unzstd`"),
    (b"\x04\x22\x4d\x18", "an lz4 file; unpack it first, with `unlz4`"),
    (b"\xfd7zXZ\0", "an xz file; unpack it first, with `unxz`"),
    (b"BZh", "a bzip2 file; unpack it first, with `bunzip2`"),
    (b"PK\x03\x04", "a ZIP archive; unpack it first, with `unzip`"),
    (b"#ROSBAG", "a ROS 1 bag"),
    (b"SQLite format 3\0", "a SQLite database, perhaps a ROS 2 bag"),
    (b"\x89PNG", "a PNG image"),
    (b"\xff\xd8\xff", "a JPEG image"),
    (b"ply\n", "a PLY file"),
    (b"# .PCD", "a PCD file"),
    (b"RRF", "a recording of Rerun"),
    (b"%YAML", "a YAML file"),
];
/// Number of bytes by which a text is recognized.
const TEXT_BYTES: usize = 512;

/// Reads the first bytes of a file.
pub(super) fn check_magic(reader: &mut Reader<'_>) -> Result<(), RecordingProblem> {
    let mut magic = [0; MAGIC.len()];
    let start = reader.start(TEXT_BYTES)?;
    match start.get(..MAGIC.len()) {
        Some(first) if first == MAGIC => reader.fill(&mut magic).map(drop),
        None if !start.is_empty() && MAGIC.starts_with(&start) => {
            Err(RecordingProblem::Unfinished { offset: reader.bytes, within: "within its first bytes" })
        }
        _ => Err(RecordingProblem::NotMcap { kind: kind(&start) }),
    }
}

/// Names the kind of a file by its start.
fn kind(start: &[u8]) -> &'static str {
    let known = KINDS.iter().find(|(first, _)| start.starts_with(first));
    if let Some((_, kind)) = known {
        return kind;
    }
    if start.is_empty() {
        return "empty: it has no bytes";
    }
    if start.iter().all(|&byte| byte == 0) {
        return "a file that begins with zeros; perhaps it was never written, or only reserved";
    }
    if is_text(start) { "a text" } else { "a file of an unknown kind (its first bytes are not those of MCAP)" }
}

fn is_text(start: &[u8]) -> bool {
    // The last character may be cut.
    let is_utf8 = std::str::from_utf8(start).map_or_else(|e| e.error_len().is_none(), |_| true);
    is_utf8 && start.iter().all(|&byte| byte >= b' ' || matches!(byte, b'\n' | b'\r' | b'\t'))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn kinds_of_files_are_named() {
        assert!(kind(b"").contains("empty"));
        assert!(kind(b"\x1f\x8b\x08\0").contains("gunzip"));
        assert!(kind(b"hello\n").contains("text"));
        assert!(kind("é".as_bytes()).contains("text") && kind(&"é".as_bytes()[..1]).contains("text"));
        assert!(kind(&[0; 16]).contains("zeros"));
        assert!(kind(b"\x01\x02\xff\xff").contains("unknown kind"));
        assert!(kind(b"#ROSBAG V2.0\n").contains("ROS 1"));
    }
}
