//! Which point of a found lattice is which feature of a board without markers.
//!
//! In: points of the image with whole coordinates on a lattice that may be shifted, turned and sheared. Out: ids. The lattice
//! must be as large as the board. If turning leaves a choice, the squares' colours decide; where the board looks the
//! same after a turn, its x axis is the one closest to that of the image.

use std::collections::HashMap;

use super::homography::{Homography, Point};
use super::{BoardImage, Seed};
use crate::board::{Board, Pattern};

/// Points with ids.
pub(super) struct Placed {
    pub(super) seeds: Vec<Seed>,
}

/// Why a lattice is not the board.
pub(super) enum Unplaced {
    /// It has another size.
    OtherSize {
        /// Points across and down.
        found: [usize; 2],
    },
}

/// Places a lattice on the board.
pub(super) fn placed(board: &Board, image: &BoardImage, points: &[([i32; 2], Point)]) -> Result<Placed, Unplaced> {
    let cells = cells(board);
    let features: HashMap<[i32; 2], usize> = cells.iter().enumerate().map(|(k, cell)| (*cell, k)).collect();
    let points = right_handed(points);
    let mut best: Option<(f64, Vec<Seed>)> = None;
    for [[a, b], [c, d]] in bases() {
        let turned: Vec<([i32; 2], Point)> =
            points.iter().map(|([x, y], at)| ([a * x + b * y, c * x + d * y], *at)).collect();
        let least = least_of(turned.iter().map(|(cell, _)| *cell));
        let most = most_of(turned.iter().map(|(cell, _)| *cell));
        let (board_least, board_most) = (least_of(cells.iter().copied()), most_of(cells.iter().copied()));
        if [0, 1].iter().any(|&k| most[k] - least[k] != board_most[k] - board_least[k]) {
            continue;
        }
        let shift = [board_least[0] - least[0], board_least[1] - least[1]];
        let seeds: Option<Vec<Seed>> = turned
            .iter()
            .map(|(cell, at)| {
                let feature = *features.get(&[cell[0] + shift[0], cell[1] + shift[1]])?;
                Some(Seed { feature, at: *at })
            })
            .collect();
        let Some(seeds) = seeds else { continue };
        let Some(along) = merit(board, image, &seeds) else { continue };
        if best.as_ref().is_none_or(|(other, _)| along > *other) {
            best = Some((along, seeds));
        }
    }
    let (least, most) = (least_of(points.iter().map(|p| p.0)), most_of(points.iter().map(|p| p.0)));
    let extent = [0, 1].map(|k| (most[k] - least[k] + 1).max(0) as usize);
    let found = [extent[0].max(extent[1]), extent[0].min(extent[1])];
    best.map(|(_, seeds)| Placed { seeds }).ok_or(Unplaced::OtherSize { found })
}

/// Coordinates of the features on a lattice of neighbours.
fn cells(board: &Board) -> Vec<[i32; 2]> {
    match *board.pattern() {
        Pattern::Chessboard { corners: [nx, ny], .. } | Pattern::Circles { circles: [nx, ny], .. } => {
            (0..nx * ny).map(|k| [(k % nx) as i32, (k / nx) as i32]).collect()
        }
        // Neighbours lie on the diagonals.
        Pattern::AsymmetricCircles { circles: [n, rows], .. } => {
            let place = |k: usize| ((2 * (k % n) + k / n % 2) as i32, (k / n) as i32);
            (0..n * rows).map(place).map(|(x, y)| [(x + y) / 2, (y - x).div_euclid(2)]).collect()
        }
        Pattern::Charuco { .. } | Pattern::AprilGrid { .. } => Vec::new(),
    }
}

/// How far the board's x axis points along that of the image, −1 to 1; `None` if the colours of the image are not those
/// of the board. A look at the outer squares and at the margin around them tells a part of a larger board.
fn merit(board: &Board, image: &BoardImage, seeds: &[Seed]) -> Option<f64> {
    let features = board.features();
    let pairs: Vec<(Point, Point)> =
        seeds.iter().map(|s| ([features[s.feature][0], features[s.feature][1]], s.at)).collect();
    let map = Homography::fit(&pairs)?;
    let cell = board.cell_mm();
    let (mut agree, mut seen) = (0, 0);
    for (position, _) in &pairs {
        let Some(middle) = mean_around(image, &map, *position, cell) else { continue };
        for [dx, dy] in LOOKS {
            let point = [position[0] + dx * cell, position[1] + dy * cell];
            let Some(level) = image.level(map.image(point)) else { continue };
            seen += 1;
            agree += usize::from((level > middle) == (board.brightness(point[0], point[1]) > 0.5));
        }
    }
    let [along, _] = map.axes([0.0, 0.0]);
    (agree as f64 >= LEAST_AGREEMENT * f64::from(seen)).then(|| along[0] / along[0].hypot(along[1]))
}

/// Where colours are compared, in cells from a feature: the squares around a corner, or the gaps around a circle, and
/// beyond the outermost features the margin.
const LOOKS: [[f64; 2]; 8] =
    [[0.3, 0.3], [-0.3, 0.3], [-0.3, -0.3], [0.3, -0.3], [1.3, 0.35], [-1.3, 0.35], [0.35, 1.3], [0.35, -1.3]];
/// Least share of the points whose colour must be that of the board.
const LEAST_AGREEMENT: f64 = 0.85;

/// Grey level between bright and dark around a feature.
fn mean_around(image: &BoardImage, map: &Homography, [x, y]: Point, cell: f64) -> Option<f64> {
    let mut range = [f64::MAX, f64::MIN];
    for k in 0..49 {
        let at = [x + (f64::from(k % 7) - 3.0) / 6.0 * cell, y + (f64::from(k / 7) - 3.0) / 6.0 * cell];
        let level = image.level(map.image(at))?;
        range = [range[0].min(level), range[1].max(level)];
    }
    Some((range[0] + range[1]) / 2.0)
}

/// The lattice with axes that turn as those of the image do, so that only turns are left to find.
fn right_handed(points: &[([i32; 2], Point)]) -> Vec<([i32; 2], Point)> {
    let pairs: Vec<(Point, Point)> = points.iter().map(|(cell, at)| (cell.map(f64::from), *at)).collect();
    let is_mirrored = Homography::fit(&pairs).is_some_and(|map| {
        let [x, y] = map.axes(pairs[pairs.len() / 2].0);
        x[0] * y[1] - x[1] * y[0] < 0.0
    });
    points.iter().map(|(cell, at)| (if is_mirrored { [cell[1], cell[0]] } else { *cell }, *at)).collect()
}

/// Turns and shears of a lattice onto itself. A tilted lattice may be found along its diagonals, which are shorter then.
fn bases() -> impl Iterator<Item = [[i32; 2]; 2]> {
    let entries = |k: i32| [k % 3 - 1, k / 3 % 3 - 1, k / 9 % 3 - 1, k / 27 - 1];
    (0..81).map(entries).filter(|[a, b, c, d]| a * d - b * c == 1).map(|[a, b, c, d]| [[a, b], [c, d]])
}

fn least_of(cells: impl Iterator<Item = [i32; 2]>) -> [i32; 2] {
    cells.fold([i32::MAX; 2], |least, cell| [least[0].min(cell[0]), least[1].min(cell[1])])
}

fn most_of(cells: impl Iterator<Item = [i32; 2]>) -> [i32; 2] {
    cells.fold([i32::MIN; 2], |most, cell| [most[0].max(cell[0]), most[1].max(cell[1])])
}
