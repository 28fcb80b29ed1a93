//! Writes a growing file past the page cache.
//!
//! In: bytes of any size. Out: the same bytes in the file, and their checksum. They are gathered in aligned memory, and
//! whole blocks of them go to the disk without a copy by the kernel, which would take a fresh page of memory for every
//! 4 KiB, clear it and fill it. Bytes are summed as they are copied, while they are in the cache.
//!
//! The last block is seldom full. Its bytes remain in memory for the next write, and [`BlockWriter::hand_over`] also
//! gives them to the page cache, so that they are in the file if the process is killed. The kernel writes such a block
//! out before it accepts the full one, so neither the order nor the length of the file is ever wrong.

use std::fs::{File, OpenOptions};
use std::io::{self, ErrorKind};
use std::os::unix::fs::{FileExt as _, OpenOptionsExt as _};
use std::path::Path;
use std::sync::Arc;

use bytemuck::{Pod, Zeroable};
use crc32fast::Hasher;
use rustix::fs::OFlags;

/// Size and alignment of a block: at least those that disks demand.
const BLOCK_BYTES: usize = 4096;
/// Number of bytes copied and then summed: they fit into the second cache of a core.
const PIECE_BYTES: usize = 64 << 10;

#[derive(Clone, Copy, Pod, Zeroable)]
#[repr(C, align(4096))]
struct Block([u8; BLOCK_BYTES]);

/// A file to which bytes are only added.
pub(super) struct BlockWriter {
    file: Arc<File>,
    /// The same file without the page cache; `None` if its file system refuses that.
    direct: Option<File>,
    /// The bytes that are not in whole written blocks.
    blocks: Vec<Block>,
    /// Number of bytes in `blocks`.
    bytes: usize,
    /// Offset of `blocks` in the file.
    start: u64,
    /// Number of bytes in `blocks` that were handed over.
    handed_over: usize,
}

/// Opens a file for writing past the page cache; `None` if its file system refuses that.
pub(super) fn open_direct(path: &Path) -> Option<File> {
    OpenOptions::new().write(true).custom_flags(OFlags::DIRECT.bits().cast_signed()).open(path).ok()
}

impl BlockWriter {
    /// Starts an empty file. `direct` is from [`open_direct`].
    pub(super) fn new(file: Arc<File>, direct: Option<File>) -> Self {
        Self { file, direct, blocks: Vec::new(), bytes: 0, start: 0, handed_over: 0 }
    }

    /// Offset of the next byte in the file.
    pub(super) fn offset(&self) -> u64 {
        self.start + self.bytes as u64
    }

    /// Adds bytes, in memory, and adds them to a checksum.
    pub(super) fn push(&mut self, bytes: &[u8], crc: &mut Hasher) {
        let end = self.bytes + bytes.len();
        if self.blocks.len() < end.div_ceil(BLOCK_BYTES) {
            self.blocks.resize(end.div_ceil(BLOCK_BYTES), Block::zeroed());
        }
        let room: &mut [u8] = bytemuck::cast_slice_mut(&mut self.blocks);
        for (copy, piece) in room[self.bytes..end].chunks_mut(PIECE_BYTES).zip(bytes.chunks(PIECE_BYTES)) {
            copy.copy_from_slice(piece);
            crc.update(copy);
        }
        self.bytes = end;
    }

    /// Replaces bytes that were added since the last write.
    pub(super) fn replace(&mut self, offset: u64, bytes: &[u8]) {
        let at = (offset - self.start) as usize;
        let added: &mut [u8] = bytemuck::cast_slice_mut(&mut self.blocks);
        added[at..at + bytes.len()].copy_from_slice(bytes);
    }

    /// Writes the whole blocks.
    pub(super) fn write_blocks(&mut self) -> io::Result<()> {
        let whole = self.bytes / BLOCK_BYTES;
        if whole == 0 {
            return Ok(());
        }
        let bytes: &[u8] = bytemuck::cast_slice(&self.blocks[..whole]);
        match self.direct.as_ref().map(|direct| direct.write_all_at(bytes, self.start)) {
            Some(Ok(())) => {}
            Some(Err(e)) if e.kind() != ErrorKind::InvalidInput => return Err(e),
            // The file system takes writes through the page cache only, or demands larger blocks.
            Some(Err(_)) | None => {
                self.direct = None;
                self.file.write_all_at(bytes, self.start)?;
            }
        }
        self.start += bytes.len() as u64;
        self.bytes -= bytes.len();
        self.handed_over = 0;
        self.blocks.copy_within(whole..whole + self.bytes.div_ceil(BLOCK_BYTES), 0);
        Ok(())
    }

