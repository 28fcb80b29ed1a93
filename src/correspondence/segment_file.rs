//! The file of a segment table: computed once a rig, loaded by whoever matches its images (paper, section 2.3).
//!
//! Layout, little-endian: magic, format version, CRC-32, fingerprint, sizes of C1, C2 and the epipolar frame, the direction
//! of the base, then the modes of the drift, the segments and the source pixels as they stand in memory.

use std::fs::File;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

use crate::atomic_file::{WriteError, write_atomically};
use crate::geometry::{FringePattern, MeasurementVolume, Rig};

use super::drift::DriftModes;
use super::segment_table::{Fingerprint, Segment, SegmentTable, SegmentTableError, SourcePixel};

const MAGIC: [u8; 8] = *b"FFSEGTAB";
const VERSION: u32 = 4;
/// Largest side of an image, pixels; larger ones in a header are damage.
const MAX_SIDE_PX: u32 = 65535;

/// What stands before the payload.
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Header {
    magic: [u8; 8],
    version: u32,
    /// CRC-32 of the sizes, of the base and of everything that follows the header.
    crc: u32,
    fingerprint: [u8; 32],
    /// Width and height of C1, of C2 and of the epipolar frame, pixels.
    sizes_px: [[u32; 2]; 3],
    /// Direction from C1 to C2 in the frame of C1.
    base: [f32; 3],
}

/// Why a segment table cannot be had, loaded or saved.
#[derive(Debug, thiserror::Error)]
pub enum SegmentFileError {
    /// The rig has none.
    #[error(transparent)]
    Table(#[from] SegmentTableError),
    /// It cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// It cannot be used; the file is left as it is.
    #[error("{}: {problem}", file.display())]
    Unusable {
        /// The file.
        file: PathBuf,
        /// What is wrong with it.
        #[source]
        problem: SegmentFileProblem,
    },
}

/// What is wrong with the file of a segment table.
#[derive(Debug, thiserror::Error)]
pub enum SegmentFileProblem {
    /// The file cannot be read.
    #[error("cannot be read: {0}")]
    Unreadable(#[source] io::Error),
    /// It is something else.
    #[error("is not a segment table; give another path, or delete it to have it computed")]
    NotASegmentTable,
    /// It was written by another version.
    #[error("has format version {found}, expected {VERSION}; delete it to have it computed again")]
    Version {
        /// Version in the file.
        found: u32,
    },
    /// It belongs to another rig.
    #[error(
        "belongs to another calibration, measurement volume, pattern or image size (fingerprint {found}, this rig has \
         {expected}); delete it or give another path"
    )]
    OtherRig {
        /// First bytes of the fingerprint in the file.
        found: String,
        /// First bytes of the fingerprint of the rig.
        expected: String,
    },
    /// Its length does not fit its header.
    #[error("is {found} bytes long, its header tells of {expected}; delete it to have it computed again")]
    Length {
        /// Bytes in the file.
        found: u64,
        /// Bytes that the header tells of.
        expected: u64,
    },
    /// Its content was changed.
    #[error("is damaged (field {field}); delete it to have it computed again")]
    Damaged {
        /// What shows the damage.
        field: &'static str,
    },
}

impl SegmentTable {
    /// Writes the table, all or not at all.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), SegmentFileError> {
        let modes = self.modes.as_ref().map_or_else(|| vec![0.0; DriftModes::NUMBERS], DriftModes::to_numbers);
        let payload: [&[u8]; 3] =
            [bytemuck::cast_slice(&modes), bytemuck::cast_slice(&self.segments), bytemuck::cast_slice(&self.sources)];
        let sizes_px = [self.size_px(), self.cam2_size_px, self.epipolar_size_px()].map(|size| size.map(|s| s as u32));
        let mut crc = crc32fast::Hasher::new();
        crc.update(bytemuck::bytes_of(&sizes_px));
        crc.update(bytemuck::bytes_of(&self.base));
        payload.iter().for_each(|part| crc.update(part));
        let (crc, fingerprint) = (crc.finalize(), self.fingerprint.0);
        let header = Header { magic: MAGIC, version: VERSION, crc, fingerprint, sizes_px, base: self.base };
        write_atomically(path, |out| {
            out.write_all(bytemuck::bytes_of(&header))?;
            payload.iter().try_for_each(|part| out.write_all(part))
        })?;
        Ok(())
    }

    /// Reads the table of a rig from its file if there is one; else computes it, and writes the file if one is named.
    ///
    /// # Errors
    /// The rig has no table, or the file cannot be used or written.
    pub fn load_or_build(
        path: Option<&Path>,
        rig: &Rig,
        volume: &MeasurementVolume,
        pattern: &FringePattern,
    ) -> Result<Self, SegmentFileError> {
        if let Some(path) = path.filter(|path| path.exists()) {
            return Self::load(path, Fingerprint::of(rig, volume, pattern));
        }
        let table = Self::build(rig, volume, pattern)?;
        if let Some(path) = path {
            table.save(path)?;
        }
        Ok(table)
    }

    /// Reads the table of the rig with the fingerprint `expected`.
    ///
    /// # Errors
    /// The file is no segment table, of another version or rig, truncated, or damaged.
    pub fn load(path: &Path, expected: Fingerprint) -> Result<Self, SegmentFileError> {
        read(path, expected).map_err(|problem| SegmentFileError::Unusable { file: path.to_owned(), problem })
    }
}

