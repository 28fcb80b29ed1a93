//! The figures of scenes as comma-separated values (RFC 4180).

use std::io::{self, Write};

use fringeflow_lab::evaluation::Scores;
use fringeflow_lab::scene_lists::SceneFigures;

use super::Row;
use crate::commands::evaluate::csv::{number, quoted};

const HEADER: &str = "number,kind,layout,object,n,sd_rad,efc,reference,points,com_percent,interior_percent,fpc_percent,\
                      wrong_percent,stray_percent,rms_mm,paper_com_percent,paper_interior_percent,paper_fpc_percent,\
                      scene,failure";

/// Writes the table. Fields that were not measured are empty.
pub(super) fn write(out: &mut impl Write, rows: &[Row]) -> io::Result<()> {
    writeln!(out, "{HEADER}")?;
    rows.iter().try_for_each(|row| writeln!(out, "{}", line(row)))
}

fn line(row: &Row) -> String {
    let rig = |figure: fn(&SceneFigures) -> f64| number(row.figures.as_ref().map(figure));
    let score = |figure: fn(&Scores) -> Option<f64>| number(row.figures.and_then(|f| figure(&f.scores)));
    let paper = |figure: fn(&Scores) -> Option<f64>| number(row.figures.and_then(|f| f.paper).and_then(|s| figure(&s)));
    let count = |figure: fn(&Scores) -> u64| row.figures.map(|f| figure(&f.scores).to_string()).unwrap_or_default();
    [
        row.number.to_string(),
        row.kind.to_owned(),
        row.layout.to_owned(),
        row.object.to_owned(),
        rig(|f| f.mean_periods),
        rig(|f| f.sd_rad),
        rig(|f| f.efc),
        count(|s| s.reference),
        count(|s| s.points),
        score(|s| Some(s.com_percent)),
        score(|s| s.interior_percent),
        score(|s| Some(s.fpc_percent)),
        score(|s| Some(s.wrong_percent)),
        score(|s| Some(s.stray_percent)),
        score(|s| s.rms_m.map(|m| m * 1e3)),
        paper(|s| Some(s.com_percent)),
        paper(|s| s.interior_percent),
        paper(|s| Some(s.fpc_percent)),
        quoted(&row.scene),
        row.failure.as_deref().map(quoted).unwrap_or_default(),
    ]
    .join(",")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::evaluate::scenes::test_row;

    #[test]
    fn a_scene_is_a_line_with_as_many_fields_as_the_header() {
        let measured = test_row(12, "behind", 98.0, 0.125);
        let failed = Row { figures: None, failure: Some("no \"δ\"".to_owned()), ..measured.clone() };
        let mut out = Vec::new();
        write(&mut out, &[Row { scene: "tooth".to_owned(), ..measured }, failed]).unwrap();
        let text = String::from_utf8(out).unwrap();
        let lines: Vec<&str> = text.lines().collect();
        let fields: Vec<&str> = lines[1].split(',').collect();
        assert_eq!(fields.len(), lines[0].split(',').count());
        assert_eq!(fields[..5], ["12", "behind", "inside", "tooth", "6.00000"]);
        assert_eq!(fields[9..12], ["98.00000", "98.00000", "0.12500"]);
        assert!(lines[2].ends_with("\"tooth, 4 steps\",\"no \"\"δ\"\"\""), "{}", lines[2]);
    }
}
