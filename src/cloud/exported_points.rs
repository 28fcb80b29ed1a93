//! The points of a file: the fields of the record, a normal, and the grey level as a colour. In: points. Out: 58 bytes per
//! point.
//!
//! Viewers (MeshLab, CloudCompare, Open3D) shade a cloud by its normals, and paint it in its colours, if the fields have
//! the names that they look for. A point whose surface has no normal, at an edge or alone, has the normal (0, 0, 0). The
//! types are among those that Open3D's reader takes: it skips fields of the type `short`, so the fringe order is an `int`.

use std::io::{self, Write};

use super::normals::normals_of;
use super::record::Scalar;
use super::{CloudExport, CloudPoint};

/// Name and type of every field, in the order of the file.
pub(super) const EXPORTED_FIELDS: [(&str, Scalar); 20] = [
    ("x", Scalar::F32),
    ("y", Scalar::F32),
    ("z", Scalar::F32),
    ("intensity", Scalar::U8),
    ("u1", Scalar::U16),
    ("v1", Scalar::U16),
    ("u2", Scalar::F32),
    ("v2", Scalar::F32),
    ("order", Scalar::I32),
    ("delta", Scalar::F32),
    ("candidates", Scalar::U8),
    ("stage", Scalar::U8),
    ("sigma", Scalar::F32),
    ("confidence", Scalar::F32),
    ("nx", Scalar::F32),
    ("ny", Scalar::F32),
    ("nz", Scalar::F32),
    ("red", Scalar::U8),
    ("green", Scalar::U8),
    ("blue", Scalar::U8),
];

/// Points in the unit of a file, with their normals.
pub(super) struct ExportedPoints<'a> {
    pub(super) points: &'a [CloudPoint],
    /// Unit normals towards C1, or zeros.
    pub(super) normals: Vec<[f32; 3]>,
    /// Export units per metre.
    pub(super) per_metre: f32,
}

impl<'a> ExportedPoints<'a> {
    pub(super) fn new(points: &'a [CloudPoint], export: &CloudExport<'_>) -> Self {
        Self { points, normals: normals_of(points), per_metre: export.units_per_metre() }
    }

    /// Writes packed little-endian records in the order of [`EXPORTED_FIELDS`], each followed by `colour` of its grey level.
    pub(super) fn write<const N: usize>(&self, out: &mut impl Write, colour: fn(u8) -> [u8; N]) -> io::Result<()> {
        let per_metre = self.per_metre;
        for (point, normal) in self.points.iter().zip(&self.normals) {
            for length_m in point.position_m {
                out.write_all(&(length_m * per_metre).to_le_bytes())?;
            }
            out.write_all(&[point.intensity])?;
            for pixel in point.cam1_px {
                out.write_all(&pixel.to_le_bytes())?;
            }
            for pixel in point.cam2_px {
                out.write_all(&pixel.to_le_bytes())?;
            }
            out.write_all(&i32::from(point.order).to_le_bytes())?;
            out.write_all(&point.delta_rad.to_le_bytes())?;
            out.write_all(&[point.candidates, point.stage])?;
            for value in [point.sigma_m * per_metre, point.confidence].iter().chain(normal) {
                out.write_all(&value.to_le_bytes())?;
            }
            out.write_all(&colour(point.intensity))?;
        }
        Ok(())
    }
}
