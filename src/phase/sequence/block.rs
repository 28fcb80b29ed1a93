//! Blocks of pixels spread over an image. In: M images. Out: first and second moments of each block over the images.
//! Cost: M²/2 multiply-adds per pixel, for 100 to 200 blocks of 16 × 16 pixels.

use rayon::prelude::*;

use fringeflow_base::grey::{GreyLevels, PixelFormat};
use fringeflow_base::limits::MAX_IMAGES;
use fringeflow_simd::{Kernel, Lanes, Level};

use crate::phase::Validity;

use super::signal::Signal;
use super::{Matrix, Vector};

/// Side of a block, pixels: at least a fringe, but small enough to move as a whole.
const SIDE: usize = 16;
const PIXELS: usize = SIDE * SIDE;
/// Blocks along the shorter side of an image; fewer if the image is small.
const ALONG: usize = 10;
/// Smallest share of unsaturated pixels in a usable block.
const MIN_SHARE: f64 = 0.5;
/// Blocks per task of a thread.
const BLOCKS_PER_TASK: usize = 8;
/// Independent partial sums of a dot product.
const SUMS: usize = 32;

/// Moments of the samples of a block, and the signal in them. Only the first `images` entries have a meaning.
#[derive(Clone, Debug, Default)]
pub(super) struct Block {
    pub(super) images: usize,
    /// Mean grey level of every image.
    pub(super) mean: Vector,
    /// Mean products of the grey levels of every two images.
    pub(super) products: Matrix,
    /// `None` if the block is dark or saturated.
    pub(super) signal: Option<Signal>,
}

impl Block {
    /// Computes the blocks of images of equal size, row by row. The old contents of `blocks` do not matter.
    pub(super) fn find_all(
        blocks: &mut Vec<Self>,
        images: &[GreyLevels<'_>],
        width: usize,
        height: usize,
        validity: &Validity,
    ) {
        let pitch = (width.min(height) / ALONG).max(SIDE);
        let [columns, rows] = [width, height].map(|length| (length + 1).saturating_sub(SIDE).div_ceil(pitch));
        blocks.resize_with(columns * rows, Self::default);
        let level = Level::in_use();
        blocks.par_chunks_mut(BLOCKS_PER_TASK).enumerate().for_each(|(chunk, blocks)| {
            let greys = &mut [[0.0; PIXELS]; MAX_IMAGES];
            for (number, block) in (chunk * BLOCKS_PER_TASK..).zip(blocks) {
                let corner = [number % columns * pitch, number / columns * pitch];
                let is_usable =
                    fringeflow_simd::run(level, MomentsKernel { block, greys, images, width, corner, validity });
                block.signal = if is_usable { Signal::new(&block.products, block.images, validity) } else { None };
            }
        });
    }

    /// Divides every image by its brightness.
    pub(super) fn equalize_brightness(&mut self, brightness: &Vector, validity: &Validity) {
        let images = self.images;
        self.mean[..images].iter_mut().zip(brightness).for_each(|(mean, own)| *mean /= own);
        for (products, own) in self.products[..images].iter_mut().zip(brightness) {
            products[..images].iter_mut().zip(brightness).for_each(|(product, other)| *product /= other * own);
        }
        self.signal = Signal::new(&self.products, self.images, validity);
    }

    /// The block with one image removed.
    pub(super) fn without(&self, image: usize, validity: &Validity) -> Self {
        let mut rest = Self { images: self.images - 1, ..Self::default() };
        let from = |place: usize| if place < image { place } else { place + 1 };
        for i in 0..rest.images {
            rest.mean[i] = self.mean[from(i)];
            (0..rest.images).for_each(|j| rest.products[i][j] = self.products[from(i)][from(j)]);
        }
        rest.signal = Signal::new(&rest.products, rest.images, validity);
        rest
    }

    /// Mean squared difference between an image and the next one, grey levels.
    pub(super) fn difference_square(&self, image: usize) -> f64 {
        let (a, b) = (image, image + 1);
        self.products[a][a] + self.products[b][b] - 2.0 * self.products[a][b]
    }
}

/// Computes the moments of a block; returns whether enough of its pixels are unsaturated.
struct MomentsKernel<'a> {
    block: &'a mut Block,
    /// Scratch memory for the grey levels of the block.
    greys: &'a mut [[f32; PIXELS]; MAX_IMAGES],
    images: &'a [GreyLevels<'a>],
    width: usize,
    /// Column and row of its first pixel.
    corner: [usize; 2],
    validity: &'a Validity,
}

