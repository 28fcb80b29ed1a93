//! PCD 0.7, binary, for PCL and CloudCompare. In: points. Out: a header and the records of the PLY file, but the colour as
//! PCL packs it: blue, green, red and a zero, in one field.

use std::io::{self, Write};

use super::CloudExport;
use super::exported_points::{EXPORTED_FIELDS, ExportedPoints};
use super::record::Scalar;

/// Writes a PCD file.
pub(super) fn write(out: &mut impl Write, points: &ExportedPoints<'_>, export: &CloudExport<'_>) -> io::Result<()> {
    out.write_all(header(points.points.len(), export).as_bytes())?;
    points.write(out, |grey| [grey, grey, grey, 0])
}

/// The fields, by the names that PCL and Open3D look for.
fn fields() -> Vec<(&'static str, Scalar)> {
    let name = |name| match name {
        "nx" => Some("normal_x"),
        "ny" => Some("normal_y"),
        "nz" => Some("normal_z"),
        "red" | "green" | "blue" => None,
        other => Some(other),
    };
    let named = EXPORTED_FIELDS.into_iter().filter_map(|(field, scalar)| Some((name(field)?, scalar)));
    // PCL declares the packed colour as a floating-point number.
    named.chain([("rgb", Scalar::F32)]).collect()
}

/// The header. PCD prescribes this order of lines.
fn header(count: usize, export: &CloudExport<'_>) -> String {
    let mut header = String::from("# .PCD v0.7 - Point Cloud Data file format\n");
    for (key, value) in export.remarks() {
        header += &format!("# {key} {value}\n");
    }
    header += "VERSION 0.7\n";
    header += &format!("FIELDS {}\n", joined(|name, _| name.to_owned()));
    header += &format!("SIZE {}\n", joined(|_, scalar| scalar.size().to_string()));
    header += &format!("TYPE {}\n", joined(|_, scalar| type_letter(scalar).to_owned()));
    header += &format!("COUNT {}\n", joined(|_, _| "1".to_owned()));
    header += &format!("WIDTH {count}\nHEIGHT 1\nVIEWPOINT 0 0 0 1 0 0 0\nPOINTS {count}\nDATA binary\n");
    header
}

fn joined(describe: impl Fn(&str, Scalar) -> String) -> String {
    fields().into_iter().map(|(name, scalar)| describe(name, scalar)).collect::<Vec<_>>().join(" ")
}

fn type_letter(scalar: Scalar) -> &'static str {
    match scalar {
        Scalar::U8 | Scalar::U16 => "U",
        Scalar::I16 | Scalar::I32 => "I",
        Scalar::F32 => "F",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::export::tests::{EXPORT_MM, sample_points};

    const HEADER: &str = concat!(
        "# .PCD v0.7 - Point Cloud Data file format\n",
        "# unit mm\n",
        "# frame cam1 (x right, y down, z forward)\n",
        "# software fringeflow ",
        env!("CARGO_PKG_VERSION"),
        "\n",
        "# dataset nose\n",
        "VERSION 0.7\n",
        "FIELDS x y z intensity u1 v1 u2 v2 order delta candidates stage sigma confidence normal_x normal_y normal_z rgb\n",
        "SIZE 4 4 4 1 2 2 4 4 4 4 1 1 4 4 4 4 4 4\n",
        "TYPE F F F U U U F F I F U U F F F F F F\n",
        "COUNT 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1 1\n",
        "WIDTH 2\n",
        "HEIGHT 1\n",
        "VIEWPOINT 0 0 0 1 0 0 0\n",
        "POINTS 2\n",
        "DATA binary\n",
    );

    #[test]
    fn the_file_is_the_header_and_the_records_of_the_ply_file_with_a_packed_colour() {
        let (mut pcd, mut ply) = (Vec::new(), Vec::new());
        let points = sample_points();
        let exported = ExportedPoints::new(&points, &EXPORT_MM);
        write(&mut pcd, &exported, &EXPORT_MM).unwrap();
        crate::cloud::ply::write(&mut ply, &exported, &EXPORT_MM).unwrap();
        let (header, body) = pcd.split_at(HEADER.len());
        assert_eq!(std::str::from_utf8(header).unwrap(), HEADER);
        // A record of the PLY file has three bytes of colour, one of this file four.
        let of_ply = ply[ply.len() - 2 * 58..].chunks(58);
        assert_eq!((body.len(), of_ply.len()), (2 * 59, 2));
        for (record, of_ply) in body.chunks(59).zip(of_ply) {
            assert_eq!((&record[..58], record[58]), (of_ply, 0));
        }
    }
}
