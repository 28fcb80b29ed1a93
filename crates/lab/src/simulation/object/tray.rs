//! A tray of pieces, larger than the field of view, so that the scanner must be moved over it.

use crate::simulation::solid::{PointMm, Solid, length, smooth_union, sphere};

use super::Object;

/// Pieces on a domed plate of 168 mm × 144 mm, up to 23 mm high.
pub(super) struct Tray {
    pieces: [Piece; 4],
}

/// A solid in its place.
struct Piece {
    solid: Box<dyn Solid>,
    /// Position of its frame on the tray, and sine and cosine of its rotation there.
    place: [f64; 2],
    turn: [f64; 2],
    /// Box around it in its own frame: centre and half its size.
    middle: PointMm,
    half: PointMm,
}

/// The pieces, their positions (x, y) and rotations.
const PIECES: [(Object, [f64; 2], f64); 4] = [
    (Object::Elephant, [-41.0, 34.0], 0.1),
    (Object::Machine, [43.0, 34.0], 0.3),
    (Object::Prism, [-41.0, -35.0], 0.08),
    (Object::Elephant, [42.0, -34.0], -0.15),
];
/// Half the size of the plate, its height in the middle, and the radius of its dome.
const HALF: [f64; 2] = [84.0, 72.0];
const HEIGHT: f64 = 5.0;
const DOME_RADIUS: f64 = 1500.0;
/// Fillet between plate and pieces. Pieces farther away have no effect.
const FILLET: f64 = 0.8;

impl Tray {
    pub(super) fn new() -> Self {
        let piece = |(object, place, turn_rad): (Object, [f64; 2], f64)| {
            let solid = object.solid();
            let (min, max) = solid.bounds_mm();
            let turn = turn_rad.sin_cos().into();
            Piece { solid, place, turn, middle: (min + max) / 2.0, half: (max - min) / 2.0 }
        };
        Self { pieces: PIECES.map(piece) }
    }
}

impl Piece {
    /// Distance from the piece if that is below `limit`. Otherwise a lower bound of at least `limit`.
    fn distance(&self, point: &PointMm, limit: f64) -> f64 {
        let [x, y] = [point.x - self.place[0], point.y - self.place[1]];
        let [sin, cos] = self.turn;
        let own = PointMm::new(cos * x + sin * y, cos * y - sin * x, point.z);
        let beyond = |axis: usize| ((own[axis] - self.middle[axis]).abs() - self.half[axis]).max(0.0);
        let beyond = length(length(beyond(0), beyond(1)), beyond(2));
        if beyond >= limit {
            return beyond;
        }
        let distance = self.solid.distance_mm(&own);
        if beyond > 0.0 { distance.max(beyond) } else { distance }
    }
}

/// The plate: a block intersected with a ball.
fn plate(p: &PointMm) -> f64 {
    let beside = |along: f64, half: f64| along.abs() - half;
    let block = beside(p.x, HALF[0]).max(beside(p.y, HALF[1]));
    block.max(sphere(p, PointMm::new(0.0, 0.0, HEIGHT - DOME_RADIUS), DOME_RADIUS))
}

impl Solid for Tray {
    fn distance_mm(&self, point: &PointMm) -> f64 {
        self.pieces
            .iter()
            .fold(plate(point), |all, piece| smooth_union(all, piece.distance(point, all + FILLET), FILLET))
    }

    fn bounds_mm(&self) -> (PointMm, PointMm) {
        let [x, y] = HALF;
        (PointMm::new(-x, -y, 0.0), PointMm::new(x, y, 23.0))
    }
}
