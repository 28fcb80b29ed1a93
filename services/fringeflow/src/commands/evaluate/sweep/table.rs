//! The rows of a sweep as comma-separated values (RFC 4180).

use std::io::{self, Write};

use super::{Row, Warning};
use crate::commands::evaluate::csv::{number, quoted};

const HEADER: &str = "knob,value,object,resolution,n,sd_rad,efc,efc_predicted,efc_measured,com_percent,interior_percent,\
                      miss_percent,fpc_percent,outliers_percent,points,reconstruction_ms,warning,failure";

/// Writes the table. Fields that were not measured are empty.
pub(in crate::commands::evaluate) fn write(out: &mut impl Write, rows: &[Row]) -> io::Result<()> {
    writeln!(out, "{HEADER}")?;
    rows.iter().try_for_each(|row| writeln!(out, "{}", line(row)))
}

fn line(row: &Row) -> String {
    let rig = |figure: fn(&super::RigFigures) -> f64| number(row.rig.as_ref().map(figure));
    let result = |figure: fn(&super::Figures) -> f64| number(row.figures.as_ref().map(figure));
    [
        row.knob.name().to_owned(),
        row.value.to_string(),
        row.object.to_owned(),
        row.resolution.to_owned(),
        rig(|f| f.mean_periods),
        rig(|f| f.sd_rad),
        rig(|f| f.efc),
        result(|f| f.efc_predicted),
        result(|f| f.efc_measured),
        result(|f| f.com_percent),
        number(row.figures.as_ref().and_then(|f| f.interior_percent)),
        result(|f| f.miss_percent),
        result(|f| f.fpc_percent),
        number(row.figures.as_ref().and_then(|f| f.outliers_percent)),
        row.figures.as_ref().map(|f| f.points.to_string()).unwrap_or_default(),
        result(|f| f.reconstruction_ms),
        row.figures.as_ref().and_then(|f| f.warning).map(Warning::name).unwrap_or_default().to_owned(),
        row.failure.as_deref().map(quoted).unwrap_or_default(),
    ]
    .join(",")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::evaluate::sweep::{Knob, test_row};

    fn written(rows: &[Row]) -> Vec<String> {
        let mut out = Vec::new();
        write(&mut out, rows).unwrap();
        String::from_utf8(out).unwrap().lines().map(str::to_owned).collect()
    }

    #[test]
    fn a_measurement_is_a_line_with_as_many_fields_as_the_header() {
        let lines = written(&[test_row(Knob::Depth, "elephant", 0.2, 0.125)]);
        let fields: Vec<&str> = lines[1].split(',').collect();
        assert_eq!(fields.len(), lines[0].split(',').count());
        assert_eq!(fields[..7], ["depth", "25", "elephant", "paper", "6.00000", "0.04100", "0.20000"]);
        assert_eq!(fields[9..], ["99.50000", "99.90000", "0.50000", "0.12500", "0.25000", "1234", "321.00000", "", ""]);
    }

    #[test]
    fn a_failure_is_a_line_with_its_reason() {
        let failure = Some("no \"δ\", no cloud".to_owned());
        let rows = [Row { rig: None, figures: None, failure, ..test_row(Knob::Sd, "nose", 2.0, 1.0) }];
        assert_eq!(written(&rows)[1], "sd,25,nose,paper,,,,,,,,,,,,,,\"no \"\"δ\"\", no cloud\"");
    }
}
