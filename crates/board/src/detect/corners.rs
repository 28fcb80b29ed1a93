//! Corners of chessboards and ChArUco boards with their ids, by the crates `calib-targets-*`.
//!
//! The image is searched at full size and halved, because blurred corners are found only in smaller images. The best
//! result counts. If there is none, it is searched at twice its size, where small squares are found.

use calib_targets_charuco::{CharucoBoardSpec, CharucoDetectError, CharucoDetector, CharucoParams};
use calib_targets_chessboard::{
    ChessCorner, ChessboardDetector, ChessboardParams, GrayImageView, default_chess_config, detect_corners,
};

use super::placement::{Placed, Unplaced, placed};
use super::{BoardImage, NotDetected, Seed};
use crate::board::{Board, Pattern, Tags};

/// Numbers of times that the image is halved.
const HALVINGS: [usize; 3] = [0, 1, 2];
/// Smallest width and height of an image that is searched, pixels.
const SMALLEST_PX: usize = 100;

/// An image at one size, and its corners.
pub(super) struct Level {
    width: usize,
    height: usize,
    pixels: Vec<u8>,
    pub(super) corners: Vec<ChessCorner>,
    /// Pixels of the full image per pixel.
    scale: f64,
}

impl Level {
    /// The image at several sizes, the largest first.
    pub(super) fn all(image: &BoardImage) -> Vec<Self> {
        let mut levels = Vec::new();
        let mut image = image.clone();
        for halvings in HALVINGS {
            if halvings > 0 {
                image = image.halved();
            }
            if halvings > 0 && image.width_px().min(image.height_px()) < SMALLEST_PX {
                break;
            }
            levels.push(Self::new(&image, f64::from(1 << halvings)));
        }
        levels
    }

    /// The image at twice its size.
    pub(super) fn doubled(image: &BoardImage) -> Self {
        Self::new(&image.doubled(), 0.5)
    }

    fn new(image: &BoardImage, scale: f64) -> Self {
        let pixels = image.stretched();
        let view = GrayImageView { width: image.width_px(), height: image.height_px(), data: &pixels };
        let corners = detect_corners(&view, &default_chess_config());
        Self { width: image.width_px(), height: image.height_px(), corners, scale, pixels }
    }

    fn view(&self) -> GrayImageView<'_> {
        GrayImageView { width: self.width, height: self.height, data: &self.pixels }
    }

    /// The point of the full image.
    pub(super) fn full(&self, at: nalgebra::Point2<f32>) -> [f64; 2] {
        [at.x, at.y].map(|c| f64::from(c) * self.scale + (self.scale - 1.0) / 2.0)
    }
}

/// Corners of a chessboard. All rows and columns must be seen.
pub(super) fn chessboard(board: &Board, image: &BoardImage) -> Result<Vec<Seed>, NotDetected> {
    let Pattern::Chessboard { corners: wanted, .. } = *board.pattern() else { return Ok(Vec::new()) };
    let mut best = Err(NotDetected::Nothing { found: 0, elements: "corners" });
    let doubled = std::iter::once_with(|| Level::doubled(image));
    for level in Level::all(image).into_iter().chain(doubled) {
        if best.is_ok() && level.scale < 1.0 {
            break;
        }
        let Some(grid) = grid(&level.corners) else { continue };
        let points: Vec<_> = grid.iter().map(|(cell, at)| (*cell, level.full(*at))).collect();
        let found = placed(board, image, &points).map_err(|unplaced| match unplaced {
            Unplaced::OtherSize { found } => NotDetected::OtherSize { found, wanted, elements: "inner corners" },
        });
        best = better(best, found);
    }
    best.map(|placed| placed.seeds)
}

/// Labelled corners of the largest grid of squares.
fn grid(corners: &[ChessCorner]) -> Option<Vec<([i32; 2], nalgebra::Point2<f32>)>> {
    let detector = ChessboardDetector::new(ChessboardParams::default()).ok()?;
    let grid = detector.detect(corners)?;
    Some(grid.corners.iter().map(|corner| ([corner.grid.u, corner.grid.v], corner.position)).collect())
}

