//! A calibration board: its pattern, the features on it, and the brightness of each of its points.
//!
//! In: a description (see [`spec`]). Out: positions of the features in the order of their ids, and brightness. Cost:
//! a few operations a point.

mod dictionary;
mod error;
mod spec;
mod toml_file;

pub use dictionary::{Marker, Tags};
pub use error::BoardError;

/// What is printed on the board. Lengths in millimetres.
#[derive(Clone, Debug, PartialEq)]
pub enum Pattern {
    /// Black and white squares; the features are the inner corners. The square at the top left is black.
    Chessboard {
        /// Inner corners of a row and of a column: one less than the squares.
        corners: [usize; 2],
        /// Side of a square.
        square_mm: f64,
    },
    /// A chessboard with a marker in each white square; the features are the inner corners. As OpenCV has it from 4.6
    /// on: the square at the top left is black, and the markers are numbered row by row.
    Charuco {
        /// Squares of a row and of a column.
        squares: [usize; 2],
        /// Side of a square.
        square_mm: f64,
        /// Side of a marker with its black border.
        marker_mm: f64,
        /// The markers.
        dictionary: Tags,
    },
    /// Black circles at the points of a square grid; the features are the centres.
    Circles {
        /// Circles of a row and of a column.
        circles: [usize; 2],
        /// Distance between the centres of neighbours.
        spacing_mm: f64,
        /// Diameter of a circle.
        diameter_mm: f64,
    },
    /// Black circles, every second row shifted by half a distance, as OpenCV has it; the features are the centres.
    AsymmetricCircles {
        /// Circles of a row, and number of rows.
        circles: [usize; 2],
        /// Distance between rows, and half the distance between the circles of a row.
        spacing_mm: f64,
        /// Diameter of a circle.
        diameter_mm: f64,
    },
    /// AprilTags with small black squares between their corners, as Kalibr has it; the features are the corners of the
    /// tags. Tag 0 is at the bottom left; the numbers grow to the right, then upwards.
    AprilGrid {
        /// Tags of a row and of a column.
        tags: [usize; 2],
        /// Side of a tag with its black border.
        tag_mm: f64,
        /// Distance between tags, which is the side of the small squares.
        gap_mm: f64,
        /// The tags.
        family: Tags,
    },
}

/// A calibration board.
///
/// ```
/// use fringeflow_board::Board;
///
/// let board: Board = "chessboard:9x6:square=25".parse()?;
/// assert_eq!(board.to_string(), "chessboard:9x6:square=25");
/// assert_eq!(board.size_mm(), [250.0, 175.0]);
/// assert_eq!(board.turns(), 1);
/// # Ok::<(), fringeflow_board::BoardError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Board {
    pattern: Pattern,
}

impl Board {
    /// Distance of the marks of the rulers on a printed board, millimetres.
    pub const RULER_MARK_MM: f64 = 10.0;

    /// Lengths of the rulers on a printed board, along x and y: whole marks within the pattern, millimetres.
    #[must_use]
    pub fn rulers_mm(&self) -> [f64; 2] {
        self.size_mm().map(|side| (side / Self::RULER_MARK_MM).floor().max(1.0) * Self::RULER_MARK_MM)
    }

    /// The pattern.
    #[must_use]
    pub fn pattern(&self) -> &Pattern {
        &self.pattern
    }

    /// Positions of all features in the frame of the board, millimetres. The id of a feature is its index.
    ///
    /// Corners and circles go row by row from the top left, as OpenCV orders them. The corners of a tag of an AprilGrid
    /// follow each other clockwise from its top left, tag by tag.
    #[must_use]
    pub fn features(&self) -> Vec<[f64; 3]> {
        self.lattice().into_iter().map(|[x_mm, y_mm]| [x_mm, y_mm, 0.0]).collect()
    }

    /// Width and height of the pattern without white margin, millimetres.
    #[must_use]
    pub fn size_mm(&self) -> [f64; 2] {
        match self.pattern {
            Pattern::Chessboard { corners, square_mm } => corners.map(|n| (n + 1) as f64 * square_mm),
            Pattern::Charuco { squares, square_mm, .. } => squares.map(|n| n as f64 * square_mm),
            Pattern::Circles { circles, spacing_mm, diameter_mm } => {
                circles.map(|n| (n - 1) as f64 * spacing_mm + diameter_mm)
            }
            Pattern::AsymmetricCircles { circles: [n, rows], spacing_mm, diameter_mm } => {
                [2 * n - 1, rows - 1].map(|steps| steps as f64 * spacing_mm + diameter_mm)
            }
            Pattern::AprilGrid { tags, tag_mm, gap_mm, .. } => tags.map(|n| n as f64 * (tag_mm + gap_mm) + gap_mm),
        }
    }

