//! The board as a page to print, at its exact size.
//!
//! In: a board and a page. Out: a PDF or an SVG with the pattern, its description, and two rulers: a caliper tells
//! whether, and by how much, the printer scaled the page in each direction. Lengths are in millimetres from the top left
//! of the page, x right, y down.

mod page;
mod pdf;
mod svg;

use crate::{Board, Pattern};

pub use page::{Page, UnknownPage};

/// Why a board cannot be drawn.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SheetError {
    /// The board is larger than the page.
    #[error(
        "the board needs {:.0} x {:.0} mm with its margins and rulers, and page {page} has {:.0} x {:.0} mm; choose a \
         larger page, page own, or a smaller board", needed_mm[0], needed_mm[1], page_mm[0], page_mm[1]
    )]
    TooLarge {
        /// Width and height that the board needs.
        needed_mm: [f64; 2],
        /// The page.
        page: &'static str,
        /// Its width and height, turned as the board needs it.
        page_mm: [f64; 2],
    },
}

/// A page with a board.
#[derive(Clone, Debug, PartialEq)]
pub struct Sheet {
    title: String,
    size_mm: [f64; 2],
    /// Black rectangles: left, top, width, height.
    rectangles: Vec<[f64; 4]>,
    /// Black discs: middle and radius.
    discs: Vec<[f64; 3]>,
    /// Thin lines from a point to a point.
    lines: Vec<[[f64; 2]; 2]>,
    texts: Vec<Text>,
}

/// A line of text.
#[derive(Clone, Debug, PartialEq)]
struct Text {
    /// Left end of the base line.
    at_mm: [f64; 2],
    height_mm: f64,
    content: String,
}

/// Least white margin around the pattern, and around everything, which printers leave blank.
const LEAST_MARGIN_MM: f64 = 5.0;
/// Distance of the rulers from the margin, and room for them and the text below the board.
const RULER_MM: f64 = 2.0;
const RULER_ROOM_MM: f64 = 8.0;
const TEXT_ROOM_MM: f64 = 14.0;
/// Marks of the rulers.
const MARK_EVERY_MM: f64 = Board::RULER_MARK_MM;
const MARK_MM: f64 = 2.0;
const END_MARK_MM: f64 = 4.0;
/// Height and width of the letters of the description.
const TEXT_MM: f64 = 2.8;
const LETTER_MM: f64 = 0.56 * TEXT_MM;

impl Sheet {
    /// Draws a board in the middle of a page, which is turned if the board fits better.
    ///
    /// # Errors
    /// [`SheetError::TooLarge`]: the page is too small.
    pub fn new(board: &Board, page: Page) -> Result<Self, SheetError> {
        let [w, h] = board.size_mm();
        let margin = board.margin_mm().max(LEAST_MARGIN_MM);
        let title = format!("fringeflow board {board}");
        let rulers = board.rulers_mm();
        let hint =
            format!("Print at 100 %. Rulers between the outer marks: {} mm across, {} mm down.", rulers[0], rulers[1]);
        let text_mm = LETTER_MM * title.len().max(hint.len()) as f64;
        let needed_mm = [
            (w + 2.0 * margin + RULER_ROOM_MM).max(text_mm + 2.0 * LEAST_MARGIN_MM),
            h + 2.0 * margin + RULER_ROOM_MM + TEXT_ROOM_MM,
        ];
        let size_mm = page.size_for(needed_mm).map_err(|page_mm| SheetError::TooLarge {
            needed_mm,
            page: page.name(),
            page_mm,
        })?;
        let left = (size_mm[0] - w - RULER_ROOM_MM).max(2.0 * margin) / 2.0;
        let top = margin + (size_mm[1] - needed_mm[1]) / 2.0;
        let (bottom, right) = (top + h + margin + RULER_MM, left + w + margin + RULER_MM);
        let text = |line: f64, content: String| {
            let at_mm = [left.min(size_mm[0] - text_mm - LEAST_MARGIN_MM), bottom + END_MARK_MM + line * 1.6 * TEXT_MM];
            Text { at_mm, height_mm: TEXT_MM, content }
        };
        let mut sheet = Self {
            size_mm,
            rectangles: black_rectangles(board),
            discs: black_discs(board),
            lines: ruler([left, bottom], rulers[0], [1.0, 0.0], [0.0, 1.0]),
            texts: vec![text(1.0, title.clone()), text(2.0, hint)],
            title,
        };
        sheet.lines.extend(ruler([right, top], rulers[1], [0.0, 1.0], [1.0, 0.0]));
        let middle = [left + w / 2.0, top + h / 2.0];
        sheet.rectangles.iter_mut().for_each(|r| (0..2).for_each(|k| r[k] += middle[k]));
        sheet.discs.iter_mut().for_each(|d| (0..2).for_each(|k| d[k] += middle[k]));
        Ok(sheet)
    }

