//! Binary record of one point: names, types and order of its fields. In: points. Out: 41 bytes per point.
//!
//! PLY, PCD, the channel `cloud` and recordings use the same record, little-endian and without padding. Channel and
//! recordings hold lengths in metres. NPZ stores one array per field under the same names.

use rayon::prelude::*;

use crate::calibration::Unit;

use super::CloudPoint;

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
            Self::F32 => 4,
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

/// Writes all points as packed little-endian records. Multiplies lengths by `per_metre`.
///
/// # Errors
/// Errors of `out`.
pub fn write_records(out: &mut impl std::io::Write, points: &[CloudPoint], per_metre: f32) -> std::io::Result<()> {
    let mut bytes = vec![0; CHUNK_POINTS.min(points.len()) * RECORD_BYTES];
    for chunk in points.chunks(CHUNK_POINTS) {
        let bytes = &mut bytes[..chunk.len() * RECORD_BYTES];
        encode_chunk(chunk, per_metre, bytes);
        out.write_all(bytes)?;
    }
    Ok(())
}

/// Encodes points in parallel into packed little-endian records of [`RECORD_BYTES`] bytes, lengths in metres.
pub fn encode_records(bytes: &mut [u8], points: &[CloudPoint]) {
    let chunks = bytes.par_chunks_mut(CHUNK_POINTS * RECORD_BYTES).zip(points.par_chunks(CHUNK_POINTS));
    chunks.for_each(|(bytes, points)| encode_chunk(points, 1.0, bytes));
}

fn encode_chunk(points: &[CloudPoint], per_metre: f32, bytes: &mut [u8]) {
    let (records, _) = bytes.as_chunks_mut::<RECORD_BYTES>();
    for (record, point) in records.iter_mut().zip(points) {
        encode(point, per_metre, record);
    }
}

/// Encodes one point in the order and types of [`FIELDS`].
fn encode(point: &CloudPoint, per_metre: f32, record: &mut [u8; RECORD_BYTES]) {
    let [x, y, z] = point.position_m.map(|c| c * per_metre);
    record[0..4].copy_from_slice(&x.to_le_bytes());
    record[4..8].copy_from_slice(&y.to_le_bytes());
    record[8..12].copy_from_slice(&z.to_le_bytes());
    record[12] = point.intensity;
    record[13..15].copy_from_slice(&point.cam1_px[0].to_le_bytes());
    record[15..17].copy_from_slice(&point.cam1_px[1].to_le_bytes());
    record[17..21].copy_from_slice(&point.cam2_px[0].to_le_bytes());
    record[21..25].copy_from_slice(&point.cam2_px[1].to_le_bytes());
    record[25..27].copy_from_slice(&point.order.to_le_bytes());
    record[27..31].copy_from_slice(&point.delta_rad.to_le_bytes());
    record[31] = point.candidates;
    record[32] = point.stage;
    record[33..37].copy_from_slice(&(point.sigma_m * per_metre).to_le_bytes());
    record[37..41].copy_from_slice(&point.confidence.to_le_bytes());
}

/// Decodes records with lengths in metres; `None` if the bytes do not hold a whole number of records.
#[must_use]
pub fn read_records(bytes: &[u8]) -> Option<Vec<CloudPoint>> {
    let (records, rest) = bytes.as_chunks::<RECORD_BYTES>();
    rest.is_empty().then(|| records.iter().map(decode_record).collect())
}

/// Decodes one record with lengths in metres.
#[must_use]
pub fn decode_record(record: &[u8; RECORD_BYTES]) -> CloudPoint {
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
        let points = sample_points();
        let mut bytes = Vec::new();
        write_records(&mut bytes, &points, 1.0).unwrap();
        assert_eq!(read_records(&bytes).unwrap(), points);
        let mut in_place = vec![0; bytes.len()];
        encode_records(&mut in_place, &points);
        assert_eq!(in_place, bytes);
        assert!(read_records(&bytes[1..]).is_none());
        assert!(read_records(&[]).unwrap().is_empty());
    }
}
