//! A sheet as a PDF of one page, with one of the fonts that every viewer has. All rectangles are filled at once, so that
//! no seam shows between neighbours.

use std::fmt::Write as _;

use super::Sheet;

/// Units of a PDF in a millimetre.
const UNITS_PER_MM: f64 = 72.0 / 25.4;
/// Distance of the control points of a quarter circle by a Bézier curve from its ends, in radii.
const CONTROL: f64 = 0.552_284_75;

/// Writes the sheet.
pub(super) fn pdf(sheet: &Sheet) -> Vec<u8> {
    let [w, h] = sheet.size_mm.map(|mm| mm * UNITS_PER_MM);
    let content = content(sheet);
    let objects = [
        "<< /Type /Catalog /Pages 2 0 R /ViewerPreferences << /PrintScaling /None >> >>".to_owned(),
        "<< /Type /Pages /Kids [3 0 R] /Count 1 >>".to_owned(),
        format!(
            "<< /Type /Page /Parent 2 0 R /MediaBox [0 0 {w:.4} {h:.4}] /Contents 4 0 R \
             /Resources << /Font << /F 5 0 R >> >> >>"
        ),
        format!("<< /Length {} >>\nstream\n{content}endstream", content.len()),
        "<< /Type /Font /Subtype /Type1 /BaseFont /Helvetica >>".to_owned(),
        format!("<< /Title ({}) >>", sheet.title),
    ];
    // Writing to a String cannot fail.
    let mut out = String::from("%PDF-1.6\n");
    let mut places = Vec::new();
    for (k, object) in objects.iter().enumerate() {
        places.push(out.len());
        let _ = write!(out, "{} 0 obj\n{object}\nendobj\n", k + 1);
    }
    let (table, count) = (out.len(), objects.len() + 1);
    let _ = write!(out, "xref\n0 {count}\n0000000000 65535 f \n");
    for place in places {
        let _ = writeln!(out, "{place:010} 00000 n ");
    }
    let _ = write!(out, "trailer\n<< /Size {count} /Root 1 0 R /Info 6 0 R >>\nstartxref\n{table}\n%%EOF\n");
    out.into_bytes()
}

/// What is drawn, in millimetres from the top left.
fn content(sheet: &Sheet) -> String {
    let height = sheet.size_mm[1] * UNITS_PER_MM;
    let mut out = format!("{UNITS_PER_MM:.9} 0 0 -{UNITS_PER_MM:.9} 0 {height:.4} cm\n");
    for [x, y, width, height] in &sheet.rectangles {
        let _ = writeln!(out, "{x:.4} {y:.4} {width:.4} {height:.4} re");
    }
    for disc in &sheet.discs {
        push_disc(&mut out, disc);
    }
    out.push_str("f\n0.1 w\n");
    for [[ax, ay], [bx, by]] in &sheet.lines {
        let _ = writeln!(out, "{ax:.4} {ay:.4} m {bx:.4} {by:.4} l");
    }
    out.push_str("S\n");
    for text in &sheet.texts {
        let [x, y] = text.at_mm;
        let _ = writeln!(out, "BT /F {} Tf 1 0 0 -1 {x:.3} {y:.3} Tm ({}) Tj ET", text.height_mm, text.content);
    }
    out
}

fn push_disc(out: &mut String, [x, y, r]: &[f64; 3]) {
    let c = CONTROL * r;
    let _ = writeln!(out, "{:.4} {y:.4} m", x + r);
    let quarters = [[1.0, 0.0, 0.0, 1.0], [0.0, 1.0, -1.0, 0.0], [-1.0, 0.0, 0.0, -1.0], [0.0, -1.0, 1.0, 0.0]];
    for [ax, ay, bx, by] in quarters {
        let first = [x + r * ax + c * bx, y + r * ay + c * by];
        let second = [x + r * bx + c * ax, y + r * by + c * ay];
        let end = [x + r * bx, y + r * by];
        let [p, q, e] = [first, second, end].map(|[x, y]| format!("{x:.4} {y:.4}"));
        let _ = writeln!(out, "{p} {q} {e} c");
    }
    out.push_str("h\n");
}
