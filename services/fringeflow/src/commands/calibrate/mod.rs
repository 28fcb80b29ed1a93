//! `fringeflow calibrate`: both cameras and the projector from images of a board.

mod page;
mod refine;
mod svg;
mod text;

use std::io::Write as _;
use std::path::{Path, PathBuf};

use fringeflow::calibration::{CalibrationProblem, Unit, parse_calibration, read_calibration};
use fringeflow::geometry::{FringePattern, MeasurementVolume, Point3, Pose};
use fringeflow_base::atomic_file::{check_writable, write_atomically};
use fringeflow_board::Board;
use fringeflow_calibrate::comparison::{Change, cameras_exchanged, changes};
use fringeflow_calibrate::findings::{Finding, Severity};
use fringeflow_calibrate::folder::CalibrationFolder;
use fringeflow_calibrate::{Assessment, Observed, Quality, cameras_file_text, file_text};
use fringeflow_lab::rig_report::{Assumptions, CalibrationQuality, RigSetup, report};

use crate::acting_options::{ActingOptions, Mode};
use crate::failure::Failure;
use crate::{json, progress};

/// Arguments of `fringeflow calibrate`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// Folder with the images: patterns.toml, and for each pose of the board a folder with cam1/ and cam2/. Images of the
    /// board alone, in cam1/ and cam2/, calibrate the cameras without the projector.
    #[arg(value_name = "FOLDER", required_unless_present = "refine")]
    input: Option<PathBuf>,
    /// The board, as `fringeflow board` takes it: charuco:14x10:square=12:marker=9:dictionary=4x4_250, or a TOML file.
    #[arg(long, value_name = "SPEC|FILE", required_unless_present = "refine")]
    board: Option<String>,
    /// Improve a calibration by scans of anything: a recording or a dataset folder. Or find the projector of calibrated
    /// cameras by one scene at rest: a folder with patterns.toml, cam1/ and cam2/, with Gray code along the columns.
    #[arg(long, value_name = "SCANS", conflicts_with_all = ["input", "board"])]
    refine: Option<PathBuf>,
    /// Calibration to begin with. The default is that of the scans; a scene has none.
    #[arg(long, value_name = "FILE")]
    from: Option<PathBuf>,
    /// Calibration file to write.
    #[arg(short, long, value_name = "FILE")]
    output: PathBuf,
    /// Measured lengths of the rulers on the printed board, across and down. The board says how long they should be.
    #[arg(long, value_name = "X,Y mm", value_parser = parse_rulers)]
    rulers: Option<[f64; 2]>,
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
pub(crate) const OPTIONS: ActingOptions<Args> = ActingOptions {
    always: &["output", "json", "threads", "simd"],
    choices: &[&[
        Mode { name: "with --refine", is_chosen: |args| args.refine.is_some(), options: &["refine", "from"] },
        Mode {
            name: "without --refine",
            is_chosen: |_| true,
            options: &["input", "board", "rulers", "bent_board", "report", "compare", "force"],
        },
    ]],
};

