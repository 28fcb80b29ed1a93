//! The rows of a sweep as tables for the terminal, one for each series.

use super::{Knob, Row, Warning};

/// The tables of all knobs that have rows.
pub(super) fn table(rows: &[Row]) -> String {
    let series = Knob::ALL.into_iter().map(|knob| rows.iter().filter(move |row| row.knob == knob).collect::<Vec<_>>());
    series.filter(|rows| !rows.is_empty()).map(|rows| series_table(&rows)).collect()
}

fn series_table(rows: &[&Row]) -> String {
    let heading = format!(
        "{}\n{:>8} {:<10} {:<12} {:>8} {:>8} {:>8} {:>7} {:>8}  warning\n",
        rows[0].knob.title(),
        "value",
        "object",
        "resolution",
        "com %",
        "interior",
        "fpc %",
        "efc",
        "measured",
    );
    heading + &rows.iter().map(|row| line(row)).collect::<String>() + "\n"
}

fn line(row: &Row) -> String {
    let scene = format!("{:>8} {:<10} {:<12}", row.value, row.object, row.resolution);
    match &row.figures {
        Some(figures) => format!(
            "{scene} {:>8.3} {:>8} {:>8.3} {:>7.3} {:>8.3}  {}\n",
            figures.com_percent,
            figures.interior_percent.map_or_else(|| "–".to_owned(), |percent| format!("{percent:.3}")),
            figures.fpc_percent,
            figures.efc_predicted,
            figures.efc_measured,
            figures.warning.map_or("", Warning::name),
        ),
        None => format!("{scene} failed\n"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::commands::evaluate::sweep::test_row;

    #[test]
    fn every_series_has_a_table_and_every_measurement_a_line_with_its_warning() {
        let mut rows = vec![test_row(Knob::Board, "tooth", 0.2, 12.5), test_row(Knob::Steps, "tooth", 0.2, 0.0)];
        rows[0].figures.as_mut().unwrap().warning = Some(Warning::Drift);
        rows.push(Row { figures: None, failure: Some("no δ".to_owned()), ..rows[1].clone() });
        let text = table(&rows);
        let lines: Vec<Vec<&str>> = text.lines().map(|line| line.split_whitespace().collect()).collect();
        assert!(text.starts_with(Knob::Board.title()) && text.contains(Knob::Steps.title()), "{text}");
        assert_eq!(lines[2], ["25", "tooth", "paper", "99.500", "99.900", "12.500", "0.220", "0.200", "drift"]);
        assert_eq!(lines[7], ["25", "tooth", "paper", "failed"]);
    }
}