    /// Hands everything to the kernel, so that it is kept if the process dies.
    pub(super) fn hand_over(&mut self) -> io::Result<()> {
        self.write_blocks()?;
        if self.bytes > self.handed_over {
            let bytes: &[u8] = bytemuck::cast_slice(&self.blocks);
            self.file.write_all_at(&bytes[..self.bytes], self.start)?;
            self.handed_over = self.bytes;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use tempfile::NamedTempFile;

    use super::*;

    /// Sizes around the borders of blocks and pieces.
    const SIZES: [usize; 13] = [0, 1, 4095, 4096, 4097, 8191, 8192, 12_289, 65_535, 65_536, 65_537, 200_000, 3];

    fn content(bytes: usize, seed: usize) -> Vec<u8> {
        (0..bytes).map(|i| (i.wrapping_mul(2_654_435_761).wrapping_add(seed) >> 7) as u8).collect()
    }

    fn shared(file: &NamedTempFile) -> Arc<File> {
        Arc::new(file.reopen().unwrap())
    }

    /// Writers with the page cache and, if the disk allows, without it.
    fn writers() -> [(NamedTempFile, BlockWriter); 2] {
        let [direct, cached] = [(); 2].map(|()| NamedTempFile::new().unwrap());
        let without_cache = BlockWriter::new(shared(&direct), open_direct(direct.path()));
        let with_cache = BlockWriter::new(shared(&cached), None);
        [(direct, without_cache), (cached, with_cache)]
    }

    fn read(file: &NamedTempFile) -> Vec<u8> {
        std::fs::read(file.path()).unwrap()
    }

    #[test]
    fn everything_handed_over_is_in_the_file_and_nothing_else() {
        for (file, mut writer) in writers() {
            let (mut expected, mut crc) = (Vec::new(), Hasher::new());
            for (first, &size) in SIZES.iter().enumerate() {
                for &second in &SIZES[first..] {
                    for bytes in [content(size, first), content(second, first + 7)] {
                        writer.push(&bytes, &mut crc);
                        expected.extend(bytes);
                    }
                    writer.hand_over().unwrap();
                    assert!(read(&file) == expected, "after {size} and {second} bytes");
                    assert_eq!(writer.offset(), expected.len() as u64);
                }
            }
            assert_eq!(crc.finalize(), crc32fast::hash(&expected));
        }
    }

    #[test]
    fn only_whole_blocks_are_written_before() {
        for (file, mut writer) in writers() {
            let mut expected = Vec::new();
            for size in SIZES {
                let bytes = content(size, size);
                writer.push(&bytes, &mut Hasher::new());
                writer.write_blocks().unwrap();
                expected.extend(bytes);
                let whole = expected.len() / BLOCK_BYTES * BLOCK_BYTES;
                assert!(read(&file) == expected[..whole], "after {size} bytes");
            }
        }
    }

    #[test]
    fn bytes_are_replaced_in_a_block_that_was_handed_over() {
        for (file, mut writer) in writers() {
            let mut expected = content(BLOCK_BYTES + 100, 1);
            writer.push(&expected, &mut Hasher::new());
            writer.hand_over().unwrap();
            let offset = writer.offset();
            writer.push(&content(BLOCK_BYTES, 2), &mut Hasher::new());
            writer.replace(offset, &[7; 49]);
            writer.hand_over().unwrap();
            expected.extend([7; 49]);
            expected.extend(&content(BLOCK_BYTES, 2)[49..]);
            assert!(read(&file) == expected);
        }
    }

    #[test]
    fn writes_go_through_the_page_cache_if_the_file_system_refuses_others() {
        let file = NamedTempFile::new().unwrap();
        // The kernel refuses everything but a number here, as file systems refuse direct writes.
        let refusing = OpenOptions::new().write(true).open("/proc/self/coredump_filter").unwrap();
        let mut writer = BlockWriter::new(shared(&file), Some(refusing));
        let bytes = content(3 * BLOCK_BYTES + 5, 3);
        writer.push(&bytes, &mut Hasher::new());
        writer.hand_over().unwrap();
        assert!(writer.direct.is_none());
        assert!(read(&file) == bytes);
    }

    #[test]
    fn other_errors_are_reported_and_nothing_is_forgotten() {
        let file = NamedTempFile::new().unwrap();
        let full = OpenOptions::new().write(true).open("/dev/full").unwrap();
        let mut writer = BlockWriter::new(shared(&file), Some(full));
        let bytes = content(2 * BLOCK_BYTES, 4);
        writer.push(&bytes, &mut Hasher::new());
        assert_eq!(writer.hand_over().unwrap_err().kind(), ErrorKind::StorageFull);
        assert!(read(&file).is_empty());
        writer.direct = open_direct(file.path());
        writer.hand_over().unwrap();
        assert!(read(&file) == bytes);
    }
}
