//! The part of the equalization of brightness that depends on the shifts alone.
//!
//! In: the shifts of the images. Out: projections onto what no sinusoid of these shifts explains.

use super::complement::unexplained;

/// Projections that separate changes of brightness from fringes.
#[derive(Clone, Debug)]
pub(super) struct BrightnessEqualization {
    /// See [`residual_projector`].
    pub(super) projector: Vec<Vec<f64>>,
    /// Directions of γ that are orthogonal to sinusoids of the shifts.
    pub(super) observable: Vec<Vec<f64>>,
}

impl BrightnessEqualization {
    /// `None` where the shifts determine no sinusoid.
    pub(super) fn new(shifts_rad: &[f64]) -> Option<Self> {
        let basis: Vec<[f64; 3]> = shifts_rad.iter().map(|s| [1.0, s.cos(), s.sin()]).collect();
        Some(Self { projector: residual_projector(shifts_rad)?, observable: unexplained(&basis) })
    }
}

/// Matrix, row by row, that projects the samples of a pixel onto the complement of all sinusoids with these shifts.
fn residual_projector(shifts_rad: &[f64]) -> Option<Vec<Vec<f64>>> {
    let rows: Vec<nalgebra::Vector3<f64>> =
        shifts_rad.iter().map(|s| nalgebra::Vector3::new(1.0, s.cos(), -s.sin())).collect();
    let inverse = rows.iter().map(|row| row * row.transpose()).sum::<nalgebra::Matrix3<f64>>().try_inverse()?;
    let entry = |i: usize, j: usize| f64::from(u8::from(i == j)) - rows[i].dot(&(inverse * rows[j]));
    Some((0..rows.len()).map(|i| (0..rows.len()).map(|j| entry(i, j)).collect()).collect())
}
