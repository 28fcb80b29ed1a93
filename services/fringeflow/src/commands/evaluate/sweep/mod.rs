//! `fringeflow evaluate --sweep`: measures how completeness and false correspondences depend on the expected false
//! candidates, on a board outside the volume, and on the number of steps.

mod axis;
mod knob;
mod plot;
mod table;
mod text;

use std::io::Write as _;
use std::path::Path;

use indicatif::ProgressBar;
use serde::Serialize;

use fringeflow::correspondence::ResolutionMethod;
use fringeflow_base::atomic_file::write_atomically;
use fringeflow_lab::simulation::{Object, RigOptions, SimulationSummary};
use fringeflow_telemetry::health::{HealthState, Quantity};

use self::knob::SeriesPoint;
pub(super) use self::knob::{Knob, claims};
pub(super) use self::plot::svg as efc_plot;
pub(super) use self::table::write as write_table;
use super::measurement::{Measurement, SimulatedDataset};
use crate::failure::Failure;
use crate::progress;
use crate::proposed::ProposedArgs;
use crate::statistics::Statistics;

/// Size of the images, pixels.
const USUAL_SIZE_PX: [usize; 2] = RigOptions::usual(0.0).size_px;

/// Names and options of the resolution methods that are compared.
fn resolutions() -> [(&'static str, ProposedArgs); 2] {
    [ResolutionMethod::Moments, ResolutionMethod::Paper]
        .map(|method| (method.name(), ProposedArgs::with_resolution(method)))
}

/// A measurement, or the reason why it failed.
#[derive(Clone, Serialize)]
pub(super) struct Row {
    knob: Knob,
    /// The knob's value, in its unit.
    value: f64,
    object: &'static str,
    resolution: &'static str,
    #[serde(flatten)]
    rig: Option<RigFigures>,
    #[serde(flatten)]
    figures: Option<Figures>,
    failure: Option<String>,
}

/// Figures of the simulated rig.
#[derive(Clone, Copy, Serialize)]
struct RigFigures {
    /// Mean number of periods on a segment.
    mean_periods: f64,
    /// Standard deviation of δ that the calibration error causes, rad.
    sd_rad: f64,
    /// Expected false candidates by Eq. (1), from the two above.
    efc: f64,
}

/// Figures of a reconstruction.
#[derive(Clone, Copy, Serialize)]
struct Figures {
    /// efc by Eq. (1) from the measured sd, which includes noise.
    efc_predicted: f64,
    efc_measured: f64,
    com_percent: f64,
    interior_percent: Option<f64>,
    miss_percent: f64,
    fpc_percent: f64,
    outliers_percent: Option<f64>,
    points: u64,
    /// Duration of the reconstruction, including the segment table and the reading of the images.
    reconstruction_ms: f64,
    warning: Option<Warning>,
}

/// Warning of a reconstruction: calibration and images may not belong together.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
enum Warning {
    /// δ scatters more widely than on calibrated rigs.
    Spread,
    /// The drift of the calibration exceeds its limit.
    Drift,
}

/// Measures every object at every point of the series of these knobs. Writes the table and the plot.
pub(super) fn run(folder: &Path, objects: &[Object], knobs: &[Knob], json: bool) -> Result<(), Failure> {
    let points: Vec<SeriesPoint> = knobs.iter().flat_map(|&knob| knob::series(knob)).collect();
    let bar = progress::bar("scenes", (points.len() * objects.len()) as u64);
    let rows = measure_all(objects, &points, USUAL_SIZE_PX, &bar);
    bar.finish_and_clear();
    write_atomically(&folder.join("sweep.csv"), |out| table::write(out, &rows))?;
    write_atomically(&folder.join("sweep.svg"), |out| out.write_all(plot::svg(&rows).as_bytes()))?;
    print(folder, &rows, json)?;
    failures(&rows).map_or(Ok(()), Err)
}

/// Measures every object at every point, with images of `size_px`.
pub(super) fn measure_all(
    objects: &[Object],
    points: &[SeriesPoint],
    size_px: [usize; 2],
    bar: &ProgressBar,
) -> Vec<Row> {
    let mut rows = Vec::new();
    for &object in objects {
        for point in points {
            bar.set_message(object.name());
            rows.extend(measure(object, point, size_px));
            bar.inc(1);
        }
    }
    rows
}

/// A line for each failed measurement, with its reason.
pub(super) fn failed_lines(rows: &[Row]) -> impl Iterator<Item = String> + '_ {
    rows.iter().filter_map(|row| {
        let Row { object, value, resolution, .. } = row;
        Some(format!("  {object}, {} {value}, resolution {resolution}: {}", row.knob.name(), row.failure.as_deref()?))
    })
}

