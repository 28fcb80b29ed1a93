//! Eigenvalues and eigenvectors of small symmetric matrices, in memory of a fixed size.
//!
//! Householder reflections make a matrix tridiagonal, implicit QR steps with Wilkinson's shift make it diagonal (Golub and
//! Van Loan, *Matrix Computations*, 8.3). The same numbers as nalgebra's, which asks for memory several times a matrix.

use fringeflow_base::limits::MAX_IMAGES;

use super::{Matrix, Vector};

/// What a symmetric matrix is made of.
#[derive(Debug)]
pub(super) struct Eigen {
    /// Eigenvalues, in no order.
    pub(super) values: Vector,
    /// The eigenvector of each, of length 1.
    pub(super) vectors: Matrix,
}

/// A symmetric matrix made tridiagonal.
struct Tridiagonal {
    size: usize,
    /// Columns of the reflections that made it so.
    basis: Matrix,
    diagonal: Vector,
    /// Beside the diagonal, positive.
    beside: Vector,
}

/// Cosine and sine of a rotation of two columns.
#[derive(Clone, Copy)]
struct Rotation {
    cos: f64,
    sin: f64,
}

impl Eigen {
    /// Of the first `size` rows and columns of a matrix, whose lower triangle is read: `[column][row]`.
    pub(super) fn new(matrix: &mut Matrix, size: usize) -> Self {
        let greatest = matrix[..size].iter().flat_map(|column| &column[..size]).fold(0.0, |max, x| x.abs().max(max));
        if greatest != 0.0 {
            matrix[..size].iter_mut().flat_map(|column| &mut column[..size]).for_each(|x| *x /= greatest);
        }
        let mut tridiagonal = Tridiagonal::new(matrix, size);
        let (mut start, mut end) = tridiagonal.coupled(size.saturating_sub(1));
        while end != start {
            if end - start > 1 {
                tridiagonal.step(start, end);
                if !couples(tridiagonal.beside[end - 1], tridiagonal.diagonal[end - 1], tridiagonal.diagonal[end]) {
                    end -= 1;
                }
            } else {
                tridiagonal.decouple(start);
                end -= 1;
            }
            (start, end) = tridiagonal.coupled(end);
        }
        let Tridiagonal { basis, diagonal, .. } = tridiagonal;
        Self { values: diagonal.map(|value| value * greatest), vectors: basis }
    }
}

impl Tridiagonal {
    fn new(matrix: &mut Matrix, size: usize) -> Self {
        let (mut beside, mut p) = ([0.0; MAX_IMAGES], [0.0; MAX_IMAGES]);
        for i in 0..size.saturating_sub(1) {
            let (left, right) = matrix.split_at_mut(i + 1);
            let (axis, rest) = (&mut left[i][i + 1..size], &mut right[..size - i - 1]);
            let is_axis;
            (beside[i], is_axis) = make_axis(axis);
            if !is_axis {
                continue;
            }
            // p = 2·A·axis from the lower triangle of A.
            let (axis, p) = (&*axis, &mut p[i + 1..size]);
            p.fill(0.0);
            p[0] = 2.0 * axis[0] * rest[0][i + 1];
            for (j, column) in rest.iter().enumerate() {
                let (column, from) = (&column[i + 1..size], j.max(1));
                p[j] += 2.0 * dot(&column[from..], &axis[from..]);
                add(&mut p[j + 1..], 2.0 * axis[j], &column[j + 1..]);
            }
            let along = 2.0 * dot(axis, p);
            for (j, column) in rest.iter_mut().enumerate() {
                let column = &mut column[i + 1..size];
                add(&mut column[j..], -axis[j], &p[j..]);
                add(&mut column[j..], -p[j], &axis[j..]);
                add(&mut column[j..], along * axis[j], &axis[j..]);
            }
        }
        let mut diagonal = [0.0; MAX_IMAGES];
        (0..size).for_each(|i| diagonal[i] = matrix[i][i]);
        Self { size, basis: basis(matrix, &beside, size), diagonal, beside: beside.map(f64::abs) }
    }