fn read(path: &Path, expected: Fingerprint) -> Result<SegmentTable, SegmentFileProblem> {
    let mut file = File::open(path).map_err(SegmentFileProblem::Unreadable)?;
    let length = file.metadata().map_err(SegmentFileProblem::Unreadable)?.len();
    let header = read_header(&mut file, expected)?;
    let [cam1_px, cam2_px, epipolar_px] = header.sizes_px.map(|size| size.map(|s| s as usize));
    let (segments, sources) = (cam1_px[0] * cam1_px[1], epipolar_px[0] * epipolar_px[1]);
    let mut modes = vec![0.0_f64; DriftModes::NUMBERS];
    let promised = size_of::<Header>()
        + size_of_val(modes.as_slice())
        + segments * size_of::<Segment>()
        + sources * size_of::<SourcePixel>();
    if length != promised as u64 {
        return Err(SegmentFileProblem::Length { found: length, expected: promised as u64 });
    }
    let mut table = SegmentTable {
        fingerprint: expected,
        width: cam1_px[0],
        cam2_size_px: cam2_px,
        epipolar_width: epipolar_px[0],
        base: header.base,
        modes: None,
        segments: vec![bytemuck::Zeroable::zeroed(); segments],
        sources: vec![bytemuck::Zeroable::zeroed(); sources],
    };
    let mut crc = crc32fast::Hasher::new();
    crc.update(bytemuck::bytes_of(&header.sizes_px));
    crc.update(bytemuck::bytes_of(&header.base));
    let parts: [&mut [u8]; 3] = [
        bytemuck::cast_slice_mut(&mut modes),
        bytemuck::cast_slice_mut(&mut table.segments),
        bytemuck::cast_slice_mut(&mut table.sources),
    ];
    for part in parts {
        file.read_exact(part).map_err(SegmentFileProblem::Unreadable)?;
        crc.update(part);
    }
    if crc.finalize() != header.crc {
        return Err(SegmentFileProblem::Damaged { field: "checksum" });
    }
    table.modes = read_modes(&modes)?;
    check_content(&table)?;
    Ok(table)
}

/// Modes as they were saved; all zero where there are none.
fn read_modes(numbers: &[f64]) -> Result<Option<DriftModes>, SegmentFileProblem> {
    if numbers.iter().all(|&n| n == 0.0) {
        return Ok(None);
    }
    DriftModes::from_numbers(numbers).map(Some).ok_or(SegmentFileProblem::Damaged { field: "drift modes" })
}

fn read_header(file: &mut File, expected: Fingerprint) -> Result<Header, SegmentFileProblem> {
    let mut header: Header = bytemuck::Zeroable::zeroed();
    match file.read_exact(bytemuck::bytes_of_mut(&mut header)) {
        Err(e) if e.kind() == io::ErrorKind::UnexpectedEof => return Err(SegmentFileProblem::NotASegmentTable),
        other => other.map_err(SegmentFileProblem::Unreadable)?,
    }
    if header.magic != MAGIC {
        return Err(SegmentFileProblem::NotASegmentTable);
    }
    if header.version != VERSION {
        return Err(SegmentFileProblem::Version { found: header.version });
    }
    if header.fingerprint != expected.0 {
        let (found, expected) = (short(&header.fingerprint), short(&expected.0));
        return Err(SegmentFileProblem::OtherRig { found, expected });
    }
    if header.sizes_px.iter().flatten().any(|s| !(2..=MAX_SIDE_PX).contains(s)) {
        return Err(SegmentFileProblem::Damaged { field: "image sizes" });
    }
    Ok(header)
}