    /// Width of the white margin that detection wants around the pattern, millimetres.
    #[must_use]
    pub fn margin_mm(&self) -> f64 {
        match self.pattern {
            Pattern::Chessboard { square_mm, .. } | Pattern::Charuco { square_mm, .. } => square_mm / 2.0,
            Pattern::Circles { spacing_mm, diameter_mm, .. }
            | Pattern::AsymmetricCircles { spacing_mm, diameter_mm, .. } => {
                (spacing_mm - diameter_mm / 2.0).max(spacing_mm / 2.0)
            }
            Pattern::AprilGrid { gap_mm, .. } => gap_mm,
        }
    }

    /// Number of quarter or half turns that map the pattern to itself: 4, 2, or 1 if every orientation looks different.
    ///
    /// Above 1, a detection chooses the orientation whose x axis is closest to that of the image, and the poses of a
    /// board in several cameras have to be made consistent.
    #[must_use]
    pub fn turns(&self) -> usize {
        match self.pattern {
            Pattern::Chessboard { corners: [nx, ny], .. } => match ((nx + ny) % 2, nx == ny && nx % 2 == 0) {
                (1, _) => 1,
                (_, true) => 4,
                _ => 2,
            },
            Pattern::Circles { circles: [nx, ny], .. } => {
                if nx == ny {
                    4
                } else {
                    2
                }
            }
            Pattern::AsymmetricCircles { circles: [_, rows], .. } => 2 - rows % 2,
            Pattern::Charuco { .. } | Pattern::AprilGrid { .. } => 1,
        }
    }

    /// Brightness of the printed board at a point, millimetres: 0 for black, 1 for white. Outside the pattern it is
    /// white.
    #[must_use]
    pub fn brightness(&self, x_mm: f64, y_mm: f64) -> f64 {
        if self.is_black([x_mm, y_mm]) { 0.0 } else { 1.0 }
    }

    /// Length over which the pattern changes around a feature, millimetres: a square, the distance of circles, or a tag
    /// with a gap.
    pub(crate) fn cell_mm(&self) -> f64 {
        match self.pattern {
            Pattern::Chessboard { square_mm, .. } | Pattern::Charuco { square_mm, .. } => square_mm,
            Pattern::Circles { spacing_mm, .. } => spacing_mm,
            Pattern::AsymmetricCircles { spacing_mm, .. } => spacing_mm * std::f64::consts::SQRT_2,
            Pattern::AprilGrid { gap_mm, tag_mm, .. } => gap_mm.min(tag_mm),
        }
    }

    /// Radius of the circles, millimetres; `None` if the features are corners.
    pub(crate) fn circle_radius_mm(&self) -> Option<f64> {
        match self.pattern {
            Pattern::Circles { diameter_mm, .. } | Pattern::AsymmetricCircles { diameter_mm, .. } => {
                Some(diameter_mm / 2.0)
            }
            _ => None,
        }
    }

    /// Distance of the markers from the sides of their squares, millimetres; `None` without markers in squares.
    pub(crate) fn marker_inset_mm(&self) -> Option<f64> {
        match self.pattern {
            Pattern::Charuco { square_mm, marker_mm, .. } => Some((square_mm - marker_mm) / 2.0),
            _ => None,
        }
    }

    /// The markers on the board.
    #[must_use]
    pub fn markers(&self) -> Vec<Marker> {
        match &self.pattern {
            Pattern::Charuco { squares: [nx, ny], square_mm, marker_mm, dictionary } => {
                let [left, top] = self.top_left();
                let white = (0..nx * ny).map(|k| (k % nx, k / nx)).filter(|(i, j)| (i + j) % 2 == 1);
                let at = |(id, (i, j)): (usize, (usize, usize))| {
                    let corner = |k: usize, from: f64| from + k as f64 * square_mm + (square_mm - marker_mm) / 2.0;
                    dictionary.marker(id, [corner(i, left), corner(j, top)], *marker_mm)
                };
                white.enumerate().map(at).collect()
            }
            Pattern::AprilGrid { tags: [nx, ny], tag_mm, family, .. } => {
                let at = |id: usize| family.marker(id, self.tag_corner(id % nx, ny - 1 - id / nx), *tag_mm);
                (0..nx * ny).map(at).collect()
            }
            _ => Vec::new(),
        }
    }

    fn top_left(&self) -> [f64; 2] {
        self.size_mm().map(|size| -size / 2.0)
    }

