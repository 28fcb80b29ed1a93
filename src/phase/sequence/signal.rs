//! Signal of a block: the plane in which its fringes change from image to image. In: second moments of M images. Out:
//! two directions and the noise. Cost: two matrix products and the eigenvectors of an M × M matrix, 2 µs for six
//! images, 50 µs for 24.

use fringeflow_base::limits::MAX_IMAGES;
use fringeflow_simd::{Kernel, Lanes, Level};

use crate::phase::Validity;

use super::Matrix;
use super::eigen::Eigen;
use super::span::Directions;

/// Dimensions of fringes in the space of images: the mean, and two in which they change.
const FRINGE_DIMENSIONS: usize = 3;
/// Largest variance outside the fringes of a coherent block, a share of the squared modulation.
const MAX_NOISE_SQUARE: f64 = 0.08;
/// Rows summed together.
const ROWS: usize = 8;

/// How the fringes of a block change from image to image.
#[derive(Clone, Debug)]
pub(super) struct Signal {
    /// The directions in which the fringes change, without noise.
    pub(super) directions: Directions,
    /// Variance of a sample in all other directions (noise, edges), a share of the squared modulation.
    pub(super) noise_square: f64,
}

impl Signal {
    /// The signal of a block of `images` images with these mean products; `None` if it is dark.
    pub(super) fn new(products: &Matrix, images: usize, validity: &Validity) -> Option<Self> {
        let freedom = images.checked_sub(FRINGE_DIMENSIONS).filter(|&freedom| freedom > 0)?;
        let changes = fringeflow_simd::run(Level::in_use(), CentreKernel { products, images });
        let scatter: f64 = (0..images).map(|i| changes[i][i]).sum();
        let eigen = Eigen::new(&changes, images)?;
        let values = eigen.values;
        let first = index_of_largest(&values, None)?;
        let second = index_of_largest(&values, Some(first))?;
        // The two largest eigenvalues hold fringes plus noise, the others noise alone.
        let noise = ((scatter - values[first] - values[second]) / freedom as f64).max(0.0);
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
    pub(super) fn is_coherent(&self) -> bool {
        self.noise_square <= MAX_NOISE_SQUARE
    }
}

/// Index of the largest value except one; the first of equal values.
fn index_of_largest(values: &[f64], except: Option<usize>) -> Option<usize> {
    let indices = (0..values.len()).filter(|&k| Some(k) != except);
    indices.reduce(|best, k| if values[k].total_cmp(&values[best]).is_gt() { k } else { best })
}

/// Removes the mean of every pixel over the images from the mean products: C·P·C with C = 1 − 1/M.
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

/// Product of the first `size` rows and columns of two matrices; sums run from the first term to the last.
#[inline(always)]
fn times(a: &Matrix, b: &Matrix, size: usize) -> Matrix {
    let mut product = [[0.0; MAX_IMAGES]; MAX_IMAGES];
    for j in 0..size {
        let mut first = 0;
        while first < size {
            let mut sums = [0.0; ROWS];
            for k in 0..size {
                let (column, factor) = (&a[k], b[j][k]);
                for row in 0..ROWS {
                    sums[row] += column[first + row] * factor;
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
                    // nalgebra uses fused multiply-add for larger matrices, if the machine has it.
                    (0..images).for_each(|j| assert!((found[j][i] - expected[(i, j)]).abs() < 1e-10));
                    assert_eq!(found[i], reference[i], "{images} images, {level:?}");
                }
            }
        }
    }
}
