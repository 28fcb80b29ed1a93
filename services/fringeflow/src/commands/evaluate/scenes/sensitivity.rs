//! `fringeflow evaluate --scenes LIST --sensitivity`: what each constant and each step of the order decision is worth.

use std::fmt::Write as _;
use std::io::Write as _;
use std::path::Path;

use serde::Serialize;

use fringeflow::correspondence::{Constant, Model};
use fringeflow_base::atomic_file::write_atomically;
use fringeflow_lab::scene_lists::{Change, FACTOR, ListedScene, Sensitivity, measure_sensitivity};

use crate::failure::Failure;
use crate::{json, progress};

/// Name of the file of the table.
const FILE: &str = "sensitivity.md";

/// A changed constant or a step left out, and how far it moves the means of the scenes.
#[derive(Serialize)]
struct Row {
    /// Name of the constant or of the step.
    name: &'static str,
    /// Factor of the constant; `None` for a step that is left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    factor: Option<f32>,
    com_percent: f64,
    interior_percent: f64,
    fpc_percent: f64,
    milliseconds: f64,
}

#[derive(Serialize)]
struct Report {
    scenes: usize,
    com_percent: f64,
    interior_percent: f64,
    fpc_percent: f64,
    milliseconds: f64,
    changes: Vec<Row>,
}

/// Measures the scenes with every change, and prints the table. With a folder, it is also written there.
pub(super) fn run(scenes: &[ListedScene], folder: Option<&Path>, as_json: bool) -> Result<(), Failure> {
    let bar = progress::bar("scenes", scenes.len() as u64);
    let measured = measure_sensitivity(scenes, || bar.inc(1)).map_err(Failure::unusable)?;
    bar.finish_and_clear();
    let Some((usual, changed)) = measured.split_first().filter(|(usual, _)| usual.scenes > 0) else {
        return Err(Failure::NothingMeasured("no scene gave a cloud".to_owned()));
    };
    let changes = changed.iter().map(|changed| Row::new(usual, changed)).collect();
    let report = Report {
        scenes: usual.scenes,
        com_percent: usual.com_percent,
        interior_percent: usual.interior_percent,
        fpc_percent: usual.fpc_percent,
        milliseconds: 1e3 * usual.time.as_secs_f64(),
        changes,
    };
    let table = table(&report);
    if let Some(folder) = folder {
        write_atomically(&folder.join(FILE), |out| out.write_all(table.as_bytes()))?;
    }
    if as_json {
        return json::print(&report);
    }
    Ok(write!(std::io::stdout().lock(), "{table}")?)
}

impl Row {
    fn new(usual: &Sensitivity, changed: &Sensitivity) -> Self {
        let (name, factor) = match changed.change {
            Change::Usual => ("usual", None),
            Change::Times(constant, factor) => (constant.name, Some(factor)),
            Change::Without(step) => (step.name(), None),
        };
        Self {
            name,
            factor,
            com_percent: changed.com_percent - usual.com_percent,
            interior_percent: changed.interior_percent - usual.interior_percent,
            fpc_percent: changed.fpc_percent - usual.fpc_percent,
            milliseconds: 1e3 * (changed.time.as_secs_f64() - usual.time.as_secs_f64()),
        }
    }

    /// com and fpc.
    fn cells(&self) -> String {
        format!("{:+.2}, {:+.2}", self.com_percent, self.fpc_percent)
    }
}

/// The constants and the steps as tables in Markdown.
fn table(report: &Report) -> String {
    let Report { scenes, com_percent, interior_percent, fpc_percent, milliseconds, changes } = report;
    let mut text = format!(
        "Means of {scenes} scenes: com {com_percent:.2} %, interior {interior_percent:.2} %, fpc {fpc_percent:.2} %, \
         {milliseconds:.1} ms. com and fpc, percent, that a change adds:\n\n\
         | constant | value | what it is | × {FACTOR} | ÷ {FACTOR} |\n|---|---|---|---|---|\n"
    );
    for constant in Model::CONSTANTS {
        let cells = |is_more: bool| {
            let of_it = |row: &&Row| row.name == constant.name && row.factor.is_some_and(|f| (f > 1.0) == is_more);
            changes.iter().find(of_it).map(Row::cells).unwrap_or_default()
        };
        let Constant { name, unit, text: what, of } = constant;
        let value = format!("{} {unit}", of(&mut Model::USUAL.clone()));
        let (more, less) = (cells(true), cells(false));
        let _ = writeln!(text, "| `{name}` | {} |{what} | {more} | {less} |", value.trim_end());
    }
    text += "\n| without this step | com % | interior % | fpc % | ms |\n|---|---|---|---|---|\n";
    for row in changes.iter().filter(|row| row.factor.is_none()) {
        let Row { name, com_percent, interior_percent, fpc_percent, milliseconds, .. } = row;
        let _ = writeln!(
            text,
            "| {name} | {com_percent:+.2} | {interior_percent:+.2} | {fpc_percent:+.2} | {milliseconds:+.1} |"
        );
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_constant_and_every_step_has_its_line() {
        let row = |change| Row::new(&sensitivity(Change::Usual, 99.0), &sensitivity(change, 98.5));
        let changes: Vec<Row> = Change::all().skip(1).map(row).collect();
        let (com_percent, interior_percent, fpc_percent) = (99.0, 99.9, 0.1);
        let count = changes.len();
        let text = table(&Report { scenes: 2, com_percent, interior_percent, fpc_percent, milliseconds: 5.0, changes });
        let constants = Model::CONSTANTS.len();
        assert_eq!(text.matches("-0.50, +0.00").count(), 2 * constants, "{text}");
        assert_eq!(text.matches("| -0.50 | +0.00 |").count(), count - 2 * constants, "{text}");
        assert!(text.contains("| `price_nats` | 5 nats | Price"), "{text}");
    }

    fn sensitivity(change: Change, com_percent: f64) -> Sensitivity {
        let time = std::time::Duration::from_millis(10);
        Sensitivity { change, scenes: 2, com_percent, interior_percent: 99.9, fpc_percent: 0.1, time }
    }
}