    /// Width and height of the page, millimetres.
    #[must_use]
    pub fn size_mm(&self) -> [f64; 2] {
        self.size_mm
    }

    /// The page as a PDF file.
    #[must_use]
    pub fn pdf(&self) -> Vec<u8> {
        pdf::pdf(self)
    }

    /// The page as an SVG file.
    #[must_use]
    pub fn svg(&self) -> String {
        svg::svg(self)
    }
}

/// A ruler: a line with a mark every centimetre, longer at its ends.
fn ruler(from: [f64; 2], length: f64, along: [f64; 2], out: [f64; 2]) -> Vec<[[f64; 2]; 2]> {
    let at = |a: f64, o: f64| [0, 1].map(|k| from[k] + a * along[k] + o * out[k]);
    let marks = (length / MARK_EVERY_MM).round() as usize;
    let mark = |k: usize| {
        let position = k as f64 * MARK_EVERY_MM;
        [at(position, 0.0), at(position, if k == 0 || k == marks { END_MARK_MM } else { MARK_MM })]
    };
    (0..=marks).map(mark).chain([[at(0.0, 0.0), at(length, 0.0)]]).collect()
}

/// Black rectangles of the pattern in the frame of the board.
fn black_rectangles(board: &Board) -> Vec<[f64; 4]> {
    let [left, top] = board.size_mm().map(|size| -size / 2.0);
    let mut rectangles = Vec::new();
    if let Pattern::Chessboard { square_mm: s, .. } | Pattern::Charuco { square_mm: s, .. } = *board.pattern() {
        let [nx, ny] = board.size_mm().map(|size| (size / s).round() as usize);
        let black = (0..nx * ny).map(|k| [k % nx, k / nx]).filter(|[i, j]| (i + j).is_multiple_of(2));
        rectangles.extend(black.map(|[i, j]| [left + i as f64 * s, top + j as f64 * s, s, s]));
    }
    if let Pattern::AprilGrid { tags: [nx, ny], tag_mm, gap_mm, .. } = *board.pattern() {
        let period = tag_mm + gap_mm;
        let squares = (0..(nx + 1) * (ny + 1)).map(|k| [k % (nx + 1), k / (nx + 1)]);
        rectangles.extend(squares.map(|[i, j]| [left + i as f64 * period, top + j as f64 * period, gap_mm, gap_mm]));
    }
    for marker in board.markers() {
        let side = (marker.cells.len() as f64).sqrt() as usize;
        let cell = marker.side_mm / side as f64;
        for (row, cells) in marker.cells.chunks_exact(side).enumerate() {
            let mut column = 0;
            for run in cells.chunk_by(|a, b| a == b) {
                if run[0] {
                    let [x, y] = marker.corner_mm;
                    let width = run.len() as f64 * cell;
                    rectangles.push([x + column as f64 * cell, y + row as f64 * cell, width, cell]);
                }
                column += run.len();
            }
        }
    }
    rectangles
}

/// Black discs of the pattern in the frame of the board.
fn black_discs(board: &Board) -> Vec<[f64; 3]> {
    let radius = board.circle_radius_mm();
    radius.map_or_else(Vec::new, |r| board.features().iter().map(|[x, y, _]| [*x, *y, r]).collect())
}

#[cfg(test)]
mod tests;