/// Sizes of prints, relative to that of the board: beyond these it was scaled on purpose, or measured wrongly.
const PRINT_SCALES: std::ops::RangeInclusive<f64> = 0.8..=1.25;
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
    /// What moved since the calibration of --compare.
    changes: Option<Vec<Change>>,
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
        check_writable(&self.output)?;
        match (&self.refine, &self.input, &self.board) {
            (Some(scans), ..) => refine::run(self, scans),
            (None, Some(folder), Some(board)) => self.calibrate(folder, board),
            // The parser asks for them.
            _ => Err(Failure::Usage("give a folder with images and --board, or --refine".to_owned())),
        }
    }

    fn calibrate(&self, path: &Path, board: &str) -> Result<(), Failure> {
        let board = Board::read(board).map_err(|e| Failure::Usage(format!("--board {board}: {e}")))?;
        if let Some(report) = &self.report {
            check_writable(report)?;
        }
        let old = self.compare.as_ref().map(|path| read_calibration(path, Unit::Millimetre)).transpose()?;
        let folder = CalibrationFolder::open(path).map_err(Failure::unusable)?;
        let bar = progress::bar("finding the board", folder.poses.len() as u64);
        let scale = self.print_scale(&board)?;
        let mut observed = Observed::read(&folder, &board, scale, || bar.inc(1)).map_err(Failure::unusable)?;
        bar.finish_and_clear();
        observed.views.free_shape = self.bent_board;
        let mut assessment = Assessment::of(&observed);
        let calibrated = assessment.calibrated.as_ref().ok();
        let mut changed = None;
        if let (Some(old), Some(calibrated)) = (&old, calibrated)
            && let Some(new) = calibrated.rig()
        {
            changed = Some(changes(old, &new, &calibrated.adjusted.covariance));
            if cameras_exchanged(old, &new) {
                assessment.findings.insert(0, exchanged(self.compare.as_deref()));
            }
        }
        let scan = expected_scan(&observed, &assessment);
        let outcome = Outcome {
            folder: path,
            board: &board,
            observed: &observed,
            assessment: &assessment,
            changes: changed,
            scan,
        };
        if let Some(report) = &self.report {
            write_atomically(report, |out| out.write_all(page::page(&outcome).as_bytes()))?;
        }
        if self.json {
            json::print(&outcome.to_json())?;
        } else {
            text::write(&mut std::io::stdout().lock(), &outcome)?;
        }
        self.write(&assessment)
    }

    /// Writes the text of a calibration that the other commands accept.
    fn write_text(&self, text: &str) -> Result<(), Failure> {
        // Without a projector, only --refine reads it.
        let accepted = parse_calibration(text, Unit::Millimetre).map(|_| ());
        match accepted {
            Err(CalibrationProblem::Missing { .. }) | Ok(()) => {}
            Err(problem) => {
                return Err(Failure::NotMeasurable(format!("no calibration is written, since its {problem}")));
            }
        }
        Ok(write_atomically(&self.output, |out| out.write_all(text.as_bytes()))?)
    }

    /// Size of the print relative to that of the board, along x and y.
    fn print_scale(&self, board: &Board) -> Result<[f64; 2], Failure> {
        let nominal_mm = board.rulers_mm();
        let Some(measured_mm) = self.rulers else { return Ok([1.0; 2]) };
        let scale = [measured_mm[0] / nominal_mm[0], measured_mm[1] / nominal_mm[1]];
        if scale.iter().all(|scale| PRINT_SCALES.contains(scale)) {
            return Ok(scale);
        }
        Err(Failure::Usage(format!(
            "--rulers {},{}: on a print of {board} the rulers are {} mm across and {} mm down; these lengths are too far from \
             it for a print, so measure between the outer marks",
            measured_mm[0], measured_mm[1], nominal_mm[0], nominal_mm[1]
        )))
    }

    /// Writes the calibration file, or says why not.
    fn write(&self, assessment: &Assessment) -> Result<(), Failure> {
        let flaws: Vec<&Finding> = assessment.refusals().collect();
        let calibrated = match &assessment.calibrated {
            Ok(calibrated) if flaws.is_empty() || self.force => calibrated,
            _ => {
                let why = flaws.first().map_or_else(String::new, |flaw| format!(": {}", flaw.text));
                let others = flaws.len().saturating_sub(1);
                let more = if others > 0 { format!(" ({others} more causes above)") } else { String::new() };
                return Err(Failure::NotMeasurable(format!("no calibration is written{why}{more}")));
            }
        };
        let text = match (calibrated.rig(), calibrated.cameras()) {
            (Some(rig), _) => file_text(&rig, &calibrated.adjusted.covariance, &flaws),
            (None, Some(cameras)) => cameras_file_text(&cameras, &calibrated.adjusted.covariance, &flaws),
            (None, None) => return Err(Failure::NotMeasurable("no camera is calibrated".to_owned())),
        };
        self.write_text(&text)?;
        if !self.json {
            let what =
                if calibrated.rig().is_some() { "" } else { " with the cameras alone; --refine finds the projector" };
            writeln!(std::io::stdout(), "\n{} is written{what}", self.output.display())?;
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
fn parse_rulers(text: &str) -> Result<[f64; 2], String> {
    let wrong = || format!("{text:?} are not the lengths of two rulers; write both in millimetres, as in 159.8,110.1");
    let (x, y) = text.split_once(',').ok_or_else(wrong)?;
    let length = |text: &str| text.trim().parse::<f64>().ok().filter(|mm| mm.is_finite()).ok_or_else(wrong);
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
