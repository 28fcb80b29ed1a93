//! Reads the points of a PLY file, of this program or of another one.

use std::fs::File;
use std::io::BufReader;
use std::path::Path;

use ply_rs_bw::parser::{Parser, Reader};
use ply_rs_bw::ply::{Header, Property, PropertyAccess, PropertyAccessResult};

use fringeflow::calibration::Unit;
use fringeflow::geometry::Point3;
use fringeflow_lab::artefact::Views;

use crate::failure::Failure;

/// Largest coordinate of a point of a scan, metres.
const MAX_M: f64 = 1000.0;

/// The points of a file.
pub(super) struct CloudFile {
    /// Frame of the file, metres.
    pub(super) points_m: Vec<Point3>,
    /// Points without coordinates, or a kilometre away: so other programs write pixels that measured nothing.
    pub(super) skipped: usize,
    pub(super) views: Views,
}

/// The coordinates of a vertex, in the unit of the file.
struct Vertex([f64; 3]);

impl PropertyAccess for Vertex {
    fn new() -> Self {
        Self([f64::NAN; 3])
    }

    fn set_property(&mut self, key: &str, property: Property) -> PropertyAccessResult {
        let axis = match key {
            "x" => 0,
            "y" => 1,
            "z" => 2,
            _ => return PropertyAccessResult::Ignored,
        };
        self.0[axis] = match property {
            Property::Double(value) => value,
            other => other.to_f32_lossy().map_or(f64::NAN, f64::from),
        };
        PropertyAccessResult::Set
    }
}

/// Reads a PLY file. Its unit is that of its comment `unit`, or else `unit`.
///
/// # Errors
/// The file is no PLY file with points, or `unit` contradicts it.
pub(super) fn read(path: &Path, unit: Option<Unit>) -> Result<CloudFile, Failure> {
    let wrong = |what: String| Failure::Usage(format!("{}: {what}", path.display()));
    let broken = |error: std::io::Error| {
        // The reader gives its reason in a line of its own.
        let why = error.to_string().split_whitespace().collect::<Vec<_>>().join(" ");
        wrong(format!("cannot be read as a PLY file: {why}; export it again in binary form"))
    };
    let mut reader = Reader::new(BufReader::new(File::open(path).map_err(|e| wrong(format!("cannot be read: {e}")))?));
    let parser = Parser::<Vertex>::new();
    let header = parser.read_header(&mut reader).map_err(|e| broken(e.into()))?;
    let unit = unit_of(&header, unit).map_err(&wrong)?;
    for (name, element) in &header.elements {
        let has = |key: &str| element.properties.contains_key(key);
        if name == "vertex" && !["x", "y", "z"].into_iter().all(has) {
            return Err(wrong("its vertices lack x, y or z; export a point cloud".to_owned()));
        }
        let vertices = parser.read_payload_for_element(&mut reader, element, &header).map_err(|e| broken(e.into()))?;
        if name == "vertex" {
            let count = vertices.len();
            let points = vertices.into_iter().map(|vertex| Point3::from(vertex.0) * unit.in_metres());
            let points_m: Vec<Point3> = points.filter(|point| point.iter().all(|value| value.abs() < MAX_M)).collect();
            // Only a cloud of one view knows the pixels of C1.
            let views = if has("u1") && has("v1") { Views::Cam1 } else { Views::Several };
            return Ok(CloudFile { skipped: count - points_m.len(), points_m, views });
        }
    }
    Err(wrong("it has no element vertex; export a point cloud".to_owned()))
}

/// The unit that the header states, or else the given one, or else millimetres.
fn unit_of(header: &Header, given: Option<Unit>) -> Result<Unit, String> {
    let stated = header.comments.iter().find_map(|comment| comment.trim().strip_prefix("unit "));
    let stated = match stated {
        None => return Ok(given.unwrap_or(Unit::Millimetre)),
        Some(text) => [Unit::Millimetre, Unit::Metre].into_iter().find(|unit| unit.symbol() == text.trim()),
    };
    match (stated, given) {
        (Some(stated), Some(given)) if stated != given => Err(format!(
            "--units {} contradicts the unit {} that it states; leave --units out",
            given.symbol(),
            stated.symbol()
        )),
        (Some(stated), _) => Ok(stated),
        (None, _) => Err("its comment unit is neither mm nor m; export it in one of these".to_owned()),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read_bytes(bytes: &[u8], unit: Option<Unit>) -> Result<CloudFile, String> {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("cloud.ply");
        std::fs::write(&path, bytes).unwrap();
        read(&path, unit).map_err(|e| e.to_string())
    }

    #[test]
    fn files_of_other_programs_are_read_and_points_without_coordinates_counted() {
        let head = "element vertex 3\nproperty double x\nproperty double y\nproperty double z\nproperty uint16 u1\n\
                    property uint16 v1\nend_header\n";
        let points = [[1.0, 2.0, 300.0], [f64::NAN; 3], [-4.0, 5.5, 301.0]];
        let mut binary = format!("ply\nformat binary_big_endian 1.0\n{head}").into_bytes();
        for point in points {
            binary.extend(point.map(f64::to_be_bytes).concat());
            binary.extend([0; 4]);
        }
        let file = read_bytes(&binary, None).unwrap();
        assert_eq!((file.points_m.len(), file.skipped, file.views), (2, 1, Views::Cam1));
        assert!((file.points_m[1] - Point3::new(-0.004, 0.0055, 0.301)).norm() < 1e-12);
        let text = format!("ply\nformat ascii 1.0\n{head}1 2 300 0 0\n1e9 0 0 1 0\n-4 5.5 301 2 0\n");
        let file = read_bytes(text.as_bytes(), Some(Unit::Metre)).unwrap();
        assert!((file.points_m[0].z - 300.0).abs() < 1e-9 && file.skipped == 1);
        let stated = text.replace("1.0\n", "1.0\ncomment unit mm\n");
        let refused = read_bytes(stated.as_bytes(), Some(Unit::Metre)).err().unwrap();
        assert!(refused.contains("contradicts the unit mm"), "{refused}");
    }

    #[test]
    fn what_is_no_cloud_is_refused_with_its_name() {
        let faces = "ply\nformat ascii 1.0\nelement face 0\nproperty list uchar int vertex_index\nend_header\n";
        let cut = "ply\nformat ascii 1.0\nelement vertex 2\nproperty float x\nproperty float y\nproperty float z\nend_header\n1 2 3\n";
        let flat = "ply\nformat ascii 1.0\nelement vertex 1\nproperty float x\nproperty float y\nend_header\n1 2\n";
        for (text, told) in
            [(faces, "no element vertex"), (cut, "cannot be read"), (flat, "lack x"), ("x", "cannot be")]
        {
            let error = read_bytes(text.as_bytes(), None).err().unwrap();
            assert!(error.contains("cloud.ply: ") && error.contains(told), "{error}");
        }
    }
}
