//! `fringeflow evaluate --paper`: measures the paper's seven objects with the virtual scanner, and prints the paper's
//! tables beside ours.

use std::io::Write as _;

use serde::Serialize;

use fringeflow_lab::evaluation::{
    CompletenessRow, PAPER_TABLE_2, Scores, SequenceRow, completeness_table, sequence_table,
};
use fringeflow_lab::simulation::{Object, SimulationSummary};

use crate::failure::Failure;
use crate::progress;
use crate::proposed::ProposedArgs;
use crate::statistics::Statistics;

use super::measurement::{Measurement, SimulatedDataset, paper_options};

/// Numbers of phase steps in the paper's Table 2, in its order.
const STEPS: [usize; 3] = [16, 8, 4];
/// Number of phase steps in the paper's Table 1.
const TABLE_1_STEPS: usize = 16;

#[derive(Serialize)]
struct Row {
    object: &'static str,
    steps: usize,
    #[serde(flatten)]
    scores: Scores,
    #[serde(flatten)]
    statistics: Statistics,
    simulated: SimulationSummary,
}

/// Simulates and measures every object with every number of steps, and prints the tables.
pub(super) fn run(proposed: &ProposedArgs, json: bool) -> Result<(), Failure> {
    let bar = progress::bar("objects", (Object::PAPER.len() * STEPS.len()) as u64);
    let mut rows = Vec::new();
    for object in Object::PAPER {
        for steps in STEPS {
            bar.set_message(object.name());
            rows.push(measure(object, steps, proposed)?);
            bar.inc(1);
        }
    }
    bar.finish_and_clear();
    let mut out = std::io::stdout().lock();
    if json {
        serde_json::to_writer(&mut out, &rows).map_err(std::io::Error::from)?;
        return Ok(writeln!(out)?);
    }
    writeln!(out, "Table 1, completeness ({TABLE_1_STEPS} steps)")?;
    writeln!(out, "{}", completeness_table(&table_1(&rows)))?;
    writeln!(out, "All numbers of steps")?;
    writeln!(
        out,
        "{:<14} {:>5} {:>8} {:>7} {:>7} {:>6} {:>7} {:>6}",
        "object", "steps", "com %", "miss %", "fpc %", "n", "sd", "efc"
    )?;
    for row in &rows {
        let (s, d) = (&row.scores, &row.statistics);
        writeln!(
            out,
            "{:<14} {:>5} {:>8.3} {:>7.3} {:>7.3} {:>6.2} {:>7.4} {:>6.3}",
            row.object,
            row.steps,
            s.com_percent,
            s.miss_percent,
            s.fpc_percent,
            d.mean_periods,
            d.delta_sd_rad,
            d.efc_predicted
        )?;
    }
    writeln!(out, "\nTable 2, length of the sequence (images)")?;
    Ok(writeln!(out, "{}", sequence_table(&table_2(&rows)))?)
}

fn measure(object: Object, steps: usize, proposed: &ProposedArgs) -> Result<Row, Failure> {
    let simulated = SimulatedDataset::new(paper_options(object, steps))?;
    let Measurement { scores, statistics, .. } = simulated.measure(proposed)?;
    Ok(Row { object: object.name(), steps, scores, statistics, simulated: simulated.summary })
}

fn table_1(rows: &[Row]) -> Vec<CompletenessRow<'_>> {
    let measured = rows.iter().filter(|row| row.steps == TABLE_1_STEPS);
    let row = |row: &Row| CompletenessRow {
        object: name_in_paper(row.object),
        com_percent: row.scores.com_percent,
        miss_percent: row.scores.miss_percent,
        fpc_percent: row.scores.fpc_percent,
        points: row.scores.reference,
    };
    measured.map(row).collect()
}

fn name_in_paper(object: &str) -> &str {
    match object {
        "plane" => "Plane",
        "prism" => "Prism",
        "machine" => "Machine tool",
        "teeth" => "Set of teeth",
        "tooth" => "Plaster tooth",
        "nose" => "Nose",
        "elephant" => "Elephant",
        other => other,
    }
}

/// Numbers of images of our sequences: phase images only, with the Gray code of one direction, and with that of both.
fn table_2(rows: &[Row]) -> Vec<SequenceRow> {
    let first = |steps: usize| rows.iter().find(|row| row.steps == steps);
    // A simulated sequence has phase images, Gray code, a white and a black image.
    let gray = first(STEPS[0]).map_or(0, |row| row.simulated.images.saturating_sub(STEPS[0] + 2)) as u64;
    let images = |method: &str, steps: u64| match method {
        "CGC" => 2 * (steps + gray),
        "EGC" => steps + gray,
        _ => steps,
    };
    let row = |paper: &SequenceRow| SequenceRow {
        method: paper.method,
        images: STEPS.map(|steps| images(paper.method, steps as u64)),
    };
    PAPER_TABLE_2.iter().map(row).collect()
}
