//! The file of a segment table: computed once per rig, loaded before matching (paper, section 2.3).
//!
//! Layout, little-endian: magic, format version, CRC-32, fingerprint, sizes of C1, C2 and the epipolar frame, direction
//! of the base, columns at infinity; then, as in memory, the drift modes, the fields of the pixels of C1, the ends of
//! their segments, and the places of the pixels of the epipolar frame.

use std::fs::File;
use std::io::{self, Read, Write};
use std::path::{Path, PathBuf};

use fringeflow_base::atomic_file::{WriteError, write_atomically};

use crate::geometry::{FringePattern, MeasurementVolume, Rig};

use super::drift::DriftModes;
use super::fingerprint::Fingerprint;
use super::patches::Patches;
use super::segment_fields::{FIELDS, SegmentTableError, padded, units_per_px};
use super::segment_table::SegmentTable;
use super::source_map::SourceMap;

const MAGIC: [u8; 8] = *b"FFSEGTAB";
const VERSION: u32 = 6;
/// Largest side of an image, pixels. A larger one in a header is damage.
const MAX_SIDE_PX: u32 = 65535;
/// Bytes read at a time. They stay in the cache while they are summed and checked.
const BLOCK_BYTES: usize = 1 << 18;

/// The header of the file.
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct Header {
    magic: [u8; 8],
    version: u32,
    /// CRC-32 of sizes, base, columns at infinity, and everything behind the header.
    crc: u32,
    fingerprint: [u8; 32],
    /// Width and height of C1, of C2 and of the epipolar frame, pixels.
    sizes_px: [[u32; 2]; 3],
    /// Direction from C1 to C2 in the frame of C1.
    base: [f32; 3],
    /// Columns of infinitely far points.
    infinity_px: [f32; 3],
}

/// Why a segment table cannot be built, loaded or saved.
#[derive(Debug, thiserror::Error)]
pub enum SegmentFileError {
    /// The rig has no segment table.
    #[error(transparent)]
    Table(#[from] SegmentTableError),
    /// The file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The file cannot be used. It is left as it is.
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
    /// The file is of another kind.
    #[error("is not a segment table; give another path, or delete it to rebuild it")]
    NotASegmentTable,
    /// The file has another format version.
    #[error("has format version {found}, expected {VERSION}; delete it to rebuild it")]
    Version {
        /// Version in the file.
        found: u32,
    },
    /// The file belongs to another rig.
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
    /// The length does not fit the header.
    #[error("is {found} bytes long, its header says {expected}; delete it to rebuild it")]
    Length {
        /// Bytes in the file.
        found: u64,
        /// Bytes according to the header.
        expected: u64,
    },
    /// The content was changed.
    #[error("is damaged (field {field}); delete it to rebuild it")]
    Damaged {
        /// The field that shows the damage.
        field: &'static str,
    },
}

impl SegmentTable {
    /// Writes the table atomically.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), SegmentFileError> {
        let modes = self.modes.as_ref().map_or_else(|| vec![0.0; DriftModes::NUMBERS], DriftModes::to_numbers);
        let payload: [&[u8]; 4] = [
            bytemuck::cast_slice(&modes),
            bytemuck::cast_slice(self.fields.coefficients()),
            bytemuck::cast_slice(&self.limits),
            bytemuck::cast_slice(self.sources.places.coefficients()),
        ];
        let sizes_px = [self.size_px, self.cam2_size_px, self.epipolar_size_px].map(|size| size.map(|s| s as u32));
        let mut crc = crc32fast::Hasher::new();
        crc.update(bytemuck::bytes_of(&sizes_px));
        crc.update(bytemuck::bytes_of(&self.base));
        crc.update(bytemuck::bytes_of(&self.infinity_px));
        payload.iter().for_each(|part| crc.update(part));
        let (crc, fingerprint) = (crc.finalize(), self.fingerprint.0);
        let (base, infinity_px) = (self.base, self.infinity_px);
        let header = Header { magic: MAGIC, version: VERSION, crc, fingerprint, sizes_px, base, infinity_px };
        write_atomically(path, |out| {
            out.write_all(bytemuck::bytes_of(&header))?;
            payload.iter().try_for_each(|part| out.write_all(part))
        })?;
        Ok(())
    }

    /// Loads the table of a rig if its file exists. Otherwise builds it, and writes the file if `path` is given.
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
            return Self::load(path, Fingerprint::new(rig, volume, pattern));
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
    let [size_px, cam2_size_px, epipolar_size_px] = header.sizes_px.map(|size| size.map(|s| s as usize));
    let promised = promised_bytes(size_px, epipolar_size_px);
    // Checked before any memory is allocated.
    if length != promised {
        return Err(SegmentFileProblem::Length { found: length, expected: promised });
    }
    let mut modes = vec![0.0_f64; DriftModes::NUMBERS];
    let mut fields = Patches::zeroed(size_px);
    let mut limits = vec![0_u16; limits_of(size_px)];
    let mut places = Patches::zeroed(epipolar_size_px);
    let mut crc = crc32fast::Hasher::new();
    crc.update(bytemuck::bytes_of(&header.sizes_px));
    crc.update(bytemuck::bytes_of(&header.base));
    crc.update(bytemuck::bytes_of(&header.infinity_px));
    let mut reading = Reading { file, crc, damaged: None };
    reading.fill(&mut modes, "drift modes", |numbers: &[f64]| numbers.iter().all(|n| n.is_finite()))?;
    reading.fill(fields.coefficients_mut().as_flattened_mut(), "fields", are_finite)?;
    let last = (epipolar_size_px[0] as u32 - 1) * units_per_px(epipolar_size_px[0]);
    let in_frame = |limits: &[u16]| limits.iter().fold(0, |most, &end| most.max(end)) <= last as u16;
    reading.fill(&mut limits, "segments", in_frame)?;
    reading.fill(places.coefficients_mut().as_flattened_mut(), "source pixels", are_finite)?;
    reading.finish(header.crc)?;
    for (numbers, field) in [(header.base, "base"), (header.infinity_px, "columns at infinity")] {
        if !numbers.iter().all(|number| number.is_finite()) {
            return Err(SegmentFileProblem::Damaged { field });
        }
    }
    Ok(SegmentTable {
        fingerprint: expected,
        size_px,
        cam2_size_px,
        epipolar_size_px,
        base: header.base,
        infinity_px: header.infinity_px,
        modes: read_modes(&modes)?,
        fields,
        limits,
        sources: SourceMap::with_places(places, cam2_size_px),
    })
}