/// The result with more corners; of two failures the one that tells more.
fn better(a: Result<Placed, NotDetected>, b: Result<Placed, NotDetected>) -> Result<Placed, NotDetected> {
    let extent = |result: &Result<Placed, NotDetected>| match result {
        Ok(placed) => 1_000_000 + placed.seeds.len(),
        Err(NotDetected::OtherSize { found, .. }) => found[0] * found[1],
        Err(_) => 0,
    };
    if extent(&b) > extent(&a) { b } else { a }
}

/// Corners of a ChArUco board.
pub(super) fn charuco(board: &Board, image: &BoardImage) -> Result<Vec<Seed>, NotDetected> {
    let Pattern::Charuco { dictionary, .. } = board.pattern() else { return Ok(Vec::new()) };
    let mut levels = Level::all(image);
    let seeds_at = |level: &Level| charuco_at(board, dictionary, level).unwrap_or_default();
    let mut best = levels.iter().map(seeds_at).max_by_key(Vec::len).unwrap_or_default();
    if best.is_empty() {
        let doubled = Level::doubled(image);
        best = seeds_at(&doubled);
        levels.push(doubled);
    }
    if best.is_empty() { Err(instead_of_charuco(board, image, &levels)) } else { Ok(best) }
}

/// Corners of a ChArUco board with the markers of a dictionary.
fn charuco_at(board: &Board, dictionary: &Tags, level: &Level) -> Result<Vec<Seed>, CharucoDetectError> {
    let Pattern::Charuco { squares: [nx, ny], square_mm, marker_mm, .. } = *board.pattern() else {
        return Ok(Vec::new());
    };
    let share = (marker_mm / square_mm) as f32;
    let spec = CharucoBoardSpec::new(ny as u32, nx as u32, square_mm as f32, share, dictionary.dictionary());
    // The board was checked when it was read, so the crate accepts it.
    let Ok(detector) = CharucoDetector::new(CharucoParams::for_board(spec)) else { return Ok(Vec::new()) };
    let found = detector.detect_with_corners(&level.view(), &level.corners)?;
    let seed = |corner: &calib_targets_charuco::CharucoCorner| Seed {
        feature: corner.id as usize,
        at: level.full(corner.position),
    };
    let features = (nx - 1) * (ny - 1);
    Ok(found.corners.iter().map(seed).filter(|seed| seed.feature < features).collect())
}

/// What is in the image if the ChArUco board is not.
fn instead_of_charuco(board: &Board, image: &BoardImage, levels: &[Level]) -> NotDetected {
    let corners = levels.iter().filter_map(|level| grid(&level.corners)).map(|grid| grid.len()).max().unwrap_or(0);
    let Pattern::Charuco { dictionary, squares: [nx, ny], .. } = board.pattern() else {
        return NotDetected::Nothing { found: corners, elements: "corners" };
    };
    if corners == 0 {
        return NotDetected::Nothing { found: 0, elements: "corners" };
    }
    let is_found = |dictionary: &Tags, levels: &[Level]| {
        levels.iter().any(|level| charuco_at(board, dictionary, level).is_ok_and(|seeds| !seeds.is_empty()))
    };
    if is_found(dictionary, &Level::all(&image.mirrored())) {
        return NotDetected::Mirrored;
    }
    let others = Tags::all().into_iter().filter(|other| other != dictionary && other.count() >= nx * ny / 2);
    match others.into_iter().find(|other| is_found(other, levels)) {
        Some(other) => {
            NotDetected::OtherDictionary { found: other.name().to_owned(), wanted: dictionary.name().to_owned() }
        }
        None => NotDetected::NoMarkers { corners, dictionary: dictionary.name().to_owned() },
    }
}