    /// Top left corner of the tag in a column and a row counted from the top.
    fn tag_corner(&self, column: usize, row: usize) -> [f64; 2] {
        let Pattern::AprilGrid { tag_mm, gap_mm, .. } = self.pattern else { return self.top_left() };
        let [left, top] = self.top_left();
        [left + gap_mm + column as f64 * (tag_mm + gap_mm), top + gap_mm + row as f64 * (tag_mm + gap_mm)]
    }

    fn lattice(&self) -> Vec<[f64; 2]> {
        let grid = |[nx, ny]: [usize; 2], step_mm: f64| {
            let at = move |k: usize, n: usize| (k as f64 - (n - 1) as f64 / 2.0) * step_mm;
            (0..nx * ny).map(|k| [at(k % nx, nx), at(k / nx, ny)]).collect()
        };
        match self.pattern {
            Pattern::Chessboard { corners, square_mm } => grid(corners, square_mm),
            Pattern::Charuco { squares, square_mm, .. } => grid(squares.map(|n| n - 1), square_mm),
            Pattern::Circles { circles, spacing_mm, .. } => grid(circles, spacing_mm),
            Pattern::AsymmetricCircles { circles: [n, rows], spacing_mm, .. } => {
                let at = |k: usize, last: usize| (k as f64 - last as f64 / 2.0) * spacing_mm;
                let place = |k: usize| [at(2 * (k % n) + k / n % 2, 2 * n - 1), at(k / n, rows - 1)];
                (0..n * rows).map(place).collect()
            }
            Pattern::AprilGrid { tags: [nx, ny], tag_mm, .. } => {
                let corners = |id: usize| {
                    let [x, y] = self.tag_corner(id % nx, ny - 1 - id / nx);
                    [[x, y], [x + tag_mm, y], [x + tag_mm, y + tag_mm], [x, y + tag_mm]]
                };
                (0..nx * ny).flat_map(corners).collect()
            }
        }
    }

    fn is_black(&self, point: [f64; 2]) -> bool {
        let [left, top] = self.top_left();
        let (x, y) = (point[0] - left, point[1] - top);
        let [width, height] = self.size_mm();
        if !(0.0..width).contains(&x) || !(0.0..height).contains(&y) {
            return false;
        }
        match &self.pattern {
            Pattern::Chessboard { square_mm, .. } => {
                ((x / square_mm) as usize + (y / square_mm) as usize).is_multiple_of(2)
            }
            Pattern::Charuco { squares: [nx, _], square_mm, marker_mm, dictionary } => {
                let (i, j) = ((x / square_mm) as usize, (y / square_mm) as usize);
                let inset = (square_mm - marker_mm) / 2.0;
                // Each row of squares has a white one at every second place; the first row begins with a black one.
                let id = j * nx / 2 + i / 2;
                (i + j) % 2 == 0
                    || dictionary.is_black(
                        id,
                        (x - i as f64 * square_mm - inset) / marker_mm,
                        (y - j as f64 * square_mm - inset) / marker_mm,
                    )
            }
            Pattern::Circles { circles: [nx, ny], spacing_mm, diameter_mm } => {
                let nearest = |at: f64, n: usize| {
                    let steps = ((at - diameter_mm / 2.0) / spacing_mm).round().clamp(0.0, (n - 1) as f64);
                    at - diameter_mm / 2.0 - steps * spacing_mm
                };
                nearest(x, *nx).hypot(nearest(y, *ny)) <= diameter_mm / 2.0
            }
            Pattern::AsymmetricCircles { circles: [n, rows], spacing_mm, diameter_mm } => {
                let (x, y) = ((x - diameter_mm / 2.0) / spacing_mm, (y - diameter_mm / 2.0) / spacing_mm);
                let near = |row: f64| {
                    let shift = row.rem_euclid(2.0);
                    let column = ((x - shift) / 2.0).round().clamp(0.0, (n - 1) as f64);
                    let is_row = row >= 0.0 && row < *rows as f64;
                    is_row && (x - shift - 2.0 * column).hypot(y - row) <= diameter_mm / (2.0 * spacing_mm)
                };
                near(y.floor()) || near(y.floor() + 1.0)
            }
            Pattern::AprilGrid { tags: [nx, ny], tag_mm, gap_mm, family } => {
                let period = tag_mm + gap_mm;
                let (i, j) = ((x / period) as usize, (y / period) as usize);
                let (in_x, in_y) = (x - i as f64 * period - gap_mm, y - j as f64 * period - gap_mm);
                if in_x < 0.0 && in_y < 0.0 {
                    return true;
                }
                i < *nx && j < *ny && family.is_black((ny - 1 - j) * nx + i, in_x / tag_mm, in_y / tag_mm)
            }
        }
    }
}

#[cfg(test)]
mod tests;
