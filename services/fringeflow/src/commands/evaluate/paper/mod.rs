//! `fringeflow evaluate --paper`: the experiment of the paper (section 3), measured with the virtual scanner, beside the
//! figures of the paper.
//!
//! Every object is measured with 16, 8 and 4 steps, by four ways and against two references, once for each seed; see
//! [`fringeflow_lab::paper_experiment`]. Then the expected false candidates go from few to many, since the paper states
//! how the result depends on them.

mod csv;
mod experiment;
mod page;
mod published;
mod summary;
mod table;
mod tables;

use std::io::Write as _;
use std::path::Path;

use serde::Serialize;

use fringeflow_base::atomic_file::write_atomically;
use fringeflow_lab::paper_experiment::Figures;
use fringeflow_lab::preview::Picture;

use super::sweep::{self, Row};
use crate::failure::Failure;
use experiment::Extent;
use table::Table;

/// Number of tables that are short: those of the paper.
const SHORT_TABLES: usize = 2;

/// The result of the experiment.
#[derive(Default, Serialize)]
struct Experiment {
    /// Number of seeds.
    seeds: u64,
    /// Width and height of the images, pixels.
    size_px: [usize; 2],
    /// Duration of the whole experiment, seconds.
    seconds: f64,
    /// Every measurement.
    measurements: Vec<Figures>,
    /// Scenes with more and more false candidates.
    claims: Vec<Row>,
    /// Measurements that failed, with the reason.
    failures: Vec<String>,
    /// Pictures of the judgements by RD.
    #[serde(skip)]
    pictures: Vec<NamedPicture>,
}

/// A picture with its file name.
struct NamedPicture {
    name: String,
    title: String,
    picture: Picture,
}

/// Runs the experiment, prints its tables, and writes them to a folder.
pub(super) fn run(folder: Option<&Path>, quick: bool, json: bool) -> Result<(), Failure> {
    let experiment = experiment::run(if quick { Extent::Quick } else { Extent::Whole })?;
    let tables = tables::tables(&experiment);
    if let Some(folder) = folder {
        write(folder, &experiment, &tables)?;
    }
    let mut out = std::io::stdout().lock();
    if json {
        serde_json::to_writer(&mut out, &experiment).map_err(std::io::Error::from)?;
        writeln!(out)?;
    } else {
        // The long tables are in the files.
        let shown = if folder.is_some() { &tables[..SHORT_TABLES] } else { &tables };
        write!(out, "{}", markdown(&experiment, shown))?;
        if let Some(folder) = folder {
            let files = "paper.html, paper.md, paper.csv, claims.csv, claims.svg and pictures";
            writeln!(out, "{}: {files}", folder.display())?;
        }
    }
    failure(&experiment).map_or(Ok(()), Err)
}

fn write(folder: &Path, experiment: &Experiment, tables: &[Table]) -> Result<(), Failure> {
    let claims = &experiment.claims;
    let plot = sweep::efc_plot(claims);
    write_atomically(&folder.join("paper.md"), |out| out.write_all(markdown(experiment, tables).as_bytes()))?;
    write_atomically(&folder.join("paper.csv"), |out| csv::write(out, &experiment.measurements))?;
    write_atomically(&folder.join("claims.csv"), |out| sweep::write_table(out, claims))?;
    write_atomically(&folder.join("claims.svg"), |out| out.write_all(plot.as_bytes()))?;
    for NamedPicture { name, picture, .. } in &experiment.pictures {
        picture.write_png(&folder.join(name))?;
    }
    let page = page::html(&about(experiment), tables, &plot, &experiment.pictures);
    Ok(write_atomically(&folder.join("paper.html"), |out| out.write_all(page.as_bytes()))?)
}

fn markdown(experiment: &Experiment, tables: &[Table]) -> String {
    let tables: String = tables.iter().map(Table::markdown).collect();
    format!("# The experiment of the paper\n\n{}\n\n{tables}", about(experiment))
}

/// What was measured, in a sentence.
fn about(experiment: &Experiment) -> String {
    let Experiment { seeds, size_px: [width, height], seconds, measurements, claims, .. } = experiment;
    format!(
        "{} measurements of seven objects with 16, 8 and 4 steps, {seeds} {} each, images of {width} × {height} pixels, \
         and {} measurements with more and more false candidates, in {seconds:.0} s. ± is the standard deviation over \
         the seeds.",
        measurements.len(),
        if *seeds == 1 { "seed" } else { "seeds" },
        claims.len(),
    )
}

/// The error that lists the failed measurements; `None` if all succeeded.
fn failure(experiment: &Experiment) -> Option<Failure> {
    let Experiment { failures, measurements, .. } = experiment;
    let lines = failures.iter().map(|line| format!("  {line}")).chain(sweep::failed_lines(&experiment.claims));
    let lines: Vec<String> = lines.collect();
    let text = format!("{} measurements failed:\n{}", lines.len(), lines.join("\n"));
    match (lines.len(), measurements.len()) {
        (0, _) => None,
        (_, 0) => Some(Failure::NothingMeasured(text)),
        _ => Some(Failure::Losses(text)),
    }
}
