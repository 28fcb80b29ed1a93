//! Samples of 8 and 16 bits, as the kernels read them from the camera's memory, without a copy. In: stored values. Out:
//! lanes of them. Cost: a load and a conversion.

use fringeflow_base::grey::PixelFormat;
use fringeflow_simd::{LANES, Lanes};

/// The stored value of a pixel.
pub(super) trait Sample: Copy + Default + Send + Sync + bytemuck::Pod {
    /// Whether it has 8 bits.
    const IS_BYTE: bool;
    /// Added by [`Self::words`], so that all values fit signed words.
    const BIAS: i16;

    /// Values plus [`Self::BIAS`].
    fn words<L: Lanes>(lanes: L, samples: &[Self; LANES]) -> L::Words;

    /// Low bytes of the values; the values themselves if they have 8 bits.
    fn bytes<L: Lanes>(lanes: L, samples: &[Self; LANES]) -> L::Bytes;

    /// Values as floats.
    fn reals<L: Lanes>(lanes: L, samples: &[Self; LANES]) -> L::Reals;

    /// Unsigned values from [`Self::words`].
    fn unsigned<L: Lanes>(lanes: L, words: L::Words) -> L::Words;

    /// Values from floats between 0 and the largest value, truncated.
    fn from_reals<L: Lanes>(lanes: L, reals: L::Reals) -> [Self; LANES];

    /// The value as a number.
    fn value(self) -> u16;

    /// Grey level of the value. `grey_per_value` depends on the format and on the brightness of the image.
    fn grey(self, grey_per_value: f32) -> f32;

    /// Smallest value whose grey level is at least `grey`.
    fn from_grey(grey: u8, format: PixelFormat) -> Self;

    /// Whether it is less than `limit`.
    fn is_below(self, limit: Self) -> bool;
}

/// 8 bits.
impl Sample for u8 {
    const IS_BYTE: bool = true;
    const BIAS: i16 = 0;

    #[inline(always)]
    fn words<L: Lanes>(lanes: L, samples: &[Self; LANES]) -> L::Words {
        lanes.words_of_bytes(samples)
    }

    #[inline(always)]
    fn bytes<L: Lanes>(lanes: L, samples: &[Self; LANES]) -> L::Bytes {
        lanes.bytes(samples)
    }

    #[inline(always)]
    fn reals<L: Lanes>(lanes: L, samples: &[Self; LANES]) -> L::Reals {
        lanes.reals_of_bytes(samples)
    }

    #[inline(always)]
    fn unsigned<L: Lanes>(_: L, words: L::Words) -> L::Words {
        words
    }

    #[inline(always)]
    fn from_reals<L: Lanes>(lanes: L, reals: L::Reals) -> [Self; LANES] {
        let mut bytes = [0; LANES];
        lanes.store_real_bytes(reals, &mut bytes);
        bytes
    }

    fn value(self) -> u16 {
        u16::from(self)
    }

    #[inline(always)]
    fn grey(self, grey_per_value: f32) -> f32 {
        f32::from(self) * grey_per_value
    }

    fn from_grey(grey: u8, _: PixelFormat) -> Self {
        grey
    }

    #[inline(always)]
    fn is_below(self, limit: Self) -> bool {
        self < limit
    }
}

/// More than 8 bits, little-endian, at any alignment.
impl Sample for [u8; 2] {
    const IS_BYTE: bool = false;
    const BIAS: i16 = i16::MIN;

    #[inline(always)]
    fn words<L: Lanes>(lanes: L, samples: &[Self; LANES]) -> L::Words {
        lanes.add(lanes.words_of_le(samples), lanes.word(Self::BIAS))
    }

    #[inline(always)]
    fn bytes<L: Lanes>(lanes: L, samples: &[Self; LANES]) -> L::Bytes {
        lanes.bytes(&samples.map(|[low, _]| low))
    }

    #[inline(always)]
    fn reals<L: Lanes>(lanes: L, samples: &[Self; LANES]) -> L::Reals {
        lanes.reals_of_le(samples)
    }

    #[inline(always)]
    fn unsigned<L: Lanes>(lanes: L, words: L::Words) -> L::Words {
        lanes.sub(words, lanes.word(Self::BIAS))
    }

    #[inline(always)]
    fn from_reals<L: Lanes>(lanes: L, reals: L::Reals) -> [Self; LANES] {
        let mut words = [0; LANES];
        lanes.store_real_words(reals, &mut words);
        words.map(u16::to_le_bytes)
    }

    fn value(self) -> u16 {
        u16::from_le_bytes(self)
    }

    #[inline(always)]
    fn grey(self, grey_per_value: f32) -> f32 {
        f32::from(u16::from_le_bytes(self)) * grey_per_value
    }

    fn from_grey(grey: u8, format: PixelFormat) -> Self {
        (u16::from(grey) << (format.bits() - 8)).to_le_bytes()
    }

    #[inline(always)]
    fn is_below(self, limit: Self) -> bool {
        u16::from_le_bytes(self) < u16::from_le_bytes(limit)
    }
}