/// Length of the file of a table.
fn promised_bytes(size_px: [usize; 2], epipolar_size_px: [usize; 2]) -> u64 {
    let fields = Patches::<FIELDS>::numbers(size_px) + Patches::<2>::numbers(epipolar_size_px);
    let bytes = size_of::<Header>()
        + DriftModes::NUMBERS * size_of::<f64>()
        + fields * size_of::<f32>()
        + limits_of(size_px) * size_of::<u16>();
    bytes as u64
}

/// Number of first and last columns of all segments of an image.
fn limits_of([width, height]: [usize; 2]) -> usize {
    2 * padded(width) * height
}

/// Whether all numbers are finite, which a forged file with a valid checksum may violate. Their values need no check:
/// every place is clamped to its image before it is read.
fn are_finite(numbers: &[f32]) -> bool {
    const SIGN: u32 = 1 << 31;
    // Numbers that are not finite have the greatest exponent; adding one to it carries into the sign bit.
    let one_more = |number: &f32| (number.to_bits() & !SIGN) + (SIGN - f32::INFINITY.to_bits());
    numbers.iter().map(one_more).fold(0, |all, bits| all | bits) & SIGN == 0
}

/// The file while its payload is read.
struct Reading {
    file: File,
    crc: crc32fast::Hasher,
    /// The first field with impossible content.
    damaged: Option<&'static str>,
}

impl Reading {
    /// Reads a field block by block; each block is summed and checked while it is in the cache.
    fn fill<T: bytemuck::Pod>(
        &mut self,
        part: &mut [T],
        field: &'static str,
        is_sound: impl Fn(&[T]) -> bool,
    ) -> Result<(), SegmentFileProblem> {
        for block in part.chunks_mut(BLOCK_BYTES / size_of::<T>()) {
            self.file.read_exact(bytemuck::cast_slice_mut(block)).map_err(SegmentFileProblem::Unreadable)?;
            self.crc.update(bytemuck::cast_slice(block));
            if !is_sound(block) {
                self.damaged = self.damaged.or(Some(field));
            }
        }
        Ok(())
    }

    /// Reports a wrong checksum, else impossible content.
    fn finish(self, crc: u32) -> Result<(), SegmentFileProblem> {
        let checksum = (self.crc.finalize() != crc).then_some("checksum");
        checksum.or(self.damaged).map_or(Ok(()), |field| Err(SegmentFileProblem::Damaged { field }))
    }
}

/// The saved drift modes; all zero stands for none.
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

/// The first bytes of a fingerprint, enough to tell two apart.
fn short(fingerprint: &[u8; 32]) -> String {
    fingerprint[..6].iter().map(|byte| format!("{byte:02x}")).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::correspondence::patches::Nodes;

    fn table() -> SegmentTable {
        let [size_px, epipolar_size_px] = [[18, 3], [20, 2]];
        let fields = Nodes::from_size_px(size_px);
        let fields =
            Patches::through(fields, &fields.map(|u, v| Some([u, 0.1 * v, 1.5, 7.0, 3.0, 0.2, 1e-3])), [0.0; 7]);
        let places = Nodes::from_size_px(epipolar_size_px);
        let places = Patches::through(places, &places.map(|u, v| Some([u, v])), [0.0; 2]);
        SegmentTable {
            fingerprint: Fingerprint([7; 32]),
            size_px,
            cam2_size_px: [19, 4],
            epipolar_size_px,
            base: [1.0, 0.0, 0.0],
            infinity_px: [3.0, 1.0, 0.0],
            modes: None,
            fields,
            limits: (0..2 * 32 * 3).map(|i| 10 * i).collect(),
            sources: SourceMap::with_places(places, [19, 4]),
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
    fn a_forged_file_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("forged.segments");
        let mut outside = table();
        outside.limits[101] = 65535;
        let [mut nan, mut infinite] = [table(), table()];
        nan.fields.coefficients_mut()[50][2] = f32::NAN;
        infinite.sources.places.coefficients_mut()[3][0] = f32::NEG_INFINITY;
        for (forged, field) in [(outside, "segments"), (nan, "fields"), (infinite, "source pixels")] {
            forged.save(&path).unwrap();
            let refused = SegmentTable::load(&path, Fingerprint([7; 32])).unwrap_err().to_string();
            assert!(refused.contains(field), "{refused}");
        }
    }
}
