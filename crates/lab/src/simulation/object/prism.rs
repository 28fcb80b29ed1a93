//! A three-sided prism lying on the board, and a flight of steps beside it.

use crate::simulation::solid::{PointMm, Solid, rounded_box};

/// Prism and steps, with sharp edges as if milled.
pub(super) struct Prism {
    /// Outward normals of the two upper faces of the prism.
    faces: [PointMm; 2],
    /// Sine and cosine of the rotation of the prism on the board.
    turn: [f64; 2],
}

/// Height of the ridge of the prism, and half of its width at the board.
const RIDGE: f64 = 20.0;
const HALF_WIDTH: f64 = 18.0;
/// Half of the length of the prism.
const HALF_LENGTH: f64 = 29.0;
/// Rotation of the prism on the board, rad.
const TURN_RAD: f64 = 0.30;
/// Centre of the prism on the board.
const PLACE: [f64; 2] = [-12.0, 0.0];
/// Steps: left border and height, millimetres.
const STEPS: [[f64; 2]; 3] = [[17.0, 15.0], [25.0, 10.0], [33.0, 5.0]];

impl Prism {
    pub(super) fn new() -> Self {
        let face = |side: f64| PointMm::new(side * RIDGE, 0.0, HALF_WIDTH).normalize();
        Self { faces: [face(-1.0), face(1.0)], turn: TURN_RAD.sin_cos().into() }
    }

    fn prism(&self, point: &PointMm) -> f64 {
        let (offset, [sin, cos]) = (point - PointMm::new(PLACE[0], PLACE[1], 0.0), self.turn);
        let p = PointMm::new(cos * offset.x + sin * offset.y, cos * offset.y - sin * offset.x, offset.z);
        let below_ridge = p - PointMm::new(0.0, 0.0, RIDGE);
        let sides = self.faces.map(|normal| normal.dot(&below_ridge));
        sides[0].max(sides[1]).max(p.y.abs() - HALF_LENGTH).max(-p.z)
    }
}

impl Solid for Prism {
    fn distance_mm(&self, point: &PointMm) -> f64 {
        let step = |[left, height]: [f64; 2]| {
            let (centre, half) = (PointMm::new(left + 4.0, 2.0, height / 2.0), PointMm::new(4.0, 24.0, height / 2.0));
            rounded_box(point, centre, half, 0.0)
        };
        STEPS.map(step).into_iter().fold(self.prism(point), f64::min)
    }

    fn bounds_mm(&self) -> (PointMm, PointMm) {
        (PointMm::new(-39.0, -34.0, 0.0), PointMm::new(42.0, 34.0, 20.5))
    }
}
