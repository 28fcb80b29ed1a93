//! 32 decoded pixels, and the trait of what decodes them. In: decoded values. Out: phase, modulation, mean and validity.

use fringeflow_simd::{LANES, Lanes};

use crate::phase::map::Exposure;
use crate::phase::sample::Sample;

use super::side_by_side::SideBySide;
use super::validity::Limits;

/// Decoded values of 32 pixels.
#[derive(Clone, Copy)]
pub(super) struct Block<L: Lanes> {
    pub(super) phase: L::Words,
    pub(super) modulation: L::Words,
    pub(super) mean: L::Words,
    /// Pixels whose residual is too large.
    pub(super) misfits: L::Mask,
    /// Largest sample.
    pub(super) greatest: L::Words,
}

/// Decodes blocks of 32 pixels.
pub(super) trait BlockDecoder<S: Sample> {
    /// Whether two blocks are faster together than one after the other. That holds for a long chain of operations that
    /// wait for each other. Besides, a cache line holds the bytes of two blocks.
    const IS_CHAIN: bool;

    /// Decodes `COUNT` blocks. `samples_of(k)` returns their samples in the k-th image in the order of the plan.
    fn decode<'a, L: Lanes, const COUNT: usize>(
        &self,
        blocks: SideBySide<L, COUNT>,
        samples_of: impl Fn(usize) -> [&'a [S; LANES]; COUNT],
    ) -> [Block<L>; COUNT];
}

/// Destinations of phase, modulation, mean and validity of a block.
type Places<'a> = (&'a mut [u16; LANES], &'a mut [u16; LANES], &'a mut [u8; LANES], &'a mut [bool; LANES]);

impl<L: Lanes> Block<L> {
    /// Checks and counts the pixels whose bit in `used` is set, and stores all pixels. Pixels with saturated samples do
    /// not count as valid: [`super::band`] decides about them.
    #[inline(always)]
    pub(super) fn check_and_store(&self, lanes: L, limits: &Limits, used: u32, to: Places<'_>) -> Counts {
        let saturated = lanes.bits(lanes.is_at_least(self.greatest, lanes.word(limits.saturation as i16))) & used;
        let lit = lanes.is_at_least(self.modulation, lanes.word(limits.least.0 as i16));
        let not_dim = lanes.is_at_least(self.modulation, lanes.word(limits.not_dim.0 as i16));
        let valid = lanes.and_not(lit, self.misfits);
        let (phase, modulation, mean, valid_to) = to;
        lanes.store(self.phase, phase);
        lanes.store(self.modulation, modulation);
        lanes.store_bytes(self.mean, mean);
        lanes.store_mask(valid, valid_to);
        let (lit, not_dim) = (lanes.bits(lit) & used & !saturated, lanes.bits(not_dim));
        Counts {
            valid_pixels: u64::from((lanes.bits(valid) & used & !saturated).count_ones()),
            exposure: Exposure {
                lit_pixels: u64::from((lit | saturated).count_ones()),
                saturated_pixels: u64::from(saturated.count_ones()),
                dim_pixels: u64::from((lit & !not_dim).count_ones()),
            },
        }
    }
}

/// Counts over the pixels of an image.
#[derive(Clone, Copy, Default)]
pub(super) struct Counts {
    pub(super) valid_pixels: u64,
    pub(super) exposure: Exposure,
}

impl Counts {
    pub(super) fn plus(self, other: Self) -> Self {
        Self { valid_pixels: self.valid_pixels + other.valid_pixels, exposure: self.exposure.plus(other.exposure) }
    }
}
