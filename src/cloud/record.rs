//! Binary record of one point: names, types and order of its fields. In: points. Out: 41 bytes per point.
//!
//! The channel `cloud` and recordings use this record, little-endian and without padding, with lengths in metres. Files
//! have its fields and some more (`exported_points.rs`).

use crate::calibration::Unit;

use super::CloudPoint;
use super::triangulate::PointForm;

/// Unit and origin of an exported cloud.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct CloudExport<'a> {
    /// Unit of `x y z` and `sigma`.
    pub unit: Unit,
    /// Name of the dataset or recording that the cloud comes from.
    pub dataset: &'a str,
}

/// Scalar type of a field.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scalar {
    /// Unsigned, 1 byte.
    U8,
    /// Unsigned, 2 bytes.
    U16,
    /// Signed, 2 bytes.
    I16,
    /// Signed, 4 bytes.
    I32,
    /// Floating point, 4 bytes.
    F32,
}

impl Scalar {
    /// Bytes of one value.
    #[must_use]
    pub const fn size(self) -> usize {
        match self {
            Self::U8 => 1,
            Self::U16 | Self::I16 => 2,
            Self::I32 | Self::F32 => 4,
        }
    }
}

/// Name and type of every field, in the order of the record.
pub const FIELDS: [(&str, Scalar); 14] = [
    ("x", Scalar::F32),
    ("y", Scalar::F32),
    ("z", Scalar::F32),
    ("intensity", Scalar::U8),
    ("u1", Scalar::U16),
    ("v1", Scalar::U16),
    ("u2", Scalar::F32),
    ("v2", Scalar::F32),
    ("order", Scalar::I16),
    ("delta", Scalar::F32),
    ("candidates", Scalar::U8),
    ("stage", Scalar::U8),
    ("sigma", Scalar::F32),
    ("confidence", Scalar::F32),
];

/// Bytes of one record.
pub const RECORD_BYTES: usize = {
    let mut sum = 0;
    let mut i = 0;
    while i < FIELDS.len() {
        sum += FIELDS[i].1.size();
        i += 1;
    }
    sum
};

/// Records encoded at a time: enough to keep system calls rare, few enough for the cache.
const CHUNK_POINTS: usize = 8192;

/// Writes all points as packed little-endian records, lengths in metres.
///
/// # Errors
/// Errors of `out`.
pub fn write_records(out: &mut impl std::io::Write, points: &[CloudPoint]) -> std::io::Result<()> {
    let mut bytes = vec![0; CHUNK_POINTS.min(points.len()) * RECORD_BYTES];
    for chunk in points.chunks(CHUNK_POINTS) {
        let bytes = &mut bytes[..chunk.len() * RECORD_BYTES];
        encode_chunk(chunk, bytes);
        out.write_all(bytes)?;
    }
    Ok(())
}

fn encode_chunk(points: &[CloudPoint], bytes: &mut [u8]) {
    let (records, _) = bytes.as_chunks_mut::<RECORD_BYTES>();
    for (record, point) in records.iter_mut().zip(points) {
        encode(point, record);
    }
}

/// A point as a packed little-endian record, lengths in metres.
pub type Record = [u8; RECORD_BYTES];

impl PointForm for Record {
    #[inline(always)]
    fn from_point(point: CloudPoint) -> Self {
        let mut record = [0; RECORD_BYTES];
        encode(&point, &mut record);
        record
    }
}

/// Encodes one point in the order and types of [`FIELDS`]. Fields are joined to words of eight bytes first: a store of
/// its own for each field takes several times as long.
#[inline(always)]
fn encode(point: &CloudPoint, record: &mut Record) {
    let bits = |value: f32| u64::from(value.to_bits());
    let [x, y, z] = point.position_m.map(bits);
    let [u1, v1] = point.cam1_px.map(u64::from);
    let [u2, v2] = point.cam2_px.map(bits);
    let (order, delta) = (u64::from(point.order.cast_unsigned()), bits(point.delta_rad));
    let (sigma, confidence) = (bits(point.sigma_m), bits(point.confidence));
    let words = [
        x | y << 32,
        z | u64::from(point.intensity) << 32 | u1 << 40 | v1 << 56,
        v1 >> 8 | u2 << 8 | v2 << 40,
        v2 >> 24 | order << 8 | delta << 24 | u64::from(point.candidates) << 56,
        u64::from(point.stage) | sigma << 8 | confidence << 40,
    ];
    let (whole, rest) = record.as_chunks_mut();
    whole.iter_mut().zip(words).for_each(|(bytes, word)| *bytes = word.to_le_bytes());
    rest.copy_from_slice(&[(confidence >> 24) as u8]);
}

/// Decodes records with lengths in metres; `None` if the bytes do not hold a whole number of records.
#[must_use]
pub fn read_records(bytes: &[u8]) -> Option<Vec<CloudPoint>> {
    let (records, rest) = bytes.as_chunks::<RECORD_BYTES>();
    rest.is_empty().then(|| records.iter().map(decode_record).collect())
}

/// Decodes one record with lengths in metres.
#[must_use]
pub fn decode_record(record: &Record) -> CloudPoint {
    let two_bytes = |at: usize| [record[at], record[at + 1]];
    let float = |at: usize| f32::from_le_bytes([record[at], record[at + 1], record[at + 2], record[at + 3]]);
    CloudPoint {
        position_m: [float(0), float(4), float(8)],
        intensity: record[12],
        cam1_px: [u16::from_le_bytes(two_bytes(13)), u16::from_le_bytes(two_bytes(15))],
        cam2_px: [float(17), float(21)],
        order: i16::from_le_bytes(two_bytes(25)),
        delta_rad: float(27),
        candidates: record[31],
        stage: record[32],
        sigma_m: float(33),
        confidence: float(37),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::export::tests::sample_points;

    #[test]
    fn records_in_metres_read_back_to_the_same_points() {
        // More than one chunk.
        let mut points = sample_points().repeat(CHUNK_POINTS);
        points.iter_mut().enumerate().for_each(|(i, point)| point.cam1_px[0] = i as u16);
        let mut bytes = Vec::new();
        write_records(&mut bytes, &points).unwrap();
        assert_eq!(read_records(&bytes).unwrap(), points);
        let records: Vec<Record> = points.iter().map(|&point| Record::from_point(point)).collect();
        assert_eq!(records.as_flattened(), bytes);
        assert!(read_records(&bytes[1..]).is_none());
        assert!(read_records(&[]).unwrap().is_empty());
    }
}
