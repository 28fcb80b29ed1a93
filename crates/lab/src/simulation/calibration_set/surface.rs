//! The board as a surface: a plane, or a plane that is bent smoothly. Lengths in the frame of the board, millimetres.

use fringeflow::geometry::{Point3, Pose, Vector3};
use fringeflow_board::Board;

use crate::simulation::solid::MM_PER_M;

/// Albedo of black and of white print.
const BLACK: f64 = 0.045;
const WHITE: f64 = 0.75;
/// Newton steps to the bent surface; the third one moves less than a nanometre.
const STEPS: usize = 4;

/// A board, perhaps bent.
pub(super) struct Surface<'a> {
    board: &'a Board,
    /// Half the width and height of the board with its margin.
    half_mm: [f64; 2],
    /// Height of the bend: `k0·u² + k1·u·v + k2·v²` with u and v from −1 to 1 over the board.
    bend_mm: [f64; 3],
}

/// A point of the surface in the frame of the board.
pub(super) struct Hit {
    pub(super) point_mm: Vector3,
    /// Unit normal towards the reader of the board.
    pub(super) normal: Vector3,
}

impl<'a> Surface<'a> {
    /// A board whose bend has this peak to valley height. `shape` says how it is bent: along x, along the diagonals,
    /// along y.
    pub(super) fn new(board: &'a Board, bend_mm: f64, shape: [f64; 3]) -> Self {
        let half_mm = board.size_mm().map(|size| size / 2.0 + board.margin_mm());
        let mut surface = Self { board, half_mm, bend_mm: shape };
        let heights =
            (0..441).map(|k| surface.height([f64::from(k % 21) / 10.0 - 1.0, f64::from(k / 21) / 10.0 - 1.0]));
        let (least, most) = heights.fold((f64::MAX, f64::MIN), |(least, most), h| (least.min(h), most.max(h)));
        surface.bend_mm = shape.map(|k| k * bend_mm / (most - least).max(1e-9));
        surface
    }

    fn height(&self, [u, v]: [f64; 2]) -> f64 {
        let [a, b, c] = self.bend_mm;
        a * u * u + b * u * v + c * v * v
    }

    /// Height of the surface above the plane, away from the reader, and its slopes.
    fn at(&self, x_mm: f64, y_mm: f64) -> (f64, [f64; 2]) {
        let [a, b, c] = self.bend_mm;
        let [hx, hy] = self.half_mm;
        let (u, v) = (x_mm / hx, y_mm / hy);
        (self.height([u, v]), [(2.0 * a * u + b * v) / hx, (b * u + 2.0 * c * v) / hy])
    }

    /// Positions of the features on the surface.
    pub(super) fn features(&self) -> Vec<[f64; 3]> {
        self.board.features().into_iter().map(|[x, y, _]| [x, y, self.at(x, y).0]).collect()
    }

    /// Where a ray meets the front of the board; `None` if it misses it or comes from behind.
    pub(super) fn hit(&self, origin_mm: &Vector3, direction: &Vector3) -> Option<Hit> {
        if direction.z <= 0.0 {
            return None;
        }
        let mut way = -origin_mm.z / direction.z;
        if self.bend_mm != [0.0; 3] {
            for _ in 0..STEPS {
                let point = origin_mm + direction * way;
                let (height, [sx, sy]) = self.at(point.x, point.y);
                way -= (point.z - height) / (direction.z - sx * direction.x - sy * direction.y);
            }
        }
        let point_mm = origin_mm + direction * way;
        let is_on_board = point_mm.x.abs() <= self.half_mm[0] && point_mm.y.abs() <= self.half_mm[1];
        let [sx, sy] = self.at(point_mm.x, point_mm.y).1;
        (way > 0.0 && is_on_board).then(|| Hit { point_mm, normal: Vector3::new(sx, sy, -1.0).normalize() })
    }

    /// Albedo of a point of the print.
    pub(super) fn albedo(&self, [x_mm, y_mm]: [f64; 2]) -> f64 {
        BLACK + (WHITE - BLACK) * self.board.brightness(x_mm, y_mm)
    }

    /// The board that is printed.
    pub(super) fn board(&self) -> &Board {
        self.board
    }
}

/// A point of the board in the frame of C1, metres.
pub(super) fn in_cam1(cam1_from_board: &Pose, point_mm: &[f64; 3]) -> Point3 {
    cam1_from_board * Point3::from(Vector3::from(*point_mm) / MM_PER_M)
}