impl Kernel for MomentsKernel<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<L: Lanes>(self, _: L) -> bool {
        let Self { block, greys, images, width, corner: [u, v], validity } = self;
        let saturation = f32::from(validity.saturation_grey);
        let mut kept = [1.0; PIXELS];
        for (greys, image) in greys.iter_mut().zip(images) {
            for (row, greys) in greys.as_chunks_mut::<SIDE>().0.iter_mut().enumerate() {
                load_row(greys, image, (v + row) * width + u);
            }
            for p in 0..PIXELS {
                kept[p] = if greys[p] >= saturation { 0.0 } else { kept[p] };
            }
        }
        // Samples are multiples of a power of two, so sums of their products are exact, in any order of addition.
        let pixels = dot(&kept, &kept);
        if pixels < MIN_SHARE * PIXELS as f64 {
            return false;
        }
        block.images = images.len();
        for i in 0..images.len() {
            for p in 0..PIXELS {
                greys[i][p] *= kept[p];
            }
            block.mean[i] = dot(&greys[i], &kept) / pixels;
            for j in 0..=i {
                let product = dot(&greys[i], &greys[j]) / pixels;
                (block.products[i][j], block.products[j][i]) = (product, product);
            }
        }
        true
    }
}

/// Loads grey levels of a row of pixels.
#[inline(always)]
fn load_row(greys: &mut [f32; SIDE], image: &GreyLevels<'_>, first: usize) {
    match image.format {
        PixelFormat::Grey => {
            let bytes = &image.bytes[first..first + SIDE];
            for k in 0..SIDE {
                greys[k] = f32::from(bytes[k]);
            }
        }
        deep => {
            let (values, grey_per_value) =
                (&image.bytes.as_chunks::<2>().0[first..first + SIDE], deep.grey_per_value());
            for k in 0..SIDE {
                greys[k] = f32::from(u16::from_le_bytes(values[k])) * grey_per_value;
            }
        }
    }
}

/// Σ a·b.
#[inline(always)]
fn dot(a: &[f32; PIXELS], b: &[f32; PIXELS]) -> f64 {
    let mut sums = [0.0; SUMS];
    let mut first = 0;
    while first < PIXELS {
        for k in 0..SUMS {
            sums[k] += f64::from(a[first + k]) * f64::from(b[first + k]);
        }
        first += SUMS;
    }
    sums.iter().sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: usize = 37;

    #[test]
    fn moments_are_those_of_the_samples_at_every_level() {
        let byte = |k: usize| (k * k % 251) as u8;
        let (shallow, deep): (Vec<u8>, Vec<u8>) = (
            (0..WIDTH * WIDTH).map(|k| byte(3 * k + k / 7)).collect(),
            (0..2 * WIDTH * WIDTH).map(|k| if k % 2 == 1 { byte(k) % 15 } else { byte(k + 5) }).collect(),
        );
        let deep = GreyLevels { format: PixelFormat::Y12, bytes: &deep };
        let images = [GreyLevels::eight_bit(&shallow), deep, GreyLevels::eight_bit(&shallow[..WIDTH * WIDTH])];
        let validity = Validity { saturation_grey: 240, ..Validity::default() };
        let corner @ [u, v] = [9, 20];
        let pixels = (0..PIXELS).map(|k| (v + k / SIDE) * WIDTH + u + k % SIDE);
        let greys: Vec<[f64; 3]> = pixels
            .map(|pixel| images.map(|image| f64::from(image.grey(pixel))))
            .filter(|greys| greys.iter().all(|&grey| grey < 240.0))
            .collect();
        assert!(greys.len() < PIXELS && greys.len() > PIXELS / 2);
        let mean = |product: &dyn Fn(&[f64; 3]) -> f64| greys.iter().map(product).sum::<f64>() / greys.len() as f64;
        for level in Level::ALL {
            let (mut block, mut scratch) = (Block::default(), [[7.0; PIXELS]; MAX_IMAGES]);
            let (images, validity) = (&images, &validity);
            let kernel =
                MomentsKernel { block: &mut block, greys: &mut scratch, images, width: WIDTH, corner, validity };
            assert!(fringeflow_simd::run(level, kernel));
            for i in 0..3 {
                assert_eq!(block.mean[i], mean(&|greys| greys[i]), "{level:?}");
                (0..3).for_each(|j| assert_eq!(block.products[i][j], mean(&|greys| greys[i] * greys[j]), "{level:?}"));
            }
        }
    }
}
