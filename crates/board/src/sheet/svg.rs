//! A sheet as SVG, in millimetres. All rectangles are one path, so that no seam shows between neighbours.

use std::fmt::Write as _;

use super::Sheet;

/// Writes the sheet.
pub(super) fn svg(sheet: &Sheet) -> String {
    let [w, h] = sheet.size_mm;
    let mut out = format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{w}mm\" height=\"{h}mm\" viewBox=\"0 0 {w} {h}\">\n\
         <title>{}</title>\n<rect width=\"{w}\" height=\"{h}\" fill=\"white\"/>\n<path d=\"",
        sheet.title
    );
    // Writing to a String cannot fail.
    for [x, y, width, height] in &sheet.rectangles {
        let _ = write!(out, "M{x:.4} {y:.4}h{width:.4}v{height:.4}h-{width:.4}z");
    }
    out.push_str("\"/>\n");
    for [x, y, r] in &sheet.discs {
        let _ = writeln!(out, "<circle cx=\"{x:.4}\" cy=\"{y:.4}\" r=\"{r:.4}\"/>");
    }
    out.push_str("<path stroke=\"black\" stroke-width=\"0.1\" d=\"");
    for [[ax, ay], [bx, by]] in &sheet.lines {
        let _ = write!(out, "M{ax:.4} {ay:.4}L{bx:.4} {by:.4}");
    }
    out.push_str("\"/>\n");
    for text in &sheet.texts {
        let [x, y] = text.at_mm;
        let _ = writeln!(
            out,
            "<text x=\"{x:.2}\" y=\"{y:.2}\" font-family=\"Helvetica, Arial, sans-serif\" font-size=\"{}\">{}</text>",
            text.height_mm, text.content
        );
    }
    out.push_str("</svg>\n");
    out
}