/// The error that lists the failed measurements with their reasons; `None` if all succeeded.
fn failures(rows: &[Row]) -> Option<Failure> {
    let lines: Vec<String> = failed_lines(rows).collect();
    let text = format!("{} of {} measurements failed:\n{}", lines.len(), rows.len(), lines.join("\n"));
    match lines.len() {
        0 => None,
        failed if failed == rows.len() => Some(Failure::NothingMeasured(text)),
        _ => Some(Failure::Losses(text)),
    }
}

/// Measures a scene with every resolution, one row each. Returns no rows if the volume is shallower than the object.
fn measure(object: Object, point: &SeriesPoint, size_px: [usize; 2]) -> Vec<Row> {
    let Some(options) = point.options(object, size_px) else { return Vec::new() };
    let simulated = SimulatedDataset::new(options);
    // The paper measures sd beforehand.
    let known_sd_rad =
        simulated.as_ref().ok().filter(|_| point.knows_sd).map(|s| s.summary.calibration_error.delta_rms);
    let row = |(resolution, proposed): (&'static str, ProposedArgs)| {
        let proposed = match known_sd_rad {
            Some(sd_rad) if resolution == ResolutionMethod::Paper.name() => proposed.with_known_sd(sd_rad),
            _ => proposed,
        };
        let measured = match &simulated {
            Ok(simulated) => simulated.measure(&proposed).map_err(|e| simulated.failure_text(&e)),
            Err(e) => Err(e.to_string()),
        };
        Row {
            knob: point.knob,
            value: point.value(),
            object: object.name(),
            resolution,
            rig: simulated.as_ref().ok().map(|s| RigFigures::from_summary(&s.summary)),
            figures: measured.as_ref().ok().map(Figures::from_measurement),
            failure: measured.err(),
        }
    };
    resolutions().into_iter().map(row).collect()
}

impl RigFigures {
    fn from_summary(summary: &SimulationSummary) -> Self {
        Self {
            mean_periods: summary.mean_periods,
            sd_rad: summary.calibration_error.delta_rms,
            efc: summary.expected_false_candidates,
        }
    }
}

impl Figures {
    fn from_measurement(Measurement { scores, statistics, duration }: &Measurement) -> Self {
        Self {
            efc_predicted: statistics.efc_predicted,
            efc_measured: statistics.efc_measured,
            com_percent: scores.com_percent,
            interior_percent: scores.interior_percent,
            miss_percent: scores.miss_percent,
            fpc_percent: scores.fpc_percent,
            outliers_percent: scores.outliers_percent,
            points: scores.points,
            reconstruction_ms: duration.as_secs_f64() * 1e3,
            warning: Warning::from_statistics(statistics),
        }
    }
}

impl Warning {
    /// The more serious warning of a reconstruction; `None` if it has none.
    fn from_statistics(statistics: &Statistics) -> Option<Self> {
        let is_beyond =
            |quantity| statistics.health.quantity(quantity).is_some_and(|gauge| gauge.state >= HealthState::Warn);
        let drift = is_beyond(Quantity::Drift).then_some(Self::Drift);
        if is_beyond(Quantity::DeltaSd) { Some(Self::Spread) } else { drift }
    }

    /// Name in the table.
    fn name(self) -> &'static str {
        match self {
            Self::Spread => "spread",
            Self::Drift => "drift",
        }
    }
}

fn print(folder: &Path, rows: &[Row], json: bool) -> Result<(), Failure> {
    let mut out = std::io::stdout().lock();
    if json {
        serde_json::to_writer(&mut out, rows).map_err(std::io::Error::from)?;
        return Ok(writeln!(out)?);
    }
    write!(out, "{}", text::table(rows))?;
    Ok(writeln!(out, "{}: sweep.csv and sweep.svg of {} measurements", folder.display(), rows.len())?)
}

/// A row for tests.
#[cfg(test)]
fn test_row(knob: Knob, object: &'static str, efc: f64, fpc_percent: f64) -> Row {
    Row {
        knob,
        value: 25.0,
        object,
        resolution: "paper",
        rig: Some(RigFigures { mean_periods: 6.0, sd_rad: 0.041, efc }),
        figures: Some(Figures {
            efc_predicted: efc * 1.1,
            efc_measured: efc,
            com_percent: 99.5,
            interior_percent: Some(99.9),
            miss_percent: 0.5,
            fpc_percent,
            outliers_percent: Some(0.25),
            points: 1234,
            reconstruction_ms: 321.0,
            warning: None,
        }),
        failure: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn failures_are_listed_and_count_as_losses_unless_all_failed() {
        let measured = test_row(Knob::Depth, "nose", 0.2, 0.0);
        let failed = Row { figures: None, failure: Some("no δ".to_owned()), ..measured };
        let rows = [measured, failed];
        assert!(failures(&rows[..1]).is_none());
        let some = failures(&rows);
        let Some(Failure::Losses(text)) = some else { panic!("{some:?}") };
        assert_eq!(text, "1 of 2 measurements failed:\n  nose, depth 25, resolution paper: no δ");
        assert!(matches!(failures(&rows[1..]), Some(Failure::NothingMeasured(_))));
    }
}
