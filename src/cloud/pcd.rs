//! PCD 0.7, binary, for PCL and CloudCompare. In: points. Out: a header and the records of the PLY file.

use std::io::{self, Write};

use super::record::{FIELDS, Scalar, write_records};
use super::{CloudExport, CloudPoint};

/// Writes a PCD file.
pub(super) fn write(out: &mut impl Write, points: &[CloudPoint], export: &CloudExport<'_>) -> io::Result<()> {
    out.write_all(header(points.len(), export).as_bytes())?;
    write_records(out, points, export.units_per_metre())
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
    FIELDS.map(|(name, scalar)| describe(name, scalar)).join(" ")
}

fn type_letter(scalar: Scalar) -> &'static str {
    match scalar {
        Scalar::U8 | Scalar::U16 => "U",
        Scalar::I16 => "I",
        Scalar::F32 => "F",
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::cloud::export::tests::{EXPORT_MM, sample_points};
    use crate::cloud::record::RECORD_BYTES;

    const HEADER: &str = concat!(
        "# .PCD v0.7 - Point Cloud Data file format\n",
        "# unit mm\n",
        "# frame cam1 (x right, y down, z forward)\n",
        "# software fringeflow ",
        env!("CARGO_PKG_VERSION"),
        "\n",
        "# dataset nose\n",
        "VERSION 0.7\n",
        "FIELDS x y z intensity u1 v1 u2 v2 order delta candidates stage sigma confidence\n",
        "SIZE 4 4 4 1 2 2 4 4 2 4 1 1 4 4\n",
        "TYPE F F F U U U F F I F U U F F\n",
        "COUNT 1 1 1 1 1 1 1 1 1 1 1 1 1 1\n",
        "WIDTH 2\n",
        "HEIGHT 1\n",
        "VIEWPOINT 0 0 0 1 0 0 0\n",
        "POINTS 2\n",
        "DATA binary\n",
    );

    #[test]
    fn the_file_is_the_header_and_the_records_of_the_ply_file() {
        let (mut pcd, mut ply) = (Vec::new(), Vec::new());
        write(&mut pcd, &sample_points(), &EXPORT_MM).unwrap();
        crate::cloud::ply::write(&mut ply, &sample_points(), &EXPORT_MM).unwrap();
        let (header, body) = pcd.split_at(HEADER.len());
        assert_eq!(std::str::from_utf8(header).unwrap(), HEADER);
        assert_eq!(body, &ply[ply.len() - 2 * RECORD_BYTES..]);
    }
}