    /// First and last row of the last part that is not diagonal yet, of the rows up to one; both 0 where there is none.
    fn coupled(&mut self, last: usize) -> (usize, usize) {
        let Self { diagonal, beside, .. } = self;
        let mut end = last;
        while end > 0 && !couples(beside[end - 1], diagonal[end], diagonal[end - 1]) {
            end -= 1;
        }
        if end == 0 {
            return (0, 0);
        }
        let mut start = end - 1;
        while start > 0 {
            if !couples(beside[start - 1], diagonal[start], diagonal[start - 1]) {
                beside[start - 1] = 0.0;
                break;
            }
            start -= 1;
        }
        (start, end)
    }

    /// A step of QR on the rows from `start` to `end`.
    fn step(&mut self, start: usize, end: usize) {
        let Self { size, basis, diagonal, beside } = self;
        let shift = wilkinson_shift(diagonal[end - 1], diagonal[end], beside[end - 1]);
        let [mut x, mut y] = [diagonal[start] - shift, beside[start]];
        for i in start..end {
            if y == 0.0 {
                return;
            }
            let length = (x * x + y * y).sqrt();
            let (cos, sin) = (x.abs() / length, -y / with_sign(length, x));
            if i > start {
                beside[i - 1] = with_sign(length, x);
            }
            let ([before, behind], between) = ([diagonal[i], diagonal[i + 1]], beside[i]);
            let (cc, ss, cs) = (cos * cos, sin * sin, cos * sin);
            let b = cs * 2.0 * between;
            diagonal[i] = (cc * before + ss * behind) - b;
            diagonal[i + 1] = (ss * before + cc * behind) + b;
            beside[i] = cs * (before - behind) + between * (cc - ss);
            if i + 1 < end {
                [x, y] = [beside[i], -sin * beside[i + 1]];
                beside[i + 1] *= cos;
            }
            Rotation { cos, sin: -sin }.turn(&mut basis[i..], *size);
        }
    }

    /// Makes two rows diagonal.
    fn decouple(&mut self, start: usize) {
        let Self { size, basis, diagonal, beside } = self;
        let ([before, behind], between) = ([diagonal[start], diagonal[start + 1]], beside[start]);
        let half = (before - behind) * 0.5;
        let root = (between * between + half * half).sqrt();
        let middle = (before + behind) * 0.5;
        let values = [middle + root, middle - root];
        // The direction that loses the least to cancellation.
        let [x, y] = if (values[0] - behind).abs() > (values[0] - before).abs() {
            [values[0] - behind, between]
        } else {
            [between, values[0] - before]
        };
        [diagonal[start], diagonal[start + 1]] = values;
        let length = (x * x + y * y).sqrt();
        if length > f64::EPSILON {
            Rotation { cos: x.abs() / length, sin: y / with_sign(length, x) }.turn(&mut basis[start..], *size);
        }
    }
}

impl Rotation {
    /// Turns the first two columns, of so many rows.
    fn turn(self, columns: &mut [Vector], rows: usize) {
        let [first, second, ..] = columns else { return };
        for (a, b) in first[..rows].iter_mut().zip(&mut second[..rows]) {
            (*a, *b) = (*a * self.cos + self.sin * *b, -self.sin * *a + *b * self.cos);
        }
    }
}

/// Makes a column the axis of the reflection that leaves its first entry alone; what that then is, and whether there is an axis.
fn make_axis(column: &mut [f64]) -> (f64, bool) {
    let square = dot(column, column);
    let length = square.sqrt();
    let signed = with_sign(length, column[0]);
    let factor = (square + column[0].abs() * length) * 2.0;
    column[0] += signed;
    if factor == 0.0 {
        return (signed, false);
    }
    // Once more, for a length of exactly 1.
    scale_down(column, factor.sqrt());
    scale_down(column, dot(column, column).sqrt());
    (-signed, true)
}

