//! Largest eigenvalues and eigenvectors of the positive semidefinite matrices of 4 to 24 images, by nalgebra. Cost: 1 µs
//! for 4 images, 6 µs for 12, 30 µs for 24.
//!
//! The size is known at run time only, and a window must not allocate. So some sizes have a matrix type of their own, and
//! a matrix between them is padded with zeros, which add eigenvalues of zero.

use nalgebra::SMatrix;

use fringeflow_base::limits::MAX_IMAGES;

use super::{Matrix, Vector};

/// Eigenvalues and eigenvectors of a positive semidefinite matrix.
#[derive(Debug)]
pub(super) struct Eigen {
    /// Eigenvalues, in no particular order; zeros after them.
    pub(super) values: Vector,
    /// The unit eigenvector of each.
    pub(super) vectors: Matrix,
}

/// Solves a matrix with the type of the smallest listed size that holds it.
macro_rules! solve_by_size {
    ($matrix:ident, $size:ident: $($from:literal..=$n:literal)+) => {
        match $size {
            $($from..=$n => {
                let padded = |row: usize, column: usize| match row.max(column) < $size {
                    true => $matrix[column][row],
                    false => 0.0,
                };
                let eigen = SMatrix::<f64, $n, $n>::from_fn(padded).symmetric_eigen();
                let (mut values, mut vectors) = ([0.0; MAX_IMAGES], [[0.0; MAX_IMAGES]; MAX_IMAGES]);
                values[..$n].copy_from_slice(eigen.eigenvalues.as_slice());
                for (vector, column) in vectors.iter_mut().zip(eigen.eigenvectors.column_iter()) {
                    vector[..$n].copy_from_slice(column.as_slice());
                }
                Some(Self { values, vectors })
            })+
            _ => None,
        }
    };
}

impl Eigen {
    /// Solves the first `size` rows and columns of a matrix, from its lower triangle; `None` unless `size` is 4 to 24.
    pub(super) fn new(matrix: &Matrix, size: usize) -> Option<Self> {
        const { assert!(MAX_IMAGES == 24, "the last size holds all images") };
        solve_by_size!(matrix, size: 4..=4 5..=6 7..=8 9..=12 13..=16 17..=24)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_size_has_orthonormal_eigenvectors() {
        let number = |i: usize, j: usize| ((3 + i + j) * 7919 % 101 + i * j * 53 % 211) as f64;
        for size in 4..=MAX_IMAGES {
            // A product of a matrix with itself is positive semidefinite; more on the diagonal makes it definite.
            let diagonal = |i: usize, j: usize| if i == j { 1000.0 } else { 0.0 };
            let product =
                |i: usize, j: usize| (0..size).map(|k| number(i, k) * number(j, k)).sum::<f64>() + diagonal(i, j);
            let matrix: Matrix = std::array::from_fn(|i| std::array::from_fn(|j| product(i, j)));
            let Eigen { values, vectors } = Eigen::new(&matrix, size).unwrap();
            let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            let trace: f64 = (0..size).map(|i| matrix[i][i]).sum();
            assert!((values.iter().sum::<f64>() / trace - 1.0).abs() < 1e-12);
            let found: Vec<usize> = (0..MAX_IMAGES).filter(|&k| values[k] > 1e-9 * trace).collect();
            assert_eq!(found.len(), size, "{size}: {values:?}");
            for &k in &found {
                for i in 0..size {
                    let (left, right) = (dot(&matrix[i][..size], &vectors[k][..size]), values[k] * vectors[k][i]);
                    assert!((left - right).abs() < 1e-13 * trace, "{size}: row {i} of vector {k}: {left} {right}");
                }
                for &other in &found {
                    let expected = if other == k { 1.0 } else { 0.0 };
                    assert!(
                        (dot(&vectors[other][..size], &vectors[k][..size]) - expected).abs() < 1e-12,
                        "{size}: {k}"
                    );
                }
            }
        }
        let matrix = [[0.0; MAX_IMAGES]; MAX_IMAGES];
        assert!(Eigen::new(&matrix, 3).is_none() && Eigen::new(&matrix, MAX_IMAGES + 1).is_none());
    }
}