/// A forged file with a fitting checksum must not lead outside an image.
fn check_content(table: &SegmentTable) -> Result<(), SegmentFileProblem> {
    let [width, height] = table.epipolar_size_px().map(|s| s as f32);
    let segment_fits = |s: &Segment| {
        let numbers = [s.ray[0], s.ray[1], s.row_px, s.begin_px, s.end_px, s.phase[0], s.phase[1], s.phase[2]];
        numbers.iter().all(|n| n.is_finite())
            && (s.is_none() || (s.begin_px >= 0.0 && s.end_px < width && s.row_px >= 0.0 && s.row_px < height))
    };
    if !table.base.iter().all(|b| b.is_finite()) {
        return Err(SegmentFileProblem::Damaged { field: "base" });
    }
    if !table.segments.iter().all(segment_fits) {
        return Err(SegmentFileProblem::Damaged { field: "segments" });
    }
    let [width, height] = table.cam2_size_px;
    let source_fits = |s: &SourcePixel| {
        s.index == SourcePixel::OUTSIDE
            || (s.index as usize % width + 1 < width && s.index as usize / width + 1 < height)
    };
    if !table.sources.iter().all(source_fits) {
        return Err(SegmentFileProblem::Damaged { field: "source pixels" });
    }
    Ok(())
}

/// Enough of a fingerprint to tell two apart.
fn short(fingerprint: &[u8; 32]) -> String {
    fingerprint[..6].iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn table() -> SegmentTable {
        let segment = |i: usize| Segment {
            ray: [0.1, -0.2],
            row_px: 1.5,
            begin_px: 0.25 * i as f32,
            end_px: 4.0,
            phase: [10.0, 0.1, 1e-4],
        };
        SegmentTable {
            fingerprint: Fingerprint([7; 32]),
            width: 4,
            cam2_size_px: [5, 4],
            epipolar_width: 6,
            base: [1.0, 0.0, 0.0],
            modes: None,
            segments: (0..12).map(segment).collect(),
            sources: (0..18).map(|i| SourcePixel { index: i % 3, right: 100, below: 200 }).collect(),
        }
    }

    fn saved() -> (tempfile::TempDir, PathBuf, Vec<u8>) {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("rig.segments");
        table().save(&path).unwrap();
        let bytes = std::fs::read(&path).unwrap();
        (folder, path, bytes)
    }

    #[test]
    fn it_comes_back_as_it_was() {
        let (_folder, path, _) = saved();
        assert_eq!(SegmentTable::load(&path, Fingerprint([7; 32])).unwrap(), table());
    }

    #[test]
    fn another_rig_is_refused() {
        let (_folder, path, _) = saved();
        let refused = SegmentTable::load(&path, Fingerprint([8; 32])).unwrap_err().to_string();
        assert!(refused.contains("070707070707") && refused.contains("080808080808"), "{refused}");
    }

    #[test]
    fn no_cut_and_no_flipped_bit_goes_unnoticed() {
        let (_folder, path, bytes) = saved();
        for length in 0..bytes.len() {
            std::fs::write(&path, &bytes[..length]).unwrap();
            assert!(SegmentTable::load(&path, Fingerprint([7; 32])).is_err(), "{length} bytes were accepted");
        }
        for i in 0..bytes.len() {
            for bit in 0..8 {
                let mut damaged = bytes.clone();
                damaged[i] ^= 1 << bit;
                std::fs::write(&path, &damaged).unwrap();
                assert!(SegmentTable::load(&path, Fingerprint([7; 32])).is_err(), "bit {bit} of byte {i}");
            }
        }
    }

    #[test]
    fn a_forged_file_does_not_lead_outside_the_image() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("forged.segments");
        let mut outside = table();
        outside.sources[3].index = 19;
        let mut nan = table();
        nan.segments[5].end_px = f32::NAN;
        for (forged, field) in [(outside, "source pixels"), (nan, "segments")] {
            forged.save(&path).unwrap();
            let refused = SegmentTable::load(&path, Fingerprint([7; 32])).unwrap_err().to_string();
            assert!(refused.contains(field), "{refused}");
        }
    }
}
