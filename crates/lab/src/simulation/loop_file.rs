//! The file of an image loop. The loop is rendered once, and loaded when the same virtual scanner starts again.
//!
//! Layout, little-endian: magic, format version, CRC-32 of the pixels, hash of the options of the scanner; then the
//! pixels, pose by pose, C1 before C2. The number of pixels follows from the options, not from the file.

use std::fs::File;
use std::io::{self, Read, Write};
use std::path::Path;

use sha2::{Digest, Sha256};

use fringeflow_base::atomic_file::{WriteError, write_atomically};

use super::image_loop::ImageLoop;
use super::virtual_scanner::VirtualScanner;

const MAGIC: [u8; 8] = *b"FFIMLOOP";
/// Increased with each change of the layout, and of the images of a scanner with the same options.
const VERSION: u32 = 2;

/// Header before the pixels.
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Header {
    magic: [u8; 8],
    version: u32,
    crc: u32,
    options: [u8; 32],
}

/// Why a file does not hold the image loop of a scanner.
#[derive(Debug, thiserror::Error)]
pub enum LoopFileProblem {
    /// The file does not exist yet.
    #[error("does not exist yet")]
    Missing,
    /// It cannot be read.
    #[error("cannot be read: {0}")]
    Unreadable(#[source] io::Error),
    /// It is not an image loop.
    #[error("is not an image loop; use another path")]
    NotAnImageLoop,
    /// It was written by another version.
    #[error("has format version {found}, expected {VERSION}")]
    Version {
        /// Version in the file.
        found: u32,
    },
    /// It belongs to a scanner with other options.
    #[error("belongs to a virtual scanner with other options")]
    OtherOptions,
    /// Its length does not match the loop.
    #[error("is {found} bytes long, expected {expected}")]
    Length {
        /// Bytes in the file.
        found: u64,
        /// Bytes expected.
        expected: u64,
    },
    /// Its content has changed.
    #[error("is damaged: its checksum does not match")]
    Damaged,
}

impl LoopFileProblem {
    /// Whether the file may be replaced: it is an image loop, even if old or damaged, or does not exist.
    #[must_use]
    pub fn may_be_replaced(&self) -> bool {
        !matches!(self, Self::Unreadable(_) | Self::NotAnImageLoop)
    }
}

impl ImageLoop {
    /// Writes the loop of `scanner` atomically.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn save(&self, scanner: &VirtualScanner, path: &Path) -> Result<(), WriteError> {
        let (crc, options) = (crc32fast::hash(&self.pixels), options_hash(scanner));
        let header = Header { magic: MAGIC, version: VERSION, crc, options };
        write_atomically(path, |out| {
            out.write_all(bytemuck::bytes_of(&header))?;
            out.write_all(&self.pixels)
        })
    }

    /// Reads the loop of `scanner`.
    ///
    /// # Errors
    /// [`LoopFileProblem`]: the file is missing or does not contain this loop. The remedy is to render it.
    pub fn load(scanner: &VirtualScanner, path: &Path) -> Result<Self, LoopFileProblem> {
        let mut file = File::open(path).map_err(|e| match e.kind() {
            io::ErrorKind::NotFound => LoopFileProblem::Missing,
            _ => LoopFileProblem::Unreadable(e),
        })?;
        let header = read_header(&mut file)?;
        if header.options != options_hash(scanner) {
            return Err(LoopFileProblem::OtherOptions);
        }
        let mut images = Self::black(scanner);
        let found = file.metadata().map_err(LoopFileProblem::Unreadable)?.len();
        let expected = (size_of::<Header>() + images.pixels.len()) as u64;
        if found != expected {
            return Err(LoopFileProblem::Length { found, expected });
        }
        file.read_exact(&mut images.pixels).map_err(LoopFileProblem::Unreadable)?;
        if crc32fast::hash(&images.pixels) != header.crc {
            return Err(LoopFileProblem::Damaged);
        }
        Ok(images)
    }
}

fn read_header(file: &mut File) -> Result<Header, LoopFileProblem> {
    let mut header: Header = bytemuck::Zeroable::zeroed();
    match file.read_exact(bytemuck::bytes_of_mut(&mut header)) {
        Err(e) if e.kind() == io::ErrorKind::UnexpectedEof => return Err(LoopFileProblem::NotAnImageLoop),
        other => other.map_err(LoopFileProblem::Unreadable)?,
    }
    if header.magic != MAGIC {
        return Err(LoopFileProblem::NotAnImageLoop);
    }
    if header.version != VERSION {
        return Err(LoopFileProblem::Version { found: header.version });
    }
    Ok(header)
}

/// Returns the hash of the options. Their debug text contains all digits of the numbers.
fn options_hash(scanner: &VirtualScanner) -> [u8; 32] {
    Sha256::digest(format!("{:?}", scanner.options())).into()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simulation::virtual_scanner::tests::options;
    use crate::simulation::{RigOptions, SweepOptions, VirtualScannerOptions};

    fn small() -> VirtualScannerOptions {
        let usual = options();
        let sweep = SweepOptions { poses: 4, ..usual.sweep };
        VirtualScannerOptions { rig: RigOptions { size_px: [64, 64], ..usual.rig }, sweep, ..usual }
    }

    fn saved() -> (tempfile::TempDir, std::path::PathBuf, VirtualScanner, ImageLoop) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("images.loop");
        let scanner = VirtualScanner::new(small()).unwrap();
        let images = ImageLoop::render(&scanner, |_| std::ops::ControlFlow::Continue(())).unwrap().unwrap();
        images.save(&scanner, &path).unwrap();
        (folder, path, scanner, images)
    }

    #[test]
    fn it_is_loaded_as_it_was_saved() {
        let (_folder, path, scanner, images) = saved();
        assert_eq!(ImageLoop::load(&scanner, &path).unwrap(), images);
        assert!(ImageLoop::load(&scanner, &path.with_extension("none")).unwrap_err().may_be_replaced());
    }

    #[test]
    fn other_options_are_refused() {
        let (_folder, path, ..) = saved();
        let usual = small();
        for other in [
            VirtualScannerOptions { seed: 10, ..usual },
            VirtualScannerOptions { gamma: 1.000_000_1, ..usual },
            VirtualScannerOptions { exposure: 1.5, ..usual },
            VirtualScannerOptions { sweep: SweepOptions { tremor_mm: 0.02, ..usual.sweep }, ..usual },
        ] {
            let refused = ImageLoop::load(&VirtualScanner::new(other).unwrap(), &path).unwrap_err();
            assert!(matches!(refused, LoopFileProblem::OtherOptions) && refused.may_be_replaced(), "{refused}");
        }
    }

    #[test]
    fn no_truncation_and_no_flipped_bit_goes_unnoticed() {
        let (_folder, path, scanner, _) = saved();
        let bytes = std::fs::read(&path).unwrap();
        let refused = |bytes: &[u8]| {
            std::fs::write(&path, bytes).unwrap();
            ImageLoop::load(&scanner, &path).unwrap_err()
        };
        let header = size_of::<Header>();
        for length in (0..header).chain([header + 1, bytes.len() - 1]) {
            refused(&bytes[..length]);
        }
        refused(&[&bytes[..], &[0]].concat());
        for i in (0..header).chain((header..bytes.len()).step_by(997)) {
            let mut damaged = bytes.clone();
            damaged[i] ^= 1 << (i % 8);
            let problem = refused(&damaged);
            assert_eq!(problem.may_be_replaced(), i >= MAGIC.len(), "byte {i}: {problem}");
        }
    }
}
