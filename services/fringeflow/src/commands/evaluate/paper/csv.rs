//! Every measurement as comma-separated values (RFC 4180).

use std::io::{self, Write};

use fringeflow_lab::evaluation::Scores;
use fringeflow_lab::paper_experiment::{DeltaFigures, Figures};

use crate::commands::evaluate::csv::number;

const HEADER: &str = "object,seed,steps,way,images,rd_com_percent,rd_miss_percent,rd_fpc_percent,rd_points,\
                      com_percent,interior_percent,miss_percent,fpc_percent,points,rms_mm,n,sd_rad,efc_predicted,\
                      efc_measured,puc_predicted,puc_measured,seconds";

/// Writes the table. Figures that a way does not have are empty.
pub(super) fn write(out: &mut impl Write, measurements: &[Figures]) -> io::Result<()> {
    writeln!(out, "{HEADER}")?;
    measurements.iter().try_for_each(|figures| writeln!(out, "{}", line(figures)))
}

fn line(figures: &Figures) -> String {
    let Figures { object, seed, way, steps, images, truth, rd, delta, seconds, .. } = figures;
    let scores = |s: &Scores| [s.com_percent, s.miss_percent, s.fpc_percent].map(|percent| number(Some(percent)));
    let [rd_com, rd_miss, rd_fpc] = scores(rd);
    let [com, miss, fpc] = scores(truth);
    let of_delta = |figure: fn(&DeltaFigures) -> f64| number(delta.as_ref().map(figure));
    [
        (*object).to_owned(),
        seed.to_string(),
        steps.to_string(),
        way.name().to_owned(),
        images.to_string(),
        rd_com,
        rd_miss,
        rd_fpc,
        rd.reference.to_string(),
        com,
        number(truth.interior_percent),
        miss,
        fpc,
        truth.reference.to_string(),
        number(truth.rms_m.map(|rms_m| 1e3 * rms_m)),
        of_delta(|delta| delta.mean_periods),
        of_delta(|delta| delta.sd_rad),
        of_delta(|delta| delta.efc_predicted),
        of_delta(|delta| delta.efc_measured),
        of_delta(|delta| delta.puc_predicted),
        of_delta(|delta| delta.puc_measured),
        format!("{seconds:.4}"),
    ]
    .join(",")
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use fringeflow_lab::paper_experiment::Way;

    #[test]
    fn a_measurement_is_a_line_with_as_many_fields_as_the_header() {
        let truth = Scores { com_percent: 99.5, reference: 1234, ..Scores::default() };
        let (rd, delta, missed) = (Scores::default(), None, BTreeMap::new());
        let (object, way) = ("nose", Way::Egc);
        let figures = Figures { object, seed: 3, way, steps: 8, images: 15, truth, rd, delta, missed, seconds: 0.25 };
        let mut out = Vec::new();
        write(&mut out, &[figures]).unwrap();
        let text = String::from_utf8(out).unwrap();
        let lines: Vec<Vec<&str>> = text.lines().map(|line| line.split(',').collect()).collect();
        assert_eq!(lines[0].len(), lines[1].len());
        assert_eq!(lines[1][..5], ["nose", "3", "8", "egc", "15"]);
        assert_eq!((lines[1][9], lines[1][15], lines[1][21]), ("99.50000", "", "0.2500"));
    }
}
