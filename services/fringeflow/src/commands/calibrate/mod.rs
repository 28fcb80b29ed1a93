//! `fringeflow calibrate`: both cameras and the projector from images of a board.

mod page;
mod svg;
mod text;

use std::io::Write as _;
use std::path::{Path, PathBuf};

use fringeflow::calibration::{Unit, read_calibration};
use fringeflow::geometry::{FringePattern, MeasurementVolume, Point3, Pose};
use fringeflow_base::atomic_file::{check_writable, write_atomically};
use fringeflow_board::Board;
use fringeflow_calibrate::comparison::{Change, cameras_exchanged, changes};
use fringeflow_calibrate::findings::{Finding, Severity};
use fringeflow_calibrate::folder::CalibrationFolder;
use fringeflow_calibrate::{Assessment, CalibratedRig, Observed, Quality, file_text};
use fringeflow_lab::rig_report::{Assumptions, CalibrationQuality, RigSetup, report};

use crate::acting_options::ActingOptions;
use crate::failure::Failure;
use crate::{json, progress};

/// Arguments of `fringeflow calibrate`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Folder with the images: patterns.toml, and for each pose of the board a folder with cam1/ and cam2/.
    folder: PathBuf,
    /// The board, as `fringeflow board` takes it: charuco:14x10:square=12:marker=9:dictionary=4x4_250, or a TOML file.
    #[arg(long, value_name = "SPEC|FILE")]
    board: String,
    /// Calibration file to write.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Lengths of the rulers on the printed board, measured along x and y. They are 100 mm if the print has its size.
    #[arg(long, value_name = "X,Y mm", value_parser = parse_ruler, default_value = "100,100")]
    ruler: [f64; 2],
    /// Estimate how the board deviates from a plane. It needs many poses with tilts.
    #[arg(long)]
    bent_board: bool,
    /// Write a page with all figures and drawings.
    #[arg(long, value_name = "FILE.html")]
    report: Option<PathBuf>,
    /// Tell what has moved since an earlier calibration.
    #[arg(long, value_name = "FILE")]
    compare: Option<PathBuf>,
    /// Write the file even if the calibration is refused. Its flaws are written into it.
    #[arg(long)]
    force: bool,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Where the options act.
pub(crate) const OPTIONS: ActingOptions<Args> = ActingOptions::all(&[
    "folder",
    "board",
    "output",
    "ruler",
    "bent_board",
    "report",
    "compare",
    "force",
    "json",
    "threads",
    "simd",
]);

/// Length of a ruler on a print of exact size, millimetres.
const RULER_MM: f64 = 100.0;
/// Lengths of rulers that a printer may produce, relative.
const RULER_SCALES: std::ops::RangeInclusive<f64> = 0.5..=2.0;
/// Fringe images of a scan, for efc.
const STEPS: usize = 4;
/// Every how many pixels of C1 the report on the rig is computed.
const REPORT_GRID_PX: usize = 16;

/// All that is printed.
pub(super) struct Outcome<'a> {
    folder: &'a Path,
    board: &'a Board,
    observed: &'a Observed,
    assessment: &'a Assessment,
    changes: Vec<Change>,
    scan: Option<ExpectedScan>,
}

/// What a scan with the calibration is expected to be.
#[derive(Clone, Copy, serde::Serialize)]
pub(super) struct ExpectedScan {
    /// Box in the frame of C1 that all devices see between the nearest and the farthest pose: xmin, ymin, zmin, xmax, ymax,
    /// zmax, millimetres.
    volume_mm: [f64; 6],
    /// Standard deviation of δ with this calibration, noise of the cameras included, rad.
    delta_sd_rad: f64,
    /// Expected false candidates per true one with four images (paper, Eq. 1).
    expected_false_candidates: f64,
}

impl Args {
    pub(crate) fn run(&self) -> Result<(), Failure> {
        let board = Board::read(&self.board).map_err(|e| Failure::Usage(format!("--board {}: {e}", self.board)))?;
        for path in std::iter::once(&self.output).chain(&self.report) {
            check_writable(path)?;
        }
        let old = self.compare.as_ref().map(|path| read_calibration(path, Unit::Millimetre)).transpose()?;
        let folder = CalibrationFolder::open(&self.folder).map_err(Failure::unusable)?;
        let bar = progress::bar("finding the board", folder.poses.len() as u64);
        let scale = self.ruler.map(|length_mm| length_mm / RULER_MM);
        let mut observed = Observed::read(&folder, &board, scale, || bar.inc(1)).map_err(Failure::unusable)?;
        bar.finish_and_clear();
        observed.views.free_shape = self.bent_board;
        let mut assessment = Assessment::of(&observed);
        let calibrated = assessment.calibrated.as_ref().ok();
        let changes = match (&old, calibrated) {
            (Some(old), Some(calibrated)) => changes(old, calibrated),
            _ => Vec::new(),
        };
        if let (Some(old), Some(new)) = (&old, calibrated.and_then(CalibratedRig::rig)) {
            if cameras_exchanged(old, &new) {
                assessment.findings.insert(0, exchanged(self.compare.as_deref()));
            }
        }
        let scan = expected_scan(&observed, &assessment);
        let outcome = Outcome {
            folder: &self.folder,
            board: &board,
            observed: &observed,
            assessment: &assessment,
            changes,
            scan,
        };
        if let Some(path) = &self.report {
            write_atomically(path, |out| out.write_all(page::page(&outcome).as_bytes()))?;
        }
        if self.json {
            json::print(&outcome.to_json())?;
        } else {
            text::write(&mut std::io::stdout().lock(), &outcome)?;
        }
        self.write(&assessment)
    }

