//! Eigenvalues and eigenvectors of the symmetric matrices of 4 to 24 images, by nalgebra. Cost: 1 µs for 4 images, 6 µs
//! for 12, 30 µs for 24.
//!
//! The size is known at run time only, and a window must not allocate. So each size has a matrix type of its own.

use nalgebra::SMatrix;

use fringeflow_base::limits::MAX_IMAGES;

use super::{Matrix, Vector};

/// Eigenvalues and eigenvectors of a symmetric matrix.
#[derive(Debug)]
pub(super) struct Eigen {
    /// Eigenvalues, in no particular order.
    pub(super) values: Vector,
    /// The unit eigenvector of each.
    pub(super) vectors: Matrix,
}

/// Solves a matrix with the type of its size, for each listed size.
macro_rules! solve_by_size {
    ($matrix:ident, $size:ident: $($n:literal)+) => {
        match $size {
            $($n => {
                let eigen = SMatrix::<f64, $n, $n>::from_fn(|row, column| $matrix[column][row]).symmetric_eigen();
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
        const { assert!(MAX_IMAGES == 24, "list every size") };
        solve_by_size!(matrix, size: 4 5 6 7 8 9 10 11 12 13 14 15 16 17 18 19 20 21 22 23 24)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_size_has_orthonormal_eigenvectors() {
        let number = |i: usize, j: usize| ((3 + i + j) * 7919 % 101 + i * j * 53 % 211) as f64;
        let matrix: Matrix = std::array::from_fn(|i| std::array::from_fn(|j| number(i, j)));
        for size in 4..=MAX_IMAGES {
            let Eigen { values, vectors } = Eigen::new(&matrix, size).unwrap();
            let dot = |a: &Vector, b: &Vector| a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>();
            for k in 0..size {
                for i in 0..size {
                    let (left, right) = (dot(&matrix[i], &vectors[k]), values[k] * vectors[k][i]);
                    assert!((left - right).abs() < 1e-9, "{size}: row {i} of vector {k}: {left} {right}");
                    let expected = if i == k { 1.0 } else { 0.0 };
                    assert!((dot(&vectors[i], &vectors[k]) - expected).abs() < 1e-12, "{size}: {i} · {k}");
                }
            }
        }
        assert!(Eigen::new(&matrix, 3).is_none() && Eigen::new(&matrix, MAX_IMAGES + 1).is_none());
    }
}
