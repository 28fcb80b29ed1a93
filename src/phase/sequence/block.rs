//! Blocks of pixels all over an image: how their samples vary together from image to image.

use nalgebra::{DMatrix, DVector, SymmetricEigen};
use rayon::prelude::*;

use crate::grey::GreyLevels;
use crate::phase::Validity;

use super::span::Directions;

/// Side of a block, pixels: a fringe or more, and small enough to move alike.
const SIDE: usize = 16;
const PIXELS: usize = SIDE * SIDE;
/// Blocks along the shorter side of an image; as many as have room where it is smaller.
const ALONG: usize = 10;
/// Least share of a block's pixels that are not saturated.
const MIN_SHARE: f64 = 0.5;
/// Directions that fringes take: the mean and two in which they change.
const TAKEN: usize = 3;

/// Mean and second moments of the samples of a block.
#[derive(Clone, Debug)]
pub(super) struct Block {
    /// Mean grey level of every image.
    mean: DVector<f64>,
    /// Mean products of the grey levels of every two images.
    products: DMatrix<f64>,
}

/// What a block says of the order of its images.
#[derive(Clone, Debug)]
pub(super) struct Signal {
    /// The directions in which its fringes change, noise apart.
    pub(super) directions: Directions,
    /// Noise and whatever else has no part in them: variance of a sample as a share of the squared modulation.
    pub(super) noise_square: f64,
}

impl Block {
    /// The blocks of images of `width` pixels a row and the same size each.
    pub(super) fn all(images: &[GreyLevels<'_>], width: usize, height: usize, validity: &Validity) -> Vec<Self> {
        let pitch = (width.min(height) / ALONG).max(SIDE);
        let starts = |length: usize| (0..(length + 1).saturating_sub(SIDE)).step_by(pitch);
        let corners: Vec<[usize; 2]> = starts(height).flat_map(|v| starts(width).map(move |u| [u, v])).collect();
        corners.par_iter().filter_map(|&corner| Self::of(images, width, corner, validity)).collect()
    }

    fn of(images: &[GreyLevels<'_>], width: usize, [u, v]: [usize; 2], validity: &Validity) -> Option<Self> {
        let saturation = f32::from(validity.saturation_grey);
        let mut greys = vec![[0.0; PIXELS]; images.len()];
        let mut kept = [1.0; PIXELS];
        for (greys, image) in greys.iter_mut().zip(images) {
            for (row, greys) in greys.chunks_exact_mut(SIDE).enumerate() {
                let first = (v + row) * width + u;
                greys.iter_mut().enumerate().for_each(|(k, grey)| *grey = f64::from(image.grey(first + k)));
            }
            for (kept, &grey) in kept.iter_mut().zip(greys.iter()) {
                *kept = if grey >= f64::from(saturation) { 0.0 } else { *kept };
            }
        }
        for greys in &mut greys {
            greys.iter_mut().zip(&kept).for_each(|(grey, kept)| *grey *= kept);
        }
        // Samples are whole numbers of a power of two: sums of their products are exact in any order.
        let sums: Vec<f64> = greys.iter().map(|greys| dot(greys, &kept)).collect();
        let mut products =
            DMatrix::from_fn(images.len(), images.len(), |i, j| if j <= i { dot(&greys[i], &greys[j]) } else { 0.0 });
        let pixels = dot(&kept, &kept);
        if pixels < MIN_SHARE * PIXELS as f64 {
            return None;
        }
        products.fill_upper_triangle_with_lower_triangle();
        Some(Self { mean: DVector::from_vec(sums) / pixels, products: products / pixels })
    }

    /// Mean grey level of every image.
    pub(super) fn mean(&self) -> impl Iterator<Item = f64> + '_ {
        self.mean.iter().copied()
    }

    /// With every image divided by its brightness.
    pub(super) fn levelled(&self, brightness: &[f64]) -> Self {
        let by = |i: usize| brightness.get(i).copied().unwrap_or(1.0);
        let mean = DVector::from_fn(self.mean.len(), |i, _| self.mean[i] / by(i));
        let products = self.products.map_with_location(|i, j, product| product / (by(i) * by(j)));
        Self { mean, products }
    }

    /// Without an image.
    pub(super) fn without(&self, image: usize) -> Self {
        Self {
            mean: self.mean.clone().remove_row(image),
            products: self.products.clone().remove_row(image).remove_column(image),
        }
    }

    /// Mean squared difference of an image and the one behind it, grey levels.
    pub(super) fn difference_square(&self, image: usize) -> f64 {
        let (a, b) = (image, image + 1);
        self.products[(a, a)] + self.products[(b, b)] - 2.0 * self.products[(a, b)]
    }

    /// What it says; `None` where it is hardly lit.
    pub(super) fn signal(&self, validity: &Validity) -> Option<Signal> {
        let images = self.mean.len();
        let free = images.checked_sub(TAKEN).filter(|&free| free > 0)?;
        // Without the mean over the images of every pixel.
        let centre = DMatrix::identity(images, images).add_scalar(-1.0 / images as f64);
        let changes = &centre * &self.products * &centre;
        let scatter: f64 = changes.trace();
        let eigen = SymmetricEigen::new(changes);
        let mut order: Vec<usize> = (0..images).collect();
        order.sort_by(|&a, &b| eigen.eigenvalues[b].total_cmp(&eigen.eigenvalues[a]));
        let (first, second) = (*order.first()?, *order.get(1)?);
        let values = [first, second].map(|k| eigen.eigenvalues[k]);
        let noise = ((scatter - values[0] - values[1]) / free as f64).max(0.0);
        let fringes = values.map(|value| (value - noise).max(0.0));
        let power = fringes[0] + fringes[1];
        let modulation_square = 2.0 * power / images as f64;
        let least = 2.0 * f64::from(validity.min_modulation_grey);
        if modulation_square.is_nan() || modulation_square < least * least {
            return None;
        }
        let direction = |k: usize, square: f64| -> Vec<f64> {
            let length = (square / power).sqrt();
            eigen.eigenvectors.column(k).iter().map(|x| x * length).collect()
        };
        Some(Signal {
            directions: [direction(first, fringes[0]), direction(second, fringes[1])],
            noise_square: noise / modulation_square,
        })
    }
}

/// Σ a·b, as eight sums that wait for none of the others.
fn dot(a: &[f64; PIXELS], b: &[f64; PIXELS]) -> f64 {
    let mut sums = [0.0; 8];
    for (a, b) in a.as_chunks::<8>().0.iter().zip(b.as_chunks::<8>().0) {
        for k in 0..8 {
            sums[k] += a[k] * b[k];
        }
    }
    sums.iter().sum()
}
