//! PLY, binary little-endian. In: points. Out: a header and one vertex of 58 bytes per point.

use std::io::{self, Write};

use super::CloudExport;
use super::exported_points::{EXPORTED_FIELDS, ExportedPoints};
use super::record::Scalar;

/// Writes a PLY file.
pub(super) fn write(out: &mut impl Write, points: &ExportedPoints<'_>, export: &CloudExport<'_>) -> io::Result<()> {
    out.write_all(ply_header(points.points.len(), &export.remarks(), &EXPORTED_FIELDS).as_bytes())?;
    points.write(out, |grey| [grey; 3])
}

/// PLY header for `count` vertices with these `fields`; `remarks` are keys and values of one line each.
pub fn ply_header(count: usize, remarks: &[(&str, String)], fields: &[(&str, Scalar)]) -> String {
    let mut header = String::from("ply\nformat binary_little_endian 1.0\n");
    for (key, value) in remarks {
        header += &format!("comment {key} {value}\n");
    }
    header += &format!("element vertex {count}\n");
    for &(name, scalar) in fields {
        header += &format!("property {} {name}\n", type_name(scalar));
    }
    header + "end_header\n"
}

/// The name of a type. Of the two names of 16 bits without sign, Open3D's reader takes this one alone.
fn type_name(scalar: Scalar) -> &'static str {
    match scalar {
        Scalar::U8 => "uchar",
        Scalar::U16 => "uint16",
        Scalar::I16 => "short",
        Scalar::I32 => "int",
        Scalar::F32 => "float",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::CloudPoint;
    use crate::cloud::export::tests::{EXPORT_MM, sample_points};

    /// Bytes of a point.
    const POINT_BYTES: usize = 58;

    const HEADER: &str = concat!(
        "ply\n",
        "format binary_little_endian 1.0\n",
        "comment unit mm\n",
        "comment frame cam1 (x right, y down, z forward)\n",
        "comment software fringeflow ",
        env!("CARGO_PKG_VERSION"),
        "\n",
        "comment dataset nose\n",
        "element vertex 2\n",
        "property float x\n",
        "property float y\n",
        "property float z\n",
        "property uchar intensity\n",
        "property uint16 u1\n",
        "property uint16 v1\n",
        "property float u2\n",
        "property float v2\n",
        "property int order\n",
        "property float delta\n",
        "property uchar candidates\n",
        "property uchar stage\n",
        "property float sigma\n",
        "property float confidence\n",
        "property float nx\n",
        "property float ny\n",
        "property float nz\n",
        "property uchar red\n",
        "property uchar green\n",
        "property uchar blue\n",
        "end_header\n",
    );

    fn written(points: &[CloudPoint]) -> Vec<u8> {
        let mut out = Vec::new();
        write(&mut out, &ExportedPoints::new(points, &EXPORT_MM), &EXPORT_MM).unwrap();
        out
    }

    #[test]
    fn the_file_is_the_header_and_the_packed_fields_in_order() {
        let bytes = written(&sample_points());
        let (header, body) = bytes.split_at(HEADER.len());
        assert_eq!(std::str::from_utf8(header).unwrap(), HEADER);
        assert_eq!(body.len(), 2 * POINT_BYTES);
        // x = 1 m = 1000 mm … sigma = 0.5 mm, confidence = 0.75, written out by hand.
        let mut expected = Vec::new();
        for x in [1000.0_f32, -250.0, 500.0] {
            expected.extend(x.to_le_bytes());
        }
        expected.extend([200, 0x02, 0x01, 0x04, 0x03]);
        expected.extend(12.5_f32.to_le_bytes());
        expected.extend(772.25_f32.to_le_bytes());
        expected.extend((-3_i32).to_le_bytes());
        expected.extend(0.0625_f32.to_le_bytes());
        expected.extend([5, 2]);
        expected.extend(0.5_f32.to_le_bytes());
        expected.extend(0.75_f32.to_le_bytes());
        // Two points make no surface.
        expected.extend([0.0_f32; 3].map(f32::to_le_bytes).concat());
        expected.extend([200; 3]);
        assert_eq!(&body[..POINT_BYTES], expected);
    }

    #[test]
    fn an_empty_cloud_is_only_a_header() {
        let text = String::from_utf8(written(&[])).unwrap();
        assert_eq!(text, HEADER.replace("vertex 2", "vertex 0"));
    }
}
