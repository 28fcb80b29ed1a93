//! NPZ for NumPy. In: points. Out: one uncompressed array per field, and the metadata as byte strings.

use std::io::{self, Seek, Write};

use fringeflow_base::npz::NpzWriter;
use npyz::AutoSerialize;

use super::exported_points::ExportedPoints;
use super::{CloudExport, CloudPoint};

/// Writes an NPZ file.
pub(super) fn write(
    out: &mut (impl Write + Seek),
    exported: &ExportedPoints<'_>,
    export: &CloudExport<'_>,
) -> io::Result<()> {
    let ExportedPoints { points, normals, per_metre } = exported;
    let mut fields = FieldWriter { npz: NpzWriter::new(&mut *out), points };
    fields.write("x", |p| p.position_m[0] * per_metre)?;
    fields.write("y", |p| p.position_m[1] * per_metre)?;
    fields.write("z", |p| p.position_m[2] * per_metre)?;
    fields.write("intensity", |p| p.intensity)?;
    fields.write("u1", |p| p.cam1_px[0])?;
    fields.write("v1", |p| p.cam1_px[1])?;
    fields.write("u2", |p| p.cam2_px[0])?;
    fields.write("v2", |p| p.cam2_px[1])?;
    fields.write("order", |p| i32::from(p.order))?;
    fields.write("delta", |p| p.delta_rad)?;
    fields.write("candidates", |p| p.candidates)?;
    fields.write("stage", |p| p.stage)?;
    fields.write("sigma", |p| p.sigma_m * per_metre)?;
    fields.write("confidence", |p| p.confidence)?;
    for (axis, name) in ["nx", "ny", "nz"].into_iter().enumerate() {
        fields.write_values(name, normals.iter().map(|normal| normal[axis]))?;
    }
    for name in ["red", "green", "blue"] {
        fields.write(name, |p| p.intensity)?;
    }
    for (key, value) in export.remarks() {
        fields.npz.text(key, &value)?;
    }
    fields.npz.finish()?;
    Ok(())
}

struct FieldWriter<'a, W: Write + Seek> {
    npz: NpzWriter<W>,
    points: &'a [CloudPoint],
}

impl<W: Write + Seek> FieldWriter<'_, W> {
    fn write<T: AutoSerialize>(&mut self, name: &str, field: impl Fn(&CloudPoint) -> T) -> io::Result<()> {
        self.write_values(name, self.points.iter().map(field))
    }

    /// An array with a value for each point.
    fn write_values<T: AutoSerialize>(&mut self, name: &str, values: impl Iterator<Item = T>) -> io::Result<()> {
        self.npz.array(name, &[self.points.len() as u64], values)
    }
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use fringeflow_base::npz::NpzReader;

    use super::*;
    use crate::cloud::export::tests::{EXPORT_MM, sample_points};
    use crate::cloud::exported_points::EXPORTED_FIELDS;

    fn written(points: &[CloudPoint]) -> Vec<u8> {
        let mut out = Cursor::new(Vec::new());
        write(&mut out, &ExportedPoints::new(points, &EXPORT_MM), &EXPORT_MM).unwrap();
        out.into_inner()
    }

    fn read<T: npyz::Deserialize>(bytes: &[u8], name: &str) -> Vec<T> {
        let mut archive = NpzReader::new(Cursor::new(bytes)).unwrap();
        archive.array(name).unwrap().unwrap().into_vec().unwrap()
    }

    #[test]
    fn arrays_read_back_in_the_export_unit() {
        let points = sample_points();
        let bytes = written(&points);
        let each = |f: fn(&CloudPoint) -> f32| points.iter().map(f).collect::<Vec<_>>();
        assert_eq!(read::<f32>(&bytes, "x"), each(|p| p.position_m[0] * 1000.0));
        assert_eq!(read::<f32>(&bytes, "y"), each(|p| p.position_m[1] * 1000.0));
        assert_eq!(read::<f32>(&bytes, "z"), each(|p| p.position_m[2] * 1000.0));
        assert_eq!(read::<f32>(&bytes, "u2"), each(|p| p.cam2_px[0]));
        assert_eq!(read::<f32>(&bytes, "v2"), each(|p| p.cam2_px[1]));
        assert_eq!(read::<f32>(&bytes, "delta"), each(|p| p.delta_rad));
        assert_eq!(read::<f32>(&bytes, "sigma"), each(|p| p.sigma_m * 1000.0));
        assert_eq!(read::<f32>(&bytes, "confidence"), [0.75, 1.0]);
        assert_eq!(read::<u16>(&bytes, "u1"), points.iter().map(|p| p.cam1_px[0]).collect::<Vec<_>>());
        assert_eq!(read::<u16>(&bytes, "v1"), points.iter().map(|p| p.cam1_px[1]).collect::<Vec<_>>());
        assert_eq!(read::<i32>(&bytes, "order"), points.iter().map(|p| i32::from(p.order)).collect::<Vec<_>>());
        assert_eq!(read::<u8>(&bytes, "intensity"), [200, 7]);
        assert_eq!(read::<f32>(&bytes, "nz"), [0.0, 0.0]);
        assert_eq!(read::<u8>(&bytes, "green"), [200, 7]);
        assert_eq!(read::<u8>(&bytes, "candidates"), [5, 1]);
        assert_eq!(read::<u8>(&bytes, "stage"), [2, 4]);
        assert_eq!(read::<Vec<u8>>(&bytes, "unit"), [b"mm"]);
        assert_eq!(read::<Vec<u8>>(&bytes, "dataset"), [b"nose"]);
    }

    #[test]
    fn the_arrays_are_the_fields_of_the_other_formats_and_the_metadata() {
        let bytes = written(&sample_points());
        let archive = NpzReader::new(Cursor::new(&bytes)).unwrap();
        let mut names: Vec<_> = archive.names().collect();
        let mut expected: Vec<_> = EXPORTED_FIELDS.map(|(name, _)| name).to_vec();
        expected.extend(["unit", "frame", "software", "dataset"]);
        names.sort_unstable();
        expected.sort_unstable();
        assert_eq!(names, expected);
    }

    #[test]
    fn an_empty_cloud_has_empty_arrays() {
        assert!(read::<f32>(&written(&[]), "x").is_empty());
    }
}
