//! `fringeflow board`: draws a calibration board to print, and looks for it in an image.

use std::io::Write as _;
use std::path::{Path, PathBuf};

use fringeflow_base::atomic_file::write_atomically;
use fringeflow_board::{Board, BoardImage, Detection, Page, Sheet, detect};
use fringeflow_dataset::read_grey;

use crate::acting_options::{ActingOptions, Mode};
use crate::failure::Failure;
use crate::json;
use crate::output_folder::has_extension;
use crate::values::one_of;

/// Arguments of `fringeflow board`.
#[derive(clap::Args)]
pub(crate) struct Args {
    /// The board: a line as below, or a TOML file with a table [board]. Lengths are in millimetres.
    ///
    ///   chessboard:9x6:square=25
    ///   charuco:14x10:square=12:marker=9:dictionary=4x4_250
    ///   circles:9x7:spacing=20:diameter=12
    ///   asymmetric-circles:4x11:spacing=20:diameter=15
    ///   aprilgrid:6x6:tag=20:gap=6
    ///
    /// A chessboard counts its inner corners, one less than its squares; a ChArUco board counts its squares. So does
    /// OpenCV. The spacing of asymmetric circles is that of their rows. Tag 0 of an AprilGrid is at the bottom left, as
    /// in Kalibr.
    #[arg(value_name = "SPEC", verbatim_doc_comment)]
    board: String,
    /// File to draw the board into, at its exact size: .pdf or .svg. Print it at 100 %, and measure the rulers.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Page of the drawing. own is as large as the board needs.
    #[arg(long, value_name = "PAGE", default_value = "a4", value_parser = one_of(&Page::ALL, Page::name))]
    page: Page,
    /// Look for the board in an image, and tell where its features are, or what is there instead. Exit code 1: the
    /// board was not found.
    #[arg(long, value_name = "IMAGE")]
    find: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long)]
    json: bool,
}

/// Where the options act.
pub(crate) const OPTIONS: ActingOptions<Args> = ActingOptions {
    always: &["board", "output", "find", "json", "threads"],
    choices: &[&[
        Mode { name: "with --output", is_chosen: |args| args.output.is_some(), options: &["page"] },
        Mode { name: "without --output", is_chosen: |_| true, options: &[] },
    ]],
};

#[derive(serde::Serialize)]
struct Report<'a> {
    board: String,
    size_mm: [f64; 2],
    features: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    page_mm: Option<[f64; 2]>,
    #[serde(skip_serializing_if = "Option::is_none")]
    found: Option<Vec<Found>>,
    #[serde(skip_serializing_if = "Option::is_none")]
    file: Option<&'a Path>,
}

/// A feature in the image.
#[derive(serde::Serialize)]
struct Found {
    id: usize,
    x_mm: f64,
    y_mm: f64,
    u_px: f64,
    v_px: f64,
    sd_px: f64,
}

impl Args {
    pub(crate) fn run(&self) -> Result<(), Failure> {
        let board = Board::read(&self.board).map_err(Failure::unusable)?;
        let found = self.find.as_deref().map(|image| find(&board, image)).transpose()?;
        let page_mm = self.output.as_deref().map(|file| draw(&board, self.page, file)).transpose()?;
        let report = Report {
            board: board.to_string(),
            size_mm: board.size_mm(),
            features: board.features().len(),
            page_mm,
            found,
            file: self.output.as_deref(),
        };
        if self.json { json::print(&report) } else { Ok(print(&mut std::io::stdout().lock(), &report)?) }
    }
}

/// Draws the board and returns the size of the page.
fn draw(board: &Board, page: Page, file: &Path) -> Result<[f64; 2], Failure> {
    let sheet = Sheet::new(board, page).map_err(|error| Failure::unusable(format!("--page: {error}")))?;
    let content = match (has_extension(file, "pdf"), has_extension(file, "svg")) {
        (true, _) => sheet.pdf(),
        (_, true) => sheet.svg().into_bytes(),
        _ => {
            let file = file.display();
            return Err(Failure::Usage(format!(
                "--output {file}: the drawing is a .pdf or an .svg; choose such a name"
            )));
        }
    };
    write_atomically(file, |out| out.write_all(&content))?;
    Ok(sheet.size_mm())
}

/// Looks for the board in an image file.
fn find(board: &Board, file: &Path) -> Result<Vec<Found>, Failure> {
    let name = file.display();
    let image = read_grey(file, None, None).map_err(|problem| Failure::Usage(format!("{name}: {problem}")))?;
    let levels = BoardImage::new([image.width, image.height], image.levels());
    let levels = levels.ok_or_else(|| Failure::Usage(format!("{name}: the image has no pixels")))?;
    let detections = detect(board, &levels).map_err(|reason| Failure::NothingMeasured(format!("{name}: {reason}")))?;
    let features = board.features();
    let found = |d: &Detection| {
        let [x_mm, y_mm, _] = features[d.feature];
        Found { id: d.feature, x_mm, y_mm, u_px: d.pixel[0], v_px: d.pixel[1], sd_px: d.sd_px }
    };
    Ok(detections.iter().map(found).collect())
}

fn print(out: &mut impl std::io::Write, report: &Report<'_>) -> std::io::Result<()> {
    let [w, h] = report.size_mm;
    writeln!(out, "{}: {w:.2} x {h:.2} mm without margin, {} features", report.board, report.features)?;
    if let (Some(file), Some([w, h])) = (report.file, report.page_mm) {
        writeln!(out, "{}: page of {w:.1} x {h:.1} mm; print it at 100 % and measure both rulers", file.display())?;
    }
    if let Some(found) = &report.found {
        let mean = found.iter().map(|f| f.sd_px).sum::<f64>() / found.len().max(1) as f64;
        writeln!(out, "found {} of {} features, standard deviation {mean:.3} px", found.len(), report.features)?;
        for f in found {
            writeln!(out, "{:5} {:9.3} {:9.3}", f.id, f.u_px, f.v_px)?;
        }
    }
    Ok(())
}
