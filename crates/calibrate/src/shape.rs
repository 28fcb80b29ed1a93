//! How a board deviates from a plane: a polynomial of its height, without the terms that a pose replaces.

use fringeflow::geometry::Vector3;
use nalgebra::Vector2;

/// Exponents of x and y of the modes: second to fourth order.
const MODES: [(i32, i32); 12] =
    [(2, 0), (1, 1), (0, 2), (3, 0), (2, 1), (1, 2), (0, 3), (4, 0), (3, 1), (2, 2), (1, 3), (0, 4)];

/// Height of a board over its plane, metres into the board.
#[derive(Clone, Debug, PartialEq)]
pub struct BoardShape {
    /// Half the longer side of the board, metres: the unit of x and y in the modes.
    half_size_m: f64,
    modes_m: Vec<f64>,
}

impl BoardShape {
    /// A plane that stays one.
    #[must_use]
    pub fn flat() -> Self {
        Self { half_size_m: 1.0, modes_m: Vec::new() }
    }

    /// A plane whose deviation is to be estimated. `half_size_m` is half the longer side of the board.
    #[must_use]
    pub fn free(half_size_m: f64) -> Self {
        Self { half_size_m, modes_m: vec![0.0; MODES.len()] }
    }

    /// Heights of the modes at the edge of the board, metres; empty for a plane.
    #[must_use]
    pub fn modes(&self) -> &[f64] {
        &self.modes_m
    }

    /// Value of a mode at a position on the board, for a height of one.
    pub(crate) fn mode(&self, mode: usize, position_m: Vector2<f64>) -> f64 {
        let [x, y]: [f64; 2] = (position_m / self.half_size_m).into();
        let (i, j) = MODES[mode];
        x.powi(i) * y.powi(j)
    }

    /// A position on the board as a point in its frame.
    pub(crate) fn point(&self, position_m: Vector2<f64>) -> Vector3 {
        let height = self.modes_m.iter().enumerate().map(|(k, height)| height * self.mode(k, position_m));
        position_m.push(height.sum())
    }

    pub(crate) fn moved(&self, step: impl Fn(usize) -> f64) -> Self {
        let modes_m = self.modes_m.iter().enumerate().map(|(k, height)| height + step(k)).collect();
        Self { modes_m, ..self.clone() }
    }
}
