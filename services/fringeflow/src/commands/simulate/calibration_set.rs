//! `fringeflow simulate --calibration-board`: the images of a calibration with exact truth.

use fringeflow_board::Board;
use fringeflow_lab::simulation::{CalibrationSet, CalibrationSetOptions, CalibrationSetSummary, drawn_rig};

use crate::failure::Failure;
use crate::{json, progress};

use super::Args;

/// Options of `simulate` about the images of a calibration.
#[derive(clap::Args)]
pub(super) struct CalibrationArgs {
    /// Take the images of a calibration: this board in the hand, in several views, with all patterns of a calibration.
    ///
    /// SPEC is as in `fringeflow board`. The folder holds view_00/cam1/000.png and so on, numbered as in its
    /// patterns.toml; exact.yml and volume.json describe the exact rig; truth.json has the pose of the board in each
    /// view, and where cameras and projector see its features. The board should be about as large as the measurement
    /// volume, 100 mm × 80 mm for the built-in rig.
    #[arg(long, value_name = "SPEC", value_parser = parse_board)]
    pub(super) calibration_board: Option<Board>,
    /// Number of views of the board.
    #[arg(long, value_name = "N", default_value_t = 20)]
    views: usize,
    /// Bend of the board from its lowest to its highest point.
    #[arg(long, value_name = "MM", default_value_t = 0.0)]
    board_bend: f64,
    /// Way of the board in the hand from the first to the last image of a view. It also turns, by 0.1° per millimetre.
    #[arg(long, value_name = "MM", default_value_t = 0.0)]
    pub(super) board_motion: f64,
    /// Blur of cameras and projector at a tenth of the distance off their planes of focus, which lie in the middle of
    /// the volume: standard deviation in their pixels.
    #[arg(long, value_name = "PX", default_value_t = 0.0)]
    defocus: f64,
    /// Share by which the brightness of the images beats, as with an exposure that is no multiple of the projector's
    /// refresh.
    #[arg(long, value_name = "SHARE", default_value_t = 0.0)]
    beat: f64,
    /// Ambient light relative to that of the projector.
    #[arg(long, value_name = "SHARE", default_value_t = 0.03)]
    ambient: f64,
    /// Draw the rig: distance, base, lenses, distortion, place and image of the projector. The same seed gives the same
    /// rig.
    #[arg(long, value_name = "SEED")]
    pub(super) drawn_rig: Option<u64>,
}

fn parse_board(text: &str) -> Result<Board, String> {
    Board::read(text).map_err(|error| error.to_string())
}

#[derive(serde::Serialize)]
struct Report<'a> {
    folder: &'a std::path::Path,
    board: String,
    #[serde(flatten)]
    summary: CalibrationSetSummary,
}

impl Args {
    /// Takes the images of a calibration and writes its folder.
    pub(super) fn write_calibration_set(&self, board: &Board) -> Result<(), Failure> {
        let rig = self.rig_options()?;
        let rig = match self.calibration.drawn_rig {
            Some(seed) => rig.with_given(drawn_rig(seed, self.size, rig.period_px)?),
            None => rig,
        };
        let set = CalibrationSet::new(CalibrationSetOptions {
            board: board.clone(),
            rig,
            views: self.calibration.views,
            steps: self.steps,
            noise: self.noise,
            gamma: self.gamma,
            exposure: self.exposure,
            ambient: self.calibration.ambient,
            bend_mm: self.calibration.board_bend,
            defocus_px: self.calibration.defocus,
            beat: self.calibration.beat,
            motion_mm: self.calibration.board_motion,
            blur: self.blur,
            seed: self.seed,
        })?;
        let bar = progress::bar("taking images", set.images() as u64);
        let summary = set.write(&self.output, || bar.inc(1))?;
        bar.finish_and_clear();
        let report = Report { folder: &self.output, board: board.to_string(), summary };
        if self.json { json::print(&report) } else { Ok(print(&mut std::io::stdout().lock(), &report)?) }
    }
}

fn print(out: &mut impl std::io::Write, report: &Report<'_>) -> std::io::Result<()> {
    let CalibrationSetSummary { views, images, features_seen: [cam1, cam2, projector] } = report.summary;
    writeln!(
        out,
        "{}: {views} views of {}, {images} images per view and camera\n\
         features of the board in a view, on average: {cam1:.1} in C1, {cam2:.1} in C2, {projector:.1} in the projector",
        report.folder.display(),
        report.board,
    )
}
