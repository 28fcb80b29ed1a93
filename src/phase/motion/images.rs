//! The images of a window. In: samples of 8 or 16 bits. Out: grey levels, with compensated brightness. Cost: a
//! conversion and a multiplication per sample.

use fringeflow_base::grey::{GreyLevels, PixelFormat};
use fringeflow_base::limits::MAX_IMAGES;
use fringeflow_simd::{LANES, Lanes};

use crate::phase::sample::Sample;

/// The images of a window, by size of their samples.
pub(super) enum Stack<'a> {
    /// 8 bits.
    Bytes(Images<'a, u8>),
    /// More than 8 bits.
    Words(Images<'a, [u8; 2]>),
}

/// The images of a window.
pub(super) struct Images<'a, S> {
    samples: [&'a [S]; MAX_IMAGES],
    pub(super) count: usize,
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) format: PixelFormat,
    /// Smallest saturated sample.
    saturation: S,
    /// Grey levels per value of each image, by its compensated brightness.
    pub(super) grey_per_value: [f32; MAX_IMAGES],
}

impl<'a> Stack<'a> {
    /// The images, each of `width · height` pixels; `None` if one has another size or format.
    pub(super) fn new(images: &[GreyLevels<'a>], width: usize, height: usize, saturation_grey: u8) -> Option<Self> {
        let format = images.first()?.format;
        let fits =
            |image: &GreyLevels<'_>| image.format == format && image.bytes.len() == width * height * format.bytes();
        if images.len() > MAX_IMAGES || !images.iter().all(fits) {
            return None;
        }
        let size = [width, height];
        Some(match format {
            PixelFormat::Grey => Self::Bytes(Images::new(images, |bytes| bytes, size, saturation_grey)),
            _ => Self::Words(Images::new(images, |bytes| bytes.as_chunks().0, size, saturation_grey)),
        })
    }
}

impl<'a, S: Sample> Images<'a, S> {
    fn new(
        images: &[GreyLevels<'a>],
        samples_of: impl Fn(&'a [u8]) -> &'a [S],
        [width, height]: [usize; 2],
        saturation_grey: u8,
    ) -> Self {
        let format = images[0].format;
        let mut samples = [[].as_slice(); MAX_IMAGES];
        samples.iter_mut().zip(images).for_each(|(samples, image)| *samples = samples_of(image.bytes));
        Self {
            samples,
            count: images.len(),
            width,
            height,
            format,
            saturation: S::from_grey(saturation_grey, format),
            grey_per_value: [format.grey_per_value(); MAX_IMAGES],
        }
    }

    /// Grey level of a pixel in an image.
    #[inline(always)]
    pub(super) fn grey(&self, image: usize, pixel: usize) -> f32 {
        self.samples[image][pixel].grey(self.grey_per_value[image])
    }

    /// Whether a sample is saturated.
    #[inline(always)]
    pub(super) fn is_saturated(&self, image: usize, pixel: usize) -> bool {
        !self.samples[image][pixel].is_below(self.saturation)
    }

    /// The same images with other samples, in planes of `plane` samples.
    pub(super) fn with_samples<'b>(&self, samples: &'b [S], plane: usize) -> Images<'b, S> {
        let mut planes = [[].as_slice(); MAX_IMAGES];
        planes.iter_mut().zip(samples.chunks_exact(plane.max(1))).take(self.count).for_each(|(to, from)| *to = from);
        Images { samples: planes, ..*self }
    }

    /// Smallest saturated sample.
    pub(super) fn saturation(&self) -> S {
        self.saturation
    }

    /// Whether images contain this number of columns and rows, from a point on.
    #[inline(always)]
    pub(super) fn contains(&self, [(u, columns), (v, rows)]: [(f32, usize); 2]) -> bool {
        let within = |x: f32, count: usize, length: usize| x >= 0.0 && x + (count - 1) as f32 <= (length - 1) as f32;
        within(u, columns, self.width) && within(v, rows, self.height)
    }

    /// Samples of a row.
    #[inline(always)]
    pub(super) fn row(&self, image: usize, row: usize) -> &[S] {
        &self.samples[image][row * self.width..][..self.width]
    }

    /// Samples of an image from a pixel on.
    #[inline(always)]
    pub(super) fn samples_from(&self, image: usize, pixel: usize) -> &[S] {
        &self.samples[image][pixel..]
    }

    /// `count` samples of an image from a pixel on, padded with zeros.
    #[inline(always)]
    pub(super) fn block(&self, image: usize, pixel: usize, count: usize) -> [S; LANES] {
        fringeflow_simd::filled(&self.samples[image][pixel..pixel + count], S::default())
    }

    /// Grey levels of [`Self::block`]. Updates `greatest`, the largest samples so far, for [`Self::saturates`].
    #[inline(always)]
    pub(super) fn greys<L: Lanes>(
        &self,
        lanes: L,
        image: usize,
        [pixel, count]: [usize; 2],
        greatest: &mut L::Words,
    ) -> L::Reals {
        let block = self.block(image, pixel, count);
        *greatest = lanes.max_unsigned(*greatest, S::unsigned(lanes, S::words(lanes, &block)));
        lanes.times_real(S::reals(lanes, &block), lanes.real(self.grey_per_value[image]))
    }

    /// Pixels whose largest sample is saturated.
    #[inline(always)]
    pub(super) fn saturates<L: Lanes>(&self, lanes: L, greatest: L::Words) -> L::Mask {
        lanes.is_at_least(greatest, lanes.word(self.saturation.value() as i16))
    }
}
