//! What a camera stores for a pixel, as the kernels read it: where it lies, without a copy.

use fringeflow_base::grey::PixelFormat;
use fringeflow_simd::{LANES, Lanes};

/// A stored value.
pub(super) trait Sample: Copy + Default + Send + Sync + bytemuck::Pod {
    /// Whether it is stored in 8 bits.
    const IS_BYTE: bool;
    /// What [`Self::words`] adds to stored values, so that all are signed words.
    const BIAS: i16;

    /// Stored values with their bias.
    fn words<L: Lanes>(lanes: L, samples: &[Self; LANES]) -> L::Words;

    /// The low bytes of stored values: all of those of 8 bits.
    fn bytes<L: Lanes>(lanes: L, samples: &[Self; LANES]) -> L::Bytes;

    /// Stored values as reals.
    fn reals<L: Lanes>(lanes: L, samples: &[Self; LANES]) -> L::Reals;

    /// Stored values as unsigned words, from those with their bias.
    fn unsigned<L: Lanes>(lanes: L, words: L::Words) -> L::Words;

    /// Stored values of reals between 0 and the largest one, without their fractions.
    fn of_reals<L: Lanes>(lanes: L, reals: L::Reals) -> [Self; LANES];

    /// The stored value.
    fn value(self) -> u16;

    /// Its grey level; `grey_per_value` is that of its format, less where its image is brighter than the others of a window.
    fn grey(self, grey_per_value: f32) -> f32;

    /// The value from which on a grey level is at least `grey`.
    fn from_grey(grey: u8, format: PixelFormat) -> Self;

    /// Whether it is less than another.
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
    fn of_reals<L: Lanes>(lanes: L, reals: L::Reals) -> [Self; LANES] {
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

/// More than 8 bits, little endian; at any address.
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
    fn of_reals<L: Lanes>(lanes: L, reals: L::Reals) -> [Self; LANES] {
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