    /// Writes the calibration file, or says why not.
    fn write(&self, assessment: &Assessment) -> Result<(), Failure> {
        let flaws: Vec<&Finding> = assessment.refusals().collect();
        let text = match &assessment.calibrated {
            Ok(calibrated) if flaws.is_empty() || self.force => file_text(calibrated, &flaws),
            Ok(_) | Err(_) => {
                let why = flaws.first().map_or_else(String::new, |flaw| format!(": {}", flaw.text));
                let more =
                    if flaws.len() > 1 { format!(" ({} more causes above)", flaws.len() - 1) } else { String::new() };
                let what = format!("no calibration is written{why}{more}");
                return Err(Failure::NotMeasurable(what));
            }
        };
        let without = || {
            Failure::NotMeasurable(format!(
                "{}: the images show the board without patterns, so there is no calibration of the projector; show the \
                 images of `fringeflow patterns --calibration` in each pose",
                self.folder.display()
            ))
        };
        let text = text.ok_or_else(without)?;
        write_atomically(&self.output, |out| out.write_all(text.as_bytes()))?;
        if !self.json {
            writeln!(std::io::stdout(), "\n{} is written", self.output.display())?;
        }
        Ok(())
    }
}

fn exchanged(old: Option<&Path>) -> Finding {
    let old = old.unwrap_or(Path::new("")).display();
    Finding {
        severity: Severity::Refusal,
        cause: "cameras exchanged",
        text: format!(
            "the cameras are exchanged: camera 1 of these images is camera 2 of {old}; exchange cam1 and cam2"
        ),
    }
}

/// Parses the measured lengths of both rulers.
fn parse_ruler(text: &str) -> Result<[f64; 2], String> {
    let wrong = || format!("{text:?} are not the lengths of two rulers; write both in millimetres, as in 99.8,100.1");
    let (x, y) = text.split_once(',').ok_or_else(wrong)?;
    let length = |text: &str| {
        let length = text.trim().parse::<f64>().ok();
        length.filter(|mm| RULER_SCALES.contains(&(mm / RULER_MM))).ok_or_else(wrong)
    };
    Ok([length(x)?, length(y)?])
}

/// Computes what a scan is expected to be; `None` without a calibration of the projector.
fn expected_scan(observed: &Observed, assessment: &Assessment) -> Option<ExpectedScan> {
    let rig = assessment.calibrated.as_ref().ok()?.rig()?;
    let quality = assessment.quality.as_ref()?;
    let (expected, period_px) = (quality.expected?, observed.period_px?);
    let volume_mm = seen_box_mm(quality)?;
    let corner = |k: usize| Point3::new(volume_mm[k] * 1e-3, volume_mm[k + 1] * 1e-3, volume_mm[k + 2] * 1e-3);
    let volume = MeasurementVolume::new(Pose::identity(), corner(0), corner(3)).ok()?;
    let setup = RigSetup { rig, volume, pattern: FringePattern { period_px, sign: 1.0, offset_rad: 0.0 } };
    let calibration = CalibrationQuality::SdRad(expected.delta_rad(period_px));
    let assumptions = Assumptions { steps: STEPS, calibration, ..Assumptions::default() };
    let figures = report(&setup, &assumptions, REPORT_GRID_PX).ok()?.evaluation.figures();
    Some(ExpectedScan { volume_mm, delta_sd_rad: figures.sd_rad, expected_false_candidates: figures.efc })
}

/// The box that all devices see at the nearest and at the farthest depth, millimetres.
fn seen_box_mm(quality: &Quality) -> Option<[f64; 6]> {
    let points: Vec<_> = quality.probes.points_m().map(|point| point * 1e3).collect();
    let depths = points.iter().map(|point| point.z);
    let (near, far) = (depths.clone().fold(f64::INFINITY, f64::min), depths.fold(f64::NEG_INFINITY, f64::max));
    let range = |depth: f64, axis: usize| {
        let at = points.iter().filter(|point| (point.z - depth).abs() < 0.5).map(|point| point[axis]);
        (at.clone().fold(f64::INFINITY, f64::min), at.fold(f64::NEG_INFINITY, f64::max))
    };
    let common = |axis: usize| {
        let ((a, b), (c, d)) = (range(near, axis), range(far, axis));
        (a.max(c), b.min(d))
    };
    let ((x0, x1), (y0, y1)) = (common(0), common(1));
    (x1 > x0 && y1 > y0 && far > near).then(|| [x0, y0, near, x1, y1, far].map(f64::round))
}

impl Outcome<'_> {
    /// All figures for other programs.
    fn to_json(&self) -> serde_json::Value {
        let calibrated = self.assessment.calibrated.as_ref().ok();
        let quality = self.assessment.quality.as_ref();
        serde_json::json!({
            "folder": self.folder,
            "board": self.board.to_string(),
            "poses": self.observed.poses.len(),
            "findings": self.assessment.findings,
            "devices": calibrated.map(|calibrated| text::devices_json(calibrated, quality)),
            "expected": quality.and_then(|quality| quality.expected),
            "scan": self.scan,
            "proposed_poses": quality.map(|quality| {
                quality.proposed.iter().map(|pose| pose.words.to_string()).collect::<Vec<_>>()
            }),
            "changes": self.changes,
        })
    }
}
