//! What the moments of a block say of the order of its images.

use fringeflow_base::limits::MAX_IMAGES;
use fringeflow_simd::{Kernel, Lanes, Level};

use crate::phase::Validity;

use super::Matrix;
use super::block::Block;
use super::eigen::Eigen;
use super::span::Directions;

/// Directions that fringes take: the mean and two in which they change.
const TAKEN: usize = 3;
/// Greatest variance beside the fringes, a share of the squared modulation, of a block whose pixels move alike.
const MAX_NOISE_SQUARE: f64 = 0.08;
/// Rows that are summed together.
const ROWS: usize = 8;

/// What a block says of the order of its images.
#[derive(Clone, Debug)]
pub(super) struct Signal {
    /// The directions in which its fringes change, noise apart.
    pub(super) directions: Directions,
    /// Noise and whatever else has no part in them: variance of a sample as a share of the squared modulation.
    pub(super) noise_square: f64,
}

impl Signal {
    /// What a block says; `None` where it is hardly lit.
    pub(super) fn new(block: &Block, validity: &Validity) -> Option<Self> {
        let images = block.images;
        let free = images.checked_sub(TAKEN).filter(|&free| free > 0)?;
        let changes = fringeflow_simd::run(Level::in_use(), CentreKernel { products: &block.products, images });
        let scatter: f64 = (0..images).map(|i| changes[i][i]).sum();
        let eigen = Eigen::new(&changes, images)?;
        let values = &eigen.values[..images];
        let first = greatest(values, None)?;
        let second = greatest(values, Some(first))?;
        let noise = ((scatter - values[first] - values[second]) / free as f64).max(0.0);
        let fringes = [first, second].map(|k| (values[k] - noise).max(0.0));
        let power = fringes[0] + fringes[1];
        let modulation_square = 2.0 * power / images as f64;
        let least = 2.0 * f64::from(validity.min_modulation_grey);
        if modulation_square.is_nan() || modulation_square < least * least {
            return None;
        }
        let direction = |k: usize, square: f64| eigen.vectors[k].map(|x| x * (square / power).sqrt());
        let directions = [direction(first, fringes[0]), direction(second, fringes[1])];
        Some(Self { directions, noise_square: noise / modulation_square })
    }

    /// Whether the pixels of the block move alike.
    pub(super) fn is_alike(&self) -> bool {
        self.noise_square <= MAX_NOISE_SQUARE
    }
}

/// Place of the greatest value beside one; of the first of several.
fn greatest(values: &[f64], beside: Option<usize>) -> Option<usize> {
    let places = (0..values.len()).filter(|&k| Some(k) != beside);
    places.reduce(|best, k| if values[k].total_cmp(&values[best]).is_gt() { k } else { best })
}

/// Mean products of samples without the mean over the images of every pixel.
struct CentreKernel<'a> {
    products: &'a Matrix,
    images: usize,
}

impl Kernel for CentreKernel<'_> {
    type Output = Matrix;

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) -> Matrix {
        let Self { products, images } = self;
        let mut centre = [[0.0; MAX_IMAGES]; MAX_IMAGES];
        for (i, column) in centre[..images].iter_mut().enumerate() {
            column[..images].fill(-1.0 / images as f64);
            column[i] += 1.0;
        }
        let left = times(&centre, products, images);
        times(&left, &centre, images)
    }
}

/// Product of two matrices of so many rows and columns, `[column][row]`, each sum from the first term to the last.
#[inline(always)]
fn times(a: &Matrix, b: &Matrix, size: usize) -> Matrix {
    let mut product = [[0.0; MAX_IMAGES]; MAX_IMAGES];
    for j in 0..size {
        let mut first = 0;
        while first < size {
            let mut sums = [0.0; ROWS];
            for k in 0..size {
                let (factors, by) = (&a[k], b[j][k]);
                for row in 0..ROWS {
                    sums[row] += factors[first + row] * by;
                }
            }
            product[j][first..first + ROWS].copy_from_slice(&sums);
            first += ROWS;
        }
    }
    product
}

#[cfg(test)]
mod tests {
    use nalgebra::DMatrix;

    use super::*;

    #[test]
    fn products_without_their_means_are_those_of_nalgebra_at_every_level() {
        for images in 3..=MAX_IMAGES {
            let mut products = [[0.0; MAX_IMAGES]; MAX_IMAGES];
            (0..images * images).for_each(|k| {
                let (i, j) = (k / images, k % images);
                products[i][j] = (1000 + (i + j) * 37 % 101 + i * j * 53 % 211) as f64 / 7.0;
            });
            let of = DMatrix::from_fn(images, images, |i, j| products[j][i]);
            let centre = DMatrix::identity(images, images).add_scalar(-1.0 / images as f64);
            let expected = &centre * of * &centre;
            let reference = fringeflow_simd::run(Level::Portable, CentreKernel { products: &products, images });
            for level in Level::ALL {
                let found = fringeflow_simd::run(level, CentreKernel { products: &products, images });
                for i in 0..images {
                    // Of larger matrices nalgebra fuses the sums where the machine can.
                    (0..images).for_each(|j| assert!((found[j][i] - expected[(i, j)]).abs() < 1e-10));
                    assert_eq!(found[i], reference[i], "{images} images, {level:?}");
                }
            }
        }
    }
}
