//! The part of the equalization of brightness that depends on the shifts alone.
//!
//! In: the shifts of the images. Out: projections onto what no sinusoid of these shifts explains.

use super::complement::unexplained;

/// Projections that separate changes of brightness from fringes.
#[derive(Clone, Debug)]
pub(super) struct BrightnessEqualization {
    /// Matrix, row by row, that projects the samples of a pixel onto the complement of all sinusoids with these shifts.
    pub(super) projector: Vec<Vec<f64>>,
    /// Orthonormal basis of this complement: the observable directions of γ.
    pub(super) observable: Vec<Vec<f64>>,
}

impl BrightnessEqualization {
    pub(super) fn new(shifts_rad: &[f64]) -> Self {
        let images = shifts_rad.len();
        let term = |value: fn(f64) -> f64| shifts_rad.iter().map(|&s| value(s)).collect::<Vec<f64>>();
        let observable = unexplained(images, &[vec![1.0; images], term(f64::cos), term(f64::sin)], &[]);
        let entry = |i: usize, j: usize| observable.iter().map(|direction| direction[i] * direction[j]).sum();
        Self { projector: (0..images).map(|i| (0..images).map(|j| entry(i, j)).collect()).collect(), observable }
    }
}
