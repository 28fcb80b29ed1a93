//! Writes a cloud to a file. In: a cloud, a path and a unit. Out: a complete file, or an error and no change on disk.

use std::path::{Path, PathBuf};

use fringeflow_base::atomic_file::{WriteError, write_atomically};

use crate::calibration::Unit;

use super::exported_points::ExportedPoints;
use super::record::CloudExport;
use super::{Cloud, CloudPoint, npz, pcd, ply};

/// File format of a cloud.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CloudFormat {
    /// PLY, binary little-endian.
    Ply,
    /// PCD 0.7, binary.
    Pcd,
    /// NPZ, one array per field.
    Npz,
}

/// Why a cloud was not written. An existing file stays as it is.
#[derive(Debug, thiserror::Error)]
pub enum CloudWriteError {
    /// The extension is not that of a supported format.
    #[error(
        "{}: {} does not name a format for point clouds; use .ply, .pcd or .npz",
        path.display(),
        extension.as_ref().map_or("a name without extension".to_owned(), |e| format!("extension .{e}"))
    )]
    UnknownFormat {
        /// The requested path.
        path: PathBuf,
        /// Its extension.
        extension: Option<String>,
    },
    /// A value of a point is not finite in the unit of the file.
    #[error(
        "{}: the point of pixel {}, {} of C1 has a {field} that is not finite ({value}); nothing was written",
        path.display(), cam1_px[0], cam1_px[1]
    )]
    NotFinite {
        /// The file.
        path: PathBuf,
        /// Pixel of C1.
        cam1_px: [u16; 2],
        /// Field of the point.
        field: &'static str,
        /// Its value.
        value: f32,
    },
    /// The file cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
}

impl CloudFormat {
    /// The format that belongs to the extension of a path, in upper or lower case.
    ///
    /// # Errors
    /// [`CloudWriteError::UnknownFormat`] if the extension is not `ply`, `pcd` or `npz`.
    pub fn from_path(path: &Path) -> Result<Self, CloudWriteError> {
        let extension = path.extension().map(|e| e.to_string_lossy().into_owned());
        match extension.as_deref().map(str::to_ascii_lowercase).as_deref() {
            Some("ply") => Ok(Self::Ply),
            Some("pcd") => Ok(Self::Pcd),
            Some("npz") => Ok(Self::Npz),
            _ => Err(CloudWriteError::UnknownFormat { path: path.to_owned(), extension }),
        }
    }
}

impl CloudExport<'_> {
    /// Export units per metre.
    pub fn units_per_metre(&self) -> f32 {
        match self.unit {
            Unit::Millimetre => 1000.0,
            Unit::Metre => 1.0,
        }
    }

    /// Metadata of the file: keys and values, one printable ASCII line each.
    pub fn remarks(&self) -> [(&'static str, String); 4] {
        [
            ("unit", self.unit.symbol().to_owned()),
            ("frame", "cam1 (x right, y down, z forward)".to_owned()),
            ("software", concat!("fringeflow ", env!("CARGO_PKG_VERSION")).to_owned()),
            ("dataset", ascii_line(self.dataset)),
        ]
    }
}

impl Cloud {
    /// Writes the cloud to a file in the format of its extension: `.ply`, `.pcd` or `.npz`.
    ///
    /// Beside the fields of the points, a file has their normals towards C1 (0, 0, 0 where the surface has none) and their
    /// grey level as a colour, so that viewers show a shaded surface. The same cloud and export always give the same bytes.
    ///
    /// # Errors
    /// The extension is unknown, a value is not finite, or the file cannot be written. An existing file then stays as
    /// it is.
    pub fn write(&self, path: &Path, export: &CloudExport<'_>) -> Result<(), CloudWriteError> {
        let format = CloudFormat::from_path(path)?;
        check_finite(path, &self.points, export.units_per_metre())?;
        let points = ExportedPoints::new(&self.points, export);
        write_atomically(path, |out| match format {
            CloudFormat::Ply => ply::write(out, &points, export),
            CloudFormat::Pcd => pcd::write(out, &points, export),
            CloudFormat::Npz => npz::write(out, &points, export),
        })?;
        Ok(())
    }
}

/// Replaces everything but printable ASCII by question marks: header lines hold nothing else.
fn ascii_line(name: &str) -> String {
    name.chars().map(|c| if c == ' ' || c.is_ascii_graphic() { c } else { '?' }).collect()
}