/// The reflections one after the other: their axes stand below the diagonal, what they made of it beside.
fn basis(axes: &Matrix, beside: &Vector, size: usize) -> Matrix {
    let mut basis = [[0.0; MAX_IMAGES]; MAX_IMAGES];
    (0..size).for_each(|i| basis[i][i] = 1.0);
    for i in (0..size.saturating_sub(1)).rev() {
        let (axis, sign) = (&axes[i][i + 1..size], beside[i].signum());
        for column in &mut basis[i..size] {
            let column = &mut column[i + 1..size];
            let factor = dot(axis, column) * (-2.0 * sign);
            column.iter_mut().zip(axis).for_each(|(x, a)| *x = factor * a + sign * *x);
        }
    }
    basis
}

/// Whether what is beside two entries of the diagonal is something to them.
fn couples(beside: f64, a: f64, b: f64) -> bool {
    beside.abs() > f64::EPSILON * (a.abs() + b.abs())
}

/// A length with the sign of a number.
fn with_sign(length: f64, of: f64) -> f64 {
    if of >= 0.0 { length } else { -length }
}

/// The eigenvalue of the last two rows that is the nearer to the last entry.
fn wilkinson_shift(before: f64, last: f64, between: f64) -> f64 {
    let square = between * between;
    if square == 0.0 {
        return last;
    }
    let half = (before - last) * 0.5;
    last - square / (half + half.signum() * (half * half + square).sqrt())
}

/// Σ a·b, eight sums at a time while there are so many.
fn dot(a: &[f64], b: &[f64]) -> f64 {
    let ((a, a_rest), (b, b_rest)) = (a.as_chunks::<8>(), b.as_chunks::<8>());
    let mut sums = [0.0; 8];
    for (a, b) in a.iter().zip(b) {
        (0..8).for_each(|k| sums[k] += a[k] * b[k]);
    }
    let eighths = (0..4).fold(0.0, |sum, k| sum + (sums[k] + sums[k + 4]));
    a_rest.iter().zip(b_rest).fold(eighths, |sum, (a, b)| sum + a * b)
}

/// Adds `factor` times some numbers.
fn add(to: &mut [f64], factor: f64, numbers: &[f64]) {
    to.iter_mut().zip(numbers).for_each(|(to, x)| *to += factor * x);
}

fn scale_down(numbers: &mut [f64], by: f64) {
    numbers.iter_mut().for_each(|x| *x /= by);
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, SymmetricEigen};

    use super::*;

    /// Numbers from −1 to 1, the same at every run.
    fn number(place: usize) -> f64 {
        let hash = (place as u64 + 1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        ((hash ^ hash >> 29).wrapping_mul(0xbf58_476d_1ce4_e5b9) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }

    #[test]
    fn eigenvalues_and_vectors_are_those_of_nalgebra_to_the_bit() {
        for size in 2..=MAX_IMAGES {
            for (round, rank) in [1, 2, 3, size, size].into_iter().enumerate() {
                let factor = DMatrix::from_fn(size, rank, |i, j| number((round * 97 + size) * 1000 + i * 31 + j));
                let matrix =
                    if round == 4 { DMatrix::identity(size, size) } else { &factor * factor.transpose() * 1e4 };
                let expected = SymmetricEigen::new(matrix.clone());
                let mut scratch = [[0.0; MAX_IMAGES]; MAX_IMAGES];
                (0..size * size).for_each(|k| scratch[k / size][k % size] = matrix[(k % size, k / size)]);
                let found = Eigen::new(&mut scratch, size);
                for k in 0..size {
                    assert_eq!(
                        found.values[k].to_bits(),
                        expected.eigenvalues[k].to_bits(),
                        "{size} {round}: value {k}"
                    );
                    let vector = expected.eigenvectors.column(k);
                    assert!((0..size).all(|i| found.vectors[k][i] == vector[i]), "{size} {round}: vector {k}");
                }
            }
        }
    }
}
