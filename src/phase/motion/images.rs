//! The images of a window, and grey levels of them.

use fringeflow_base::grey::{GreyLevels, PixelFormat};
use fringeflow_base::limits::MAX_IMAGES;
use fringeflow_simd::{LANES, Lanes};

use crate::phase::sample::Sample;

/// The images of a window, by what they store for a pixel.
pub(super) enum Stack<'a> {
    /// 8 bits.
    Bytes(Images<'a, u8>),
    /// More.
    Words(Images<'a, [u8; 2]>),
}

/// The images of a window.
pub(super) struct Images<'a, S> {
    samples: [&'a [S]; MAX_IMAGES],
    pub(super) count: usize,
    pub(super) width: usize,
    pub(super) height: usize,
    pub(super) format: PixelFormat,
    /// Value from which on a sample is saturated.
    saturation: S,
    /// Grey levels of a value, image by image: what differs is the brightness that is compensated.
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

    /// Grey level of a pixel in an image, its brightness compensated.
    #[inline(always)]
    pub(super) fn grey(&self, image: usize, pixel: usize) -> f32 {
        self.samples[image][pixel].grey(self.grey_per_value[image])
    }

    /// Whether a sample is saturated.
    #[inline(always)]
    pub(super) fn is_saturated(&self, image: usize, pixel: usize) -> bool {
        !self.samples[image][pixel].is_below(self.saturation)
    }

    /// Images of as many other samples, each `plane` behind the one before.
    pub(super) fn others<'b>(&self, samples: &'b [S], plane: usize) -> Images<'b, S> {
        let mut others = [[].as_slice(); MAX_IMAGES];
        others.iter_mut().zip(samples.chunks_exact(plane.max(1))).take(self.count).for_each(|(to, from)| *to = from);
        Images { samples: others, ..*self }
    }

    /// Value from which on a sample is saturated.
    pub(super) fn saturation(&self) -> u16 {
        self.saturation.value()
    }

    /// A sample that is saturated.
    pub(super) fn saturated_sample(&self) -> S {
        self.saturation
    }

    /// Whether images hold all of so many columns and rows from a place on.
    #[inline(always)]
    pub(super) fn holds(&self, [(u, columns), (v, rows)]: [(f32, usize); 2]) -> bool {
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

    /// The samples of an image from a pixel on, `count` of which are of its row, the others 0.
    #[inline(always)]
    pub(super) fn block(&self, image: usize, pixel: usize, count: usize) -> [S; LANES] {
        fringeflow_simd::filled(&self.samples[image][pixel..pixel + count], S::default())
    }

    /// Grey levels of those samples; `greatest` takes them in, for [`Self::saturates`].
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

    /// Where any of the greatest samples of pixels is saturated.
    #[inline(always)]
    pub(super) fn saturates<L: Lanes>(&self, lanes: L, greatest: L::Words) -> L::Mask {
        lanes.is_at_least(greatest, lanes.word(self.saturation.value() as i16))
    }
}