fn check_finite(path: &Path, points: &[CloudPoint], per_metre: f32) -> Result<(), CloudWriteError> {
    for point in points {
        let [x, y, z] = point.position_m.map(|c| c * per_metre);
        let fields = [
            ("x", x),
            ("y", y),
            ("z", z),
            ("u2", point.cam2_px[0]),
            ("v2", point.cam2_px[1]),
            ("delta", point.delta_rad),
            ("sigma", point.sigma_m * per_metre),
            ("confidence", point.confidence),
        ];
        if let Some(&(field, value)) = fields.iter().find(|(_, value)| !value.is_finite()) {
            return Err(CloudWriteError::NotFinite { path: path.to_owned(), cam1_px: point.cam1_px, field, value });
        }
    }
    Ok(())
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    pub(in crate::cloud) const EXPORT_MM: CloudExport<'static> =
        CloudExport { unit: Unit::Millimetre, dataset: "nose" };

    pub(in crate::cloud) fn sample_points() -> Vec<CloudPoint> {
        let first = CloudPoint {
            position_m: [1.0, -0.25, 0.5],
            intensity: 200,
            cam1_px: [0x0102, 0x0304],
            cam2_px: [12.5, 772.25],
            order: -3,
            delta_rad: 0.0625,
            candidates: 5,
            stage: 2,
            sigma_m: 0.0005,
            confidence: 0.75,
        };
        let second = CloudPoint { position_m: [0.0, 0.125, 0.75], intensity: 7, order: 11, candidates: 1, ..first };
        vec![first, CloudPoint { stage: 4, delta_rad: -0.5, sigma_m: 0.00025, confidence: 1.0, ..second }]
    }

    #[test]
    fn the_extension_chooses_the_format() {
        let of = |name: &str| CloudFormat::from_path(Path::new(name));
        assert_eq!(of("a/nose.ply").unwrap(), CloudFormat::Ply);
        assert_eq!(of("nose.PCD").unwrap(), CloudFormat::Pcd);
        assert_eq!(of("nose.npz").unwrap(), CloudFormat::Npz);
        for name in ["nose.xyz", "nose", "ply"] {
            let message = of(name).unwrap_err().to_string();
            assert!(message.starts_with(name) && message.ends_with("use .ply, .pcd or .npz"), "{message}");
        }
    }

    #[test]
    fn the_same_cloud_is_the_same_bytes_and_metres_stay_metres() {
        let folder = tempfile::tempdir().unwrap();
        let cloud = Cloud { points: sample_points() };
        for extension in ["ply", "pcd", "npz"] {
            let [first, second] = ["a", "b"].map(|n| folder.path().join(n).with_extension(extension));
            cloud.write(&first, &EXPORT_MM).unwrap();
            cloud.write(&second, &EXPORT_MM).unwrap();
            assert_eq!(std::fs::read(first).unwrap(), std::fs::read(second).unwrap());
        }
        let path = folder.path().join("m.ply");
        cloud.write(&path, &CloudExport { unit: Unit::Metre, ..EXPORT_MM }).unwrap();
        let bytes = std::fs::read(path).unwrap();
        let text = String::from_utf8_lossy(&bytes).into_owned();
        assert!(text.contains("\ncomment unit m\n"));
        let end = [0.00025_f32, 1.0, 0.0, 0.0, 0.0].map(f32::to_le_bytes).concat();
        assert!(bytes.ends_with(&[end, vec![7; 3]].concat()));
    }

    #[test]
    fn a_cloud_that_cannot_be_written_leaves_the_old_file() {
        let folder = tempfile::tempdir().unwrap();
        for extension in ["ply", "pcd", "npz"] {
            let path = folder.path().join("cloud").with_extension(extension);
            std::fs::write(&path, "old").unwrap();
            let mut points = sample_points();
            points[1].sigma_m = f32::NAN;
            let error = Cloud { points }.write(&path, &EXPORT_MM).unwrap_err();
            assert!(matches!(error, CloudWriteError::NotFinite { field: "sigma", .. }), "{error}");
            assert_eq!(std::fs::read_to_string(&path).unwrap(), "old");
        }
        let missing = folder.path().join("missing/cloud.ply");
        let error = Cloud::default().write(&missing, &EXPORT_MM).unwrap_err();
        assert!(matches!(error, CloudWriteError::Write(_)), "{error}");
    }

    #[test]
    fn no_name_can_break_the_header() {
        let export = CloudExport { dataset: "a\nend_header\u{e9}", ..EXPORT_MM };
        assert_eq!(export.remarks()[3].1, "a?end_header?");
    }
}
